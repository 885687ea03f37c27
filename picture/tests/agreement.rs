//! Verdicts on sets of synthetic pictures, whose true difference is known.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use pumice_picture::Image;
use pumice_picture::agreement::{Agreement, LEVEL, PictureSet, Verdict, judge, level_of_look};
use rayon::prelude::*;

const SIZE: [usize; 2] = [40, 28];

/// Numbers in [0, 1): a multiplicative congruential generator (Lehmer 1951) with the constants of L'Ecuyer 1999 for 2⁶⁴.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_181_783_497_276_652_981);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// The true picture: a dark and a bright half, without blue.
fn truth(x: usize) -> [f64; 3] {
    if x < SIZE[0] / 2 { [0.05, 0.1, 0.0] } else { [0.8, 0.6, 0.0] }
}

/// Pictures with a noise as path tracers have it: most samples are dim, one in fifty is bright, here by a twentieth of what it would be, so
/// that 128 pictures suffice for a verdict. `change` alters the true values.
fn set(
    seed: u64,
    pictures: usize,
    spp: usize,
    change: impl Fn(usize, usize, [f64; 3]) -> [f64; 3],
) -> PictureSet {
    let mut random = Random(2 * seed + 1);
    for _ in 0..100 {
        random.next();
    }
    let mut set = PictureSet::default();
    for _ in 0..pictures {
        let mut pixels = Vec::new();
        for i in 0..SIZE[0] * SIZE[1] {
            let (x, y) = (i % SIZE[0], i / SIZE[0]);
            let value = change(x, y, truth(x));
            let bright = |random: &mut Random| if random.next() < 0.02 { 25.0 } else { 25.0 / 49.0 };
            let sum: f64 = (0..spp).map(|_| bright(&mut random)).sum();
            // The mean of `bright` is 0.5 + 0.5.
            pixels.push(value.map(|v| (v * (1.0 + 0.05 * (sum / spp as f64 - 1.0))) as f32));
        }
        set.push(Image::new(SIZE[0], SIZE[1], pixels));
    }
    set
}

fn same(_: usize, _: usize, value: [f64; 3]) -> [f64; 3] {
    value
}

fn judged(ours: &PictureSet, theirs: &PictureSet) -> Agreement {
    judge(ours, theirs, &vec![true; SIZE[0] * SIZE[1]], LEVEL)
}

#[test]
fn equal_pictures_agree_once_there_are_enough_and_are_not_judged_before() {
    let few = judged(&set(1, 4, 2, same), &set(2, 4, 2, same));
    assert_eq!(few.verdict, Verdict::CannotTell, "{:?}", few.standing);
    let many = judged(&set(3, 128, 16, same), &set(4, 128, 16, same));
    assert_eq!(many.verdict, Verdict::Agrees, "{:?}", many.standing);
    // 5 × 4 tiles of three channels, of which blue is black everywhere and cannot tell anything of noise.
    assert_eq!((many.standing, many.equality.tests), ([60, 0, 0], 40));
    assert!(
        many.equality.agrees() && many.sentence().ends_with("; no smaller difference is proven."),
        "{}",
        many.sentence()
    );
    let [low, high] = many.equality.ratio_by_chance.unwrap();
    assert!(low < 1.0 && 1.0 < high && (low..high).contains(&many.equality.ratio), "{:?}", many.equality);
    // A picture alone says nothing of its noise.
    assert_eq!(judged(&set(1, 1, 2, same), &set(2, 1, 2, same)).verdict, Verdict::CannotTell);
}

#[test]
fn a_difference_beyond_the_margin_is_found_where_it_is() {
    let dimmer = |x: usize, y: usize, value: [f64; 3]| {
        if (24..32).contains(&x) && (8..16).contains(&y) { value.map(|v| 0.95 * v) } else { value }
    };
    let found = judged(&set(5, 64, 16, dimmer), &set(6, 64, 16, same));
    assert_eq!((found.verdict, found.standing[2]), (Verdict::Differs, 2), "red and green of one tile");
    let (share, at) = found.proven_in_tile.unwrap();
    assert!((share + 0.05).abs() < 0.006 && at == [24, 8], "{share} {at:?}");
    assert!(found.equality.rejected >= 2 && found.equality.smallest_p < 1e-9);
}

#[test]
fn a_negligible_difference_stays_negligible_and_is_named() {
    let slightly = |_: usize, _: usize, value: [f64; 3]| value.map(|v| 1.0007 * v);
    let found = judged(&set(7, 256, 64, slightly), &set(8, 256, 64, same));
    assert_eq!(found.verdict, Verdict::Agrees, "{:?}", found.standing);
    let share = found.proven_in_mean.unwrap();
    // 0.07 % of red, which is 1.64 times the mean of the channels, give or take the interval of some 0.05 %.
    assert!((0.0003..0.0017).contains(&share), "{share}");
}

/// Neighbouring pixels that are brighter and darker by 0.7 % leave the means of tiles alone. The noise of a pixel's difference is 0.54 % of it
/// (0.05 · √11.76 / √(16 · 64)), so the ratio is about 1 + (0.7 / 0.54)².
#[test]
fn a_difference_that_only_the_ratio_shows_is_named_beside_agrees() {
    let checkered = |x: usize, y: usize, value: [f64; 3]| {
        let factor = if (x + y).is_multiple_of(2) { 1.007 } else { 0.993 };
        value.map(|v| factor * v)
    };
    let found = judged(&set(11, 128, 16, checkered), &set(12, 128, 16, same));
    assert_eq!((found.verdict, found.proven_in_mean, found.proven_in_tile), (Verdict::Agrees, None, None));
    assert!((2.4..3.0).contains(&found.equality.ratio), "{}", found.equality);
    let says =
        "; a smaller difference shows in the test of equality, which errs in 2 of 100 cases: its square is ";
    assert!(found.sentence().contains(says), "{}", found.sentence());
}

/// Few pictures of much noise: no tile is decided, and the test of equality has seen what is off.
#[test]
fn what_the_test_of_equality_shows_is_named_beside_cannot_tell() {
    let brighter = |_: usize, _: usize, value: [f64; 3]| value.map(|v| 1.01 * v);
    let found = judged(&set(13, 4, 16, brighter), &set(14, 4, 16, same));
    assert_eq!(found.verdict, Verdict::CannotTell, "{:?}", found.standing);
    assert!(found.sentence().contains("undecided; a difference "), "{}", found.sentence());
    let equal = judged(&set(15, 4, 16, same), &set(16, 4, 16, same));
    assert_eq!(equal.verdict, Verdict::CannotTell, "{:?}", equal.standing);
    assert!(equal.sentence().ends_with("undecided; no difference is proven."), "{}", equal.sentence());
}

#[test]
fn masked_pixels_are_left_out_and_too_many_forbid_a_verdict() {
    let with_holes = |holes: usize| {
        let mut set = PictureSet::default();
        for picture in self::set(9, 128, 16, same).pictures() {
            let mut picture = picture.clone();
            picture.pixels[..holes].fill([f32::NAN, 1.0, f32::INFINITY]);
            set.push(picture);
        }
        set
    };
    let theirs = set(10, 128, 16, same);
    let pixels = SIZE[0] * SIZE[1];
    let some = judged(&with_holes(pixels / 50), &theirs);
    assert_eq!(some.verdict, Verdict::Agrees, "{:?}", some.standing);
    assert!(some.masked > 0.019 && some.mask.iter().filter(|m| **m).count() == pixels / 50);
    let more = judged(&with_holes(pixels / 50 + 1), &theirs);
    assert_eq!(more.verdict, Verdict::CannotTell);
    // What shows no surface need not be covered.
    let covered: Vec<bool> = (0..pixels).map(|i| i > pixels / 10).collect();
    assert_eq!(judge(&with_holes(pixels / 50 + 1), &theirs, &covered, LEVEL).masked, 0.0);
    assert_eq!(judge(&with_holes(pixels), &theirs, &covered, LEVEL).verdict, Verdict::CannotTell);
}

/// 400 runs of equal pictures. Without a difference an interval misses 0 in at most 1 run of 100: more than 11 of 400 have the
/// probability 0.3 % (binomial). As many tests of equality may reject a tile; *differs* needs a miss by the whole margin.
#[test]
fn false_alarms_are_as_rare_as_promised() {
    let runs = 400;
    let found: Vec<Agreement> = (0..runs)
        .into_par_iter()
        .map(|run| judged(&set(1000 + 2 * run, 12, 4, same), &set(1001 + 2 * run, 12, 4, same)))
        .collect();
    assert!(found.iter().all(|f| f.verdict != Verdict::Differs));
    let count = |is: fn(&Agreement) -> bool| found.iter().filter(|f| is(f)).count();
    let misses = count(|f| f.proven_in_tile.is_some() || f.proven_in_mean.is_some());
    let rejections = count(|f| f.equality.rejected > 0);
    assert!(misses <= 11 && rejections <= 11, "{misses} and {rejections} of {runs}");
}

#[test]
fn looks_share_the_level() {
    let spent: f64 = (0..60).map(level_of_look).sum();
    assert!((spent - LEVEL).abs() < 1e-12 && level_of_look(0) == 0.5 * LEVEL);
}
