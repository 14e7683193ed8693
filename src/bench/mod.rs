//! Compute against classic: the same pass by both, on one device, in one process.
//!
//! | file | concept |
//! |---|---|
//! | `recipe` | what a generated scene is made of, and the axes along which that varies |
//! | `scenes` | the named scenes |
//! | `geometry`, `build` | from a recipe to a pass |
//! | `run` | pictures compared, then frames in turns |
//! | `changing` | frames in which everything changes |
//! | `stages` | compute's frame taken apart |
//! | `watch` | whether the machine was quiet meanwhile |
//! | `alone` | one executor in a process of its own: its first frame and its memory |
//! | `statistics` | medians, their intervals, the verdict |
//! | `counts`, `clock`, `environment` | what a pass consists of; what the system tells; where figures come from |
//! | `limits` | how fast the device copies and counts, and what a stage must do at least |
//! | `rows` | results as JSON, written row by row, from which `table` makes text, `report` a page and `diff` a comparison |
//!
//! A figure is believed if it can be checked, so: pictures are compared before anything is timed, and a
//! row whose pictures differ has no verdict; losing rows stand among the winning ones; each median has an
//! interval, and a ratio that could be either way says so; one configuration draws all scenes; and the
//! environment is part of the result.

mod alone;
mod build;
mod changing;
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
mod stages;
pub mod statistics;
mod table;
mod watch;

pub use alone::{Alone, in_empty_caches};
pub use build::pass;
pub use clock::{peak_bytes, process_cpu_ms};
pub use counts::Counts;
pub use diff::{diff, diff_table};
pub use environment::environment;
pub use limits::Rates;
pub use recipe::{Axis, Layers, MOST_TRIANGLES, Order, Recipe, Shape};
pub use report::report;
pub use rows::{
    Label, SCHEMA_VERSION, add_alone, any_invalid, closing, line, opening, read, row, settings,
};
pub use run::{Executors, MAX_ROUNDS, Measurement, Rounds, Settings, Side, measure};
pub use scenes::{CROSSOVER, Named, SHEET, find, named};
pub use stages::{StageTime, Stages};
pub use table::{Columns, csv_header, csv_line, footer, table};
pub use watch::{Quiet, Watch, busy_already};
