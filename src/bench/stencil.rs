//! The stencil tests that a scene can be drawn with.

use crate::{
    state::Compare,
    stencil::{StencilFace, StencilOp, StencilState},
};

/// What all draws of a scene do with stencil values. The picture is the same with each of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stencil {
    /// There is no stencil target.
    None,
    /// The test compares, and passes everywhere.
    Test,
    /// What is seen writes the number of its draw: the order of opaque work does not matter.
    Write,
    /// What passes the depth test adds one: the order matters.
    Order,
}

impl Stencil {
    /// All of them, as they are typed.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::None, "none"),
        (Self::Test, "test"),
        (Self::Write, "write"),
        (Self::Order, "order"),
    ];

    /// The value `text` of [`Axis::Stencil`](super::Axis::Stencil).
    ///
    /// # Errors
    /// A sentence, if it is none.
    pub fn named(text: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(_, name)| *name == text);
        found
            .map(|(stencil, _)| *stencil)
            .ok_or_else(|| format!("`{text}` is no stencil: none, test, write or order is"))
    }

    /// The state of pipelines, for a target that begins with zeros.
    pub(super) fn state(self) -> Option<StencilState> {
        let always = StencilFace::new(Compare::Always);
        let face = match self {
            Self::None => return None,
            Self::Test => StencilFace::new(Compare::GreaterOrEqual),
            Self::Write => always.pass(StencilOp::Replace),
            Self::Order => always.pass(StencilOp::IncrementAndWrap),
        };
        Some(StencilState::new(face))
    }
}
