//! Users' cases: the binary is run, and its exit code, standard output and standard error looked at.

mod bench;
mod cases;
mod devices;
mod outputs;
mod robustness;
mod scenes;
pub mod tool;
mod usage;
