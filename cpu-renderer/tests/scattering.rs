//! What a surface scatters, against quadrature and counting that share no code with the sampling.

use glam::Vec3;
use pumice_cpu::bsdf::Bsdf;
use pumice_scene::Material;

fn materials() -> Vec<Material> {
    let mut all = Vec::new();
    for roughness in [0.3f32, 0.6, 1.0] {
        for (metallic, specular) in [(0.0, 0.0), (0.0, 0.5), (1.0, 0.5), (0.4, 1.0)] {
            all.push(Material {
                base_color: [0.9, 0.5, 0.2],
                roughness,
                metallic,
                specular,
                ..Material::default()
            });
        }
    }
    all
}

fn toward(z: f32, azimuth: f32) -> Vec3 {
    let s = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(s * azimuth.cos(), s * azimuth.sin(), z)
}

/// A plain counter-based generator.
fn uniform(i: u64) -> f32 {
    let mut x = i.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ (x >> 31)) >> 40) as f32 / 16_777_216.0
}

const Z_BINS: usize = 8;
const A_BINS: usize = 12;
const SUB: usize = 24;

/// Expected shares of the bins by the density's integral, and the integral of f·cos.
fn quadrature(bsdf: &Bsdf) -> (Vec<f64>, Vec3) {
    let mut shares = vec![0f64; Z_BINS * A_BINS];
    let mut energy = Vec3::ZERO;
    let (nz, na) = (Z_BINS * SUB, A_BINS * SUB);
    let cell = 2.0 * std::f64::consts::PI / (nz * na) as f64;
    for i in 0..nz {
        for j in 0..na {
            let wo =
                toward((i as f32 + 0.5) / nz as f32, (j as f32 + 0.5) / na as f32 * std::f32::consts::TAU);
            let (f, pdf) = bsdf.eval(wo);
            shares[i / SUB * A_BINS + j / SUB] += f64::from(pdf) * cell;
            energy += f * cell as f32;
        }
    }
    (shares, energy)
}

/// χ² of sampled directions against bins; samples lost below the surface are a bin of their own.
fn chi_square(bsdf: &Bsdf, shares: &[f64], n: u64, skew: f32) -> (f64, usize) {
    let mut counts = vec![0f64; shares.len() + 1];
    for i in 0..n {
        let u = [uniform(3 * i).powf(skew), uniform(3 * i + 1)];
        let bin = bsdf.sample(u, uniform(3 * i + 2)).map_or(shares.len(), |s| {
            let a = s.wo.y.atan2(s.wo.x).rem_euclid(std::f32::consts::TAU) / std::f32::consts::TAU;
            ((s.wo.z * Z_BINS as f32) as usize).min(Z_BINS - 1) * A_BINS
                + ((a * A_BINS as f32) as usize).min(A_BINS - 1)
        });
        counts[bin] += 1.0;
    }
    let lost = (1.0 - shares.iter().sum::<f64>()).max(0.0);
    let (mut chi, mut bins, mut rest) = (0.0, 0, (0.0, 0.0));
    for (count, share) in counts.iter().zip(shares.iter().chain([&lost])) {
        let expected = share * n as f64;
        // Bins below 20 are pooled: χ² is not χ² there, and the quadrature's own error shows.
        if expected < 20.0 {
            rest = (rest.0 + count, rest.1 + expected);
        } else {
            chi += (count - expected).powi(2) / expected;
            bins += 1;
        }
    }
    if rest.1 >= 20.0 {
        chi += (rest.0 - rest.1).powi(2) / rest.1;
        bins += 1;
    }
    (chi, bins - 1)
}

/// Level: mean + 6 σ of χ² with k degrees, below 1e-6 for each of 36 cases.
fn limit(k: usize) -> f64 {
    k as f64 + 6.0 * (2.0 * k as f64).sqrt()
}

#[test]
fn samples_follow_their_density_and_energy_is_kept() {
    let mut convicted = 0;
    for m in materials() {
        for z in [0.95f32, 0.6, 0.25] {
            let bsdf = Bsdf::new(&m, toward(z, 0.4));
            let (shares, energy) = quadrature(&bsdf);
            let total: f64 = shares.iter().sum();
            assert!(total < 1.005, "{m:?} at {z}: density integrates to {total}");
            // Quadrature and table: half a percent.
            assert!(energy.max_element() <= 1.005, "{m:?} at {z}: energy {energy}");
            if m.specular == 0.0 && m.metallic == 0.0 {
                assert!((total - 1.0).abs() < 1e-3 && (energy.x - 0.9).abs() < 1e-3);
            }
            let (chi, k) = chi_square(&bsdf, &shares, 20_000, 1.0);
            assert!(chi < limit(k), "{m:?} at {z}: χ² {chi} with {k} degrees");
            let (chi, k) = chi_square(&bsdf, &shares, 20_000, 1.3);
            convicted += usize::from(chi > limit(k));
        }
    }
    assert_eq!(convicted, 36, "skewed samples must be noticed");
}

/// Metal alone is reciprocal, and so is Lambert; the layer over Lambert is not, as in Cycles.
#[test]
fn single_lobes_are_reciprocal() {
    for m in materials().into_iter().filter(|m| m.metallic == 1.0 || m.metallic + m.specular == 0.0) {
        for i in 0..200u64 {
            let (a, b) = (
                toward(0.1 + 0.9 * uniform(4 * i), 6.0 * uniform(4 * i + 1)),
                toward(0.1 + 0.9 * uniform(4 * i + 2), 6.0 * uniform(4 * i + 3)),
            );
            let there = Bsdf::new(&m, a).eval(b).0 / b.z;
            let back = Bsdf::new(&m, b).eval(a).0 / a.z;
            // f32: some 10 roundings of D near its peak.
            assert!(
                (there - back).abs().max_element() <= 1e-4 * there.max_element().max(1e-3),
                "{there} {back}"
            );
        }
    }
}
