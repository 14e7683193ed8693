//! Does a renderer with stages of the user's own draw by them, and does it say what is wrong with them?

use crate::{
    common::{gpu, on_each_gpu, random::Random},
    indirect, twin,
};
use std::sync::Arc;
use tilewright::{Error, Extent, LoadOp, Renderer, Shader, Stage, compute, vk::Gpu};

#[allow(dead_code)]
#[path = "../examples/coarse_depth.rs"]
mod coarse_depth;

/// The text of the engine's file `name`.
fn engine(name: &str) -> &'static str {
    compute::GLSL.iter().find(|(file, _)| *file == name).expect("a file of the engine").1
}

/// The engine's file `name` with `new` in the place of `old`.
fn changed(name: &str, old: &str, new: &str) -> String {
    let text = engine(name);
    assert!(text.contains(old), "{name} has no `{old}`");
    text.replace(old, new)
}

/// All files with another comment, so that all kernels are compiled at run time: bounds are checked then, and the compiler is
/// another one than that of the kernels that the library contains.
#[test]
fn the_engines_own_text_draws_the_same() {
    on_each_gpu("the engine's own text draws the same", |gpu| {
        let files: Vec<_> = (compute::GLSL.iter())
            .filter(|(name, _)| *name != "abi.glsl")
            .map(|(name, text)| (*name, format!("{text}// The same.\n")))
            .collect();
        let files: Vec<_> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
        let mut own = Renderer::with_glsl(gpu, &files).unwrap();
        let mut engine = Renderer::new(gpu).unwrap();
        let shaders = twin::shaders();
        for seed in 7700..7712 {
            let direct = twin::random_pass(seed, &shaders);
            let indirect = indirect::as_commands(gpu, &mut Random::new(seed), &direct);
            for (what, pass) in [("direct", direct), ("indirect", indirect)] {
                let [own, engine] = [&mut own, &mut engine].map(|r| r.render(&pass).unwrap());
                let depths = [&own, &engine].map(|frame| frame.depth.as_ref().map(|d| &d.bytes));
                assert!(own.colors == engine.colors, "{}, seed {seed}, {what}", gpu.info());
                assert!(depths[0] == depths[1], "{}, seed {seed}, {what}", gpu.info());
            }
        }
    });
}

/// The winner of each pixel is the one of the rule: a surface that is hidden by less than a step of depth is not always hidden.
#[test]
fn a_rule_for_depth_holds_everywhere() {
    on_each_gpu("a rule for depth holds everywhere", |gpu| {
        let extent = Extent::new(400, 250);
        let mut fine = Renderer::new(gpu).unwrap();
        let mut coarse = coarse_depth::coarse(gpu).unwrap();
        let [fine, coarse] =
            [&mut fine, &mut coarse].map(|r| coarse_depth::draw(r, extent).unwrap());
        let texels = |picture: &tilewright::Picture| -> Vec<[u8; 4]> {
            picture.bytes.chunks(4).map(|t| t.try_into().unwrap()).collect()
        };
        let depths = |picture| texels(picture).into_iter().map(f32::from_le_bytes);
        let steps = |depth: f32| (depth * 255.0 + 0.5).floor();
        let (mut equal, mut differing) = (0, 0);
        let colors = texels(&fine.0).into_iter().zip(texels(&coarse.0));
        for ((a, b), (fine, coarse)) in colors.zip(depths(&fine.1).zip(depths(&coarse.1))) {
            assert_eq!(coarse, steps(coarse) * (1.0 / 255.0), "8 bits");
            // What wins by less than a step is as far away.
            assert_eq!(steps(coarse), steps(fine), "the nearest");
            if a == b { equal += 1 } else { differing += 1 }
        }
        let all = extent.pixels();
        assert!(equal > all * 3 / 4 && differing > all / 50, "{equal} equal, {differing} not");
    });
}

/// Ordered work too, and depths that shaders write.
#[test]
fn a_rule_for_depth_holds_in_every_kernel() {
    on_each_gpu("a rule for depth holds in every kernel", |gpu| {
        let mut coarse = coarse_depth::coarse(gpu).unwrap();
        let (vertex, fragment) = twin::shaders();
        let writes = "#version 450
            layout(location = 0) in vec4 color;
            layout(location = 0) out vec4 target;
            void main() { target = color; gl_FragDepth = 0.3 + 0.7 * gl_FragCoord.z; }";
        let writes = Arc::new(Shader::from_glsl(Stage::Fragment, "depth.frag", writes).unwrap());
        for seed in 7800..7816 {
            let fragment = if seed % 2 == 0 { &fragment } else { &writes };
            let pass = twin::random_pass(seed, &(vertex.clone(), fragment.clone()));
            let LoadOp::Clear(cleared) = pass.depth.as_ref().unwrap().load else { panic!() };
            for depth in coarse.render(&pass).unwrap().depth.unwrap().depths() {
                let kept = (depth * 255.0 + 0.5).floor() * (1.0 / 255.0);
                assert!(depth == kept || depth == cleared, "{}, seed {seed}: {depth}", gpu.info());
            }
        }
    });
}

fn fault(gpu: &Gpu, files: &[(&str, &str)]) -> Error {
    match Renderer::with_glsl(gpu, files) {
        Ok(mut renderer) => {
            let pass = twin::random_pass(1, &twin::shaders());
            renderer.render(&pass).expect_err("something is wrong with it")
        }
        Err(fault) => fault,
    }
}

#[test]
fn faults_in_stages_are_named() {
    let gpu = gpu();
    let said = |files: &[(&str, &str)]| fault(&gpu, files).to_string();
    let text = said(&[("lib/key.glsl", "a"), ("lib/key.glsl", "b")]);
    assert!(text.contains("`lib/key.glsl` is there twice"), "{text}");
    let text = said(&[("lib/key.glsl", "//\n\0")]);
    assert!(text.contains("lib/key.glsl") && text.contains("line 2: a NUL"), "{text}");
    for (include, fault) in [
        ("#include \"lib/key.glsl\"", "line 2: `lib/key.glsl` includes itself"),
        ("# include \"lib/tile.glsl\"", "line 2: an include is"),
        ("#include <lib/tile.glsl>", "line 2: an include is"),
        ("#include \"lib/none.glsl\"", "no file `lib/none.glsl`"),
    ] {
        let text = said(&[("lib/key.glsl", &format!("//\n{include}\n"))]);
        assert!(text.contains(fault), "{text}");
    }
    let chain: Vec<_> =
        (0..2000).map(|n| (format!("{n}"), format!("#include \"{}\"\n", n + 1))).collect();
    let chain = chain.iter().map(|(name, text)| (name.as_str(), text.as_str()));
    let first = ("lib/key.glsl", "#include \"0\"\n");
    let text = said(&[first].into_iter().chain(chain).collect::<Vec<_>>());
    assert!(text.contains("include one another"), "{text}");
    let text = said(&[("lib/dept.glsl", "")]);
    assert!(text.contains("`lib/dept.glsl`") && text.contains("lib/depth.glsl"), "{text}");
    assert!(said(&[("abi.glsl", engine("abi.glsl"))]).contains("cannot be replaced"));
    let text = said(&[("lib/key.glsl", "float twice(float a) {\n    return oops * a;\n}\n")]);
    assert!(text.contains("lib/key.glsl line 2: 'oops'"), "{text}");
    let text = said(&[("raster.comp", "void main() {}")]);
    assert!(text.contains("raster.comp") && text.contains("#version"), "{text}");
    let text = said(&[("raster.comp", "#version 460\n#include \"lib/mine.glsl\"\nvoid main() {}")]);
    assert!(text.contains("raster.comp") && text.contains("`lib/mine.glsl`"), "{text}");
    // Line numbers are those of the text that was handed in.
    let text = changed("raster.comp", "void main() {", "void main() { oops();");
    let line = text.lines().position(|line| line.contains("oops")).unwrap() + 1;
    let said_line = said(&[("raster.comp", &text)]);
    assert!(said_line.contains(&format!("line {line}: 'oops'")), "{said_line}");
    // What the engine looks for in a kernel.
    let compare = "layout(constant_id = SPEC_COMPARE) const";
    let text = said(&[("raster.comp", &changed("raster.comp", compare, "const"))]);
    assert!(text.contains("no constant `COMPARE`"), "{text}");
    let text = said(&[("vertex.comp", &changed("vertex.comp", "tw_user_", "user_"))]);
    assert!(text.contains("tw_user_"), "{text}");
    let text = said(&[("primitive.comp", &changed("primitive.comp", "Triangles {", "Paint {"))]);
    assert!(text.contains("`Triangles`"), "{text}");
    let own =
        "layout(std430, binding = 40) buffer Own { uint own[]; };\nvoid main() { own[0] = 1u;";
    let text = said(&[("primitive.comp", &changed("primitive.comp", "void main() {", own))]);
    assert!(text.contains("`Own`") || text.contains("`own`"), "{text}");
}

/// Shaders are spliced into functions and variables of these types. Drivers crash on calls of others.
#[test]
fn hooks_of_other_types_are_refused() {
    let gpu = gpu();
    for (old, new) in [
        ("uint tw_resource(const in uint i)", "uint tw_resource(uint i)"),
        (
            "uint tw_resource(const in uint i) {",
            "float tw_resource(const in uint i) { return 0.0; }\nuint other(const in uint i) {",
        ),
        (
            "vec4 tw_input_smooth(const in uint location) {",
            "void tw_input_smooth(const in uint location) {} vec4 other(const in uint location) {",
        ),
        (
            "const in uint count, const in uvec4 value) {",
            "const in uint count, inout uvec4 value) {",
        ),
        ("bool tw_HelperInvocation;", "int tw_HelperInvocation;"),
        ("vec4 tw_FragCoord;", "vec3 tw_FragCoord;"),
    ] {
        let text = changed("fragment.glsl", old, new);
        match Renderer::with_glsl(&gpu, &[("fragment.glsl", &text)]) {
            Err(Error::Shader { shader, .. }) => {
                assert!(["shade.comp", "ordered.comp"].contains(&shader.as_str()), "{shader}");
            }
            Err(other) => panic!("{new}: {other}"),
            Ok(_) => panic!("{new} is taken"),
        }
    }
}

/// The example of the documentation.
#[test]
fn a_screen_door_covers_every_second_pixel() {
    on_each_gpu("a screen door covers every second pixel", |gpu| {
        let file = "lib/coverage.glsl";
        let door = changed(file, "COVERS_WHOLE_BINS = true", "COVERS_WHOLE_BINS = false");
        let door = door.replace(">= 0;", ">= 0 && ((pixel.x ^ pixel.y) & 1) == 0;");
        let mut door = Renderer::with_glsl(gpu, &[(file, &door)]).unwrap();
        let mut engine = Renderer::new(gpu).unwrap();
        let shaders = twin::shaders();
        for seed in 7900..7916 {
            let pass = twin::random_pass(seed, &shaders);
            let width = pass.extent.width as usize;
            let [door, all] = [&mut door, &mut engine].map(|r| r.render(&pass).unwrap());
            let LoadOp::Clear(cleared) = pass.depth.as_ref().unwrap().load else { panic!() };
            let depths = door.depth.unwrap().depths().into_iter().zip(all.depth.unwrap().depths());
            let colors = door.colors[0].bytes.chunks(4).zip(all.colors[0].bytes.chunks(4));
            for (i, ((a, b), (door, all))) in colors.zip(depths).enumerate() {
                let open = ((i % width) ^ (i / width)) & 1 == 0;
                let what = format!("{}, seed {seed}, pixel {i}", gpu.info());
                assert_eq!(a, if open { b } else { &[0; 4] }, "{what}");
                assert_eq!(door, if open { all } else { cleared }, "{what}");
            }
        }
    });
}

/// Wrong numbers between the stages reach no memory of others. What is drawn does not matter.
#[test]
fn stages_that_break_their_contracts_end() {
    on_each_gpu("stages that break their contracts end", |gpu| {
        let shaders = twin::shaders();
        let wrong = [
            (
                "lib/key.glsl",
                "uint primitive = (key >> KEY_LOG2) - 1u;",
                "uint primitive = (key >> KEY_LOG2) + 12345u;",
            ),
            (
                "lib/depth.glsl",
                "return d > 0.0 ? (d < 1.0 ? d : 1.0) : 0.0;",
                "return sin(d * 1e6) * 1e30;",
            ),
        ];
        for (file, old, new) in wrong {
            let mut renderer =
                Renderer::with_glsl(gpu, &[(file, &changed(file, old, new))]).unwrap();
            for seed in 100..104 {
                renderer.render(&twin::random_pass(seed, &shaders)).unwrap();
            }
        }
        // Numbers that the host would believe.
        let wrong = changed(
            "primitive.comp",
            "uvec2(floatBitsToUint(plane.y), piece_index)",
            "uvec2(floatBitsToUint(plane.y), 12345u)",
        );
        let mut renderer = Renderer::with_glsl(gpu, &[("primitive.comp", &wrong)]).unwrap();
        let fault = renderer.trace(&twin::random_pass(100, &shaders)).unwrap_err();
        assert!(fault.to_string().contains("leaves no trace"), "{fault}");
        // Nothing is left behind.
        let pass = twin::random_pass(100, &shaders);
        let [first, second] = [(); 2].map(|()| Renderer::new(gpu).unwrap().render(&pass).unwrap());
        assert!(first.colors == second.colors);
    });
}

/// A further file, which a file of the engine includes.
#[test]
fn stages_may_have_files_of_their_own() {
    let gpu = gpu();
    let depth = changed(
        "lib/depth.glsl",
        "#include \"lib/exact.glsl\"",
        "#include \"lib/exact.glsl\"\n#include \"mine/half.glsl\"",
    );
    let depth = depth.replace(
        "return d > 0.0 ? (d < 1.0 ? d : 1.0) : 0.0;",
        "return half_of(d > 0.0 ? (d < 1.0 ? d : 1.0) : 0.0);",
    );
    let half = "float half_of(const float d) { return 0.5 * d; }\n";
    let files = [("lib/depth.glsl", depth.as_str()), ("mine/half.glsl", half)];
    let mut own = Renderer::with_glsl(&gpu, &files).unwrap();
    let mut engine = Renderer::new(&gpu).unwrap();
    let extent = Extent::new(160, 100);
    let [own, engine] = [&mut own, &mut engine].map(|r| coarse_depth::draw(r, extent).unwrap());
    let least = |depth: &tilewright::Picture| {
        let all = depth.bytes.chunks(4).map(|d| f32::from_le_bytes(d.try_into().unwrap()));
        all.fold(1.0, f32::min)
    };
    assert_eq!(least(&own.1), 0.5 * least(&engine.1));
    assert!(own.0 == engine.0);
}
