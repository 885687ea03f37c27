//! Colours that are as far as possible from given ones, where distance is that of [`palette`](crate::palette): the least ΔE over three
//! kinds of eye.
//!
//! ```text
//! color_new_labels   labels that have a colour keep it: those with the most coloured neighbours first, each other label takes the colour
//!                    of the palette whose nearest coloured neighbour is farthest (ties: the one with the fewest uses)
//! distinct_colors    a sequence: of all candidates, the one whose nearest colour so far is farthest, again and again
//! ```
//! The sequence is that of Glasbey, van der Heijden, Toh, Gray 2007 (*Colour displays for categorical images*), which begins with the
//! background: here with black and white, so that neither is among the colours. The candidates are a grid in OKLCH inside the screen's gamut.

use crate::palette::{
    Neighbors, PALETTE_COLORS, Seen, VISIONS, least_distance, linear_from_oklab, palette, seen,
};

/// The most colours of [`distinct_colors`]: later ones could hardly be told from those before.
pub const MOST_DISTINCT: usize = 256;
/// Step of the walk through the palette, which skips across rings and hues; coprime to its length.
const STRIDE: usize = 13;

/// Colours of all labels, linear Rec. 709. `known` has the colour that each label keeps, with NaN for a new label; `contacts` are touching
/// pairs of dense indices. Pairs of a label with itself or beyond the labels are ignored.
///
/// The result depends on the set of pairs alone, not on their order. Time is linear in new labels × (neighbours + 1) × palette.
pub fn color_new_labels(known: &[[f32; 3]], contacts: impl Iterator<Item = (u32, u32)>) -> Vec<[f32; 3]> {
    let labels = known.len();
    let pairs: Vec<(u32, u32)> = contacts.filter(|&(a, b)| a != b && (a.max(b) as usize) < labels).collect();
    let neighbors = Neighbors::new(labels, &pairs);
    let mut looks: Vec<Option<Seen>> =
        known.iter().map(|&color| color.iter().all(|v| !v.is_nan()).then(|| seen(color))).collect();

    // Those with the most coloured neighbours first.
    let colored = |label: u32| neighbors.of(label).iter().filter(|&&n| looks[n as usize].is_some()).count();
    let mut order: Vec<u32> = (0..labels as u32).filter(|&l| looks[l as usize].is_none()).collect();
    order.sort_by_cached_key(|&label| (std::cmp::Reverse(colored(label)), label));

    let (palette, mut colors) = (palette(), known.to_vec());
    let shades = palette.map(seen);
    let mut uses = [0u64; PALETTE_COLORS];
    for label in order {
        // For each colour of the palette, the distance of the nearest coloured neighbour.
        let mut nearest = [f64::INFINITY; PALETTE_COLORS];
        for look in neighbors.of(label).iter().filter_map(|&n| looks[n as usize].as_ref()) {
            for (near, shade) in nearest.iter_mut().zip(&shades) {
                *near = near.min(least_distance(shade, look));
            }
        }
        let better = |best: usize, next: usize| {
            let order = nearest[next].total_cmp(&nearest[best]).then(uses[best].cmp(&uses[next]));
            if order.is_gt() { next } else { best }
        };
        let best = (0..PALETTE_COLORS).map(|i| i * STRIDE % PALETTE_COLORS).reduce(better).unwrap_or(0);
        uses[best] += 1;
        colors[label as usize] = palette[best];
        looks[label as usize] = Some(shades[best]);
    }
    colors
}

/// The first `count` colours of the sequence, linear Rec. 709, at most [`MOST_DISTINCT`]; `is_safe` tells them apart by colour-blind eyes
/// too.
pub fn distinct_colors(count: usize, is_safe: bool) -> Vec<[f32; 3]> {
    let visions = if is_safe { VISIONS.len() } else { 1 };
    let candidates = candidates();
    let looks: Vec<Seen> = candidates.iter().map(|&color| seen(color)).collect();
    let mut nearest = vec![f64::INFINITY; candidates.len()];
    let mut take = |look: &Seen| {
        for (near, other) in nearest.iter_mut().zip(&looks) {
            *near = near.min(least_distance(&look[..visions], other));
        }
        // The first of the farthest.
        (0..nearest.len()).reduce(|best, next| if nearest[next] > nearest[best] { next } else { best })
    };
    take(&seen([0.0; 3]));
    let mut next = take(&seen([1.0; 3]));
    let mut colors = Vec::new();
    while let Some(at) = next.filter(|_| colors.len() < count.min(MOST_DISTINCT)) {
        colors.push(candidates[at]);
        next = take(&looks[at]);
    }
    colors
}

/// Colours of the screen, 0.02 apart in lightness and chroma and 6° in hue, from a lightness and up to a chroma that shading leaves visible.
fn candidates() -> Vec<[f32; 3]> {
    let grid = |steps: u32, step: f64, first: f64| (0..steps).map(move |i| first + step * f64::from(i));
    grid(30, 0.02, 0.34)
        .flat_map(|lightness| grid(11, 0.02, 0.0).map(move |chroma| (lightness, chroma)))
        .flat_map(|(lightness, chroma)| grid(60, 6.0, 0.0).map(move |hue_deg| (lightness, chroma, hue_deg)))
        .map(|(lightness, chroma, hue_deg)| {
            let hue_rad = hue_deg.to_radians();
            linear_from_oklab([lightness, chroma * hue_rad.cos(), chroma * hue_rad.sin()]).map(|v| v as f32)
        })
        .filter(|color| color.iter().all(|v| (0.0..=1.0).contains(v)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::palette::least_delta_e;

    const NEW: [f32; 3] = [f32::NAN; 3];

    #[test]
    fn known_labels_keep_their_colours_and_a_new_one_is_farthest_from_its_neighbours() {
        let known = [[0.9, 0.1, 0.1], [0.1, 0.2, 0.9], [0.02, 0.5, 0.05], NEW];
        let colors = color_new_labels(&known, [(3, 0), (1, 3), (3, 3), (2, 9)].into_iter());
        assert_eq!(colors[..3], known[..3]);
        let least = |color| known[..2].iter().map(|&n| least_delta_e(color, n)).fold(f64::INFINITY, f64::min);
        let best = palette().into_iter().map(least).fold(0.0, f64::max);
        assert_eq!(least(colors[3]), best);
        // Negative control: the label that touches nothing new plays no part, and its colour may come near.
        assert!(palette().iter().any(|&color| least(color) < best / 2.0));
    }

    #[test]
    fn new_labels_that_touch_differ_from_each_other() {
        let colors = color_new_labels(&[NEW; 3], [(0, 1), (1, 2), (2, 0)].into_iter());
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            assert!(least_delta_e(colors[a], colors[b]) > 20.0, "{colors:?}");
        }
        // Without neighbours the palette is used evenly.
        let mut alone = color_new_labels(&[NEW; 2 * PALETTE_COLORS], std::iter::empty());
        alone.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert!(alone.chunks(2).all(|pair| pair[0] == pair[1]));
        alone.dedup();
        assert_eq!(alone.len(), PALETTE_COLORS);
    }

    #[test]
    fn the_order_of_pairs_does_not_matter() {
        let known: Vec<[f32; 3]> =
            (0..60).map(|i| if i % 3 == 0 { NEW } else { palette()[i as usize % 36] }).collect();
        let pairs: Vec<(u32, u32)> = (0..60).flat_map(|a| [(a, a * 7 % 60), (a, a * 11 % 60)]).collect();
        let turned = pairs.iter().rev().map(|&(a, b)| (b, a));
        assert_eq!(color_new_labels(&known, turned), color_new_labels(&known, pairs.iter().copied()));
        assert!(color_new_labels(&[], [(0, 1)].into_iter()).is_empty());
    }

    #[test]
    fn each_colour_of_the_sequence_is_farthest_from_those_before() {
        let all: Vec<Seen> = candidates().into_iter().map(seen).collect();
        for is_safe in [false, true] {
            let visions = if is_safe { 3 } else { 1 };
            let mut former = vec![seen([0.0; 3]), seen([1.0; 3])];
            let mut last = f64::INFINITY;
            for color in distinct_colors(12, is_safe) {
                let nearest = |look: &Seen| {
                    let apart = former.iter().map(|f| least_distance(&look[..visions], &f[..visions]));
                    apart.fold(f64::INFINITY, f64::min)
                };
                let farthest = all.iter().map(nearest).fold(0.0, f64::max);
                assert_eq!(nearest(&seen(color)), farthest);
                assert!(farthest <= last, "later colours are never farther");
                last = farthest;
                former.push(seen(color));
            }
        }
        assert!(distinct_colors(0, true).is_empty());
        assert_eq!(distinct_colors(1000, true).len(), MOST_DISTINCT);
    }
}
