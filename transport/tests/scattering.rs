//! Compares the BSDF with quadrature and counting that share no code with the sampling.

use glam::Vec3;
use pumice_scene::Material;
use pumice_transport::bsdf::Bsdf;
use pumice_transport::bsdf::tables::{SHEEN, SHEEN_ENTRIES, table_2d};

/// Metal, plastic and both, which scatter only above the surface.
fn opaque() -> Vec<Material> {
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

/// Every further lobe, alone and over others.
fn lobes() -> Vec<Material> {
    let base = Material { base_color: [0.9, 0.5, 0.2], roughness: 0.5, ..Material::default() };
    let tint = [0.9, 0.3, 0.5];
    vec![
        Material { specular_tint: tint, specular: 1.0, ..base },
        Material { specular_tint: tint, metallic: 1.0, multiscatter: false, ..base },
        Material { coat: 1.0, coat_roughness: 0.4, coat_tint: tint, ..base },
        Material { coat: 0.5, coat_roughness: 0.6, coat_ior: 2.0, metallic: 1.0, ..base },
        Material { transmission: 1.0, ..base },
        Material { transmission: 0.5, ior: 1.2, roughness: 0.7, multiscatter: false, ..base },
        Material { transmission: 0.7, coat: 0.5, coat_roughness: 0.5, metallic: 0.3, roughness: 0.8, ..base },
        Material { sheen: 1.0, sheen_roughness: 0.3, sheen_tint: tint, specular: 0.0, ..base },
        Material { sheen: 1.0, sheen_roughness: 1.0, base_color: [0.0; 3], specular: 0.0, ..base },
        Material { sheen: 0.7, coat: 0.5, coat_roughness: 0.5, metallic: 0.3, transmission: 0.3, ..base },
    ]
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

/// Bins over the whole sphere.
const Z_BINS: usize = 16;
const A_BINS: usize = 12;
const SUB: usize = 24;

/// Expected shares of the bins by the density's integral, and the integral of f·|cos|.
fn quadrature(bsdf: &Bsdf) -> (Vec<f64>, Vec3) {
    let mut shares = vec![0f64; Z_BINS * A_BINS];
    let mut energy = Vec3::ZERO;
    let (nz, na) = (Z_BINS * SUB, A_BINS * SUB);
    let cell = 4.0 * std::f64::consts::PI / (nz * na) as f64;
    for i in 0..nz {
        for j in 0..na {
            let z = 2.0 * (i as f32 + 0.5) / nz as f32 - 1.0;
            let wo = toward(z, (j as f32 + 0.5) / na as f32 * std::f32::consts::TAU);
            let (f, pdf) = bsdf.eval(wo);
            shares[i / SUB * A_BINS + j / SUB] += f64::from(pdf) * cell;
            energy += f * cell as f32;
        }
    }
    (shares, energy)
}

/// χ² of sampled directions against bins; samples without a direction have a bin of their own.
fn chi_square(bsdf: &Bsdf, shares: &[f64], n: u64, skew: f32) -> (f64, usize) {
    let mut counts = vec![0f64; shares.len() + 1];
    for i in 0..n {
        let u = [uniform(3 * i).powf(skew), uniform(3 * i + 1)];
        let bin = bsdf.sample(u, uniform(3 * i + 2)).map_or(shares.len(), |s| {
            let a = s.wo.y.atan2(s.wo.x).rem_euclid(std::f32::consts::TAU) / std::f32::consts::TAU;
            (((s.wo.z + 1.0) / 2.0 * Z_BINS as f32) as usize).min(Z_BINS - 1) * A_BINS
                + ((a * A_BINS as f32) as usize).min(A_BINS - 1)
        });
        counts[bin] += 1.0;
    }
    let lost = (1.0 - shares.iter().sum::<f64>()).max(0.0);
    let (mut chi, mut bins, mut rest) = (0.0, 0, (0.0, 0.0));
    for (count, share) in counts.iter().zip(shares.iter().chain([&lost])) {
        let expected = share * n as f64;
        // Bins below 20 are pooled: their sum is not distributed as χ², and the quadrature's own error shows.
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

/// Limit: mean + 6 σ of χ² with k degrees of freedom, exceeded with a probability below 1e-6 in each case.
fn limit(k: usize) -> f64 {
    k as f64 + 6.0 * (2.0 * k as f64).sqrt()
}

#[test]
fn samples_follow_their_density_and_energy_is_kept() {
    let (mut convicted, mut cases) = (0, 0);
    for m in opaque().into_iter().chain(lobes()) {
        for (z, from_inside) in [(0.95f32, false), (0.6, false), (0.25, false), (0.95, true), (0.6, true)] {
            if from_inside && m.transmission == 0.0 {
                continue;
            }
            let bsdf = Bsdf::new(&m, toward(z, 0.4), from_inside);
            let what = || format!("{m:?} at {z}, from inside: {from_inside}");
            let (shares, energy) = quadrature(&bsdf);
            let total: f64 = shares.iter().sum();
            assert!(total < 1.005, "{}: density integrates to {total}", what());
            // Precision of quadrature and tables: half a percent.
            assert!(energy.max_element() <= 1.005, "{}: energy {energy}", what());
            if m.specular == 0.0 && m.metallic == 0.0 && m.sheen == 0.0 {
                assert!((total - 1.0).abs() < 1e-3 && (energy.x - 0.9).abs() < 1e-3);
            }
            let (chi, k) = chi_square(&bsdf, &shares, 20_000, 1.0);
            assert!(chi < limit(k), "{}: χ² {chi} with {k} degrees", what());
            let (chi, k) = chi_square(&bsdf, &shares, 20_000, 1.3);
            convicted += usize::from(chi > limit(k));
            cases += 1;
        }
    }
    assert_eq!(convicted, cases, "skewed samples must be noticed");
}

/// Mean weight of samples: the reflected share of uniform light.
fn furnace(bsdf: &Bsdf, n: u64) -> f64 {
    let sides = (n as f64).sqrt() as u64;
    let weights = (0..sides * sides).map(|i| {
        let u = [i % sides, i / sides].map(|c| (c as f32 + 0.5) / sides as f32);
        bsdf.sample(u, uniform(i)).map_or(0.0, |s| f64::from(s.weight.x))
    });
    weights.sum::<f64>() / (sides * sides) as f64
}

/// With multiple scattering, white metal and white glass keep all light; with single scattering, rough ones lose some.
#[test]
fn white_surfaces_lose_nothing() {
    for roughness in [0.0f32, 1e-4, 0.1, 0.35, 0.6, 0.8, 1.0] {
        for z in [1.0f32, 0.7, 0.3] {
            let metal = Material { base_color: [1.0; 3], metallic: 1.0, roughness, ..Material::default() };
            let glass = Material { metallic: 0.0, transmission: 1.0, ..metal };
            // Tables are interpolated linearly: 32 entries for metal, 16 for glass, whose random choice also adds noise.
            for (m, tolerance) in [(metal, 0.003), (glass, 0.01)] {
                let all = furnace(&Bsdf::new(&m, toward(z, 0.4), false), 40_000);
                assert!((all - 1.0).abs() < tolerance, "{m:?} at {z}: {all}");
                let once = Material { multiscatter: false, ..m };
                let once = furnace(&Bsdf::new(&once, toward(z, 0.4), false), 40_000);
                let lost = if roughness >= 0.6 { 0.015 } else { 0.0 };
                assert!(once < 1.0 + tolerance - lost, "{m:?} at {z}: {once} of one scattering");
            }
        }
    }
}

/// No sample is NaN, infinite or negative, however sharp the lobe, large the index or grazing the angle.
#[test]
fn extremes_stay_finite() {
    let mut scattered = 0;
    for (i, ior) in [1.0f32, 1.000_01, 1.0001, 1.5, 3.0].into_iter().enumerate() {
        for roughness in [0.0f32, 1e-4, 0.004, 0.01, 0.5, 1.0] {
            for (metallic, transmission, coat, sheen) in [
                (0.0, 0.0, 0.0, 0.0),
                (1.0, 0.0, 0.0, 0.0),
                (0.0, 1.0, 0.0, 0.0),
                (0.3, 0.5, 1.0, 0.0),
                (0.0, 0.0, 1.0, 0.0),
                (0.0, 0.0, 0.0, 1.0),
                (0.3, 0.5, 0.5, 0.5),
            ] {
                let m = Material {
                    ior,
                    coat_ior: ior,
                    roughness,
                    coat_roughness: roughness,
                    metallic,
                    transmission,
                    coat,
                    sheen,
                    sheen_roughness: roughness,
                    base_color: [1.0, 0.5, 0.0],
                    coat_tint: [1.0, 0.5, 0.0],
                    ..Material::default()
                };
                for z in [1.0f32, 0.5, 1e-3, 1e-6] {
                    for from_inside in [false, true] {
                        let bsdf = Bsdf::new(&m, toward(z, 1.0), from_inside);
                        for k in 0..40u64 {
                            let (a, b, c) =
                                (uniform(3 * k + i as u64), uniform(3 * k + 1), uniform(3 * k + 2));
                            let Some(s) = bsdf.sample([a, b], c) else { continue };
                            let what = || format!("{m:?} at {z}, from inside {from_inside}: {s:?}");
                            assert!(s.weight.is_finite() && s.weight.min_element() >= 0.0, "{}", what());
                            assert!((s.wo.length() - 1.0).abs() < 1e-4 && s.pdf > 0.0, "{}", what());
                            let (f, pdf) = bsdf.eval(s.wo);
                            assert!(f.is_finite() && f.min_element() >= 0.0, "{}: {f}", what());
                            assert!(pdf >= 0.0 && pdf.is_finite(), "{}: {pdf}", what());
                            scattered += 1;
                        }
                    }
                }
            }
        }
    }
    assert!(scattered > 20_000, "{scattered}");
}

/// Metal alone is reciprocal under single scattering, and so is Lambert. The layer over Lambert is not, nor is Cycles' term for multiple
/// scattering, nor sheen, whose lobe is fitted for one direction at a time.
#[test]
fn single_lobes_are_reciprocal() {
    for m in opaque().into_iter().filter(|m| m.metallic == 1.0 || m.metallic + m.specular == 0.0) {
        let m = Material { multiscatter: false, ..m };
        for i in 0..200u64 {
            let (a, b) = (
                toward(0.1 + 0.9 * uniform(4 * i), 6.0 * uniform(4 * i + 1)),
                toward(0.1 + 0.9 * uniform(4 * i + 2), 6.0 * uniform(4 * i + 3)),
            );
            let there = Bsdf::new(&m, a, false).eval(b).0 / b.z;
            let back = Bsdf::new(&m, b, false).eval(a).0 / a.z;
            // f32: about 10 roundings of D near its peak.
            assert!(
                (there - back).abs().max_element() <= 1e-4 * there.max_element().max(1e-3),
                "{there} {back}"
            );
        }
    }
}

/// A sheen of white fibres over black reflects the share in its table, all other light is kept; over white nothing is gained.
#[test]
fn sheen_takes_off_what_it_reflects() {
    let fibres = Material { sheen: 1.0, specular: 0.0, base_color: [0.0; 3], ..Material::default() };
    let mut seen = 0.0f64;
    for sheen_roughness in [0.0f32, 0.2, 0.5, 1.0] {
        for z in [1.0f32, 0.7, 0.3, 0.05] {
            let reflected = |m: Material| {
                furnace(&Bsdf::new(&Material { sheen_roughness, ..m }, toward(z, 0.4), false), 40_000)
            };
            let roughness = sheen_roughness.max(1e-3);
            let table = f64::from(table_2d(SHEEN + 2 * SHEEN_ENTRIES, 32, z, roughness));
            let alone = reflected(fibres);
            // Every sample has the same weight, so only rounding remains.
            assert!((alone - table).abs() < 1e-4, "{sheen_roughness} at {z}: {alone}, of the table {table}");
            let half = reflected(Material { sheen_tint: [0.5; 3], ..fibres });
            assert!((half - table / 2.0).abs() < 1e-4, "{sheen_roughness} at {z}: {half} of half");
            // White Lambert below: 40,000 choices, each of a weight within 0.1 of 1.
            let white = reflected(Material { base_color: [1.0; 3], ..fibres });
            assert!((white - 1.0).abs() < 2e-3, "{sheen_roughness} at {z}: {white} of white");
            seen = seen.max(table);
        }
    }
    assert!(seen > 0.5, "no fibres were seen: {seen}");
}
