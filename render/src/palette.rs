//! Colours for labels, so that labels that touch look unlike, also to the colour-blind.
//!
//! A fixed palette is laid out in OKLCH (Ottosson 2020): twelve hues at three lightnesses with calm chroma. Labels are coloured
//! in order of index; each takes the entry whose least distance from its neighbours' colours, over normal, deuteranope and
//! protanope vision (Machado, Oliveira, Fernandes 2009, severity 1), is largest. Ties go to the entry that is used least.

/// ΔE (CIE 1976) below which two colours count as alike.
pub const ALIKE: f32 = 10.0;

/// Number of colours.
pub const PALETTE_LEN: usize = 36;

/// Linear Rec. 709 colours of the palette.
pub fn palette() -> [[f32; 3]; PALETTE_LEN] {
    std::array::from_fn(|i| {
        let (hue, level) = (i % 12, i / 12);
        // Lightnesses turn with the hue, so that entries of neighbouring hues differ in lightness too.
        let lightness = [0.80, 0.66, 0.52][(level + hue) % 3] + [0.02, -0.02][hue % 2];
        let chroma: f64 = [0.085, 0.125, 0.115][(level + hue) % 3];
        let angle = (hue as f64 * 30.0 + 15.0).to_radians();
        linear_from_oklch(lightness, chroma, angle)
    })
}

/// Ottosson 2020, *A perceptual color space for image processing*; chroma is lowered until the colour is in Rec. 709.
fn linear_from_oklch(l: f64, mut chroma: f64, hue_rad: f64) -> [f32; 3] {
    loop {
        let (a, b) = (chroma * hue_rad.cos(), chroma * hue_rad.sin());
        let x = (l + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
        let y = (l - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
        let z = (l - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
        let rgb = [
            4.076_741_662_1 * x - 3.307_711_591_3 * y + 0.230_969_929_2 * z,
            -1.268_438_004_6 * x + 2.609_757_401_1 * y - 0.341_319_396_5 * z,
            -0.004_196_086_3 * x - 0.703_418_614_7 * y + 1.707_614_701_0 * z,
        ];
        if rgb.iter().all(|v| (0.0..=1.0).contains(v)) || chroma < 1e-3 {
            return rgb.map(|v| v.clamp(0.0, 1.0) as f32);
        }
        chroma *= 0.97;
    }
}

/// Machado et al. 2009, table 1 (severity 1.0), applied to linear RGB: normal, protanope, deuteranope.
const VISIONS: [[[f32; 3]; 3]; 3] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [
        [0.152_286, 1.052_583, -0.204_868],
        [0.114_503, 0.786_281, 0.099_216],
        [-0.003_882, -0.048_116, 1.051_998],
    ],
    [
        [0.367_322, 0.860_646, -0.227_968],
        [0.280_085, 0.672_501, 0.047_413],
        [-0.011_820, 0.042_940, 0.968_881],
    ],
];

/// CIELAB (D65) of a linear Rec. 709 colour.
fn lab(rgb: [f32; 3]) -> [f32; 3] {
    let row = |m: [f32; 3]| m[0] * rgb[0] + m[1] * rgb[1] + m[2] * rgb[2];
    let f = |t: f32| if t > 216.0 / 24389.0 { t.cbrt() } else { (24389.0 / 27.0 * t + 16.0) / 116.0 };
    let x = f(row([0.412_456, 0.357_576, 0.180_438]) / 0.950_47);
    let y = f(row([0.212_673, 0.715_152, 0.072_175]));
    let z = f(row([0.019_334, 0.119_192, 0.950_304]) / 1.088_83);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The least ΔE of two linear colours over the three visions.
pub fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    VISIONS
        .iter()
        .map(|m| {
            let seen =
                |c: [f32; 3]| lab(m.map(|r| (r[0] * c[0] + r[1] * c[1] + r[2] * c[2]).clamp(0.0, 1.0)));
            let (a, b) = (seen(a), seen(b));
            (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt()
        })
        .fold(f32::INFINITY, f32::min)
}

/// Palette entry of each of `labels` labels; `touching` lists pairs of dense indices, in any order. Pairs with an index past the
/// end are ignored.
pub fn color_labels(labels: usize, touching: &[(u32, u32)]) -> Vec<u8> {
    let colors = palette();
    let distances: Vec<[f32; PALETTE_LEN]> =
        colors.iter().map(|&a| std::array::from_fn(|j| distance(a, colors[j]))).collect();
    // Neighbours of each label, as one array with starts (a counting sort of both directions).
    let known = |&&(a, b): &&(u32, u32)| (a as usize) < labels && (b as usize) < labels && a != b;
    let mut starts = vec![0usize; labels + 1];
    for &(a, b) in touching.iter().filter(known) {
        starts[a as usize + 1] += 1;
        starts[b as usize + 1] += 1;
    }
    for i in 0..labels {
        starts[i + 1] += starts[i];
    }
    let mut fill = starts.clone();
    let mut neighbours = vec![0u32; starts[labels]];
    for &(a, b) in touching.iter().filter(known) {
        for (from, to) in [(a, b), (b, a)] {
            neighbours[fill[from as usize]] = to;
            fill[from as usize] += 1;
        }
    }
    // Labels with most neighbours first: they are the hardest to please.
    let mut order: Vec<usize> = (0..labels).collect();
    order.sort_by_key(|&l| (std::cmp::Reverse(starts[l + 1] - starts[l]), l));
    const NONE: u8 = u8::MAX;
    let mut entries = vec![NONE; labels];
    let mut used = [0u32; PALETTE_LEN];
    for l in order {
        let mut least = [f32::INFINITY; PALETTE_LEN];
        for &n in &neighbours[starts[l]..starts[l + 1]] {
            if entries[n as usize] != NONE {
                let row = &distances[entries[n as usize] as usize];
                least.iter_mut().zip(row).for_each(|(v, d)| *v = v.min(*d));
            }
        }
        // Beyond three times what counts as alike more distance is worth less than an even use of the palette.
        let score = |i: usize| (least[i].min(3.0 * ALIKE), std::cmp::Reverse(used[i]));
        let mut best = l % PALETTE_LEN;
        for i in 0..PALETTE_LEN {
            if score(i) > score(best) {
                best = i;
            }
        }
        entries[l] = best as u8;
        used[best] += 1;
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_labels_look_unlike() {
        // A jittered lattice of cells with 14 neighbours each, as packed cells have.
        let n = 14u32;
        let at = |x: u32, y: u32, z: u32| (z * n + y) * n + x;
        let mut pairs = Vec::new();
        for z in 0..n {
            for y in 0..n {
                for x in 0..n {
                    for (dx, dy, dz) in
                        [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1), (1, 1, 1)]
                    {
                        if x + dx < n && y + dy < n && z + dz < n {
                            pairs.push((at(x, y, z), at(x + dx, y + dy, z + dz)));
                        }
                    }
                }
            }
        }
        let colors = palette();
        let alike = |entries: &[u8]| {
            let of = |l: u32| colors[entries[l as usize] as usize];
            pairs.iter().filter(|&&(a, b)| distance(of(a), of(b)) < ALIKE).count() as f64 / pairs.len() as f64
        };
        let share = alike(&color_labels((n * n * n) as usize, &pairs));
        assert!(share <= 0.001, "{share}");
        let hashed: Vec<u8> =
            (0..n * n * n).map(|l| (l.wrapping_mul(2_654_435_761) >> 8) as u8 % 36).collect();
        assert!(alike(&hashed) > 0.05, "the check cannot tell colours by hash: {}", alike(&hashed));
    }

    #[test]
    fn foreign_indices_are_ignored() {
        assert_eq!(color_labels(0, &[(0, 1)]), Vec::<u8>::new());
        assert_eq!(color_labels(1, &[(0, 7), (0, 0)]).len(), 1);
    }
}
