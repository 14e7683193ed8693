//! The layout of the structs that host and kernels share, as the compiler chose it for `abi.comp`.

use rspirv::{
    dr::{Module, Operand},
    spirv::{Decoration, Op},
};
use std::{
    collections::{BTreeMap, HashMap},
    fmt::Write as _,
};

/// One assertion per member of every struct of `abi.comp` that `abi.rs` has too.
///
/// # Panics
/// If a struct of quads in `text`, which is `abi.glsl`, is not the plain one.
pub fn assertions(module: &Module, text: &str) -> String {
    let structs = structs(module);
    let mut checks = String::new();
    for (name, Struct { members, bytes }) in &structs {
        // Blocks are plural by convention; only the structs inside them are shared.
        let Some(bytes) = bytes else { continue };
        if let Some(plain) = name.strip_prefix("Quad") {
            let plain = &structs[plain];
            assert_eq!(Some(*bytes), plain.bytes, "{name} has another size in glsl/abi.glsl");
            check_quad(text, name, members, &plain.members);
            continue;
        }
        for (member, offset) in members {
            writeln!(
                checks,
                "const _: () = assert!(std::mem::offset_of!(abi::{name}, {member}) == {offset}, \
                 \"{name}.{member} differs between src/abi.rs and glsl/abi.glsl; if both have changed, run \
                 `cargo spirv`\");"
            )
            .expect("a String takes all");
        }
        writeln!(
            checks,
            "const _: () = assert!(std::mem::size_of::<abi::{name}>() == {bytes}, \
             \"{name} has another size in glsl/abi.glsl; if both have changed, run `cargo spirv`\");"
        )
        .expect("a String takes all");
    }
    checks
}

/// Panics unless each of the `members` of the struct `name` of abi.glsl begins where the first of the
/// fields that its comment names does, and the others follow; without a comment, its own name.
fn check_quad(text: &str, name: &str, members: &[(String, u32)], plain: &[(String, u32)]) {
    let text = text.split_once(&format!("struct {name} {{")).expect("a struct is declared").1;
    for (member, offset) in members {
        let comment = text.lines().find_map(|line| {
            let (declaration, comment) = line.split_once("//")?;
            let (declared, _) = declaration.trim().split_once(['[', ';'])?;
            declared.strip_suffix(member.as_str())?.ends_with(' ').then_some(comment)
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
