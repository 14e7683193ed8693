//! The stencil test: the state of a pipeline, in Vulkan's terms.

use super::state::{Compare, Cull};

shared_enum! {
    /// What becomes of the stencil value that a target holds.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub enum StencilOp {
        /// It stays.
        #[default]
        Keep = 0,
        /// 0
        Zero = 1,
        /// The draw's reference value ([`crate::Draw::stencil_reference`]), or the one that the shader writes to
        /// `gl_FragStencilRefARB`.
        Replace = 2,
        /// One more, at most 255.
        IncrementAndClamp = 3,
        /// One less, at least 0.
        DecrementAndClamp = 4,
        /// All bits inverted.
        Invert = 5,
        /// One more; 0 comes after 255.
        IncrementAndWrap = 6,
        /// One less; 255 comes after 0.
        DecrementAndWrap = 7,
    }
}

/// The stencil test of one face, as `VkStencilOpState`.
///
/// A fragment passes if `reference & compare_mask`, on the left, compares so with `held & compare_mask`: with
/// [`Compare::Less`], if the reference is less than what the target holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct StencilFace {
    /// The comparison.
    pub compare: Compare,
    /// The bits that are compared.
    pub compare_mask: u8,
    /// The bits that operations change.
    pub write_mask: u8,
    /// Where the stencil test fails.
    pub fail: StencilOp,
    /// Where the stencil test passes and the depth test fails.
    pub depth_fail: StencilOp,
    /// Where both pass, or where there is no depth test.
    pub pass: StencilOp,
}

impl StencilFace {
    /// Every fragment passes and changes nothing.
    pub const KEEP: Self = Self::new(Compare::Always);

    /// Compares all bits, and changes nothing.
    pub const fn new(compare: Compare) -> Self {
        let (keep, all) = (StencilOp::Keep, u8::MAX);
        Self {
            compare,
            compare_mask: all,
            write_mask: all,
            fail: keep,
            depth_fail: keep,
            pass: keep,
        }
    }

    setters! {
        compare: Compare,
        compare_mask: u8,
        write_mask: u8,
        fail: StencilOp,
        depth_fail: StencilOp,
        pass: StencilOp,
    }

    /// Whether some fragments that fail change the target.
    pub(crate) const fn writes_on_failure(&self) -> bool {
        let keep = StencilOp::Keep as u32;
        self.write_mask != 0 && (self.fail as u32 != keep || self.depth_fail as u32 != keep)
    }
}

/// The stencil test of a pipeline. Points and lines are front faces.
///
/// The `compute` executor draws opaque work ([`crate::compute`]) fast also with a stencil test, if the order does not matter:
///
/// * a test that only compares;
/// * a test that writes zero or the reference where both tests pass, and nothing where one fails. All faces that are drawn write
///   the same bits, and the comparison reads none of these bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct StencilState {
    /// Of front faces.
    pub front: StencilFace,
    /// Of back faces.
    pub back: StencilFace,
}

impl StencilState {
    /// The same for both faces.
    pub const fn new(face: StencilFace) -> Self {
        Self { front: face, back: face }
    }

    setters! {
        front: StencilFace,
        back: StencilFace,
    }

    /// The faces that are drawn.
    pub(crate) fn drawn(&self, cull: Cull) -> impl Iterator<Item = StencilFace> + Clone {
        let front = (cull != Cull::Front).then_some(self.front);
        let back = (cull != Cull::Back).then_some(self.back);
        front.into_iter().chain(back)
    }

    /// Whether the order of opaque work does not matter with this test, and then the bits that it writes in all faces that are
    /// drawn: 0 if it only compares. If it writes, a value that it writes depends on no other one, and no value that it writes
    /// decides what passes. So the triangle that a sample shows is the one whose value stays.
    pub(crate) fn unordered(&self, cull: Cull) -> Option<u8> {
        let mut faces = self.drawn(cull);
        let writes = |face: &StencilFace| match face.pass {
            StencilOp::Keep => 0,
            _ => face.write_mask,
        };
        let written = faces.clone().next().map_or(0, |face| writes(&face));
        let all = faces.all(|face| {
            let is_value =
                matches!(face.pass, StencilOp::Keep | StencilOp::Zero | StencilOp::Replace);
            let is_stable = face.compare == Compare::Always || face.compare_mask & written == 0;
            let is_pure = face.write_mask == 0 || is_value;
            !face.writes_on_failure() && is_pure && is_stable && writes(&face) == written
        });
        all.then_some(written)
    }
}

impl Default for StencilState {
    fn default() -> Self {
        Self::new(StencilFace::KEEP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_matters_where_values_depend_on_each_other() {
        let face = StencilFace::new(Compare::Always);
        let of = |face| StencilState::new(face).unordered(Cull::None);
        assert_eq!(of(face), Some(0));
        assert_eq!(of(StencilFace::new(Compare::Equal)), Some(0));
        assert_eq!(of(face.pass(StencilOp::Replace)), Some(255));
        assert_eq!(of(face.pass(StencilOp::Zero).write_mask(6)), Some(6));
        assert_eq!(of(face.pass(StencilOp::Invert)), None);
        assert_eq!(of(face.pass(StencilOp::Invert).write_mask(0)), Some(0));
        assert_eq!(of(face.fail(StencilOp::Zero)), None);
        assert_eq!(of(face.depth_fail(StencilOp::IncrementAndWrap)), None);
        // What is compared is what is written, or it is not.
        let equal = face.compare(Compare::Equal).pass(StencilOp::Replace);
        assert_eq!(of(equal), None);
        assert_eq!(of(equal.compare_mask(0xf0).write_mask(0x0f)), Some(0x0f));
        // One face writes and the other does not.
        let faces = StencilState::default().front(face.pass(StencilOp::Replace));
        assert_eq!(faces.unordered(Cull::None), None);
        assert_eq!(faces.unordered(Cull::Back), Some(255));
        assert_eq!(faces.unordered(Cull::Front), Some(0));
    }
}
