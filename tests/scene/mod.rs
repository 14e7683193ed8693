//! Do scenes load right, and does everything else end with a sentence?

mod damaged;
mod files;
mod lenient;
mod loaded;
mod moved;
mod obj;
mod precision;
mod valid;

pub use valid::check;
