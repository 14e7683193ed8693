//! Compute against classic: the same pass by both, on one device, in one process.
//!
//! | file | concept |
//! |---|---|
//! | `recipe` | what a generated scene is made of, and the axes along which that varies |
//! | `scenes` | the named scenes |
//! | `geometry`, `build` | from a recipe to a pass |
//! | `run` | pictures compared, then frames in turns, then stages |
//! | `alone` | one executor in a process of its own: its first frame and its memory |
//! | `statistics` | medians, their intervals, the verdict |
//! | `counts`, `clock`, `environment` | what a pass consists of; what the system tells; where figures come from |
//! | `limits` | how fast the device copies and counts, and what a stage must do at least |
//! | `rows` | results as JSON, from which `table` makes text, `report` a page and `diff` a comparison |
//!
//! A figure is believed if it can be checked, so: pictures are compared before anything is timed, and a
//! row whose pictures differ has no verdict; losing rows stand among the winning ones; each median has an
//! interval, and a ratio that could be either way says so; one configuration draws all scenes; and the
//! environment is part of the result.

mod alone;
mod build;
mod clock;
mod counts;
mod diff;
mod environment;
mod geometry;
mod limits;
mod recipe;
mod report;
mod rows;
mod run;
mod scenes;
pub mod statistics;
mod table;

pub use alone::{Alone, in_empty_caches};
pub use build::pass;
pub use clock::{peak_bytes, process_cpu_ms};
pub use counts::Counts;
pub use diff::{check, diff, diff_table};
pub use environment::environment;
pub use limits::Rates;
pub use recipe::{Axis, Layers, MOST_TRIANGLES, Order, Recipe, Shape};
pub use report::report;
pub use rows::{Label, SCHEMA_VERSION, add_alone, any_invalid, document, row};
pub use run::{Executors, Measurement, Side, StageTime, measure};
pub use scenes::{CROSSOVER, Named, SHEET, find, named};
pub use table::{csv, table};
