//! Is the house in order? The rules that no compiler checks, each a test that names the file and line.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// Lines of a Rust file. Past this a file holds two ideas.
const SOURCE_LINES: usize = 500;
/// Lines of a kernel, a step or a scene shader: it is read beside its contract, on one screen or two.
const SHADER_LINES: usize = 200;
/// Files of `src/compute/` and `src/reference/` that are no stages, each with what it is instead.
const NOT_STAGES: &[(&str, &str)] = &[
    ("mod", "the order of the stages"),
    ("attach", "the targets of a pass: load and store operations"),
    ("compile", "pipelines that are compiled before a pass needs them"),
    ("encoder", "a frame that is recorded anew each time"),
    ("frame", "the buffers of a pass and its recording"),
    ("prepared", "a recorded pass and its results"),
    ("kernels", "the kernels of a pipeline, made once"),
    ("maker", "makes one kernel"),
    ("sources", "the GLSL of the kernels, also a user's"),
    ("scratch", "memory that a pass needs while it runs"),
    ("target", "the rows of a band"),
    ("slots", "the table slots of a draw's resources"),
    ("trace", "the intermediates of a frame, brought home"),
    ("assembly", "the reference's own plan: the primitives of a pass in API order"),
    ("window", "the viewport and the scissor of a draw, for the reference"),
];
/// Stages without a reference, each with the reason.
const WITHOUT_REFERENCE: &[(&str, &str)] = &[
    (
        "commands",
        "makes what the planner makes: its pictures are compared with those of the same draws",
    ),
    ("clear", "writes one value everywhere: its result is compared as the targets' first content"),
    ("narrow", "moves bytes: pictures of narrow formats are compared with what shaders wrote"),
    ("resolve", "averages samples: its pictures are compared with averages of what was drawn"),
    ("vertex", "runs the user's shader: the reference takes the positions that it wrote"),
    ("shade", "runs the user's shader: its colours are compared with the classic pipeline's"),
    ("ordered", "runs the user's shader: its colours are compared with the classic pipeline's"),
];

struct File {
    /// Relative to the checkout, with `/`.
    path: String,
    text: String,
}

impl File {
    /// The lines that hold code, with their numbers: comments of Rust, GLSL, TOML and shell are left out.
    fn code(&self) -> impl Iterator<Item = (usize, &str)> {
        let hash = !self.path.ends_with(".rs") && !is_shader(&self.path);
        let comment = if hash { "#" } else { "//" };
        self.lines().filter(move |(_, line)| !line.trim_start().starts_with(comment))
    }

    fn lines(&self) -> impl Iterator<Item = (usize, &str)> {
        self.text.lines().enumerate().map(|(at, line)| (at + 1, line))
    }

    fn is_in(&self, folder: &str) -> bool {
        self.path.starts_with(folder)
    }
}

fn is_shader(path: &str) -> bool {
    [".comp", ".glsl", ".vert", ".frag"].iter().any(|end| path.ends_with(end))
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every text file of the project, read through the folders it consists of: what lies beside them (build
/// output, pictures) is not ours to judge.
fn files() -> Vec<File> {
    fn walk(path: &Path, into: &mut Vec<File>) {
        if path.is_dir() {
            let mut entries: Vec<_> =
                fs::read_dir(path).unwrap().map(|e| e.unwrap().path()).collect();
            entries.sort();
            entries.iter().for_each(|entry| walk(entry, into));
        } else if let Ok(text) = fs::read_to_string(path) {
            let path = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
            into.push(File { path, text });
        }
    }
    let mut found = Vec::new();
    let parts = [
        "src",
        "glsl",
        "tests",
        "benches",
        "examples",
        "scripts",
        "docs",
        ".ci",
        "demo",
        "check",
        "Cargo.toml",
        "README.md",
        "deny.toml",
    ];
    parts
        .iter()
        .map(|part| root().join(part))
        .filter(|p| p.exists())
        .for_each(|p| walk(&p, &mut found));
    found
}

fn report(rule: &str, faults: &[String]) {
    assert!(faults.is_empty(), "{rule}\n  {}", faults.join("\n  "));
}

/// Lines of `file` that hold one of `words` as a whole word.
fn holding<'a>(
    lines: impl Iterator<Item = (usize, &'a str)>,
    path: &str,
    words: &[&str],
) -> Vec<String> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut faults = Vec::new();
    for (number, line) in lines {
        for word in words {
            let inside_a_word = |at: usize| {
                let end = at + word.len();
                line[..at].ends_with(is_word)
                    || word.ends_with(is_word) && line[end..].starts_with(is_word)
            };
            let whole = line.match_indices(word).any(|(at, _)| !inside_a_word(at));
            if whole {
                faults.push(format!("{path}:{number}: {}", line.trim()));
            }
        }
    }
    faults
}

#[test]
fn words_are_found_whole() {
    let text = "use ash::vk;\nhash::map();\nunsafe { x() }\nlet unsafely = 1;\n// an unsafe remark";
    let file = File { path: "x.rs".into(), text: text.into() };
    let found = holding(file.code(), &file.path, &["ash::", "unsafe"]);
    assert_eq!(found, ["x.rs:1: use ash::vk;", "x.rs:3: unsafe { x() }"]);
}

#[test]
fn only_vk_and_classic_know_vulkan_and_hold_unsafe_code() {
    let mut faults = Vec::new();
    for file in files() {
        // Rust lets nobody count allocations without it.
        let counter = file.path == "tests/common/allocations.rs";
        // A kernel that no validator of a distribution may know.
        let spliced = file.path == "tests/splice.rs";
        // Programs that use Vulkan by themselves.
        let programs = [
            "tests/adopt.rs",
            "tests/common/vulkan.rs",
            "examples/ash.rs",
            "examples/window/src/screen.rs",
        ];
        let caller = programs.contains(&file.path.as_str());
        let ours = file.is_in("src/vk/") || file.is_in("src/classic/");
        let home = ours || counter || spliced || caller;
        let rust = file.path.ends_with(".rs") && file.path != "tests/tidy.rs";
        if rust && !home {
            // A function that asks something of its caller contains no unsafe code for that.
            let lines = file.code().filter(|(_, line)| !line.contains("pub unsafe fn "));
            faults.extend(holding(lines, &file.path, &["ash::", "unsafe", "gpu_allocator"]));
        }
    }
    report("Vulkan and unsafe code of the library live in src/vk and src/classic alone:", &faults);
}

#[test]
fn the_reference_knows_nothing_of_the_device_and_plans_for_itself() {
    let mut faults = Vec::new();
    for file in files().iter().filter(|file| file.is_in("src/reference/")) {
        let words = ["vk::", "compute::", "classic::", "plan::", "Piece", "abi::Triangle"];
        faults.extend(holding(file.code(), &file.path, &words));
    }
    report(
        "src/reference says what is right without asking the device or compute's plan:",
        &faults,
    );
}

#[test]
fn a_stage_is_three_files_with_one_name() {
    let files = files();
    let stems = |folder: &str, end: &str| -> Vec<String> {
        let stem = |file: &File| {
            let name = file.path.strip_prefix(folder)?.strip_suffix(end)?;
            (!name.contains('/')).then(|| name.to_owned())
        };
        files.iter().filter_map(stem).collect()
    };
    let stages = |folder: &str| -> Vec<String> {
        let is_stage = |stem: &String| NOT_STAGES.iter().all(|(name, _)| name != stem);
        stems(folder, ".rs").into_iter().filter(is_stage).collect()
    };
    // A stage of several steps numbers them behind its name: `binning_scan.comp`.
    let kernels = stems("glsl/", ".comp");
    let of = |kernel: &str, stage: &str| {
        kernel.strip_prefix(stage).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
    };
    let (recorded, references) = (stages("src/compute/"), stages("src/reference/"));
    let mut faults = Vec::new();
    for stage in &recorded {
        if !kernels.iter().any(|kernel| of(kernel, stage)) {
            faults.push(format!("src/compute/{stage}.rs has no glsl/{stage}.comp"));
        }
        let excused = WITHOUT_REFERENCE.iter().any(|(name, _)| name == stage);
        if references.contains(stage) == excused {
            let wrong = if excused { "has one after all" } else { "has none" };
            faults
                .push(format!("src/compute/{stage}.rs and its src/reference/{stage}.rs: {wrong}"));
        }
    }
    for kernel in kernels.iter().filter(|kernel| *kernel != "abi") {
        if !recorded.is_empty() && !recorded.iter().any(|stage| of(kernel, stage)) {
            faults.push(format!("no stage of src/compute records glsl/{kernel}.comp"));
        }
    }
    report("a stage is its recorder, its kernel and its reference:", &faults);
}

#[test]
fn a_kernel_opens_with_its_contract() {
    let mut faults = Vec::new();
    let is_kernel = |path: &str| path.starts_with("glsl/") && path.ends_with(".comp");
    for file in files().iter().filter(|file| is_kernel(&file.path) && file.path != "glsl/abi.comp")
    {
        let opening: Vec<&str> =
            file.text.lines().take_while(|line| line.starts_with("//")).collect();
        let said = |heading: &str| opening.iter().any(|line| line.contains(heading));
        for heading in ["Reads:", "Writes:", "Contract:", "Kernel / Twin:"] {
            let in_place = matches!(heading, "Reads:" | "Writes:") && said("Reads and writes:");
            if !said(heading) && !in_place {
                faults.push(format!("{} does not say `{heading}`", file.path));
            }
        }
    }
    report("a kernel opens with what it reads, writes and promises:", &faults);
}

#[test]
fn steps_declare_no_buffers() {
    let mut faults = Vec::new();
    for file in files().iter().filter(|file| file.is_in("glsl/lib/")) {
        faults.extend(holding(file.code(), &file.path, &["buffer", "uniform", "binding"]));
    }
    report("glsl/lib is arithmetic; kernels declare the buffers:", &faults);
}

/// The operators of `line` that compare one of `names`, or a field of that name, with a bare number, and the labels
/// that are one.
fn bare_numbers<'a>(line: &'a str, names: &[&str]) -> Vec<&'a str> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let begins_with_digit =
        |text: &str| text.trim_start().starts_with(|c: char| c.is_ascii_digit());
    let compared = line.match_indices(['=', '!', '<', '>']).filter(|&(at, _)| {
        let (before, after) = (line[..at].trim_end(), line[at + 1..].trim_start_matches(['=']));
        let operator = &line[at..line.len() - after.len()];
        let assigns = operator == "=" || after.starts_with(['<', '>']);
        let start = before.rfind(|c| !is_word(c)).map_or(0, |at| at + 1);
        !assigns && names.contains(&&before[start..]) && begins_with_digit(after)
    });
    let labels = line.match_indices("case ").filter(|(at, _)| begins_with_digit(&line[at + 5..]));
    compared.chain(labels).map(|(at, _)| line[at..].trim_end()).collect()
}

#[test]
fn numbers_of_state_have_names() {
    // What holds an enum of state.rs or format.rs, or a number that stands for one. A vertex attribute's format is 0
    // where there is none.
    let names = [
        "topology",
        "component",
        "factor",
        "op",
        "operation",
        "cull",
        "front_face",
        "depth_compare",
        "COMPARE",
        "FORMAT",
        "DEPTH",
        "vertex_mode",
    ];
    assert_eq!(bare_numbers("if (piece.cull != 2u)", &names), ["!= 2u)"]);
    assert_eq!(bare_numbers("COMPARE == COMPARE_LESS || COMPARE >= 4u", &names), [">= 4u"]);
    assert_eq!(
        bare_numbers("case 3u: case COMPONENT_U8: x = 1;", &names),
        ["case 3u: case COMPONENT_U8: x = 1;"]
    );
    assert!(bare_numbers("op < BLEND_OP_MIN ? a : topology >> 2 == 1u", &names).is_empty());
    let mut faults = Vec::new();
    for file in files().iter().filter(|file| file.is_in("glsl/") && is_shader(&file.path)) {
        for (number, line) in file.code() {
            if !bare_numbers(line, &names).is_empty() {
                faults.push(format!("{}:{number}: {}", file.path, line.trim()));
            }
        }
    }
    report("a number that Rust gives a name has it in GLSL too:", &faults);
}

#[test]
fn a_file_opens_with_what_it_is() {
    let mut faults = Vec::new();
    for file in files().iter().filter(|file| file.path.ends_with(".rs")) {
        if !file.text.starts_with("//!") {
            faults.push(file.path.clone());
        }
    }
    report("a file that says nothing of itself is a scratch pad:", &faults);
}

#[test]
fn files_stay_short() {
    let mut faults = Vec::new();
    for file in files() {
        let limit = match file.path.rsplit('.').next() {
            // Made by `cargo spirv`: nobody reads it.
            _ if file.path.starts_with("glsl/spirv/") => continue,
            Some("rs") => SOURCE_LINES,
            _ if is_shader(&file.path) => SHADER_LINES,
            _ => continue,
        };
        let lines = file.text.lines().count();
        if lines > limit {
            faults.push(format!("{}: {lines} lines, {limit} at most", file.path));
        }
    }
    report("a file that outgrows its limit is two files:", &faults);
}

#[test]
fn nothing_is_left_lying_about() {
    // Spelled so that this list does not find itself.
    let words = ["TO_DO", "FIX_ME", "XX_X", "to_do!", "db_g!", "unimple_mented!"]
        .map(|w| w.replacen('_', "", 1));
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let mut faults = Vec::new();
    for file in files() {
        faults.extend(holding(file.lines(), &file.path, &words));
        if file.path == "tests/tidy.rs" {
            continue;
        }
        for (number, line) in file.lines() {
            let lower = line.to_lowercase();
            let fault = if line.contains("#[ignore") {
                "a test that does not run"
            } else if lower.contains("in sync with") || lower.contains("keep in sync") {
                "two homes of one fact: let the compiler or a test compare them"
            } else {
                continue;
            };
            faults.push(format!("{}:{number}: {fault}: {}", file.path, line.trim()));
        }
    }
    report("work that is not done belongs in an issue:", &faults);
}

#[test]
fn no_path_of_one_machine() {
    let mut faults = Vec::new();
    for file in files().iter().filter(|file| file.path != "tests/tidy.rs") {
        for (number, line) in file.lines() {
            let elsewhere = line.contains("../shared") && file.path != ".ci/run";
            if elsewhere || ["/work/", "/root/", "/home/", "/tmp/"].iter().any(|p| line.contains(p))
            {
                faults.push(format!("{}:{number}: {}", file.path, line.trim()));
            }
        }
    }
    report("paths come from the environment or the command line:", &faults);
}

#[test]
fn every_dependency_says_why() {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let (mut in_dependencies, mut commented, mut open_brackets) = (false, false, 0);
    let mut faults = Vec::new();
    for line in manifest.lines() {
        let inside_value = open_brackets > 0;
        let count = |c| line.matches(c).count() as i32;
        open_brackets += count('[') + count('{') - count(']') - count('}');
        if inside_value {
            continue;
        }
        if line.starts_with('[') {
            in_dependencies = line.trim_end_matches(']').ends_with("dependencies");
        } else if in_dependencies && line.contains('=') && !line.starts_with('#') && !commented {
            faults.push(line.to_owned());
        }
        commented = line.starts_with('#');
    }
    report("a dependency without a reason above it:", &faults);
}

/// Whoever leaves out a feature does not wait for its crates.
#[test]
fn a_build_waits_for_no_crate_of_a_feature_that_is_off() {
    let cpp = ["cc", "cmake", "glslang", "shaderc"];
    let tool = ["clap", "clap_complete", "clap_mangen", "indicatif", "signal-hook"];
    let scene =
        ["bevy_mikktspace", "glam", "gltf-json", "humantime", "image", "indexmap", "serde_derive"];
    let lock = fs::read_to_string(root().join("Cargo.lock")).unwrap();
    let mut faults = Vec::new();
    for (features, absent) in [
        ("", &[&cpp[..]][..]),
        ("--no-default-features --features scene", &[&cpp, &tool]),
        ("--no-default-features", &[&cpp, &tool, &scene]),
    ] {
        let output = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()))
            .args(["tree", "--locked", "--offline", "--edges=normal,build", "--prefix=none"])
            .args(features.split_whitespace())
            .current_dir(root())
            .output()
            .unwrap();
        let tree = String::from_utf8_lossy(&output.stdout);
        assert!(tree.starts_with("tilewright v"), "{}", String::from_utf8_lossy(&output.stderr));
        for name in absent.iter().copied().flatten() {
            assert!(
                lock.contains(&format!("\nname = \"{name}\"\n")),
                "no crate has the name {name}"
            );
            if tree.lines().any(|line| line.split(' ').next() == Some(name)) {
                faults.push(format!("{name}, in a build with '{features}'"));
            }
        }
    }
    report("a crate that belongs to a feature is optional:", &faults);
}

#[test]
fn every_module_of_the_suite_runs() {
    let main = fs::read_to_string(root().join("tests/main.rs")).unwrap();
    let mut faults = Vec::new();
    for file in files() {
        let Some(name) = file.path.strip_prefix("tests/") else { continue };
        let Some((module, rest)) = name.split_once('/').or(name.split_once('.')) else { continue };
        let is_module = rest == "rs" || rest == "mod.rs";
        if is_module && module != "main" && !main.contains(&format!("mod {module};")) {
            faults.push(format!("{} is not in tests/main.rs: it never runs", file.path));
        }
    }
    report("one binary, every module in it:", &faults);
}

/// Readers copy commands: each script must exist, and each verb and each option must be known.
#[test]
fn the_first_page_and_docs_show_commands_that_exist() {
    let pages: Vec<File> = files().into_iter().filter(|file| file.path.ends_with(".md")).collect();
    let (mut in_shell, mut seen, mut faults) = (false, 0, Vec::new());
    for line in pages.iter().flat_map(|page| page.text.lines()) {
        if let Some(language) = line.strip_prefix("```") {
            in_shell = language == "sh";
            continue;
        }
        let words: Vec<&str> =
            line.split_whitespace().take_while(|word| !word.starts_with('#')).collect();
        let Some(first) = words.first().filter(|_| in_shell) else { continue };
        seen += 1;
        if let Some(script) = first.strip_prefix("./") {
            if !root().join(script).is_file() {
                faults.push(format!("there is no {first}"));
            }
        } else if *first == "tilewright" {
            // The verb and its sub-verb: everything before the first operand or option.
            let is_verb = |word: &&&str| word.chars().all(|c| c.is_ascii_lowercase());
            let verbs: Vec<&str> = words[1..].iter().take_while(is_verb).take(2).copied().collect();
            let output = Command::new(env!("CARGO_BIN_EXE_tilewright"))
                .args(&verbs)
                .arg("--help")
                .output()
                .unwrap();
            let help = String::from_utf8_lossy(&output.stdout);
            if !output.status.success() {
                faults.push(format!("`{line}`: tilewright {} --help fails", verbs.join(" ")));
            }
            for option in words.iter().filter(|word| word.starts_with('-') && word.len() > 1) {
                if !help.contains(option.split('=').next().unwrap_or(option)) {
                    faults.push(format!("`{line}`: {option} is not in the help"));
                }
            }
        }
    }
    assert!(seen > 0, "no page has a ```sh block");
    report("a page shows what is not there:", &faults);
}
