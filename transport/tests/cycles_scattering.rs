//! Compares materials with Cycles (Blender 5.0.1): a plane in the light of a sun of angle 0.
//!
//! `cycles_scattering.json` has the radiance for three views and three suns each; `cycles_scattering.py` produces it. Such light is only
//! found by light sampling, where one sample is exact, so there is no noise: numbers agree to the precision of f32 and of the tables.

#![allow(clippy::expect_used, reason = "tests")]

use glam::Vec3;
use pumice_scene::Material;
use pumice_transport::bsdf::{Bsdf, emitted};
use serde::Deserialize;

#[derive(Deserialize)]
struct Row {
    material: Material,
    from_inside: bool,
    /// Views outermost; for a sun of 1 W/m².
    sun: Vec<Vec3Array>,
}

type Vec3Array = [f32; 3];

fn toward(z: f32, azimuth: f32) -> Vec3 {
    let s = (1.0 - z * z).sqrt();
    Vec3::new(s * azimuth.cos(), s * azimuth.sin(), z)
}

/// Largest relative difference over all views and suns; expected values below 0.02 count as 0.02.
fn difference(row: &Row, m: &Material) -> f32 {
    let mut worst = 0.0f32;
    let views = [0.95, 0.6, 0.25].map(|z| toward(z, 0.4));
    let suns = [(0.9, 2.0), (0.5, 3.3), (0.3, 0.8)].map(|(z, a)| toward(z, a));
    for (i, expected) in row.sun.iter().enumerate() {
        let (view, sun) = (views[i / 3], suns[i % 3]);
        let seen = m.alpha * (Bsdf::new(m, view, row.from_inside).eval(sun).0 + emitted(m, view.z));
        for (got, expected) in seen.to_array().into_iter().zip(*expected) {
            worst = worst.max((got - expected).abs() / expected.max(0.02));
        }
    }
    worst
}

#[test]
fn materials_scatter_as_in_cycles() {
    let rows: Vec<Row> = serde_json::from_str(include_str!("cycles_scattering.json")).expect("rows");
    assert!(rows.len() > 10);
    let (mut convicted, mut fibres) = (0, 0);
    for row in &rows {
        // Table entries agree to 1e-4, and compensation multiplies by up to 2.
        let off = difference(row, &row.material);
        assert!(off < 5e-4, "{:?}: {off}", row.material);
        // A roughness that is off by 2 % is noticed where it matters, an albedo off by 1 % everywhere except in the reflection of glass.
        let m = Material { base_color: row.material.base_color.map(|c| c * 0.99), ..row.material };
        let seen = difference(row, &m) > 5e-4 || row.material.transmission == 1.0;
        assert!(seen, "{:?}: a darker one goes unseen", row.material);
        let m = Material { roughness: row.material.roughness * 1.02, ..row.material };
        convicted += usize::from(difference(row, &m) > 5e-4);
        // The sheen's roughness too; without sheen it must make no difference.
        let m = Material { sheen_roughness: row.material.sheen_roughness * 0.98, ..row.material };
        let seen = difference(row, &m) > 5e-4;
        assert_eq!(seen, row.material.sheen > 0.0, "{:?}: smoother fibres seen: {seen}", row.material);
        fibres += usize::from(seen);
    }
    assert!(convicted + 1 >= rows.len(), "{convicted} of {} rougher ones noticed", rows.len());
    assert_eq!(fibres, 4, "materials with sheen");
}
