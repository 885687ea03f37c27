//! Pictures of one renderer and one scene, each of a seed of its own.

use crate::image::Image;

use super::areas::Areas;

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

    /// Means of the pixels and of the areas, with their variances.
    pub(super) fn statistics(&self, areas: &Areas) -> SetStatistics {
        let mut of_tiles = vec![[Moment::default(); 3]; areas.tile_pixels.len()];
        let mut of_whole = [Moment::default(); 3];
        let mut of_pixels = vec![[Moment::default(); 3]; self.pictures.first().map_or(0, |p| p.pixels.len())];
        for picture in &self.pictures {
            let value = |pixel: usize| picture.pixels[pixel].map(f64::from);
            let (tiles, whole) = areas.means(value);
            of_tiles.iter_mut().zip(tiles).for_each(|(moments, mean)| add(moments, mean));
            add(&mut of_whole, whole);
            areas.pixels().for_each(|pixel| add(&mut of_pixels[pixel], value(pixel)));
        }
        SetStatistics { n: self.len(), of_tiles, of_whole, of_pixels }
    }
}

fn add(moments: &mut [Moment; 3], values: [f64; 3]) {
    moments.iter_mut().zip(values).for_each(|(moment, value)| moment.add(value));
}

/// Mean and variance of a growing list of numbers (Welford 1962).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moment {
    n: f64,
    mean: f64,
    squares: f64,
}

impl Moment {
    /// The moment of `n` numbers of which mean and variance of the mean are known.
    pub(super) fn known(n: usize, mean: f64, variance_of_mean: f64) -> Self {
        let n = n as f64;
        Self { n, mean, squares: variance_of_mean * n * (n - 1.0) }
    }

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

/// What a set of pictures says: means over its `n` seeds with their variances, by channel.
#[derive(Clone, Debug)]
pub(super) struct SetStatistics {
    pub(super) n: usize,
    /// By tile, row by row.
    pub(super) of_tiles: Vec<[Moment; 3]>,
    pub(super) of_whole: [Moment; 3],
    /// Without numbers where a pixel is masked.
    pub(super) of_pixels: Vec<[Moment; 3]>,
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
        let known = Moment::known(4, 1e9 + 10.0, 7.5);
        assert_eq!((known.mean(), known.variance_of_mean()), (1e9 + 10.0, 7.5));
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
        let statistics = set.statistics(&Areas::new([9, 8], &mask, &[true; 72]));
        let of = |m: &Moment| (m.mean(), m.variance_of_mean());
        assert!(statistics.of_tiles.iter().all(|tile| tile.iter().all(|m| of(m) == (2.0, 1.0))));
        assert_eq!(of(&statistics.of_whole[1]), (2.0, 1.0));
        assert_eq!(of(&statistics.of_pixels[7][2]), (2.0, 1.0));
        // The background is no part of the whole's mean, unless there is nothing else.
        let mut set = PictureSet::default();
        (0..2).for_each(|_| set.push(Image::new(2, 1, vec![[1.0; 3], [9.0; 3]])));
        let whole = |covered: [bool; 2]| {
            set.statistics(&Areas::new([2, 1], &[false; 2], &covered)).of_whole[0].mean()
        };
        assert_eq!((whole([true, false]), whole([true; 2]), whole([false; 2])), (1.0, 5.0, 5.0));
    }
}
