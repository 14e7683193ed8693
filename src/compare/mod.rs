//! Whether two executors drew the same picture: pure functions on images, the id pass, and both executors
//! asked for them (`Both`).
//!
//! Colour alone cannot say whether two rasterizers agree: two neighbouring triangles of one material
//! look alike, and one pixel of a shaded surface may differ by a rounding. So a [`Pass`] is
//! executed twice by each executor: as it is, for colour, and as its *id pass* ([`id_pass`]), where
//! every pixel tells which primitive won it.
//!
//! | figure | compared on | over which pixels |
//! |---|---|---|
//! | [`coverage_differing`](Difference::coverage_differing) | id pass, covered or not | all |
//! | [`winner_differing`](Difference::winner_differing) | id pass, which primitive | covered by both |
//! | [`depth_max`](Difference::depth_max) | depth of the id pass | won by the same primitive |
//! | [`colour_over_1`](Difference::colour_over_1), [`colour_max`](Difference::colour_max) | the pass, as sRGB in 8 bits | all |
//!
//! Ids have one sample, whatever the pass has. The coverage of the others is compared where the eye sees it: in the
//! colours that they become. All colour targets are compared, and a pixel differs as much as the worst of them.
//! Stencil values that are stored count as a colour target of integers.
//!
//! Each pixel is thus counted once among the first three, and a figure has one cause: coverage is
//! the rasterizer, the winner is the depth test, depth is the interpolation.
//!
//! How much may differ ([`Limits`]) depends on whether triangles cross the border of the viewport
//! ([`clipping`]): inside it the Vulkan specification leaves coverage no freedom, at the border it
//! leaves the clipped vertices to the implementation.
//!
//! [`Pass`]: crate::pass::Pass

mod both;
pub mod clipping;
mod difference;
mod id_pass;
mod limits;
mod picture;

pub use both::Both;
#[cfg(feature = "cli")]
pub(crate) use difference::color;
pub use difference::{Difference, Drawn, NO_PRIMITIVE, compare, ids};
pub use id_pass::{IdPass, IdRange, id_pass};
pub use limits::Limits;
pub use picture::difference_picture;
