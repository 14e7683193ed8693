//! The GLSL of the kernels: the engine's, with files of the user in the place of some.

use crate::{
    error::{Error, Result},
    prebuilt::{self, FILES, KERNELS},
    shader::{Variant, check_text, compile_stage, splice::check_hooks},
};
use std::{cell::RefCell, collections::BTreeSet};

#[allow(dead_code)] // for the build and for the tool
#[path = "../../glsl/source.rs"]
mod source;

/// The file whose structs the host writes and reads.
const SHARED: &str = "abi.glsl";

/// The words of all kernels.
#[derive(Default)]
pub struct Sources {
    /// The kernels whose text the user changed: file, what it is compiled for, words.
    own: Vec<(&'static str, Variant, Vec<u32>)>,
}

impl Sources {
    /// The engine's GLSL with `files` in the place of those with the same names, or beside them.
    ///
    /// # Errors
    /// [`Error::Usage`] if no kernel is made of a file, or if it is the one that is shared with the host. [`Error::Shader`] if a
    /// kernel does not compile.
    pub fn new(files: &[(&str, &str)]) -> Result<Self> {
        let known = |files: &[(&str, &str)], name: &str| {
            files.iter().find(|(file, _)| *file == name).map(|(_, text)| text.to_string())
        };
        for (n, (name, text)) in files.iter().enumerate() {
            if files[..n].iter().any(|(other, _)| other == name) {
                return Err(Error::Usage(format!("the file `{name}` is there twice")));
            }
            check_text(name, text)?;
        }
        let read = |name: &str| known(files, name).or_else(|| known(FILES, name));
        let used = RefCell::new(BTreeSet::new());
        let missing = |name: &str| format!("there is no file `{name}`");
        let new = |name: &str| {
            used.borrow_mut().insert(name.to_string());
            read(name).ok_or_else(|| missing(name))
        };
        let old = |name: &str| known(FILES, name).ok_or_else(|| missing(name));
        let mut changed = Vec::new();
        for (kernel, variant, _) in KERNELS {
            let text = source::expand(&new, kernel).map_err(|e| Error::shader(*kernel, e))?;
            if source::expand(&old, kernel) != Ok(text) {
                changed.push((*kernel, *variant));
            }
        }
        let used = used.into_inner();
        for (name, _) in files {
            if *name == SHARED {
                return Err(Error::Usage(format!(
                    "`{SHARED}` has the structs that the host writes and reads: it cannot be replaced"
                )));
            }
            if !used.contains(*name) {
                let names: Vec<_> =
                    FILES.iter().map(|(name, _)| *name).filter(|name| *name != SHARED).collect();
                return Err(Error::Usage(format!(
                    "no kernel includes the file `{name}`; the files are {}",
                    names.join(", ")
                )));
            }
        }
        let compile = |&(kernel, variant): &(&'static str, Variant)| {
            let text = read(kernel).unwrap_or_default();
            let defines = format!("{}{}", prebuilt::DEFINES, variant.macros());
            let words = compile_stage(kernel, &text, &defines, &read)?;
            let built = KERNELS.iter().find(|(name, of, _)| (*name, *of) == (kernel, variant));
            let built = built.expect("it is changed").2;
            check_hooks(&words, built).map_err(|fault| Error::shader(kernel, fault))?;
            Ok((kernel, variant, words))
        };
        Ok(Self { own: changed.iter().map(compile).collect::<Result<_>>()? })
    }

    /// Whether all kernels are those of the engine, which keep to the bounds of their buffers.
    pub fn are_trusted(&self) -> bool {
        self.own.is_empty()
    }

    /// The words of the kernel that the file `name` is, which has one variant.
    pub fn words(&self, name: &str) -> &[u32] {
        self.variant(name, Variant::PLAIN)
    }

    /// As [`Sources::words`], of one variant.
    pub fn variant(&self, name: &str, variant: Variant) -> &[u32] {
        let is = |kernel: &str, of_kernel: Variant| kernel == name && of_kernel == variant;
        let own = self.own.iter().find(|(kernel, of, _)| is(kernel, *of));
        let built = || KERNELS.iter().find(|(kernel, of, _)| is(kernel, *of));
        let built = || built().map(|(_, _, words)| *words);
        own.map(|(_, _, words)| words.as_slice()).or_else(built).expect("a kernel of the engine")
    }
}
