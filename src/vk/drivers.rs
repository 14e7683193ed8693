//! Driver files (ICD manifests): where the loader looks for them, and why one does not work.

use super::doctor::INSTALL_DRIVER;
use std::{
    ffi::OsString,
    path::{Path, PathBuf},
};

/// One driver file.
#[derive(Clone, Debug)]
pub struct DriverFile {
    /// The JSON file.
    pub path: PathBuf,
    /// The library it names, as written; empty if the file cannot be read.
    pub library: String,
    /// Why this driver cannot be loaded, if so; a sentence without its subject.
    pub fault: Option<String>,
}

/// Variables that name driver files and hide all others; the second is the older name.
const ONLY: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// Every driver file that the loader would read, given the environment.
pub(super) fn examine_all(variable: impl Fn(&str) -> Option<OsString>) -> Vec<DriverFile> {
    driver_files(variable).iter().map(|path| examine(path)).collect()
}

/// Why the loader finds no driver: where it looks, and each file there with its fault. `variable` gives
/// empty variables too.
pub(super) fn why_none(variable: impl Fn(&str) -> Option<OsString>) -> String {
    let only = ONLY.into_iter().find_map(|name| Some((name, variable(name)?)));
    let place = match &only {
        Some((_, value)) if value.is_empty() => String::new(),
        Some((name, value)) => format!(" in {name}={}", value.display()),
        None => String::new(),
    };
    // Entries of the list that the loader passes over.
    let listed = only.iter().flat_map(|(_, value)| std::env::split_paths(value));
    let passed_over = listed.filter_map(|path| match () {
        () if path.as_os_str().is_empty() => None,
        () if path.is_dir() => (json_files(&path).is_empty())
            .then(|| format!("{} is a folder without .json files", path.display())),
        () if path.extension().is_none_or(|e| e != "json") => {
            Some(format!("the name {} does not end in .json", path.display()))
        }
        () => None,
    });
    let faults = examine_all(&variable).into_iter().filter_map(|file| {
        let fault = file.fault?;
        Some(format!("{} {fault}", file.path.display()))
    });
    let faults: Vec<String> = passed_over.chain(faults).collect();
    let colon = if faults.is_empty() { "" } else { ": " };
    format!("no Vulkan driver was found{place}{colon}{}", faults.join(", "))
}

/// What to do when the loader finds no driver at all. `variable` gives empty variables too.
pub(super) fn fix_of_none(variable: impl Fn(&str) -> Option<OsString>) -> String {
    match ONLY.into_iter().find(|name| variable(name).is_some()) {
        Some(name) if variable(name).is_some_and(|value| value.is_empty()) => {
            format!("{name} is empty, which hides all drivers: unset it")
        }
        Some(name) => format!("unset {name}, or name the .json of a driver that is there"),
        None => INSTALL_DRIVER.into(),
    }
}

impl DriverFile {
    /// What to do about the fault.
    pub(super) fn fix(&self, variable: impl Fn(&str) -> Option<OsString>) -> String {
        if self.library.is_empty() {
            return match ONLY.into_iter().find(|name| variable(name).is_some()) {
                Some(name) => format!("correct {name}, or unset it"),
                None => {
                    let path = self.path.display();
                    format!("reinstall the package it belongs to (dpkg -S {path} says which)")
                }
            };
        }
        if self.is_nvidia() {
            return "install the NVIDIA driver's graphics libraries (Debian: nvidia-vulkan-icd, \
                    Ubuntu: libnvidia-gl of the driver's version); start a container with \
                    NVIDIA_DRIVER_CAPABILITIES=graphics,compute,utility"
                .into();
        }
        if self.library.contains("libvulkan_") {
            return INSTALL_DRIVER.into();
        }
        format!("install the package that brings {}, or remove the file", self.library)
    }

    fn is_nvidia(&self) -> bool {
        self.library.to_lowercase().contains("nvidia")
    }
}

/// GPUs that the kernel knows and no driver file serves, each with what to do. `root` is `/`.
pub(super) fn hardware_without_driver(
    root: &Path,
    drivers: &[DriverFile],
) -> Vec<(String, &'static str)> {
    let mut found = Vec::new();
    let works = |d: &DriverFile| d.is_nvidia() && d.fault.is_none();
    if root.join("dev/nvidiactl").exists() && !drivers.iter().any(works) {
        found.push((
            "there is an NVIDIA GPU (/dev/nvidiactl), and no driver file that works for it".into(),
            "Debian: apt install nvidia-vulkan-icd; Ubuntu: apt install libnvidia-gl of the \
             driver's version; in a container: NVIDIA_DRIVER_CAPABILITIES=graphics,compute,utility",
        ));
    }
    for node in std::fs::read_dir(root.join("dev/dri")).into_iter().flatten().flatten() {
        let path = node.path();
        let renders = node.file_name().to_string_lossy().starts_with("renderD");
        let open = || std::fs::OpenOptions::new().read(true).write(true).open(&path);
        let denied = |e: std::io::Error| e.kind() == std::io::ErrorKind::PermissionDenied;
        if renders && open().err().is_some_and(denied) {
            found.push((
                format!("there is a GPU ({}), which this user may not open", path.display()),
                "add the user to the group that owns it: usermod -aG render USER, then log in again",
            ));
        }
    }
    found
}

/// The driver files that the loader reads, by its own rules on Linux.
fn driver_files(list: impl Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    let split = |v: OsString| std::env::split_paths(&v).collect::<Vec<_>>();
    let mut roots = Vec::new();
    let only = ONLY.into_iter().find_map(&list);
    // The others count as unset if they are empty.
    let list = |name: &str| list(name).filter(|value| !value.is_empty());
    if let Some(only) = only {
        roots.extend(split(only));
    } else {
        roots.extend(list("VK_ADD_DRIVER_FILES").map(split).unwrap_or_default());
        let home = list("HOME").map(PathBuf::from).unwrap_or_default();
        let base = |name: &str, otherwise: PathBuf| list(name).map_or(otherwise, PathBuf::from);
        let several =
            |name: &str, otherwise: &str| list(name).map_or_else(|| split(otherwise.into()), split);
        let mut bases = vec![base("XDG_CONFIG_HOME", home.join(".config"))];
        bases.extend(several("XDG_CONFIG_DIRS", "/etc/xdg"));
        bases.push("/etc".into());
        bases.push(base("XDG_DATA_HOME", home.join(".local/share")));
        bases.extend(several("XDG_DATA_DIRS", "/usr/local/share:/usr/share"));
        roots.extend(bases.into_iter().map(|b| b.join("vulkan/icd.d")));
    }
    let mut files = Vec::new();
    for root in roots {
        if root.is_dir() {
            files.extend(json_files(&root));
        } else if root.extension().is_some_and(|e| e == "json") {
            files.push(root);
        }
    }
    files
}

/// The .json files of a folder.
fn json_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<_> = entries.map(|e| e.path()).collect();
    found.retain(|p| p.extension().is_some_and(|e| e == "json"));
    found.sort();
    found
}

/// Reads a driver file and looks for its library.
fn examine(path: &Path) -> DriverFile {
    let fault = |library: &str, fault: String| DriverFile {
        path: path.into(),
        library: library.into(),
        fault: Some(fault),
    };
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(e) => return fault("", format!("cannot be read: {e}")),
    };
    let json: serde_json::Value = match serde_json::from_str(&text) {
        Ok(json) => json,
        Err(e) => return fault("", format!("is no JSON: {e}")),
    };
    let Some(library) = json["ICD"]["library_path"].as_str() else {
        return fault("", "names no library".into());
    };
    // A bare name is searched by the dynamic linker, a path with a slash starts at the file.
    let file = if library.contains('/') {
        path.parent().unwrap_or(Path::new(".")).join(library)
    } else {
        PathBuf::from(library)
    };
    // SAFETY: the loader loads the same library when it makes an instance.
    match unsafe { libloading::Library::new(&file) } {
        Ok(loaded) => {
            // Drivers do not survive being unloaded; see `loader`.
            std::mem::forget(loaded);
            DriverFile { path: path.into(), library: library.into(), fault: None }
        }
        Err(e) => fault(library, format!("names a library that cannot be loaded: {e}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn driver_files_are_looked_for_where_the_loader_does() {
        let folder = tempfile::tempdir().unwrap();
        let icd = folder.path().join("data/vulkan/icd.d");
        fs::create_dir_all(&icd).unwrap();
        for name in ["b.json", "a.json", "c.txt"] {
            fs::write(icd.join(name), "{}").unwrap();
        }
        let data = folder.path().join("data").into_os_string();
        let none = folder.path().join("none").into_os_string();
        let found = driver_files(|name| match name {
            "XDG_DATA_HOME" => Some(data.clone()),
            "HOME" | "XDG_CONFIG_DIRS" | "XDG_DATA_DIRS" => Some(none.clone()),
            _ => None,
        });
        let ours: Vec<_> = found.iter().filter(|p| p.starts_with(&icd)).collect();
        assert_eq!(ours, [&icd.join("a.json"), &icd.join("b.json")]);
        // A list hides all others, and may hold files and folders.
        let list = std::env::join_paths([icd.join("b.json"), icd.clone()]).unwrap();
        let found = driver_files(|name| (name == "VK_DRIVER_FILES").then(|| list.clone()));
        assert_eq!(found, [icd.join("b.json"), icd.join("a.json"), icd.join("b.json")]);
    }

    #[test]
    fn each_fault_of_a_driver_file_has_its_fix() {
        let folder = tempfile::tempdir().unwrap();
        let unset = |_: &str| None;
        for (content, library, fault, fix) in [
            ("", "", "no JSON", "dpkg -S"),
            ("{\"ICD\": {}}", "", "names no library", "dpkg -S"),
            (
                "{\"ICD\": {\"library_path\": \"./libvulkan_x.so\"}}",
                "./libvulkan_x.so",
                "loaded",
                "mesa",
            ),
            (
                "{\"ICD\": {\"library_path\": \"libGLX_nvidia.so.9\"}}",
                "libGLX_nvidia.so.9",
                "loaded",
                "CAPABILITIES",
            ),
            ("{\"ICD\": {\"library_path\": \"/none/x.so\"}}", "/none/x.so", "loaded", "/none/x.so"),
        ] {
            let path = folder.path().join("driver.json");
            fs::write(&path, content).unwrap();
            let file = examine(&path);
            assert_eq!(file.library, library);
            let said = file.fault.clone().unwrap();
            assert!(said.contains(fault), "{said}");
            assert!(file.fix(unset).contains(fix), "{}", file.fix(unset));
        }
        let gone = examine(&folder.path().join("gone.json"));
        assert!(gone.fault.as_ref().unwrap().contains("cannot be read"));
        let set = |name: &str| (name == "VK_ICD_FILENAMES").then(|| OsString::from("x"));
        assert!(gone.fix(set).contains("VK_ICD_FILENAMES"));
        assert!(fix_of_none(set).contains("VK_ICD_FILENAMES"));
        let empty = |name: &str| (name == "VK_ICD_FILENAMES").then(OsString::new);
        assert_eq!(
            fix_of_none(empty),
            "VK_ICD_FILENAMES is empty, which hides all drivers: unset it"
        );
        assert!(examine_all(empty).is_empty());
        assert_eq!(why_none(empty), "no Vulkan driver was found");
        fs::write(folder.path().join("driver.json"), "{ broken").unwrap();
        fs::create_dir(folder.path().join("none")).unwrap();
        for (name, said) in [
            ("driver.json", "driver.json is no JSON"),
            ("gone.json", "gone.json cannot be read"),
            ("none", "none is a folder without .json files"),
            ("libvulkan.so", "libvulkan.so does not end in .json"),
            ("", "driver.json is no JSON"),
        ] {
            let list = folder.path().join(name).into_os_string();
            let why = why_none(|n| (n == "VK_DRIVER_FILES").then(|| list.clone()));
            assert!(why.contains(said) && why.contains("VK_DRIVER_FILES="), "{why}");
        }
        assert_eq!(fix_of_none(unset), INSTALL_DRIVER);
    }

    #[test]
    fn a_gpu_without_a_driver_is_noticed() {
        let root = tempfile::tempdir().unwrap();
        assert!(hardware_without_driver(root.path(), &[]).is_empty());
        fs::create_dir_all(root.path().join("dev/dri")).unwrap();
        fs::write(root.path().join("dev/nvidiactl"), "").unwrap();
        let found = hardware_without_driver(root.path(), &[]);
        assert!(found.len() == 1 && found[0].0.contains("NVIDIA"), "{found:?}");
        let library = "libGLX_nvidia.so.0".to_string();
        let works = DriverFile { path: "x".into(), library, fault: None };
        assert!(hardware_without_driver(root.path(), &[works]).is_empty());
    }
}
