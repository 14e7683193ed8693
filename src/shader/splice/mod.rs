//! Splicing: a user's shader becomes a function of one of the engine's kernels.
//!
//! The kernel is ordinary GLSL, compiled ahead of time, with empty functions called `tw_user_…`
//! and hooks that know where inputs come from and outputs go (the hooks are listed in
//! `hooks.rs`). The user's module is imported into the kernel's, declaration by declaration. Features of a
//! graphics pipeline are replaced by features of compute. The stubs get bodies that fetch the data that a draw
//! needs once, fetch inputs, call the user's `main` and hand on its outputs. The user's arithmetic is not
//! touched.
//!
//! In order: `import`, then over the user's functions `specialize`, `prefetch`, `resources`,
//! `fragment`, `kill`, `derivatives`, `guard`, `nonuniform`, then `glue`, then `order`.
//!
//! Why in SPIR-V: rewriting the source fails on `in` and `out` as parameter qualifiers, on name
//! clashes and on derivatives, whose types only a compiler knows; the GLSL compiler links no libraries;
//! going back to GLSL and compiling again costs ten times as much per pipeline.
//!
//! A feature that cannot be spliced is refused with a sentence that names it. The lists in `limits` are of the
//! supported features: an unknown capability, decoration or built-in is an error.

mod builtins;
mod derivatives;
mod flow;
mod fragment;
mod glue;
mod guard;
mod hooks;
mod import;
mod kill;
mod limits;
mod linker;
mod nonuniform;
mod order;
mod prefetch;
mod repair;
mod resources;
mod specialize;
#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
pub(super) mod tests;
pub(crate) mod verify;

use super::{
    Shader, Stage,
    module::{self, Index, Outcome},
    usage::Usage,
};
use crate::{Error, Result};
use hooks::Hooks;
use linker::Linker;
use resources::{Element, Span};
use rspirv::{
    binary::Assemble,
    dr::Operand,
    spirv::{Op, Word},
};

/// How a kernel gets derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Derivatives {
    /// From the device, by `VK_KHR_compute_shader_derivatives` with linear groups.
    Native,
    /// From the kernel's `tw_ddx` and `tw_ddy`, by subgroup quad operations.
    Quad,
}

/// How the user's code reads uniform and push-constant blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Blocks {
    /// From the block, each time. Right where registers are few and equal addresses are cheap: GPUs.
    InPlace,
    /// From private variables that are filled when the kernel binds a draw (see `prefetch.rs`). This is
    /// faster on CPUs, where every lane fetches for itself.
    Prefetched,
}

/// The options of splicing, beside kernel and shader.
#[derive(Clone, Copy, Debug)]
pub struct SpliceOptions<'a> {
    /// How the kernel gets derivatives.
    pub derivatives: Derivatives,
    /// How the user's code reads uniform and push-constant blocks.
    pub blocks: Blocks,
    /// The pipeline's specialization constants. One that changes the length of an array of inputs or
    /// outputs is refused.
    pub specialization: &'a [(u32, u32)],
}

/// A kernel with a user's shader in it.
#[derive(Clone, Debug)]
pub struct Spliced {
    /// The module: one compute entry point, the kernel's.
    pub spirv: Vec<u32>,
}

/// Splices `shader` into `kernel`, the SPIR-V of one of the engine's kernels.
///
/// # Errors
/// [`Error::Shader`] that names the shader and the feature that cannot be spliced.
pub fn splice(kernel: &[u32], shader: &Shader, options: &SpliceOptions) -> Result<Spliced> {
    let spirv = link(kernel, shader, options).map_err(|e| Error::shader(&shader.label, e))?;
    Ok(Spliced { spirv })
}

/// Whether the hooks of `kernel` are those of `like`, by name and by type, so that shaders can be spliced into it.
///
/// # Errors
/// A sentence that names the hook.
pub(crate) fn check_hooks(kernel: &[u32], like: &[u32]) -> Outcome<()> {
    let types = |words: &[u32]| -> Outcome<_> {
        let module = module::parse(words)?;
        Ok(Hooks::new(&module)?.types(&module))
    };
    let (found, wanted) = (types(kernel)?, types(like)?);
    for (hook, ty) in wanted {
        let name = hook.split('(').next().unwrap_or(&hook);
        match found.get(&hook) {
            Some(same) if *same == ty => {}
            Some(_) => return Err(format!("`{name}` has other types than in the engine's text")),
            None => {
                return Err(format!(
                    "`{name}`, as the engine's text declares it, is missing or nothing calls it"
                ));
            }
        }
    }
    Ok(())
}

fn link(kernel: &[u32], shader: &Shader, options: &SpliceOptions) -> Outcome<Vec<u32>> {
    let user = module::parse(&shader.spirv)?;
    let index = Index::new(&user);
    let usage = Usage::new(&index, shader.stage)?;
    let kernel = module::parse(kernel)?;
    let hooks = Hooks::new(&kernel)?;
    let mut linker = Linker::new(kernel);
    let kernel_globals = linker.module.types_global_values.len();

    let mut imported = import::import(&mut linker, &hooks, shader, options, &index, &usage)?;
    let mut functions = std::mem::take(&mut imported.functions);
    let spans = span_variables(&mut linker, &imported.elements);
    let arrays = imported.elements.iter().filter(|(_, e)| e.is_array()).map(|(v, _)| *v).collect();
    specialize::specialize(&mut linker, &mut functions, &arrays)?;
    let prefetched = match options.blocks {
        Blocks::Prefetched => {
            let elements = &imported.elements;
            prefetch::prefetch(&mut linker, &hooks, &mut functions, elements, &spans)?
        }
        Blocks::InPlace => vec![],
    };
    resources::lower(&mut linker, &mut functions, &imported.elements, &spans)?;
    if shader.stage == Stage::Fragment {
        fragment::lower(&mut linker, &hooks, &mut functions, &imported.attachments)?;
        if shader.reflection.discards {
            let helper = hooks.helper(&linker)?;
            kill::lower(&mut linker, &mut functions, helper)?;
        }
    }
    derivatives::lower(&mut linker, &hooks, shader.stage, options.derivatives, &mut functions)?;
    if shader.stage == Stage::Fragment && shader.reflection.has_side_effects {
        let helper = hooks.helper(&linker)?;
        guard::lower(&mut linker, &mut functions, helper);
    }
    nonuniform::mark(&mut linker, &functions, &imported.elements);
    glue::write(&mut linker, &hooks, shader.stage, &imported, &spans, prefetched)?;
    linker.module.functions.append(&mut functions);
    Ok(finish(linker, kernel_globals, &user))
}

/// Private variables that hold where the draw's resources are in the table.
fn span_variables(linker: &mut Linker, elements: &[(Word, Element)]) -> Vec<Span> {
    let uint = linker.uint();
    let mut variable = |name: String| {
        let variable = linker.private(uint);
        linker.name(variable, name);
        variable
    };
    let span = |(n, (_, element)): (usize, &(Word, Element))| Span {
        first: variable(format!("table index {n}")),
        last: element.last.map(|_| variable(format!("last element {n}"))),
    };
    elements.iter().enumerate().map(span).collect()
}

/// Completes the entry point's interface and the header, and writes the words.
fn finish(mut linker: Linker, kernel_globals: usize, user: &rspirv::dr::Module) -> Vec<u32> {
    let bound = linker.bound();
    let module = &mut linker.module;
    let added = module.types_global_values[kernel_globals..].iter();
    let variables = added.filter(|i| i.class.opcode == Op::Variable).filter_map(|i| i.result_id);
    let variables: Vec<Operand> = variables.map(Operand::IdRef).collect();
    if let Some(entry) = module.entry_points.first_mut() {
        entry.operands.extend(variables);
    }
    module.types_global_values = order::sort(std::mem::take(&mut module.types_global_values));
    if let (Some(header), Some(user)) = (&mut module.header, &user.header) {
        header.bound = bound;
        header.version = header.version.max(user.version);
    }
    module.assemble()
}
