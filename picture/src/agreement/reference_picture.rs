//! A picture that others are compared with again and again: the mean over many seeds, with its noise.
//!
//! ```text
//! mean            height × width × 3    the mean picture
//! variance        height × width × 3    variance of that mean, by pixel
//! tile_variance   rows × columns × 3    variance of the mean of each tile of 8 × 8 pixels: pixels of one seed are correlated, so it does
//!                                       not follow from that of the pixels
//! total_variance  3                     variance of the mean of the whole picture
//! seeds                                 number of pictures
//! ```

use thiserror::Error;

use super::areas::{Areas, tiles_across_and_down};
use super::picture_set::{Moment, PictureSet, SetStatistics};

/// Why a picture cannot be a reference, or cannot be compared with one.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ReferenceError {
    /// Too few pictures.
    #[error("expected {expected} pictures or more, got {got}")]
    TooFew {
        /// Pictures that are needed.
        expected: usize,
        /// Pictures that there are.
        got: usize,
    },
    /// A picture of another size.
    #[error("expected pictures of {} × {} pixels, got {} × {}", expected[0], expected[1], got[0], got[1])]
    Size {
        /// Width and height of the reference.
        expected: [usize; 2],
        /// Width and height of the pictures.
        got: [usize; 2],
    },
    /// A pixel is no number.
    #[error("picture {picture}, pixel ({x}, {y}): expected finite numbers")]
    NotFinite {
        /// Number of the picture, from 0.
        picture: usize,
        /// Pixels from the left.
        x: usize,
        /// Pixels from the top.
        y: usize,
    },
    /// An array of another length.
    #[error("{array}: expected {expected} values of three channels, got {got}")]
    Length {
        /// Name of the array.
        array: &'static str,
        /// Its length for pictures of this size.
        expected: usize,
        /// Its length.
        got: usize,
    },
    /// A value that a mean or a variance cannot be.
    #[error("{array}: expected finite {what}, got {got}")]
    Value {
        /// Name of the array.
        array: &'static str,
        /// What its values are.
        what: &'static str,
        /// The value.
        got: String,
    },
}

impl ReferenceError {
    /// Refuses a set with a pixel that is not finite.
    pub(super) fn if_not_finite(set: &PictureSet) -> Result<(), Self> {
        for (number, picture) in set.pictures().iter().enumerate() {
            if let Some(i) = picture.pixels.iter().position(|pixel| !pixel.iter().all(|v| v.is_finite())) {
                return Err(Self::NotFinite { picture: number, x: i % picture.width, y: i / picture.width });
            }
        }
        Ok(())
    }
}

/// The numbers of a [`ReferencePicture`], by which it is stored. Pixels and tiles are row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceArrays {
    /// Width and height.
    pub size: [usize; 2],
    /// The mean picture.
    pub mean: Vec<[f64; 3]>,
    /// Variance of the mean, by pixel.
    pub variance: Vec<[f64; 3]>,
    /// Variance of the mean, by tile.
    pub tile_variance: Vec<[f64; 3]>,
    /// Variance of the mean of the whole.
    pub total_variance: [f64; 3],
    /// Number of pictures.
    pub seeds: usize,
}

/// The mean picture of many seeds, with its noise.
#[derive(Clone, Debug)]
pub struct ReferencePicture {
    size: [usize; 2],
    statistics: SetStatistics,
}

impl ReferencePicture {
    /// The reference of two pictures or more.
    ///
    /// # Errors
    /// With fewer pictures, or with a pixel that is not finite.
    pub fn of(pictures: &PictureSet) -> Result<Self, ReferenceError> {
        if pictures.len() < 2 {
            return Err(ReferenceError::TooFew { expected: 2, got: pictures.len() });
        }
        ReferenceError::if_not_finite(pictures)?;
        let size = pictures.size();
        Ok(Self { size, statistics: pictures.statistics(&all(size)) })
    }

    /// The reference that these arrays store.
    ///
    /// # Errors
    /// Where an array does not fit the size, a value is no mean or variance, or the seeds are fewer than two.
    pub fn from_arrays(arrays: &ReferenceArrays) -> Result<Self, ReferenceError> {
        let ReferenceArrays { size, mean, variance, tile_variance, total_variance, seeds } = arrays;
        if *seeds < 2 {
            return Err(ReferenceError::TooFew { expected: 2, got: *seeds });
        }
        let pixels = size[0].saturating_mul(size[1]);
        let tiles = tiles_across_and_down(*size).into_iter().fold(1, usize::saturating_mul);
        for (array, values, expected, is_variance) in [
            ("mean", &mean[..], pixels, false),
            ("variance", &variance[..], pixels, true),
            ("tile_variance", &tile_variance[..], tiles, true),
            ("total_variance", std::slice::from_ref(total_variance), 1, true),
        ] {
            if values.len() != expected {
                return Err(ReferenceError::Length { array, expected, got: values.len() });
            }
            let is_wrong = |v: &&f64| !v.is_finite() || is_variance && **v < 0.0;
            if let Some(got) = values.as_flattened().iter().find(is_wrong) {
                let what = if is_variance { "variances of 0 or more" } else { "numbers" };
                return Err(ReferenceError::Value { array, what, got: got.to_string() });
            }
        }

        let known = |mean: &[f64; 3], variance: &[f64; 3]| {
            std::array::from_fn(|c| Moment::known(*seeds, mean[c], variance[c]))
        };
        let pairs = |means: &[[f64; 3]], variances: &[[f64; 3]]| {
            means.iter().zip(variances).map(|(mean, variance)| known(mean, variance)).collect()
        };
        let (tiles, whole) = all(*size).means(|i| mean[i]);
        let statistics = SetStatistics {
            n: *seeds,
            of_tiles: pairs(&tiles, tile_variance),
            of_whole: known(&whole, total_variance),
            of_pixels: pairs(mean, variance),
        };
        Ok(Self { size: *size, statistics })
    }

    /// The arrays to store it by.
    pub fn arrays(&self) -> ReferenceArrays {
        let variances = |of: &[[Moment; 3]]| -> Vec<[f64; 3]> {
            of.iter().map(|moments| moments.map(|m| m.variance_of_mean())).collect()
        };
        let SetStatistics { n, of_tiles, of_whole, of_pixels } = &self.statistics;
        ReferenceArrays {
            size: self.size,
            mean: of_pixels.iter().map(|moments| moments.map(|m| m.mean())).collect(),
            variance: variances(of_pixels),
            tile_variance: variances(of_tiles),
            total_variance: of_whole.map(|m| m.variance_of_mean()),
            seeds: *n,
        }
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    pub(super) fn statistics(&self) -> &SetStatistics {
        &self.statistics
    }
}

/// The areas of a picture without masks.
fn all(size: [usize; 2]) -> Areas {
    let pixels = size[0] * size[1];
    Areas::new(size, &vec![false; pixels], &vec![true; pixels])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    /// Two pictures of 9 × 1 pixels: 1 and 3 everywhere, but 0 and 0 in the last pixel.
    fn two() -> PictureSet {
        let mut set = PictureSet::default();
        for value in [1.0, 3.0] {
            let mut pixels = vec![[value; 3]; 9];
            pixels[8] = [0.0; 3];
            set.push(Image::new(9, 1, pixels));
        }
        set
    }

    #[test]
    fn a_reference_is_mean_and_variance_and_survives_its_arrays() {
        let reference = ReferencePicture::of(&two()).unwrap();
        let arrays = reference.arrays();
        let mut expected = vec![[2.0; 3]; 9];
        expected[8] = [0.0; 3];
        assert_eq!(arrays.mean, expected);
        // The variance of 1 and 3 is 2, that of their mean 1; the whole's means are 8/9 and 24/9.
        assert_eq!((arrays.variance[7], arrays.variance[8]), ([1.0; 3], [0.0; 3]));
        assert_eq!(arrays.tile_variance, [[1.0; 3], [0.0; 3]]);
        assert!(arrays.total_variance.iter().all(|v| (v - 64.0 / 81.0).abs() < 1e-12));
        let again = ReferencePicture::from_arrays(&arrays).unwrap().arrays();
        assert_eq!((again.mean, again.variance, again.seeds), (arrays.mean, arrays.variance, 2));
        assert_eq!(again.tile_variance, arrays.tile_variance);
    }

    #[test]
    fn what_is_no_reference_is_refused_in_one_line() {
        let good = ReferencePicture::of(&two()).unwrap().arrays();
        let refused = |change: &dyn Fn(&mut ReferenceArrays)| {
            let mut arrays = good.clone();
            change(&mut arrays);
            ReferencePicture::from_arrays(&arrays).unwrap_err().to_string()
        };
        assert_eq!(refused(&|a| a.seeds = 1), "expected 2 pictures or more, got 1");
        assert_eq!(
            refused(&|a| a.variance.truncate(8)),
            "variance: expected 9 values of three channels, got 8"
        );
        assert_eq!(refused(&|a| a.size = [9, 9]), "mean: expected 81 values of three channels, got 9");
        assert_eq!(refused(&|a| a.mean[3][1] = f64::NAN), "mean: expected finite numbers, got NaN");
        let negative = refused(&|a| a.total_variance[2] = -1.0);
        assert_eq!(negative, "total_variance: expected finite variances of 0 or more, got -1");
        let mut set = two();
        let mut pixels = vec![[1.0; 3]; 9];
        pixels[4][2] = f32::INFINITY;
        set.push(Image::new(9, 1, pixels));
        let error = ReferencePicture::of(&set).unwrap_err().to_string();
        assert_eq!(error, "picture 2, pixel (4, 0): expected finite numbers");
    }
}
