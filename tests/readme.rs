//! Is the first page true? The program it shows is the example, and the example draws.

#[allow(dead_code)]
#[path = "../examples/hello.rs"]
mod hello;

#[test]
fn the_program_of_the_readme_is_the_example() {
    let readme = include_str!("../README.md");
    let (_, rest) = readme.split_once("```rust\n").expect("README.md shows a program");
    let (shown, _) = rest.split_once("```").expect("the program ends");
    let source = include_str!("../examples/hello.rs");
    let (_, program) = source.split_once("\n\n").expect("the example begins with its description");
    assert_eq!(shown, program);
}

#[test]
fn the_program_of_the_readme_draws() {
    let image =
        hello::draw().unwrap_or_else(|e| panic!("{e}")).into_color().expect("a colour target");
    assert_eq!(image.texel(320, 300)[3], 255, "inside the triangle");
    assert_eq!(image.texel(5, 5), [0; 4], "outside it");
    // Each corner has a channel of its own, so the picture is not just a white one.
    let (left, right) = (image.texel(80, 425), image.texel(560, 425));
    assert!(left[2] > 200 && left[1] < 100, "blue in the left corner: {left:?}");
    assert!(right[1] > 200 && right[2] < 100, "green in the right corner: {right:?}");
}
