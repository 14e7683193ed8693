//! Files that are broken, hostile or odd: each is drawn, or ends with a sentence.

use super::tool::{command, finish, scenes};
use std::{
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
};

/// Folders below the scenes with files of this kind.
const FOLDERS: [&str; 2] = ["bad-and-odd-input", "asset-generator/Negative"];

#[test]
fn every_bad_or_odd_file_is_drawn_or_named_with_its_fault() {
    let Some(scenes) = scenes("every bad or odd file is drawn or named with its fault") else {
        return;
    };
    let mut files = Vec::new();
    for folder in FOLDERS {
        collect(&scenes.join(folder), &mut files);
    }
    assert!(files.len() > 100, "{} has only {} files", scenes.display(), files.len());

    let (next, faults) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(file) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Err(fault) = judge(file) {
                        let fault = format!("{}: {fault}", file.display());
                        faults.lock().unwrap().push(fault);
                    }
                }
            });
        }
    });
    let faults = faults.into_inner().unwrap();
    assert!(faults.is_empty(), "{} of {}:\n{}", faults.len(), files.len(), faults.join("\n"));
}

/// The fault in the tool's handling of `file`, if there is one.
fn judge(file: &Path) -> Result<(), String> {
    let line = ["--size", "64x64", "-o", "-"];
    let run = finish(command().arg("render").arg(file).args(line));
    if run.timed_out {
        return Err("it hangs".into());
    }
    if run.has_validation_message() {
        return Err(format!("a validation message: {}", run.stderr));
    }
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    match run.code {
        Some(0) => Ok(()),
        Some(4) => {
            // The last line is the fault; the lines above it are the device and warnings.
            let said = run.stderr.lines().last().unwrap_or_default();
            let reason = said.rsplit(&*name).next().unwrap_or_default();
            let is_sentence = reason.split_whitespace().count() >= 3;
            if said.contains(&*name) && is_sentence {
                Ok(())
            } else {
                Err(format!("the fault is not said: {}", run.stderr))
            }
        }
        code => Err(format!("exit {code:?}: {}", run.stderr)),
    }
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            collect(&path, files);
        } else if matches!(path.extension().and_then(|e| e.to_str()), Some("gltf" | "glb" | "obj"))
        {
            files.push(path);
        }
    }
}
