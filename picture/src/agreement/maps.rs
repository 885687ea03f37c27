//! Maps of an agreement: where the pictures differ, and how surely.

use super::{Agreement, TILE_PIXELS};
use crate::image::Image;

/// Colours from −1 over 0 to 1 (sRGB-encoded): blue, white, red, of which the middle is the lightest, so that it reads for colour-blind
/// eyes; after Brewer's *RdBu*.
const DIVERGING: [[f64; 3]; 5] =
    [[0.02, 0.19, 0.38], [0.57, 0.77, 0.87], [0.97, 0.97, 0.97], [0.96, 0.65, 0.51], [0.40, 0.0, 0.12]];

/// The signed difference of the means of the channels, ours less theirs, as a colour (sRGB-encoded): blue where ours is darker, red where it
/// is brighter, full at `range`. Pixels that were left out are black.
pub fn signed_difference_map(ours: &Image, theirs: &Image, mask: &[bool], range: f64) -> Image {
    let value = |p: &[f32; 3]| p.iter().map(|&v| f64::from(v)).sum::<f64>() / 3.0;
    let pixels = ours
        .pixels
        .iter()
        .zip(&theirs.pixels)
        .zip(mask)
        .map(|((a, b), masked)| if *masked { [0.0; 3] } else { diverging((value(a) - value(b)) / range) })
        .collect();
    Image::new(ours.width, ours.height, pixels)
}

/// The difference of each tile as a share of its margin, as a colour (sRGB-encoded), by the channel where it is largest: full at the margin.
pub fn tile_difference_map(agreement: &Agreement, [width, height]: [usize; 2]) -> Image {
    tile_map(agreement, [width, height], |i| if i.margin > 0.0 { i.difference / i.margin } else { 0.0 })
}

/// Welch's t of each tile as a colour (sRGB-encoded), by the channel where it is largest: full at 6, which one of some 10⁸ tiles reaches by
/// chance.
pub fn tile_t_map(agreement: &Agreement, [width, height]: [usize; 2]) -> Image {
    tile_map(agreement, [width, height], |i| i.t / 6.0)
}

fn tile_map(
    agreement: &Agreement,
    [width, height]: [usize; 2],
    value: impl Fn(&super::Interval) -> f64,
) -> Image {
    let colors: Vec<[f32; 3]> = agreement
        .tiles
        .iter()
        .map(|tile| {
            let largest = tile.iter().map(&value).max_by(|a, b| a.abs().total_cmp(&b.abs()));
            diverging(largest.unwrap_or(0.0))
        })
        .collect();
    let [across, _] = agreement.tiles_across_and_down;
    let pixel = |i: usize| colors[i / width / TILE_PIXELS * across + i % width / TILE_PIXELS];
    Image::new(width, height, (0..width * height).map(pixel).collect())
}

fn diverging(value: f64) -> [f32; 3] {
    let at = (value.clamp(-1.0, 1.0) + 1.0) / 2.0 * (DIVERGING.len() - 1) as f64;
    let at = if at.is_nan() { 0.0 } else { at };
    let left = (at as usize).min(DIVERGING.len() - 2);
    std::array::from_fn(|c| {
        let (from, to) = (DIVERGING[left][c], DIVERGING[left + 1][c]);
        (from + (to - from) * (at - left as f64)) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brighter_is_red_darker_blue_and_nothing_is_the_lightest() {
        let lightness = |v: f64| diverging(v).iter().sum::<f32>();
        assert!((1..=20).all(|i| lightness(f64::from(i) / 20.0) < lightness(f64::from(i - 1) / 20.0)));
        assert!((1..=20).all(|i| lightness(f64::from(-i) / 20.0) < lightness(f64::from(1 - i) / 20.0)));
        let [red, blue] = [diverging(0.7), diverging(-0.7)];
        assert!(red[0] > red[2] && blue[2] > blue[0]);
        assert_eq!(diverging(f64::INFINITY), diverging(1.0));
        let grey = |v: f32| Image::new(2, 1, vec![[v; 3]; 2]);
        let map = signed_difference_map(&grey(1.0), &grey(0.5), &[false, true], 0.5);
        assert_eq!(map.pixels, [diverging(1.0), [0.0; 3]]);
    }
}
