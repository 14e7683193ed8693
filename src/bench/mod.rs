//! Compute against classic: the same pass by both, on one device, in one process.
//!
//! | file | concept |
//! |---|---|
//! | `recipe` | the recipe of a generated scene, and the axes along which recipes vary |
//! | `scenes` | the named scenes |
//! | `geometry`, `build` | from a recipe to a pass |
//! | `stencil`, `lines` | the stencil tests of a scene, and its triangles drawn as lines |
//! | `run` | pictures compared, then frames in turns |
//! | `changing` | frames in which everything changes |
//! | `stages` | compute's frame taken apart |
//! | `watch` | whether the machine was quiet meanwhile |
//! | `alone` | one executor in a process of its own: its first frame and its memory |
//! | `statistics` | medians, their intervals, the verdict |
//! | `counts`, `clock`, `environment` | the parts of a pass; the process's times and memory; where figures come from |
//! | `limits` | how fast the device copies and counts, and the least work of a stage |
//! | `rows` | results as JSON, written row by row, from which `table` makes text, `report` a page and `diff` a comparison |
//!
//! Readers believe a figure that they can check. So pictures are compared before anything is timed, and a row
//! whose pictures differ has no verdict. Losing rows stand among the winning ones. Each median has an
//! interval, and the verdict says so if the interval allows either winner. One configuration draws all
//! scenes. The environment is part of the result.

mod alone;
mod build;
mod changing;
mod clock;
mod counts;
mod diff;
mod environment;
mod geometry;
mod limits;
mod lines;
mod recipe;
mod report;
mod rows;
mod run;
mod scenes;
mod stages;
pub mod statistics;
mod stencil;
mod table;
mod watch;

pub use alone::{Alone, in_empty_caches};
pub use build::pass;
pub use clock::{peak_bytes, process_cpu_ms};
pub use counts::Counts;
pub use diff::{diff, diff_table};
pub use environment::environment;
pub use limits::Rates;
pub use lines::Lines;
pub use recipe::{Axis, Layers, MOST_TRIANGLES, Order, Recipe, Shape};
pub use report::report;
pub use rows::{
    Label, SCHEMA_VERSION, add_alone, any_invalid, closing, line, opening, read, row, settings,
};
pub use run::{Executors, MAX_ROUNDS, Measurement, Rounds, Settings, Side, measure};
pub use scenes::{CROSSOVER, Named, SHEET, find, named};
pub use stages::{StageTime, Stages};
pub use stencil::Stencil;
pub use table::{Columns, csv_header, csv_line, footer, table};
pub use watch::{Quiet, Watch, busy_already};
