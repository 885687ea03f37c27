//! Entries of `bsdf/tables.bin`, recomputed over outgoing directions: no sampled normals, no code of the tables' own.

use std::f64::consts::PI;

use pumice_cpu::bsdf::tables::{
    ENTRIES, FRESNEL_SHARE, GLASS, GLASS_AVERAGE, INSIDE, REFLECTION, REFLECTION_AVERAGE, TABLES,
};

/// GGX's density of normals over its masking, times what a cosine of 1 leaves: D·G2 of Walter et al. 2007 and Heitz 2014.
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

/// ∫ over outgoing directions above the surface of D·G2/(4 i_z)·f(cosine with the normal between).
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
    assert!(TABLES.iter().all(|v| (0.0..=1.0).contains(v)) && TABLES.len() == ENTRIES);
    let mut noticed = 0;
    // Rough ones, where a plain grid of directions is fine enough.
    for x in [20usize, 26, 31] {
        let alpha = (x as f64 / 31.0).powi(2);
        for y in [8usize, 16, 31] {
            let expected = over_directions(alpha, y as f64 / 31.0, |_| 1.0);
            let got = entry(REFLECTION + y * 32 + x);
            // 160,000 directions: 3e-4 at the horizon, where shadows end.
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

/// Glass from outside: what is reflected, and what is refracted into normals that the other side sees.
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
        // From inside and outside it is not the same.
        assert!((entry(GLASS + INSIDE + (z * 16 + y) * 16 + x) - expected).abs() > 5e-4);
        // The average lies between the entries that it averages.
        let column = (0..16).map(|y| entry(GLASS + (z * 16 + y) * 16 + x));
        let (low, high) = column.fold((1.0f64, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        let average = entry(GLASS_AVERAGE + z * 16 + x);
        assert!((low..=high).contains(&average), "{average} in {low}..{high}");
    }
}

/// The share of Fresnel's curve, of normals that are seen and reflect upward, shadows left out: the density over that of the reflection.
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
