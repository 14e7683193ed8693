//! The shapes of images: dimensions and layers.

use super::Extent;

/// The dimensions and the layers of an image. The extent has the texels of one layer or slice; one-dimensional images are
/// one texel high.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Shape {
    /// A row: `sampler1D`.
    D1,
    /// So many rows: `sampler1DArray`.
    D1Array(u32),
    /// An ordinary picture: `sampler2D`.
    #[default]
    D2,
    /// So many pictures: `sampler2DArray`.
    D2Array(u32),
    /// So many slices, half of them in the next mip level: `sampler3D`.
    D3(u32),
    /// Six square pictures, in the order +x, -x, +y, -y, +z, -z: `samplerCube`. Seen from the middle, each has its first row
    /// at the top where the table of cube maps in the Vulkan specification has t = 0.
    Cube,
    /// So many cubes: `samplerCubeArray`.
    CubeArray(u32),
}

/// Faces of a cube.
const FACES: u32 = 6;

impl Shape {
    /// Layers of the image; the six sides of a cube are layers.
    pub const fn layers(self) -> u32 {
        match self {
            Shape::D1 | Shape::D2 | Shape::D3(_) => 1,
            Shape::D1Array(layers) | Shape::D2Array(layers) => layers,
            Shape::Cube => FACES,
            Shape::CubeArray(cubes) => cubes.saturating_mul(FACES),
        }
    }

    /// Slices of mip level `level`, 1 unless it has three dimensions.
    pub const fn slices(self, level: u32) -> u32 {
        match self {
            Shape::D3(slices) => match slices.checked_shr(level) {
                Some(slices) if slices > 0 => slices,
                _ => 1,
            },
            _ => 1,
        }
    }

    /// The pictures of mip level `level`: layers or slices.
    pub const fn pictures(self, level: u32) -> u32 {
        self.layers() * self.slices(level)
    }

    /// The most mip levels that an image of this shape and of `extent` can have.
    pub const fn most_levels(self, extent: Extent) -> u32 {
        let mut longest = if extent.width > extent.height { extent.width } else { extent.height };
        if self.slices(0) > longest {
            longest = self.slices(0);
        }
        match longest.checked_ilog2() {
            Some(halvings) => halvings + 1,
            None => 0,
        }
    }

    /// Why no image of `extent` has this shape, with as many layers or slices as Vulkan promises at least.
    pub(crate) fn check(self, extent: Extent) -> Result<(), String> {
        const LAYERS: u32 = 2048;
        let Extent { width, height } = extent;
        if width == 0 || height == 0 {
            return Err("has a side without texels: each side has at least one".into());
        }
        if self.layers() == 0 || self.slices(0) == 0 || matches!(self, Shape::D3(0)) {
            return Err(format!("is {self:?}: there is one layer or slice at least"));
        }
        if self.layers() > LAYERS || self.slices(0) > LAYERS {
            return Err(format!("is {self:?}: there are at most {LAYERS} layers or slices"));
        }
        match self {
            Shape::D1 | Shape::D1Array(_) if height != 1 => {
                Err(format!("has one dimension and is {height} texels high, not 1"))
            }
            Shape::Cube | Shape::CubeArray(_) if width != height => {
                Err(format!("is a cube with sides of {extent} texels: they are squares"))
            }
            _ => Ok(()),
        }
    }
}

impl Extent {
    /// The size of mip level `level`.
    pub(crate) fn level(self, level: u32) -> Extent {
        let shrink = |n: u32| n.checked_shr(level).unwrap_or(0).max(1);
        Extent::new(shrink(self.width), shrink(self.height))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_have_layers_slices_and_levels() {
        assert_eq!(Shape::CubeArray(3).layers(), 18);
        assert_eq!([0, 1, 2, 3, 40].map(|level| Shape::D3(5).slices(level)), [5, 2, 1, 1, 1]);
        assert_eq!(Shape::D3(9).most_levels(Extent::new(4, 2)), 4);
        assert_eq!(Shape::D2Array(9).most_levels(Extent::new(4, 2)), 3);
        assert_eq!(Extent::new(5, 1).level(1), Extent::new(2, 1));
    }

    #[test]
    fn what_is_no_shape_is_refused() {
        let square = Extent::new(4, 4);
        for shape in [Shape::D2, Shape::D2Array(2048), Shape::D3(7), Shape::Cube] {
            assert_eq!(shape.check(square), Ok(()));
        }
        for (shape, extent, part) in [
            (Shape::D1, square, "4 texels high"),
            (Shape::Cube, Extent::new(4, 5), "squares"),
            (Shape::D2Array(0), square, "one layer"),
            (Shape::D3(0), square, "one layer or slice"),
            (Shape::CubeArray(u32::MAX), square, "at most 2048"),
            (Shape::D2, Extent::new(0, 1), "a side without texels"),
        ] {
            let fault = shape.check(extent).unwrap_err();
            assert!(fault.contains(part), "{fault}");
        }
    }
}
