//! Formats of targets, textures and vertex attributes.

shared_enum! {
    /// The format of a colour target or of a texture's texels.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    #[non_exhaustive]
    pub enum Format {
        /// Four 8-bit unsigned normalized channels, linear.
        Rgba8Unorm = 0,
        /// Four 8-bit unsigned normalized channels; RGB is sRGB-encoded, alpha is linear.
        Rgba8Srgb = 1,
        /// Four half floats.
        Rgba16Float = 2,
        /// One 32-bit float of depth in 0..=1.
        D32Float = 3,
    }
}

impl Format {
    /// Bytes of one texel.
    pub const fn texel_bytes(self) -> usize {
        match self {
            Format::Rgba8Unorm | Format::Rgba8Srgb | Format::D32Float => 4,
            Format::Rgba16Float => 8,
        }
    }
}

/// The format of one vertex attribute in memory. The shader sees the usual Vulkan conversion:
/// missing components become 0, a missing fourth becomes 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct VertexFormat {
    /// How one component is stored, and how the shader sees it.
    pub component: Component,
    /// Components, 1 to 4.
    pub count: u8,
}

shared_enum! {
    /// Storage of one component of a vertex attribute.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum Component {
        /// 32-bit float.
        F32 = 0,
        /// Unsigned byte, read as an integer.
        U8 = 1,
        /// Signed byte, read as an integer.
        I8 = 2,
        /// Unsigned 16-bit, read as an integer.
        U16 = 3,
        /// Signed 16-bit, read as an integer.
        I16 = 4,
        /// Unsigned 32-bit integer.
        U32 = 5,
        /// Signed 32-bit integer.
        I32 = 6,
        /// Unsigned byte, normalized to 0..=1.
        U8Norm = 7,
        /// Signed byte, normalized to -1..=1.
        I8Norm = 8,
        /// Unsigned 16-bit, normalized to 0..=1.
        U16Norm = 9,
        /// Signed 16-bit, normalized to -1..=1.
        I16Norm = 10,
    }
}

impl Component {
    /// Bytes of one component.
    pub const fn bytes(self) -> usize {
        match self {
            Component::F32 | Component::U32 | Component::I32 => 4,
            Component::U16 | Component::I16 | Component::U16Norm | Component::I16Norm => 2,
            Component::U8 | Component::I8 | Component::U8Norm | Component::I8Norm => 1,
        }
    }

    /// Whether the shader sees a float.
    pub const fn is_float(self) -> bool {
        matches!(
            self,
            Component::F32
                | Component::U8Norm
                | Component::I8Norm
                | Component::U16Norm
                | Component::I16Norm
        )
    }
}

impl VertexFormat {
    /// One float.
    pub const F32X1: Self = Self { component: Component::F32, count: 1 };
    /// Two floats.
    pub const F32X2: Self = Self { component: Component::F32, count: 2 };
    /// Three floats.
    pub const F32X3: Self = Self { component: Component::F32, count: 3 };
    /// Four floats.
    pub const F32X4: Self = Self { component: Component::F32, count: 4 };

    /// Bytes of the whole attribute, without padding.
    pub const fn bytes(self) -> usize {
        self.component.bytes() * self.count as usize
    }
}
