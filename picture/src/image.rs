//! A picture in memory: three linear or encoded channels per pixel, rows from the top.

/// Width × height pixels of three channels; pixel (x, y) is `pixels[y · width + x]`, row 0 is the top.
///
/// The type does not say whether the values are scene-linear or sRGB-encoded; functions that take or return it do.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `width · height` pixels.
    pub pixels: Vec<[f32; 3]>,
}

impl Image {
    /// A picture of these pixels.
    ///
    /// # Panics
    /// When the number of pixels is not `width · height`.
    pub fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>) -> Self {
        assert_eq!(width.checked_mul(height), Some(pixels.len()), "{width}×{height} pixels");
        Self { width, height, pixels }
    }

    /// The picture whose pixels are `f` of this one's.
    #[must_use]
    pub fn map(&self, f: impl FnMut([f32; 3]) -> [f32; 3]) -> Self {
        Self { width: self.width, height: self.height, pixels: self.pixels.iter().copied().map(f).collect() }
    }
}
