//! Fixed-function state of a pipeline, in Vulkan's terms: plain data, no Vulkan types.

#[allow(unused_imports)] // for the tool, which takes the shared ones
pub use super::topology::ProvokingVertex;
pub use super::topology::{LineMode, PrimitiveKind, Topology};

shared_enum! {
    /// Which faces are not drawn.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub enum Cull {
        /// Both faces are drawn.
        #[default]
        None = 0,
        /// Front faces are not drawn.
        Front = 1,
        /// Back faces are not drawn.
        Back = 2,
    }
}

shared_enum! {
    /// The winding, in framebuffer coordinates (y down), of a front face.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub enum FrontFace {
        /// Counter-clockwise as seen on the screen.
        #[default]
        CounterClockwise = 0,
        /// Clockwise as seen on the screen.
        Clockwise = 1,
    }
}

shared_enum! {
    /// A comparison: `new OP old`.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum Compare {
        /// Never passes.
        Never = 0,
        /// new < old
        Less = 1,
        /// new == old
        Equal = 2,
        /// new <= old
        LessOrEqual = 3,
        /// new > old
        Greater = 4,
        /// new != old
        NotEqual = 5,
        /// new >= old
        GreaterOrEqual = 6,
        /// Always passes.
        Always = 7,
    }
}

// Kernels ask which of the first three hold.
const _: () = {
    let [less, equal, greater] =
        [Compare::Less as u32, Compare::Equal as u32, Compare::Greater as u32];
    assert!(less == 1 && equal == 2 && greater == 4 && Compare::Never as u32 == 0);
    assert!(Compare::LessOrEqual as u32 == less | equal);
    assert!(Compare::NotEqual as u32 == less | greater);
    assert!(Compare::GreaterOrEqual as u32 == equal | greater);
    assert!(Compare::Always as u32 == less | equal | greater);
};

/// The depth test. Without a depth target it is off whatever this says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct DepthState {
    /// Whether fragments are compared with the depth target.
    pub test: bool,
    /// Whether a passing fragment writes its depth; only while `test` is on, as in Vulkan.
    pub write: bool,
    /// The comparison.
    pub compare: Compare,
    /// Whether a fragment is drawn only where the depth that the target holds is within [`crate::Draw::depth_bounds`]. The
    /// depth of the fragment itself does not count.
    pub bounds: bool,
}

impl DepthState {
    /// No test, no write.
    pub const OFF: Self =
        Self { test: false, write: false, compare: Compare::Always, bounds: false };
    /// The usual one: nearer wins, the first of equals stays.
    pub const LESS: Self = Self::new(Compare::Less);

    /// A test that writes.
    pub const fn new(compare: Compare) -> Self {
        Self { test: true, write: true, compare, bounds: false }
    }

    setters! {
        test: bool,
        write: bool,
        compare: Compare,
        bounds: bool,
    }
}

impl Default for DepthState {
    fn default() -> Self {
        Self::LESS
    }
}

shared_enum! {
    /// A factor of the blend equation.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    #[non_exhaustive]
    pub enum BlendFactor {
        /// 0
        Zero = 0,
        /// 1
        One = 1,
        /// Source colour.
        SrcColor = 2,
        /// 1 - source colour.
        OneMinusSrcColor = 3,
        /// Destination colour.
        DstColor = 4,
        /// 1 - destination colour.
        OneMinusDstColor = 5,
        /// Source alpha.
        SrcAlpha = 6,
        /// 1 - source alpha.
        OneMinusSrcAlpha = 7,
        /// Destination alpha.
        DstAlpha = 8,
        /// 1 - destination alpha.
        OneMinusDstAlpha = 9,
        /// The draw's constant colour ([`crate::Draw::blend_constants`]).
        ConstantColor = 10,
        /// 1 - constant colour.
        OneMinusConstantColor = 11,
        /// The draw's constant alpha.
        ConstantAlpha = 12,
        /// 1 - constant alpha.
        OneMinusConstantAlpha = 13,
        /// For colours the lesser of source alpha and 1 - destination alpha; for alpha 1.
        SrcAlphaSaturate = 14,
        /// Colour of the second source: what the fragment shader writes to `layout(location = 0, index = 1)`.
        Src1Color = 16,
        /// 1 - colour of the second source.
        OneMinusSrc1Color = 17,
        /// Alpha of the second source.
        Src1Alpha = 18,
        /// 1 - alpha of the second source.
        OneMinusSrc1Alpha = 19,
    }
}

impl BlendFactor {
    /// Whether it needs the draw's constants.
    pub(crate) fn is_constant(self) -> bool {
        matches!(
            self,
            Self::ConstantColor
                | Self::OneMinusConstantColor
                | Self::ConstantAlpha
                | Self::OneMinusConstantAlpha
        )
    }

    /// Whether it needs a second source.
    pub(crate) fn is_second(self) -> bool {
        matches!(
            self,
            Self::Src1Color | Self::OneMinusSrc1Color | Self::Src1Alpha | Self::OneMinusSrc1Alpha
        )
    }
}

shared_enum! {
    /// How weighted source and destination are combined.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    #[non_exhaustive]
    pub enum BlendOp {
        /// source + destination
        Add = 0,
        /// source - destination
        Subtract = 1,
        /// destination - source
        ReverseSubtract = 2,
        /// Smaller of the two, unweighted.
        Min = 3,
        /// Larger of the two, unweighted.
        Max = 4,
    }
}

// Kernels take an odd factor for 1 minus the even one before it, and find the even ones by their order.
const _: () = {
    use BlendFactor::*;
    assert!((Zero as u32).is_multiple_of(2) && One as u32 == Zero as u32 + 1);
    assert!(SrcColor as u32 == 2 && OneMinusSrcColor as u32 == 3);
    assert!(DstColor as u32 == 4 && OneMinusDstColor as u32 == 5);
    assert!(SrcAlpha as u32 == 6 && OneMinusSrcAlpha as u32 == 7);
    assert!(DstAlpha as u32 == 8 && OneMinusDstAlpha as u32 == 9);
    assert!(ConstantColor as u32 == 10 && OneMinusConstantColor as u32 == 11);
    assert!(ConstantAlpha as u32 == 12 && OneMinusConstantAlpha as u32 == 13);
    assert!(SrcAlphaSaturate as u32 == 14);
    assert!(Src1Color as u32 == 16 && OneMinusSrc1Color as u32 == 17);
    assert!(Src1Alpha as u32 == 18 && OneMinusSrc1Alpha as u32 == 19);
};

shared_enum! {
    /// What a target's bits become, of the bits that a fragment brings (source) and those that are there (destination).
    ///
    /// The number of an operation is its truth table: 1 where both are 0, 2 where the destination alone is 1, 4 where the
    /// source alone is 1, 8 where both are 1.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum LogicOp {
        /// 0
        Clear = 0,
        /// not (source or destination)
        Nor = 1,
        /// not source, and destination
        AndInverted = 2,
        /// not source
        CopyInverted = 3,
        /// source, and not destination
        AndReverse = 4,
        /// not destination
        Invert = 5,
        /// source exclusive or destination
        Xor = 6,
        /// not (source and destination)
        Nand = 7,
        /// source and destination
        And = 8,
        /// not (source exclusive or destination)
        Equivalent = 9,
        /// destination
        NoOp = 10,
        /// not source, or destination
        OrInverted = 11,
        /// source
        Copy = 12,
        /// source, or not destination
        OrReverse = 13,
        /// source or destination
        Or = 14,
        /// 1
        Set = 15,
    }
}

/// One blend equation: `op(src * src_factor, dst * dst_factor)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BlendEquation {
    /// Weight of the source.
    pub src: BlendFactor,
    /// Weight of the destination.
    pub dst: BlendFactor,
    /// The combination.
    pub op: BlendOp,
}

impl BlendEquation {
    /// The equation with these weights and this combination.
    pub const fn new(src: BlendFactor, dst: BlendFactor, op: BlendOp) -> Self {
        Self { src, dst, op }
    }
}

/// Blending of a colour target, in API order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Blend {
    /// Red, green and blue.
    pub color: BlendEquation,
    /// Alpha.
    pub alpha: BlendEquation,
}

impl Blend {
    /// Straight alpha: `src.a * src + (1 - src.a) * dst`; alpha itself accumulates as coverage.
    pub const ALPHA: Self = Self {
        color: BlendEquation {
            src: BlendFactor::SrcAlpha,
            dst: BlendFactor::OneMinusSrcAlpha,
            op: BlendOp::Add,
        },
        alpha: BlendEquation {
            src: BlendFactor::One,
            dst: BlendFactor::OneMinusSrcAlpha,
            op: BlendOp::Add,
        },
    };
    /// `src + dst`, colour and alpha.
    pub const ADD: Self =
        Self::all(BlendEquation::new(BlendFactor::One, BlendFactor::One, BlendOp::Add));

    /// Whether an equation needs the draw's constants.
    pub(crate) fn has_constants(&self) -> bool {
        [self.color, self.alpha].iter().any(|e| e.src.is_constant() || e.dst.is_constant())
    }

    /// Whether an equation needs a second source.
    pub(crate) fn has_second(&self) -> bool {
        [self.color, self.alpha].iter().any(|e| e.src.is_second() || e.dst.is_second())
    }

    /// The same equation for colour and alpha.
    pub const fn all(equation: BlendEquation) -> Self {
        Self { color: equation, alpha: equation }
    }
}

/// What is added to the depth of each triangle, as `vkCmdSetDepthBias`: `constant * r + slope * m`, where `r` is the least
/// step of depth at the triangle's depth, and `m` the larger change of depth from pixel to pixel, across or down.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DepthBias {
    /// The factor of the least step.
    pub constant: f32,
    /// The factor of the change of depth.
    pub slope: f32,
    /// The most that is added if it is above 0, the least if it is below. 0 sets no limit.
    pub clamp: f32,
}

impl DepthBias {
    /// These factors, and no limit.
    pub const fn new(constant: f32, slope: f32) -> Self {
        Self { constant, slope, clamp: 0.0 }
    }

    setters! {
        clamp: f32,
    }
}

/// How fragments change a colour target, as `VkPipelineColorBlendAttachmentState`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct ColorState {
    /// Blending; `None` overwrites.
    pub blend: Option<Blend>,
    /// Which channels are written: red, green, blue, alpha. The others keep what they hold.
    pub write: [bool; 4],
}

impl ColorState {
    /// Fragments overwrite all channels.
    pub const OVERWRITE: Self = Self { blend: None, write: [true; 4] };

    /// Whether a fragment decides by itself what the target holds.
    pub(crate) fn overwrites(&self) -> bool {
        *self == Self::OVERWRITE
    }

    /// Whether fragments change the target.
    pub(crate) fn writes(&self) -> bool {
        self.write.contains(&true)
    }

    setters! {
        write: [bool; 4],
        ;
        into
        blend: Option<Blend>,
    }
}

impl Default for ColorState {
    fn default() -> Self {
        Self::OVERWRITE
    }
}

shared_enum! {
    /// What becomes of the samples of a pixel when its target has one texel for it (Vulkan's `VkResolveModeFlagBits`).
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub enum ResolveMode {
        /// Their average.
        Average = 0,
        /// Sample 0.
        #[default]
        SampleZero = 1,
        /// The least.
        Min = 2,
        /// The greatest.
        Max = 3,
    }
}

/// The viewport transform, in pixels, as `VkViewport`. A negative height flips y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewport {
    /// Left edge.
    pub x: f32,
    /// Top edge.
    pub y: f32,
    /// Width, > 0.
    pub width: f32,
    /// Height; negative flips y.
    pub height: f32,
    /// Depth of clip-space z = 0, in 0..=1.
    pub min_depth: f32,
    /// Depth of clip-space z = w, in 0..=1.
    pub max_depth: f32,
}

impl Viewport {
    /// Its least and its greatest depth.
    pub(crate) fn depths(&self) -> [f32; 2] {
        [self.min_depth.min(self.max_depth), self.min_depth.max(self.max_depth)]
    }
}

/// A rectangle of pixels, as `VkRect2D` with an offset that is never negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// Left edge.
    pub x: u32,
    /// Top edge.
    pub y: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}
