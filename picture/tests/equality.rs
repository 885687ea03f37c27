//! Pictures against a stored reference, with values in closed form.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use pumice_picture::Image;
use pumice_picture::agreement::{
    Equality, PictureSet, ReferenceArrays, ReferenceError, ReferencePicture, judge_equality,
};

/// Four pictures of 16 × 8 pixels in two grey values each, one by tile.
fn four(tiles: [[f32; 2]; 4]) -> PictureSet {
    let mut set = PictureSet::default();
    for values in tiles {
        let pixels = (0..128).map(|i| [values[i % 16 / 8]; 3]).collect();
        set.push(Image::new(16, 8, pixels));
    }
    set
}

/// A reference without noise that is `left` and `right` in its two tiles.
fn exact(left: f64, right: f64) -> ReferencePicture {
    let mean: Vec<[f64; 3]> = (0..128).map(|i| [if i % 16 < 8 { left } else { right }; 3]).collect();
    let arrays = ReferenceArrays {
        size: [16, 8],
        variance: vec![[0.0; 3]; 128],
        tile_variance: vec![[0.0; 3]; 2],
        total_variance: [0.0; 3],
        seeds: 100,
        mean,
    };
    ReferencePicture::from_arrays(&arrays).unwrap()
}

fn found(tiles: [[f32; 2]; 4], reference: &ReferencePicture) -> Equality {
    judge_equality(&four(tiles), reference).unwrap()
}

fn close(a: f64, b: f64) -> bool {
    // The noise of rounding that is added to each variance: 2e-6 of a value squared, 1e-11 of what it is added to.
    (a - b).abs() < 1e-9 * b.abs().max(1.0)
}

/// 1, 2, 3, 4 have the mean 5/2, and its variance is 5/3 / 4. With 3 degrees of freedom Student's t is beyond ±t with the probability
/// 1 − 2/π (atan u + u / (1 + u²)), u = t / √3. The halves of the four are off by 2, 1 or 0 from each other's mean, so by chance the ratio is
/// 1, 1/4 or 0 over 5/12.
#[test]
fn statistics_are_those_of_the_closed_forms() {
    let found = found([[1.0; 2], [2.0; 2], [3.0; 2], [4.0; 2]], &exact(1.5, 1.5));
    let t = 1.0 / (5.0f64 / 12.0).sqrt();
    let u = t / 3.0f64.sqrt();
    let p = 1.0 - std::f64::consts::FRAC_2_PI * (u.atan() + u / (1.0 + u * u));
    assert!(close(found.ratio, 2.4) && close(found.smallest_p, p), "{found:?} {p}");
    assert!(close(found.mean_in_standard_errors, t) && close(found.mean_difference, 1.0 / 1.5), "{found:?}");
    let [low, high] = found.ratio_by_chance.unwrap();
    assert!(close(low, 0.0) && close(high, 2.4), "{low} {high}");
    assert_eq!((found.tests, found.rejected), (6, 0));
}

/// The right tile has no noise. Up to rounding it is equal; beyond it is rejected, however small the difference.
#[test]
fn where_nothing_varies_only_rounding_may_differ() {
    let tiles = [[1.0, 0.5], [2.0, 0.5], [3.0, 0.5], [4.0, 0.5]];
    let same = found(tiles, &exact(2.5, 0.5 * (1.0 + 1.9e-5)));
    assert!(same.agrees() && same.tests == 3 && same.ratio == 0.0, "{same}");
    let other = found(tiles, &exact(2.5, 0.5 * (1.0 + 2.1e-5)));
    assert!(!other.agrees() && (other.tests, other.rejected) == (3, 3), "{other}");
    // Nothing varies anywhere.
    let flat = [[0.25, 0.5]; 4];
    assert!(found(flat, &exact(0.25, 0.5)).agrees());
    let off = found(flat, &exact(0.25, 0.6));
    assert!(!off.agrees() && off.ratio > 1.0 && off.mean_in_standard_errors.is_infinite(), "{off}");
}

#[test]
fn what_cannot_be_judged_is_refused() {
    let reference = exact(1.0, 1.0);
    let mut three = PictureSet::default();
    four([[1.0; 2]; 4]).pictures()[..3].iter().for_each(|p| three.push(p.clone()));
    let refused = |set: &PictureSet| judge_equality(set, &reference).unwrap_err();
    assert_eq!(refused(&three), ReferenceError::TooFew { expected: 4, got: 3 });
    assert_eq!(refused(&PictureSet::default()), ReferenceError::TooFew { expected: 4, got: 0 });
    let mut small = PictureSet::default();
    (0..4).for_each(|_| small.push(Image::new(8, 8, vec![[1.0; 3]; 64])));
    assert_eq!(refused(&small).to_string(), "expected pictures of 16 × 8 pixels, got 8 × 8");
    assert_eq!(
        refused(&four([[1.0; 2], [1.0; 2], [1.0, f32::NAN], [1.0; 2]])),
        ReferenceError::NotFinite { picture: 2, x: 8, y: 0 }
    );
}
