//! The areas of a picture over which means are taken: tiles of 8 × 8 pixels, row by row, and the whole.
//!
//! Tiles at the right and lower border may be smaller. Masked pixels belong to no area. The whole is made of the covered pixels, or of all
//! where none is covered.

use super::TILE_PIXELS;

/// The pixels of each area.
pub(super) struct Areas {
    width: usize,
    across: usize,
    /// Pixels that are in no area.
    masked: Vec<bool>,
    /// Pixels that are in the whole.
    in_whole: Vec<bool>,
    whole_pixels: usize,
    /// Pixels of each tile.
    pub(super) tile_pixels: Vec<usize>,
}

impl Areas {
    /// The areas of a picture of `width` and `height` that has as many pixels as `masked` and `covered`.
    pub(super) fn new([width, height]: [usize; 2], masked: &[bool], covered: &[bool]) -> Self {
        let [across, down] = tiles_across_and_down([width, height]);
        let mut in_whole: Vec<bool> = masked.iter().zip(covered).map(|(m, covered)| !m && *covered).collect();
        if !in_whole.contains(&true) {
            in_whole = masked.iter().map(|m| !m).collect();
        }
        let whole_pixels = in_whole.iter().filter(|is_in| **is_in).count();
        let tile_pixels = vec![0; across * down];
        let mut areas = Self { width, across, masked: masked.to_vec(), in_whole, whole_pixels, tile_pixels };
        for pixel in (0..masked.len()).filter(|&pixel| !masked[pixel]) {
            let tile = areas.tile_of(pixel);
            areas.tile_pixels[tile] += 1;
        }
        areas
    }

    /// The means of the tiles and of the whole, of a picture with the value `value(i)` in pixel i; 0 in an area without pixels.
    pub(super) fn means(&self, value: impl Fn(usize) -> [f64; 3]) -> (Vec<[f64; 3]>, [f64; 3]) {
        let (mut tiles, mut whole) = (vec![[0.0; 3]; self.tile_pixels.len()], [0.0; 3]);
        for pixel in self.pixels() {
            let (value, tile) = (value(pixel), self.tile_of(pixel));
            for c in 0..3 {
                tiles[tile][c] += value[c];
                if self.in_whole[pixel] {
                    whole[c] += value[c];
                }
            }
        }
        let mean =
            |sum: [f64; 3], pixels: usize| sum.map(|s| if pixels == 0 { 0.0 } else { s / pixels as f64 });
        let tiles =
            tiles.into_iter().zip(&self.tile_pixels).map(|(sum, &pixels)| mean(sum, pixels)).collect();
        (tiles, mean(whole, self.whole_pixels))
    }

    /// The pixels that are not masked.
    pub(super) fn pixels(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.masked.len()).filter(|&pixel| !self.masked[pixel])
    }

    fn tile_of(&self, pixel: usize) -> usize {
        pixel / self.width / TILE_PIXELS * self.across + pixel % self.width / TILE_PIXELS
    }
}

/// Tiles of a picture of `width` and `height`.
pub(super) fn tiles_across_and_down([width, height]: [usize; 2]) -> [usize; 2] {
    [width.div_ceil(TILE_PIXELS), height.div_ceil(TILE_PIXELS)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_at_the_border_are_smaller_and_the_whole_is_what_is_covered() {
        let mut masked = vec![false; 18];
        masked[8] = true;
        let covered: Vec<bool> = (0..18).map(|i| i < 2).collect();
        let areas = Areas::new([9, 2], &masked, &covered);
        assert_eq!(areas.tile_pixels, [16, 1]);
        let (tiles, whole) = areas.means(|i| [i as f64, 1.0, 0.0]);
        // 0 to 7 and 9 to 16; 17 alone, since 8 is masked; 0 and 1.
        assert_eq!((tiles, whole), (vec![[8.0, 1.0, 0.0], [17.0, 1.0, 0.0]], [0.5, 1.0, 0.0]));
        let (_, whole) = Areas::new([9, 2], &masked, &[false; 18]).means(|i| [i as f64; 3]);
        assert_eq!(whole, [145.0 / 17.0; 3]);
        let (tiles, whole) = Areas::new([9, 2], &[true; 18], &covered).means(|_| [f64::NAN; 3]);
        assert_eq!((tiles, whole), (vec![[0.0; 3]; 2], [0.0; 3]));
    }
}
