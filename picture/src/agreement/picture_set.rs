//! Pictures of one renderer and one scene, each of a seed of its own.

use crate::image::Image;

use super::TILE_PIXELS;

/// Pictures of the same size, independent of each other.
#[derive(Clone, Debug, Default)]
pub struct PictureSet {
    pictures: Vec<Image>,
}

impl PictureSet {
    /// The pictures.
    pub fn pictures(&self) -> &[Image] {
        &self.pictures
    }

    /// Adds a picture.
    ///
    /// # Panics
    /// When its size is not that of the others.
    pub fn push(&mut self, picture: Image) {
        if let Some(first) = self.pictures.first() {
            assert_eq!([first.width, first.height], [picture.width, picture.height]);
        }
        self.pictures.push(picture);
    }

    /// Number of pictures.
    pub fn len(&self) -> usize {
        self.pictures.len()
    }

    /// Whether there are no pictures.
    pub fn is_empty(&self) -> bool {
        self.pictures.is_empty()
    }

    /// Pixels across and down; 0 where there is no picture.
    pub fn size(&self) -> [usize; 2] {
        self.pictures.first().map_or([0; 2], |p| [p.width, p.height])
    }

    /// The mean of the pictures; `None` where there is none.
    pub fn mean(&self) -> Option<Image> {
        let first = self.pictures.first()?;
        let mut sums = vec![[0.0f64; 3]; first.pixels.len()];
        for picture in &self.pictures {
            for (sum, pixel) in sums.iter_mut().zip(&picture.pixels) {
                (0..3).for_each(|c| sum[c] += f64::from(pixel[c]));
            }
        }
        let n = self.len() as f64;
        let pixels = sums.into_iter().map(|sum| sum.map(|s| (s / n) as f32)).collect();
        Some(Image::new(first.width, first.height, pixels))
    }

    /// Marks in `mask` the pixels that are not finite in one of the pictures.
    pub(super) fn mark_not_finite(&self, mask: &mut [bool]) {
        for picture in &self.pictures {
            for (mark, pixel) in mask.iter_mut().zip(&picture.pixels) {
                *mark |= !pixel.iter().all(|v| v.is_finite());
            }
        }
    }

    /// Means and their variances over the pixels that `mask` leaves; of the whole over those of them that are `covered`, if there are any.
    pub(super) fn statistics(&self, mask: &[bool], covered: &[bool]) -> SetStatistics {
        let [width, height] = self.size();
        let [across, down] = [width.div_ceil(TILE_PIXELS), height.div_ceil(TILE_PIXELS)];
        let tiles = across * down;
        let mut left = vec![0usize; tiles];
        for (i, _) in mask.iter().enumerate().filter(|(_, m)| !**m) {
            left[i / width / TILE_PIXELS * across + i % width / TILE_PIXELS] += 1;
        }
        let shown: Vec<bool> =
            mask.iter().zip(covered).map(|(masked, covered)| !masked && *covered).collect();
        let shown_pixels = shown.iter().filter(|s| **s).count();
        let is_of_whole = |i: usize| shown_pixels == 0 || shown[i];
        let whole_pixels = if shown_pixels == 0 { left.iter().sum() } else { shown_pixels };
        // The tiles' means and the whole's, by picture.
        let mut of_tiles = vec![Moments::default(); tiles];
        let mut of_whole = Moments::default();
        let mut squares = vec![[Moment::default(); 3]; mask.len()];
        for picture in &self.pictures {
            let (mut sums, mut whole) = (vec![[0.0; 3]; tiles], [0.0; 3]);
            for (i, pixel) in picture.pixels.iter().enumerate().filter(|(i, _)| !mask[*i]) {
                let tile = i / width / TILE_PIXELS * across + i % width / TILE_PIXELS;
                for c in 0..3 {
                    let value = f64::from(pixel[c]);
                    sums[tile][c] += value;
                    squares[i][c].add(value);
                    if is_of_whole(i) {
                        whole[c] += value;
                    }
                }
            }
            for ((moments, sum), &pixels) in of_tiles.iter_mut().zip(&sums).zip(&left) {
                moments.add(sum.map(|s| if pixels == 0 { 0.0 } else { s / pixels as f64 }));
            }
            of_whole.add(whole.map(|s| if whole_pixels == 0 { 0.0 } else { s / whole_pixels as f64 }));
        }
        SetStatistics { n: self.len(), of_tiles, of_whole, of_pixels: squares, left }
    }
}

/// Mean and variance of a growing list of numbers (Welford 1962).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moment {
    n: f64,
    mean: f64,
    squares: f64,
}

impl Moment {
    pub(super) fn add(&mut self, value: f64) {
        self.n += 1.0;
        let before = value - self.mean;
        self.mean += before / self.n;
        self.squares += before * (value - self.mean);
    }

    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// Variance of the mean; infinite where fewer than two numbers are known.
    pub(super) fn variance_of_mean(&self) -> f64 {
        if self.n < 2.0 { f64::INFINITY } else { self.squares / (self.n - 1.0) / self.n }
    }
}

/// A moment by channel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments(pub(super) [Moment; 3]);

impl Moments {
    fn add(&mut self, values: [f64; 3]) {
        self.0.iter_mut().zip(values).for_each(|(moment, value)| moment.add(value));
    }
}

/// What a set of pictures says.
pub(super) struct SetStatistics {
    pub(super) n: usize,
    /// By tile, row by row.
    pub(super) of_tiles: Vec<Moments>,
    pub(super) of_whole: Moments,
    pub(super) of_pixels: Vec<[Moment; 3]>,
    /// Pixels of each tile that are not masked.
    pub(super) left: Vec<usize>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_list() {
        let list = [1e9 + 4.0, 1e9 + 7.0, 1e9 + 13.0, 1e9 + 16.0];
        let mut moment = Moment::default();
        assert!(moment.variance_of_mean().is_infinite());
        list.into_iter().for_each(|v| moment.add(v));
        // The sample variance of 4, 7, 13, 16 is 30.
        assert_eq!((moment.mean(), moment.variance_of_mean()), (1e9 + 10.0, 7.5));
    }

    #[test]
    fn a_mask_takes_pixels_out_of_their_tile_and_of_the_whole() {
        let mut set = PictureSet::default();
        for value in [1.0, 3.0] {
            let mut pixels = vec![[value; 3]; 9 * 8];
            pixels[8] = [100.0, f32::NAN, 0.0];
            set.push(Image::new(9, 8, pixels));
        }
        let mut mask = vec![false; 72];
        set.mark_not_finite(&mut mask);
        assert_eq!(mask.iter().filter(|m| **m).count(), 1);
        let statistics = set.statistics(&mask, &[true; 72]);
        assert_eq!(statistics.left, [64, 7]);
        let of = |m: &Moment| (m.mean(), m.variance_of_mean());
        assert!(statistics.of_tiles.iter().all(|tile| tile.0.iter().all(|m| of(m) == (2.0, 1.0))));
        assert_eq!(of(&statistics.of_whole.0[1]), (2.0, 1.0));
        // The background is no part of the whole's mean, unless there is nothing else.
        let mut set = PictureSet::default();
        (0..2).for_each(|_| set.push(Image::new(2, 1, vec![[1.0; 3], [9.0; 3]])));
        let whole = |covered: [bool; 2]| set.statistics(&[false; 2], &covered).of_whole.0[0].mean();
        assert_eq!((whole([true, false]), whole([true; 2]), whole([false; 2])), (1.0, 5.0, 5.0));
    }
}
