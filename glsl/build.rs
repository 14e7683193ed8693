//! Compiles the kernels and checks the structs they share with the host.
//!
//! Writes to `OUT_DIR`:
//! * `kernels.rs`: a module per kernel with its SPIR-V;
//! * `scene.rs`: the SPIR-V of the scenes' shader pair;
//! * `bench.rs`: that of the benchmark's shader pair and of its kernels;
//! * `layout.rs`: one assertion per field of `abi.rs` against the offsets that the compiler chose
//!   for `abi.comp`.

use glslang::{Compiler, ShaderSource, ShaderStage};
use rspirv::{
    binary::Assemble,
    dr::{Module, Operand},
    spirv::{Decoration, Op},
};
use std::{
    collections::{BTreeMap, HashMap},
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

#[allow(dead_code)]
#[path = "../src/abi.rs"]
mod abi;
#[path = "../src/shader/compiler.rs"]
mod compiler;
mod contraction;

fn main() {
    let root = PathBuf::from("glsl");
    println!("cargo:rerun-if-changed=glsl");
    println!("cargo:rerun-if-changed=src/abi.rs");
    println!("cargo:rerun-if-changed=src/shader/compiler.rs");
    let constants = constants(&fs::read_to_string("src/abi.rs").expect("src/abi.rs is readable"));
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));

    let mut names: Vec<String> = fs::read_dir(&root)
        .expect("glsl/ is a folder")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter_map(|name| name.strip_suffix(".comp").map(str::to_owned))
        .collect();
    names.sort();

    let mut kernels = String::new();
    for name in &names {
        let path = root.join(format!("{name}.comp"));
        let mut module = load(&path, &compile(&path, ShaderStage::Compute, &constants));
        if name == "abi" {
            fs::write(out.join("layout.rs"), layout_checks(&module)).expect("OUT_DIR is writable");
            continue;
        }
        contraction::forbid(&mut module);
        writeln!(
            kernels,
            "/// SPIR-V of `{name}.comp`.\npub const {}: &[u32] = &{:?};",
            name.to_uppercase(),
            module.assemble()
        )
        .expect("a String takes all");
    }
    let all: Vec<_> = names.iter().filter(|n| *n != "abi").map(|n| n.to_uppercase()).collect();
    writeln!(kernels, "/// All of them, for the benchmark to name.\n#[cfg(feature = \"glsl\")]\npub const ALL: &[&[u32]] = &[{}];", all.join(", "))
        .expect("a String takes all");
    fs::write(out.join("kernels.rs"), kernels).expect("OUT_DIR is writable");
    fs::write(out.join("scene.rs"), scene_shaders(&root.join("scene")))
        .expect("OUT_DIR is writable");
    fs::write(out.join("bench.rs"), bench_shaders(&root.join("bench")))
        .expect("OUT_DIR is writable");
}

/// The scenes' shaders, compiled as users' shaders are at run time: nothing is done to them, and the
/// first picture need not wait for a compiler. What varies at compile time is a macro.
fn scene_shaders(folder: &Path) -> String {
    let pair = [
        ("VERTEX", "material.vert", ShaderStage::Vertex, ""),
        ("FRAGMENT", "material.frag", ShaderStage::Fragment, ""),
        ("MASK_FRAGMENT", "material.frag", ShaderStage::Fragment, "#define ALPHA_MASK\n"),
    ];
    let mut text = String::new();
    for (name, file, stage, defines) in pair {
        let words = compile(&folder.join(file), stage, defines);
        writeln!(text, "/// SPIR-V of `{file}`.\npub const {name}: &[u32] = &{words:?};")
            .expect("a String takes all");
    }
    text
}

/// The benchmark's shader pair, for each number of further varyings, and the kernels of its limits.
fn bench_shaders(folder: &Path) -> String {
    let pair = [
        ("VERTEX", "surface.vert", ShaderStage::Vertex),
        ("FRAGMENT", "surface.frag", ShaderStage::Fragment),
    ];
    let mut text = String::new();
    for (name, file, stage) in pair {
        let modules = [0, 4, 8, 12].map(|varyings| {
            let defines = format!("#define VARYINGS {varyings}\n");
            format!("({varyings}, &{:?})", compile(&folder.join(file), stage, &defines))
        });
        writeln!(
            text,
            "/// SPIR-V of `{file}` with so many further varyings.\n\
             pub const {name}: [(u32, &[u32]); {}] = [{}];",
            modules.len(),
            modules.join(", ")
        )
        .expect("a String takes all");
    }
    for (name, file) in [("COPY", "copy.comp"), ("ATOMIC", "atomic.comp")] {
        let words = compile(&folder.join(file), ShaderStage::Compute, "");
        writeln!(text, "/// SPIR-V of `{file}`.\npub const {name}: &[u32] = &{words:?};")
            .expect("a String takes all");
    }
    text
}

/// `#define`s for every `pub const NAME: u32` of `abi.rs`; the values come from the compiled module,
/// so expressions are allowed.
fn constants(source: &str) -> String {
    let values: HashMap<&str, u32> = abi_values();
    let mut defines = String::new();
    for line in source.lines() {
        let Some(rest) = line.strip_prefix("pub const ") else { continue };
        let Some((name, _)) = rest.split_once(": u32") else { continue };
        let value = values.get(name).unwrap_or_else(|| panic!("list `{name}` in glsl/build.rs"));
        writeln!(defines, "#define {name} {value}u").expect("a String takes all");
    }
    defines
}

macro_rules! values {
    ($($name:ident)*) => { HashMap::from([$((stringify!($name), abi::$name)),*]) };
}

fn abi_values() -> HashMap<&'static str, u32> {
    values! {
        SUBPIXEL_BITS BIN_SIZE_LOG2 BIN_PIXELS CELL_LEVELS CELL_LOG2_0 CELL_LOG2_1 CELL_LOG2_2
        CELL_LOG2_3 MAX_CELLS MAX_CELLS_TESTED SEVERAL_CELLS MAX_EXTENT_LOG2 GUARD_LOG2 MAX_CLIPPED KEY_LOG2
        MAX_FRAGMENT_KERNELS GROUP CLEAR_PIXELS VERTEX_ROUNDS PRIMITIVE_ROUNDS MAX_ATTRIBUTES MAX_VARYINGS
        QUAD WINDOW_LOG2 WINDOW_OVERLAP SPEC_LANES SPEC_ATTRIBUTE
        ATTRIBUTE_COUNT_SHIFT ATTRIBUTE_PER_INSTANCE SPEC_WIDTH SPEC_COMPARE SPEC_IN_PLACE SPEC_FORMAT NONE SET_ENGINE SET_TABLE
        TABLE_BUFFERS VERTEX_RANGED VERTEX_PER_CORNER TRIANGLE_VALID TRIANGLE_FRONT TRIANGLE_CUT
        TRIANGLE_LEVEL_SHIFT TRIANGLE_EXTRA_SHIFT SPEC_DEPTH DEPTH_EARLY_TEST DEPTH_LATE
        DEPTH_EARLY FORMAT_RGBA8_UNORM FORMAT_RGBA8_SRGB FORMAT_RGBA16_FLOAT
    }
}

/// The text of `path` with its includes in place, each file once.
fn source(path: &Path, seen: &mut Vec<PathBuf>) -> String {
    let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut all = String::new();
    for line in text.lines() {
        let include = line.trim().strip_prefix("#include \"").and_then(|l| l.strip_suffix('"'));
        match include {
            Some(name) => {
                let file = Path::new("glsl").join(name);
                if !seen.contains(&file) {
                    seen.push(file.clone());
                    all += &source(&file, seen);
                }
            }
            None => {
                all += line;
                all.push('\n');
            }
        }
    }
    all
}

/// SPIR-V of `path` with `defines` after its `#version` line.
fn compile(path: &Path, stage: ShaderStage, defines: &str) -> Vec<u32> {
    let text = source(path, &mut Vec::new());
    let version = text.find("#version ").expect("a shader has a version");
    let after = version + text[version..].find('\n').expect("a shader is more than a version") + 1;
    let text = format!("{}{defines}{}", &text[..after], &text[after..]);
    let compiler = Compiler::acquire().expect("glslang starts");
    let source = ShaderSource::from(text.as_str());
    compiler::to_spirv(compiler, stage, &source, None).unwrap_or_else(|error| {
        let numbered: String =
            text.lines().enumerate().map(|(n, l)| format!("{:4} {l}\n", n + 1)).collect();
        panic!("{}\n{numbered}\n{error}", path.display())
    })
}

fn load(path: &Path, words: &[u32]) -> Module {
    rspirv::dr::load_words(words).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// One assertion per member of every struct of `abi.comp` that `abi.rs` has too.
fn layout_checks(module: &Module) -> String {
    let structs = structs(module);
    let mut checks = String::new();
    for (name, Struct { members, bytes }) in &structs {
        // Blocks are plural by convention, the structs inside them are what is shared.
        let Some(bytes) = bytes else { continue };
        if let Some(plain) = name.strip_prefix("Quad") {
            let plain = &structs[plain];
            assert_eq!(Some(*bytes), plain.bytes, "{name} has another size in glsl/abi.glsl");
            check_quad(name, members, &plain.members);
            continue;
        }
        for (member, offset) in members {
            writeln!(
                checks,
                "const _: () = assert!(std::mem::offset_of!(abi::{name}, {member}) == {offset}, \
                 \"{name}.{member} differs between src/abi.rs and glsl/abi.glsl\");"
            )
            .expect("a String takes all");
        }
        writeln!(
            checks,
            "const _: () = assert!(std::mem::size_of::<abi::{name}>() == {bytes}, \
             \"{name} has another size in glsl/abi.glsl\");"
        )
        .expect("a String takes all");
    }
    checks
}

/// Panics unless each of the `members` of the struct `name` of abi.glsl begins where the first of the
/// fields that its comment names does, and the others follow; without a comment, its own name.
fn check_quad(name: &str, members: &[(String, u32)], plain: &[(String, u32)]) {
    let text = fs::read_to_string("glsl/abi.glsl").expect("glsl/abi.glsl is readable");
    let text = text.split_once(&format!("struct {name} {{")).expect("a struct is declared").1;
    for (member, offset) in members {
        let comment = text.lines().find_map(|line| {
            let (declaration, comment) = line.split_once("//")?;
            declaration.trim().strip_suffix(&format!(" {member};")).map(|_| comment)
        });
        let fields: Vec<&str> = comment.unwrap_or(member).split(',').map(str::trim).collect();
        let found = plain.iter().position(|(_, at)| at == offset).map_or(&[][..], |n| &plain[n..]);
        let found: Vec<&str> = found.iter().take(fields.len()).map(|(f, _)| f.as_str()).collect();
        assert_eq!(found, fields, "{name}.{member} of glsl/abi.glsl holds other fields");
    }
}

/// A struct of a module.
#[derive(Default)]
struct Struct {
    /// Names and offsets, in order.
    members: Vec<(String, u32)>,
    /// From one element of a run-time array to the next, if there is such an array.
    bytes: Option<u32>,
}

/// The structs of a module by name.
fn structs(module: &Module) -> BTreeMap<String, Struct> {
    let mut names = HashMap::new();
    let mut members = BTreeMap::new();
    for i in &module.debug_names {
        let id = i.operands[0].unwrap_id_ref();
        match i.operands.as_slice() {
            [_, Operand::LiteralString(name)] => _ = names.insert(id, name),
            [_, Operand::LiteralBit32(n), Operand::LiteralString(name)] => {
                members.insert((id, *n), name);
            }
            _ => {}
        }
    }
    let mut offsets = HashMap::new();
    let mut strides = HashMap::new();
    for i in &module.annotations {
        let id = i.operands[0].unwrap_id_ref();
        match i.operands.as_slice() {
            [
                _,
                Operand::LiteralBit32(member),
                Operand::Decoration(Decoration::Offset),
                Operand::LiteralBit32(value),
            ] => _ = offsets.insert((id, *member), *value),
            [_, Operand::Decoration(Decoration::ArrayStride), Operand::LiteralBit32(value)] => {
                strides.insert(id, *value);
            }
            _ => {}
        }
    }
    let mut found = BTreeMap::<String, Struct>::new();
    for ((id, n), name) in members {
        if let Some(&offset) = offsets.get(&(id, n)) {
            found.entry(names[&id].clone()).or_default().members.push((name.clone(), offset));
        }
    }
    for i in module.types_global_values.iter().filter(|i| i.class.opcode == Op::TypeRuntimeArray) {
        let (element, array) = (i.operands[0].unwrap_id_ref(), i.result_id.unwrap_or(0));
        if let (Some(name), Some(&stride)) = (names.get(&element), strides.get(&array)) {
            found.entry((*name).clone()).or_default().bytes = Some(stride);
        }
    }
    found
}
