//! Pictures in host memory: what executors return and textures are made of.

use crate::format::Format;

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Extent {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl Extent {
    /// The extent `width` x `height`.
    pub const fn new(width: u32, height: u32) -> Self {
        Self { width, height }
    }

    /// Pixels in all.
    pub const fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }
}

impl std::fmt::Display for Extent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// A picture: rows from top to bottom, pixels from left to right, no padding.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Size in pixels.
    pub extent: Extent,
    /// Layout of one pixel in `bytes`.
    pub format: Format,
    /// `extent.pixels() * format.texel_bytes()` bytes.
    pub bytes: Vec<u8>,
}

impl Image {
    /// An image of zeros.
    pub fn zeroed(extent: Extent, format: Format) -> Self {
        Self { extent, format, bytes: vec![0; extent.pixels() * format.texel_bytes()] }
    }

    /// The bytes of the pixel at `x`, `y`.
    pub fn texel(&self, x: u32, y: u32) -> &[u8] {
        let n = self.format.texel_bytes();
        let at = (y as usize * self.extent.width as usize + x as usize) * n;
        &self.bytes[at..at + n]
    }

    /// All pixels as floats, for [`Format::D32Float`]; native byte order as the device wrote it.
    pub fn depths(&self) -> Vec<f32> {
        assert_eq!(self.format, Format::D32Float, "only a depth image holds depths");
        bytemuck::pod_collect_to_vec(&self.bytes)
    }
}
