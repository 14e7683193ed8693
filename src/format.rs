//! Formats of targets, textures and vertex attributes.

shared_enum! {
    /// What the bits of a channel mean.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    #[non_exhaustive]
    pub enum Numeric {
        /// An unsigned integer that stands for 0..=1.
        Unorm = 0,
        /// As [`Numeric::Unorm`]; red, green and blue are sRGB-encoded.
        Srgb = 1,
        /// A signed integer that stands for -1..=1.
        Snorm = 2,
        /// A float.
        Float = 3,
        /// An unsigned integer.
        Uint = 4,
        /// A signed integer.
        Sint = 5,
        /// A depth in 0..=1, and in some formats a stencil value beside it.
        Depth = 6,
        /// A stencil value.
        Stencil = 7,
        /// An unsigned integer that shaders see as a float. Only vertices have it.
        Uscaled = 8,
        /// A signed integer that shaders see as a float. Only vertices have it.
        Sscaled = 9,
    }
}

shared_enum! {
    /// Where the channels of a texel lie.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    #[non_exhaustive]
    pub enum Packing {
        /// One after the other, 8 bits each.
        Bits8 = 0,
        /// One after the other, 16 bits each.
        Bits16 = 1,
        /// One after the other, 32 bits each.
        Bits32 = 2,
        /// 8 bits each: blue, green, red, alpha.
        Bgra8 = 3,
        /// From the lowest bit of a word: 10 bits of red, of green and of blue, 2 bits of alpha.
        Rgb10a2 = 4,
        /// From the lowest bit of a word: 11 bits of red and of green, 10 bits of blue.
        Rg11b10 = 5,
        /// From the lowest of 16 bits: 5 bits of blue, 6 bits of green, 5 bits of red.
        R5g6b5 = 6,
        /// From the lowest of 16 bits: 5 bits of blue, of green and of red, 1 bit of alpha.
        A1r5g5b5 = 7,
        /// As [`Packing::Rgb10a2`] with blue first. Only vertices have it.
        Bgr10a2 = 8,
        /// 24 bits, the lowest of a word. Only depths have it.
        Low24 = 11,
    }
}

// Kernels find the bytes of a channel by the order of the packings that share no word.
const _: () = {
    let [bytes, halves, words] = [Packing::Bits8, Packing::Bits16, Packing::Bits32];
    assert!(bytes as u32 == 0 && halves as u32 == 1 && words as u32 == 2);
};

impl Packing {
    /// Bytes of so many channels.
    const fn bytes(self, channels: usize) -> usize {
        match self {
            Packing::Bits8 => channels,
            Packing::Bits16 => 2 * channels,
            Packing::Bits32 => 4 * channels,
            Packing::R5g6b5 | Packing::A1r5g5b5 => 2,
            Packing::Bgra8 | Packing::Rgb10a2 | Packing::Bgr10a2 => 4,
            Packing::Rg11b10 | Packing::Low24 => 4,
        }
    }
}

/// Declares the formats: the number of each says everything that kernels need to know of it, and fits a byte.
macro_rules! formats {
    ($(#[$meta:meta])* pub enum Format {
        $($(#[$of_format:meta])* $name:ident = $numeric:ident $packing:ident $channels:literal,)*
    }) => {
        shared_enum! {
            $(#[$meta])*
            pub enum Format {
                $($(#[$of_format])* $name = number(Numeric::$numeric, Packing::$packing, $channels),)*
            }
        }

        impl Format {
            /// What its number says.
            const fn parts(self) -> (Numeric, Packing, u32) {
                match self {
                    $(Format::$name => (Numeric::$numeric, Packing::$packing, $channels),)*
                }
            }
        }
    };
}

/// The number of a format, which `glsl/lib/color.glsl` takes apart.
const fn number(numeric: Numeric, packing: Packing, channels: u32) -> u32 {
    assert!((numeric as u32) < 8, "three bits");
    // Depth formats keep the lowest three bits of their packing, which tell them apart.
    assert!((packing as u32) < 8 || matches!(numeric, Numeric::Depth), "three bits");
    numeric as u32 | (packing as u32 & 7) << 3 | (channels - 1) << 6
}

formats! {
    /// The format of a colour target, of a depth target or of a texture's texels: what the bits of a channel mean, where the
    /// channels lie, and how many there are. Words of several bytes are in the byte order of the machine.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    #[non_exhaustive]
    pub enum Format {
        /// One 8-bit unsigned normalized channel.
        R8Unorm = Unorm Bits8 1,
        /// One 8-bit signed normalized channel.
        R8Snorm = Snorm Bits8 1,
        /// One 8-bit unsigned integer channel.
        R8Uint = Uint Bits8 1,
        /// One 8-bit signed integer channel.
        R8Sint = Sint Bits8 1,
        /// Two 8-bit unsigned normalized channels.
        Rg8Unorm = Unorm Bits8 2,
        /// Two 8-bit signed normalized channels.
        Rg8Snorm = Snorm Bits8 2,
        /// Two 8-bit unsigned integer channels.
        Rg8Uint = Uint Bits8 2,
        /// Two 8-bit signed integer channels.
        Rg8Sint = Sint Bits8 2,
        /// Four 8-bit unsigned normalized channels.
        Rgba8Unorm = Unorm Bits8 4,
        /// Four 8-bit unsigned normalized channels; RGB is sRGB-encoded, alpha is linear.
        Rgba8Srgb = Srgb Bits8 4,
        /// Four 8-bit signed normalized channels.
        Rgba8Snorm = Snorm Bits8 4,
        /// Four 8-bit unsigned integer channels.
        Rgba8Uint = Uint Bits8 4,
        /// Four 8-bit signed integer channels.
        Rgba8Sint = Sint Bits8 4,
        /// One 16-bit unsigned normalized channel.
        R16Unorm = Unorm Bits16 1,
        /// One 16-bit signed normalized channel.
        R16Snorm = Snorm Bits16 1,
        /// One 16-bit unsigned integer channel.
        R16Uint = Uint Bits16 1,
        /// One 16-bit signed integer channel.
        R16Sint = Sint Bits16 1,
        /// One half float.
        R16Float = Float Bits16 1,
        /// Two 16-bit unsigned normalized channels.
        Rg16Unorm = Unorm Bits16 2,
        /// Two 16-bit signed normalized channels.
        Rg16Snorm = Snorm Bits16 2,
        /// Two 16-bit unsigned integer channels.
        Rg16Uint = Uint Bits16 2,
        /// Two 16-bit signed integer channels.
        Rg16Sint = Sint Bits16 2,
        /// Two half floats.
        Rg16Float = Float Bits16 2,
        /// Four 16-bit unsigned normalized channels.
        Rgba16Unorm = Unorm Bits16 4,
        /// Four 16-bit signed normalized channels.
        Rgba16Snorm = Snorm Bits16 4,
        /// Four 16-bit unsigned integer channels.
        Rgba16Uint = Uint Bits16 4,
        /// Four 16-bit signed integer channels.
        Rgba16Sint = Sint Bits16 4,
        /// Four half floats.
        Rgba16Float = Float Bits16 4,
        /// One 32-bit unsigned integer channel.
        R32Uint = Uint Bits32 1,
        /// One 32-bit signed integer channel.
        R32Sint = Sint Bits32 1,
        /// One 32-bit float.
        R32Float = Float Bits32 1,
        /// Two 32-bit unsigned integer channels.
        Rg32Uint = Uint Bits32 2,
        /// Two 32-bit signed integer channels.
        Rg32Sint = Sint Bits32 2,
        /// Two 32-bit floats.
        Rg32Float = Float Bits32 2,
        /// Four 32-bit unsigned integer channels.
        Rgba32Uint = Uint Bits32 4,
        /// Four 32-bit signed integer channels.
        Rgba32Sint = Sint Bits32 4,
        /// Four 32-bit floats.
        Rgba32Float = Float Bits32 4,
        /// As [`Format::Rgba8Unorm`] with blue first: what most windows show.
        Bgra8Unorm = Unorm Bgra8 4,
        /// As [`Format::Rgba8Srgb`] with blue first.
        Bgra8Srgb = Srgb Bgra8 4,
        /// Unsigned normalized: 10 bits of red in the lowest bits of a word, of green and of blue, 2 bits of alpha.
        Rgb10a2Unorm = Unorm Rgb10a2 4,
        /// As [`Format::Rgb10a2Unorm`], of unsigned integers.
        Rgb10a2Uint = Uint Rgb10a2 4,
        /// Floats without a sign, 5 bits of exponent each: 11 bits of red in the lowest bits of a word and of green, 10 of blue.
        Rg11b10Ufloat = Float Rg11b10 3,
        /// Unsigned normalized: 5 bits of red in the highest bits of 16, 6 of green, 5 of blue.
        R5g6b5Unorm = Unorm R5g6b5 3,
        /// Unsigned normalized: a bit of alpha in the highest of 16 bits, 5 bits of red, of green and of blue.
        A1r5g5b5Unorm = Unorm A1r5g5b5 4,
        /// One 32-bit float of depth in 0..=1.
        D32Float = Depth Bits32 1,
        /// One 16-bit unsigned normalized depth.
        D16Unorm = Depth Bits16 1,
        /// One 24-bit unsigned normalized depth in the lowest bits of a word. The other bits of a picture are 0.
        X8D24Unorm = Depth Low24 1,
        /// One 8-bit stencil value.
        S8Uint = Stencil Bits8 1,
        /// A depth of [`Format::X8D24Unorm`] and a stencil value of [`Format::S8Uint`]. Images alone have it: a picture has
        /// either the depths or the stencil values.
        D24UnormS8Uint = Depth Low24 2,
        /// As [`Format::D24UnormS8Uint`], with a depth of [`Format::D32Float`].
        D32FloatS8Uint = Depth Bits32 2,
    }
}

impl Format {
    /// What the bits of a channel mean.
    pub const fn numeric(self) -> Numeric {
        self.parts().0
    }

    /// Where the channels of a texel lie.
    pub const fn packing(self) -> Packing {
        self.parts().1
    }

    /// Channels of a texel: red, green, blue, alpha, in this order. Those that are missing are read as 0, a missing alpha as 1.
    pub const fn channels(self) -> usize {
        self.parts().2 as usize
    }

    /// Bytes of one texel. Of a depth and a stencil value, those of the depth: commands copy the two apart.
    pub const fn texel_bytes(self) -> usize {
        match self.is_depth() {
            true => self.packing().bytes(1),
            false => self.packing().bytes(self.channels()),
        }
    }

    /// Bytes of one texel where kernels read and write it.
    pub(crate) const fn row_bytes(self) -> usize {
        if self.texel_bytes() < 4 { 4 } else { self.texel_bytes() }
    }

    /// Whether it holds depths.
    pub const fn is_depth(self) -> bool {
        matches!(self.numeric(), Numeric::Depth)
    }

    /// Whether it holds stencil values.
    pub const fn is_stencil(self) -> bool {
        matches!(self, Format::S8Uint | Format::D24UnormS8Uint | Format::D32FloatS8Uint)
    }

    /// Whether it holds colours.
    pub const fn is_color(self) -> bool {
        !self.is_depth() && !self.is_stencil()
    }

    /// Of a format of depths and stencil values, that of its depths; any other format itself.
    pub const fn without_stencil(self) -> Format {
        match self {
            Format::D24UnormS8Uint => Format::X8D24Unorm,
            Format::D32FloatS8Uint => Format::D32Float,
            other => other,
        }
    }

    /// The format of images that hold depths of this one and stencil values, if there is one.
    pub(crate) const fn with_stencil(self) -> Option<Format> {
        match self {
            Format::X8D24Unorm | Format::D24UnormS8Uint => Some(Format::D24UnormS8Uint),
            Format::D32Float | Format::D32FloatS8Uint => Some(Format::D32FloatS8Uint),
            _ => None,
        }
    }

    /// Bits of a depth that is a number, 0 of one that is a float.
    pub(crate) const fn depth_bits(self) -> u32 {
        match self {
            Format::D16Unorm => 16,
            Format::X8D24Unorm | Format::D24UnormS8Uint => 24,
            _ => 0,
        }
    }

    /// Whether it holds integers that stand for themselves, stencil values included. They are neither filtered nor blended.
    pub const fn is_integer(self) -> bool {
        matches!(self.numeric(), Numeric::Uint | Numeric::Sint | Numeric::Stencil)
    }
}

/// The format of one vertex attribute in memory. The shader sees the usual Vulkan conversion: missing components become 0, a
/// missing fourth becomes 1.
///
/// Every [`Format`] of colours that is not sRGB-encoded is one too: `VertexFormat::from(Format::Rgb10a2Unorm)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct VertexFormat {
    /// What the bits of a component mean.
    pub numeric: Numeric,
    /// Where the components lie.
    pub packing: Packing,
    /// Components, 1 to 4. Packings that share a word have as many as their name says.
    pub count: u8,
}

impl From<Format> for VertexFormat {
    fn from(format: Format) -> Self {
        let (numeric, packing, channels) = format.parts();
        Self::new(numeric, packing, channels as u8)
    }
}

impl VertexFormat {
    /// One float.
    pub const F32X1: Self = Self::new(Numeric::Float, Packing::Bits32, 1);
    /// Two floats.
    pub const F32X2: Self = Self::new(Numeric::Float, Packing::Bits32, 2);
    /// Three floats.
    pub const F32X3: Self = Self::new(Numeric::Float, Packing::Bits32, 3);
    /// Four floats.
    pub const F32X4: Self = Self::new(Numeric::Float, Packing::Bits32, 4);

    /// So many components whose bits mean this and lie there.
    pub const fn new(numeric: Numeric, packing: Packing, count: u8) -> Self {
        Self { numeric, packing, count }
    }

    /// Bytes of the whole attribute, without padding.
    pub const fn bytes(self) -> usize {
        self.packing.bytes(self.count as usize)
    }

    /// Bytes whose multiples its place in memory must be: those of a component, or of the word that components share.
    pub const fn alignment(self) -> usize {
        match self.packing {
            Packing::Bgra8 => 1,
            _ => self.packing.bytes(1),
        }
    }

    /// Whether vertices can have it: what Vulkan has of these packings but the sRGB-encoded ones.
    pub(crate) const fn exists(self) -> bool {
        use Numeric::*;
        let channels = match self.packing {
            Packing::Bits8 | Packing::Bits16 | Packing::Bits32 => 1..=4,
            Packing::Rg11b10 | Packing::R5g6b5 => 3..=3,
            _ => 4..=4,
        };
        let numeric = match self.packing {
            Packing::Bits16 => !matches!(self.numeric, Srgb | Depth | Stencil),
            Packing::Bits32 => matches!(self.numeric, Uint | Sint | Float),
            Packing::Rg11b10 => matches!(self.numeric, Float),
            Packing::R5g6b5 | Packing::A1r5g5b5 => matches!(self.numeric, Unorm),
            Packing::Low24 => false,
            _ => !matches!(self.numeric, Srgb | Depth | Stencil | Float),
        };
        *channels.start() <= self.count && self.count <= *channels.end() && numeric
    }
}
