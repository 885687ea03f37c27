//! Base colours of labels, chosen so that touching labels differ for normal, protanope and deuteranope eyes.
//!
//! ```text
//! for each visible label, those with the most visible neighbours first (ties: lower index):
//!     of the palette's colours, take the one that is alike (closer than CLOSE) to the fewest coloured neighbours;
//!         of those the one whose nearest neighbour is farthest, where a distance counts as at most ENOUGH;
//!         of those the one with the fewest uses so far, where a use of a dark colour counts as several
//! repeat for the labels that are alike to a neighbour, until nothing changes
//! ```
//! The distance of two colours is the least of their CIE76 ΔE (Euclidean in CIELAB, white D65) under normal vision and under full
//! protanopia and deuteranopia as simulated by Machado, Oliveira, Fernandes 2009 (*A Physiologically-based Model for Simulation of Color
//! Vision Deficiency*, table 1, severity 1.0). A ΔE of 2.3 is a just noticeable difference side by side; touching labels should be well
//! beyond it, 10 apart at least.
//!
//! The palette is made in OKLCH (Ottosson 2020, *A perceptual color space for image processing*): six rings of six hues, each ring rotated
//! against the previous one by half a step. Rings differ in lightness, which all three kinds of eye perceive, and six hues from 35° on
//! differ in blue-yellow, which two of them still perceive. Eight hues in four rings left 1.7 % of the touching pairs of a packed volume of
//! neurites alike; this palette leaves 0.04 %. (Hues by a hash of the id leave 10 to 19 % of 39,797 touching pairs alike, a fixed palette
//! of 256 colours 1 to 5.5 %.) Colours are muted: a ring's chroma is what its weakest hue can show, and at most 0.12. Time is linear in
//! contacts, and in labels × palette.

/// Lightness and chroma in OKLCH of each ring, from light to dark. All three kinds of eye perceive lightness.
const LIGHTNESSES: [(f64, f64); 6] =
    [(0.86, 0.054), (0.77, 0.111), (0.68, 0.117), (0.58, 0.099), (0.48, 0.081), (0.39, 0.063)];
/// Weight of one use of a ring's colours in the search for the least used colour. Dark surfaces hide their own shading, so dark colours are
/// reserved for neighbours that nothing else can tell apart.
const USE_COSTS: [u64; 6] = [2, 2, 2, 3, 8, 24];
/// Hues of a ring.
const HUES: usize = 6;
/// Number of colours in the palette.
pub const PALETTE_COLORS: usize = LIGHTNESSES.len() * HUES;
/// ΔE below which two colours are alike.
const CLOSE: f32 = 10.0;
/// ΔE above which distances count as equal; beyond it, the number of uses decides.
const ENOUGH: f32 = 16.0;
/// Largest number of passes over the labels: the first colours all labels, the others those that are alike to a neighbour.
const SWEEPS: usize = 16;
/// Step of the walk through the palette; coprime to the palette's length.
const STRIDE: usize = 13;

/// Palette entries (indices into [`palette`]) for `labels` labels with these touching pairs of dense indices. Each pair is given once, in
/// either order; pairs of a label with itself or beyond `labels` are ignored.
///
/// Labels that are not `visible` constrain nothing: they get a colour of the palette by their index, and their neighbours ignore it. `None`
/// makes all labels visible, and so are labels beyond the end of the list. The result depends on the set of pairs alone, not on their
/// order.
pub fn color_labels(
    labels: usize,
    contacts: impl Iterator<Item = (u32, u32)>,
    visible: Option<&[bool]>,
) -> Vec<u8> {
    let palette = palette();
    let distance = distances(&palette);
    let is_visible = |label: u32| visible.is_none_or(|v| v.get(label as usize).copied().unwrap_or(true));
    let pairs: Vec<(u32, u32)> = contacts
        .filter(|&(a, b)| a != b && a.max(b) < labels as u32 && is_visible(a) && is_visible(b))
        .collect();
    let neighbors = Neighbors::new(labels, &pairs);

    let mut order: Vec<u32> = (0..labels as u32).filter(|&l| is_visible(l)).collect();
    order.sort_by_key(|&l| (std::cmp::Reverse(neighbors.of(l).len()), l));
    let mut entry: Vec<Option<u8>> = vec![None; labels];
    let mut uses = [0u64; PALETTE_COLORS];
    for sweep in 0..SWEEPS {
        let mut changes = 0;
        for &label in &order {
            let old = entry[label as usize].map(usize::from);
            let is_alike = |mine: usize| {
                let theirs = neighbors.of(label).iter().filter_map(|&n| entry[n as usize]);
                theirs.map(usize::from).any(|theirs| distance[theirs][mine] < CLOSE)
            };
            if sweep > 0 && !old.is_some_and(is_alike) {
                continue;
            }
            let (alike, nearest) = weigh(neighbors.of(label), &entry, &distance);
            if let Some(old) = old {
                uses[old] -= 1;
            }
            // Takes the first of the best colours in a walk through the palette that skips across rings and hues.
            let walk = (0..PALETTE_COLORS).map(|i| i * STRIDE % PALETTE_COLORS);
            let cost = |entry: usize| (uses[entry] + 1) * USE_COSTS[entry / HUES];
            let better = |best: usize, next: usize| {
                let order = alike[best]
                    .cmp(&alike[next])
                    .then(nearest[next].total_cmp(&nearest[best]))
                    .then(cost(best).cmp(&cost(next)));
                if order.is_gt() { next } else { best }
            };
            let best = walk.reduce(better).unwrap_or(0);
            uses[best] += 1;
            entry[label as usize] = Some(best as u8);
            changes += usize::from(old != Some(best));
        }
        if changes == 0 {
            break;
        }
    }
    let hidden = |(label, entry): (usize, Option<u8>)| entry.unwrap_or((label % PALETTE_COLORS) as u8);
    entry.into_iter().enumerate().map(hidden).collect()
}

/// The colours themselves, linear Rec. 709: the entries of [`color_labels`] looked up in [`palette`].
pub fn assign_colors(
    labels: usize,
    contacts: impl Iterator<Item = (u32, u32)>,
    visible: Option<&[bool]>,
) -> Vec<[f32; 3]> {
    let palette = palette();
    color_labels(labels, contacts, visible).into_iter().map(|entry| palette[usize::from(entry)]).collect()
}

/// For each colour of the palette, the number of coloured neighbours less than [`CLOSE`] from it, and the distance of the nearest, limited
/// to [`ENOUGH`].
fn weigh(
    neighbors: &[u32],
    entry: &[Option<u8>],
    distance: &[[f32; PALETTE_COLORS]; PALETTE_COLORS],
) -> ([u32; PALETTE_COLORS], [f32; PALETTE_COLORS]) {
    let mut count = [0u32; PALETTE_COLORS];
    for theirs in neighbors.iter().filter_map(|&n| entry[n as usize]) {
        count[usize::from(theirs)] += 1;
    }
    let (mut alike, mut nearest) = ([0; PALETTE_COLORS], [ENOUGH; PALETTE_COLORS]);
    for (theirs, &n) in count.iter().enumerate().filter(|&(_, &n)| n > 0) {
        for (mine, &d) in distance[theirs].iter().enumerate() {
            nearest[mine] = nearest[mine].min(d);
            alike[mine] += if d < CLOSE { n } else { 0 };
        }
    }
    (alike, nearest)
}

/// Neighbours of each label, one list after another; a pair that is given twice is listed twice.
pub(crate) struct Neighbors {
    first: Vec<usize>,
    list: Vec<u32>,
}

impl Neighbors {
    pub(crate) fn new(labels: usize, pairs: &[(u32, u32)]) -> Self {
        let mut first = vec![0; labels + 1];
        for &(a, b) in pairs {
            first[a as usize + 1] += 1;
            first[b as usize + 1] += 1;
        }
        for label in 0..labels {
            first[label + 1] += first[label];
        }
        let mut next = first.clone();
        let mut list = vec![0; 2 * pairs.len()];
        for &(a, b) in pairs {
            for (from, to) in [(a, b), (b, a)] {
                list[next[from as usize]] = to;
                next[from as usize] += 1;
            }
        }
        Self { first, list }
    }

    pub(crate) fn of(&self, label: u32) -> &[u32] {
        &self.list[self.first[label as usize]..self.first[label as usize + 1]]
    }
}

/// The colours of the palette, linear Rec. 709, ring by ring.
pub fn palette() -> [[f32; 3]; PALETTE_COLORS] {
    std::array::from_fn(|i| {
        let (ring, step) = (i / HUES, i % HUES);
        let (lightness, chroma) = LIGHTNESSES[ring];
        let hue_rad = std::f64::consts::TAU * (step as f64 + ring as f64 / 2.0 + 7.0 / 12.0) / HUES as f64;
        linear_from_oklab([lightness, chroma * hue_rad.cos(), chroma * hue_rad.sin()])
            .map(|v| v.clamp(0.0, 1.0) as f32)
    })
}

/// Linear Rec. 709 values of an OKLab colour (Ottosson 2020, with the matrices of 2021-01-25).
pub(crate) fn linear_from_oklab([l, a, b]: [f64; 3]) -> [f64; 3] {
    let cone = [
        l + 0.396_337_777_4 * a + 0.215_803_757_3 * b,
        l - 0.105_561_345_8 * a - 0.063_854_172_8 * b,
        l - 0.089_484_177_5 * a - 1.291_485_548_0 * b,
    ]
    .map(|c| c * c * c);
    mul(
        [
            [4.076_741_662_1, -3.307_711_591_3, 0.230_969_929_2],
            [-1.268_438_004_6, 2.609_757_401_1, -0.341_319_396_5],
            [-0.004_196_086_3, -0.703_418_614_7, 1.707_614_701_0],
        ],
        cone,
    )
}

/// Matrices that simulate three kinds of eye on linear Rec. 709 colours: normal, protanope, deuteranope.
pub const VISIONS: [[[f64; 3]; 3]; 3] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    // Machado et al. 2009, table 1: protanomaly, severity 1.0.
    [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    // The same: deuteranomaly, severity 1.0.
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
];

/// The least ΔE of two linear Rec. 709 colours over [`VISIONS`].
pub fn least_delta_e(a: [f32; 3], b: [f32; 3]) -> f64 {
    least_distance(&seen(a), &seen(b))
}

/// CIELAB coordinates of a colour for each of [`VISIONS`].
pub(crate) type Seen = [[f64; 3]; VISIONS.len()];

/// What each of [`VISIONS`] sees of a linear Rec. 709 colour.
pub(crate) fn seen(color: [f32; 3]) -> Seen {
    VISIONS.map(|vision| lab_from_linear(mul(vision, color.map(f64::from)).map(|v| v.clamp(0.0, 1.0))))
}

/// The least ΔE of two colours over the visions that are given of both.
pub(crate) fn least_distance(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(p, q)| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt())
        .fold(f64::INFINITY, f64::min)
}

fn distances(palette: &[[f32; 3]; PALETTE_COLORS]) -> [[f32; PALETTE_COLORS]; PALETTE_COLORS] {
    std::array::from_fn(|i| std::array::from_fn(|j| least_delta_e(palette[i], palette[j]) as f32))
}

/// CIELAB of a linear Rec. 709 colour, white D65 (CIE 15:2004 §8.2.1; matrix of IEC 61966-2-1).
fn lab_from_linear(linear: [f64; 3]) -> [f64; 3] {
    let xyz = mul([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]], linear);
    let white = [0.9505, 1.0, 1.089];
    let f = |t: f64| if t > (6.0f64 / 29.0).powi(3) { t.cbrt() } else { t * (841.0 / 108.0) + 4.0 / 29.0 };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i] / white[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn mul(matrix: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u64) -> u64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        *state >> 33
    }

    /// Touching cells of a random 3-D Voronoi-like volume: a jittered grid whose cells touch those around them with decreasing probability,
    /// and some long thin labels that touch many. The mean degree is about 13, as in electron microscopy.
    fn packed(side: u32) -> (usize, Vec<(u32, u32)>) {
        let (labels, mut state, mut pairs) = (side.pow(3), 7, Vec::new());
        for (x, y, z) in (0..labels).map(|i| (i % side, i / side % side, i / side / side)) {
            for (dx, dy, dz) in (0..27).map(|i| (i % 3, i / 3 % 3, i / 9)) {
                let (u, v, w) = (x + dx, y + dy, z + dz);
                let odds = [0, 98, 60, 30][[dx, dy, dz].iter().filter(|&&d| d != 1).count()];
                if (1..=side).contains(&u) && (1..=side).contains(&v) && (1..=side).contains(&w) {
                    let (a, b) = (x + side * (y + side * z), u - 1 + side * (v - 1 + side * (w - 1)));
                    if a < b && random(&mut state) % 100 < odds {
                        pairs.push((a, b));
                    }
                }
            }
        }
        for hub in 0..labels / 500 {
            pairs.extend((0..200).map(|_| (hub * 500, (random(&mut state) % u64::from(labels)) as u32)));
        }
        (labels as usize, pairs)
    }

    /// Share of touching pairs whose colours are less than ΔE 10 apart for some kind of eye.
    fn alike(colors: &[[f32; 3]], pairs: &[(u32, u32)]) -> f64 {
        let close =
            |&&(a, b): &&(u32, u32)| a != b && least_delta_e(colors[a as usize], colors[b as usize]) < 10.0;
        pairs.iter().filter(close).count() as f64 / pairs.len() as f64
    }

    #[test]
    fn touching_labels_differ_for_all_three_eyes() {
        let (labels, pairs) = packed(20);
        let colors = assign_colors(labels, pairs.iter().copied(), None);
        let share = alike(&colors, &pairs);
        println!("share of touching pairs alike: {share}");
        assert!(share <= 0.001, "{share}");
        // Negative control: hues by hash, as viewers commonly use them.
        let hashed: Vec<[f32; 3]> = (0..labels as u64)
            .map(|i| {
                let hue = std::f64::consts::TAU * random(&mut (i * 0x9E37_79B9)) as f64 / 2f64.powi(31);
                linear_from_oklab([0.7, 0.12 * hue.cos(), 0.12 * hue.sin()]).map(|v| v.clamp(0.0, 1.0) as f32)
            })
            .collect();
        assert!(alike(&hashed, &pairs) > 0.05, "{}", alike(&hashed, &pairs));
    }

    /// Each of 400 labels touches some 60 others, more than the palette has colours, so that the first sweep leaves many labels with more
    /// alike neighbours than another colour would have.
    #[test]
    fn later_sweeps_leave_no_label_that_another_colour_suits_better() {
        let (labels, mut state) = (400, 3);
        let pairs: Vec<(u32, u32)> = (0..labels * 30)
            .map(|_| [(); 2].map(|()| (random(&mut state) % labels) as u32).into())
            .filter(|(a, b)| a != b)
            .collect();
        let palette = palette();
        let entry = color_labels(labels as usize, pairs.iter().copied(), None);
        let mut around = vec![Vec::new(); labels as usize];
        for &(a, b) in &pairs {
            around[a as usize].push(palette[usize::from(entry[b as usize])]);
            around[b as usize].push(palette[usize::from(entry[a as usize])]);
        }
        for (own, around) in entry.into_iter().zip(around) {
            let alike = palette.map(|mine| around.iter().filter(|&&c| least_delta_e(mine, c) < 10.0).count());
            assert_eq!(Some(&alike[usize::from(own)]), alike.iter().min());
        }
    }

    #[test]
    fn hidden_labels_leave_their_colours_to_others() {
        let (labels, pairs) = packed(12);
        let visible: Vec<bool> = (0..labels).map(|l| l % 5 == 0).collect();
        let seen: Vec<_> =
            pairs.iter().copied().filter(|&(a, b)| visible[a as usize] && visible[b as usize]).collect();
        let colors = assign_colors(labels, pairs.iter().copied(), Some(&visible));
        let alone = assign_colors(labels, seen.iter().copied(), Some(&visible));
        assert_eq!(colors, alone, "pairs with hidden labels change nothing");
        assert_eq!(alike(&colors, &seen), 0.0);
    }

    #[test]
    fn the_whole_palette_appears_and_dark_colours_seldom() {
        let (labels, pairs) = packed(12);
        for pairs in [pairs, Vec::new()] {
            let colors = assign_colors(labels, pairs.iter().copied(), None);
            for (i, color) in palette().iter().enumerate() {
                let share = colors.iter().filter(|&c| c == color).count() as f64 / labels as f64;
                // A fifth of an even share, reduced by the weight of its uses.
                let least = 0.2 / PALETTE_COLORS as f64 * (USE_COSTS[0] as f64 / USE_COSTS[i / HUES] as f64);
                assert!(share > least, "colour {i}: {share}, expected {least}");
            }
        }
    }

    #[test]
    fn the_order_of_pairs_does_not_matter() {
        let (labels, mut pairs) = packed(8);
        pairs.sort_unstable();
        pairs.dedup();
        let colors = assign_colors(labels, pairs.iter().copied(), None);
        pairs.reverse();
        let swapped = pairs.iter().map(|&(a, b)| (b, a));
        assert_eq!(assign_colors(labels, swapped, None), colors);
    }

    #[test]
    fn odd_input_is_harmless() {
        assert!(assign_colors(0, [(0, 0), (5, 1)].into_iter(), None).is_empty());
        assert_eq!(assign_colors(2, [(0, 0), (1, 9), (u32::MAX, 0)].into_iter(), Some(&[])).len(), 2);
        let star = assign_colors(1000, (1..1000).map(|i| (0, i)), None);
        assert!(star[1..].iter().all(|&c| least_delta_e(c, star[0]) >= 10.0));
    }

    #[test]
    fn the_palette_is_calm_and_within_the_screen() {
        let palette = palette();
        for (i, &color) in palette.iter().enumerate() {
            // Nothing is clipped, black or white: each channel lies strictly inside the range.
            assert!(color.iter().all(|&v| v > 0.0 && v < 0.95), "colour {i}: {color:?}");
            for (j, &other) in palette[..i].iter().enumerate() {
                let [p, q] = [color, other].map(|c| lab_from_linear(c.map(f64::from)));
                let delta_e = (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
                assert!(delta_e > 10.0, "colours {i} and {j}: ΔE {delta_e}");
            }
        }
    }

    /// Published values of CIELAB and OKLab.
    #[test]
    fn known_colours_have_known_coordinates() {
        // sRGB red: L* 53.24, a* 80.09, b* 67.20 (the usual tables, D65, whose matrix has more digits than the standard's 4).
        let lab = lab_from_linear([1.0, 0.0, 0.0]);
        for (got, expected) in lab.iter().zip([53.24, 80.09, 67.20]) {
            assert!((got - expected).abs() < 0.03, "{lab:?}");
        }
        // sRGB red in OKLab: 0.62796, 0.22486, 0.12585 (CSS Color 4, sample conversions).
        let red = linear_from_oklab([0.627_96, 0.224_86, 0.125_85]);
        for (got, expected) in red.iter().zip([1.0, 0.0, 0.0]) {
            assert!((got - expected).abs() < 1e-4, "{red:?}");
        }
        // Greys stay grey for every eye: the rows of each matrix add up to 1.
        for row in VISIONS.iter().flatten() {
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-5);
        }
    }
}
