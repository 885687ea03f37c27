//! Recomputes entries of `bsdf/tables.bin` over outgoing directions: without sampled normals, and without code of the tables' own.

use std::f64::consts::PI;

use pumice_transport::bsdf::tables::{
    ENTRIES, FRESNEL_SHARE, GLASS, GLASS_AVERAGE, INSIDE, REFLECTION, REFLECTION_AVERAGE, SHEEN,
    SHEEN_ENTRIES, TABLES,
};

/// D·G2 of GGX (Walter et al. 2007, Heitz 2014).
fn d_g(alpha: f64, h_z: f64, i_z: f64, o_z: f64) -> f64 {
    let a2 = alpha * alpha;
    let d = a2 / (PI * (h_z * h_z * (a2 - 1.0) + 1.0).powi(2));
    let lambda = |z: f64| ((1.0 + a2 * (1.0 - z * z) / (z * z)).sqrt() - 1.0) / 2.0;
    d / (1.0 + lambda(i_z) + lambda(o_z))
}

fn reflectance(cos: f64, eta: f64) -> f64 {
    let g2 = eta * eta - 1.0 + cos * cos;
    if g2 <= 0.0 {
        return 1.0;
    }
    let g = g2.sqrt();
    let a = (g - cos) / (g + cos);
    let b = (cos * (g + cos) - 1.0) / (cos * (g - cos) + 1.0);
    0.5 * a * a * (1.0 + b * b)
}

/// ∫ over outgoing directions above the surface of D·G2/(4 i_z)·f(cosine with the half vector).
fn over_directions(alpha: f64, i_z: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (n_z, n_a) = (400, 400);
    let s = (1.0 - i_z * i_z).sqrt();
    let mut sum = 0.0;
    for a in 0..n_z {
        let z = (f64::from(a) + 0.5) / f64::from(n_z);
        let r = (1.0 - z * z).sqrt();
        for b in 0..n_a {
            let (sin, cos) = (2.0 * PI * (f64::from(b) + 0.5) / f64::from(n_a)).sin_cos();
            let h = [s + r * cos, r * sin, i_z + z];
            let length = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            let cos_h = (s * h[0] + i_z * h[2]) / length;
            sum += d_g(alpha, h[2] / length, i_z, z) / (4.0 * i_z) * f(cos_h);
        }
    }
    sum * 2.0 * PI / f64::from(n_z * n_a)
}

fn entry(at: usize) -> f64 {
    f64::from(TABLES[at])
}

#[test]
fn entries_are_what_surfaces_keep() {
    assert!(TABLES[..SHEEN].iter().all(|v| (0.0..=1.0).contains(v)) && TABLES.len() == ENTRIES);
    let mut noticed = 0;
    // Rough surfaces, for which a plain grid of directions is fine enough.
    for x in [20usize, 26, 31] {
        let alpha = (x as f64 / 31.0).powi(2);
        for y in [8usize, 16, 31] {
            let expected = over_directions(alpha, y as f64 / 31.0, |_| 1.0);
            let got = entry(REFLECTION + y * 32 + x);
            // 160,000 directions: 3e-4 at the horizon, where shadowing ends.
            assert!((got - expected).abs() < 3e-4, "roughness {x}, cosine {y}: {got}, expected {expected}");
            noticed += usize::from((entry(REFLECTION + y * 32 + x - 1) - expected).abs() > 3e-4);
        }
        let steps = 24;
        let mean = (0..steps).map(|i| ((f64::from(i) + 0.5) / f64::from(steps)).sqrt());
        let expected = mean.map(|z| over_directions(alpha, z, |_| 1.0)).sum::<f64>() / f64::from(steps);
        let got = entry(REFLECTION_AVERAGE + x);
        assert!((got - expected).abs() < 1e-3, "average of roughness {x}: {got}, expected {expected}");
    }
    assert_eq!(noticed, 9, "the neighbour's entry must not pass");
}

/// Glass from outside: reflection, plus refraction by normals that are visible from the other side.
#[test]
fn glass_keeps_what_it_reflects_and_refracts() {
    for (x, y, z) in [(10usize, 8usize, 6usize), (15, 5, 8), (12, 15, 5)] {
        let (alpha, i_z) = ((x as f64 / 15.0).powi(2), y as f64 / 15.0);
        let root = (z as f64 / 15.0).powi(2);
        let eta = (1.0 + root) / (1.0 - root);
        let reflected = over_directions(alpha, i_z, |cos| reflectance(cos, eta));
        // Refraction over the normals of the hemisphere (Walter et al. 2007, eq. 21, with its Jacobian).
        let (n, s) = (500, (1.0 - i_z * i_z).sqrt());
        let mut refracted = 0.0;
        for a in 0..n {
            let h_z = (f64::from(a) + 0.5) / f64::from(n);
            let r = (1.0 - h_z * h_z).sqrt();
            for b in 0..n {
                let angle = 2.0 * PI * (f64::from(b) + 0.5) / f64::from(n);
                let cos = s * r * angle.cos() + i_z * h_z;
                if cos <= 0.0 {
                    continue;
                }
                let cos_t = (1.0 - (1.0 - cos * cos) / (eta * eta)).sqrt();
                let o_z = (cos / eta - cos_t) * h_z - i_z / eta;
                refracted += (1.0 - reflectance(cos, eta)) * d_g(alpha, h_z, i_z, o_z) * cos / i_z;
            }
        }
        let expected = reflected + refracted * 2.0 * PI / f64::from(n * n);
        let got = entry(GLASS + (z * 16 + y) * 16 + x);
        assert!((got - expected).abs() < 5e-4, "{x} {y} {z}: {got}, expected {expected}");
        // Entries from inside and from outside differ.
        assert!((entry(GLASS + INSIDE + (z * 16 + y) * 16 + x) - expected).abs() > 5e-4);
        // The average lies between the entries that it averages.
        let column = (0..16).map(|y| entry(GLASS + (z * 16 + y) * 16 + x));
        let (low, high) = column.fold((1.0f64, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        let average = entry(GLASS_AVERAGE + z * 16 + x);
        assert!((low..=high).contains(&average), "{average} in {low}..{high}");
    }
}

/// The Fresnel share over normals that are visible and reflect upward, without shadowing: weighted by the density of the reflection.
#[test]
fn fresnel_shares_are_averages_over_seen_normals() {
    for (x, y, z) in [(10usize, 10usize, 6usize), (14, 6, 8)] {
        let (alpha, i_z) = ((x as f64 / 15.0).powi(2), y as f64 / 15.0);
        let root = (z as f64 / 15.0).powi(2);
        let eta = (1.0 + root) / (1.0 - root);
        let (n, s, f0) = (800, (1.0 - i_z * i_z).sqrt(), reflectance(1.0, eta));
        let lambda = ((1.0 + alpha * alpha * s * s / (i_z * i_z)).sqrt() - 1.0) / 2.0;
        let mut sum = 0.0;
        for a in 0..n {
            let h_z = (f64::from(a) + 0.5) / f64::from(n);
            let r = (1.0 - h_z * h_z).sqrt();
            for b in 0..n {
                let cos = s * r * (2.0 * PI * (f64::from(b) + 0.5) / f64::from(n)).cos() + i_z * h_z;
                if cos > 0.0 && 2.0 * cos * h_z > i_z {
                    let a2 = alpha * alpha;
                    let d = a2 / (PI * (h_z * h_z * (a2 - 1.0) + 1.0).powi(2));
                    sum += d * cos / ((1.0 + lambda) * i_z) * (reflectance(cos, eta) - f0) / (1.0 - f0);
                }
            }
        }
        let expected = sum * 2.0 * PI / f64::from(n * n);
        let got = entry(FRESNEL_SHARE + (z * 16 + y) * 16 + x);
        assert!((got - expected).abs() < 2e-4, "{x} {y} {z}: {got}, expected {expected}");
    }
}

/// A simple generator: xorshift64* (Vigna 2016).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Direction in which light from (sin, 0, `i_z`) leaves the layer of fibres that sheen stands for; `None` if it leaves at the bottom.
///
/// The layer has depth 1 and is full of mirrors whose normals are those of ellipsoids with half axes 1, 1 and σ of their shadows, where σ
/// is the squared roughness (SGGX: Heitz, Dupuy, Crassin, Dachsbacher 2015). The visible part of one from w is the hemisphere around v =
/// (w.x, w.y, σ w.z), a point p of which has the normal (p.x, p.y, σ p.z); the mean free path is 1/|v|.
fn walked(roughness: f64, i_z: f64, random: &mut Random) -> Option<[f64; 3]> {
    let flat = roughness * roughness;
    let (mut w, mut depth) = ([(1.0 - i_z * i_z).sqrt(), 0.0, i_z], 0.0);
    for _ in 0..16 {
        // w points back along the walk.
        let v = [w[0], w[1], flat * w[2]];
        let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        depth += -(1.0 - random.unit()).ln() / length * w[2];
        if depth < 0.0 {
            return Some(w.map(|c| -c));
        }
        if depth > 1.0 {
            return None;
        }
        // A point of the hemisphere around v, uniform as seen from there: a point of the disk, lifted to the sphere and turned to v by a
        // reflection.
        let (r, (sin, cos)) = (random.unit().sqrt(), (2.0 * PI * random.unit()).sin_cos());
        let p = [r * cos, r * sin, (1.0 - r * r).sqrt()];
        let half = [v[0] / length, v[1] / length, v[2] / length + 1.0];
        let squared = half[0] * half[0] + half[1] * half[1] + half[2] * half[2];
        let along = 2.0 * (p[0] * half[0] + p[1] * half[1] + p[2] * half[2]) / squared.max(1e-12);
        let p: [f64; 3] = std::array::from_fn(|a| along * half[a] - p[a]);
        let m = [p[0], p[1], flat * p[2]];
        let along = 2.0 * (m[0] * w[0] + m[1] * w[1] + m[2] * w[2])
            / (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).max(1e-300);
        // The next segment goes where the mirror reflects it; w points back along that.
        w = std::array::from_fn(|a| w[a] - along * m[a]);
    }
    // The published fit ends walks there, wherever they are: light travels far along upright fibres.
    (w[2] < 0.0).then(|| w.map(|c| -c))
}

/// The tables of sheen are published, not computed here. Walks through the layer must reflect the share R, in the directions of A and B.
#[test]
fn sheen_is_what_a_layer_of_fibres_reflects() {
    let (mut noticed, mut turned, mut entries) = (0, 0, 0);
    for x in [3usize, 10, 17, 24, 31] {
        for y in [8usize, 16, 24, 31] {
            let at = |x: usize, k: usize| entry(SHEEN + k * SHEEN_ENTRIES + y * 32 + x);
            let mut random = Random(7 + (32 * x + y) as u64);
            let walks = 60_000;
            let (mut count, mut sum) = (0.0, [0.0; 3]);
            for _ in 0..walks {
                if let Some(o) = walked(y as f64 / 31.0, x as f64 / 31.0, &mut random) {
                    count += 1.0;
                    sum = std::array::from_fn(|a| sum[a] + o[a]);
                }
            }
            let share = count / f64::from(walks);
            // Statistical error: 5 standard errors.
            let noise = 5.0 * (share * (1.0 - share) / f64::from(walks)).sqrt();
            let got = at(x, 2);
            assert!((got - share).abs() < noise, "cosine {x}, roughness {y}: {got}, walked {share}");
            noticed += usize::from((at(x - 1, 2) - share).abs() > noise);
            entries += 1;
            // The lobe of the matrix, over a uniform grid of the cosine lobe that it transforms.
            let (a, b, n) = (at(x, 0), at(x, 1), 200);
            let mut mean = [0.0; 3];
            for i in 0..n * n {
                let z = ((f64::from(i / n) + 0.5) / f64::from(n)).sqrt();
                let (sin, cos) = (2.0 * PI * (f64::from(i % n) + 0.5) / f64::from(n)).sin_cos();
                let r = (1.0 - z * z).sqrt();
                let d = [r * cos - b * z, r * sin, a * z];
                let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                mean = std::array::from_fn(|k| mean[k] + d[k] / length / f64::from(n * n));
            }
            // A lobe with two parameters does not equal that of the walks: their means differ by up to 0.025 where they are known well.
            let near = 0.03 + 3.0 / count.sqrt();
            let walked = sum.map(|s| s / count);
            let off =
                |mean: [f64; 3]| mean.iter().zip(walked).map(|(m, w)| (m - w).abs()).fold(0.0, f64::max);
            assert!(off(mean) < near, "cosine {x}, roughness {y}: {mean:?}, walked {walked:?}");
            turned += usize::from(off([-mean[0], mean[1], mean[2]]) > near);
        }
    }
    assert!(turned >= 6, "{turned} of {entries} lobes that lean away from the viewer noticed");
    assert!(noticed + 2 >= entries, "{noticed} of {entries} neighbours noticed");
}
