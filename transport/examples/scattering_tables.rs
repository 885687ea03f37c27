//! Computes `transport/src/bsdf/tables.bin`: the albedos of GGX surfaces by angle and roughness.
//!
//! ```text
//! cargo run -p pumice-transport --example scattering_tables -- transport/src/bsdf/tables.bin     (minutes)
//! ```
//! `bsdf/tables.rs` describes the grids. An entry is an integral over the normals visible from one direction (Heitz 2018, JCGT 7(4)), by
//! the midpoint rule in f64; the integrand is even in the azimuth, so half of the disk is enough. `transport/tests/scattering_tables.rs`
//! recomputes some of the entries over outgoing directions instead.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a tool: it stops at the first fault")]

use std::f64::consts::PI;

use rayon::prelude::*;

/// Points along each side of the disk.
const POINTS: u32 = 256;

/// Number of cosines of an average, and points for each.
const COSINES: u32 = 64;
const POINTS_OF_AVERAGE: u32 = 192;

/// Unpolarised reflectance, and the cosine of the refracted direction if there is one (Born and Wolf, *Principles of Optics*, §1.5.2).
fn fresnel(cos: f64, eta: f64) -> (f64, Option<f64>) {
    let sin2_t = (1.0 - cos * cos) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, None);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let s = (cos - eta * cos_t) / (cos + eta * cos_t);
    let p = (eta * cos - cos_t) / (eta * cos + cos_t);
    ((s * s + p * p) / 2.0, Some(cos_t))
}

/// Smith's Λ of GGX.
fn lambda(alpha: f64, cos: f64) -> f64 {
    ((1.0 + alpha * alpha * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0) / 2.0
}

/// Mean of `f(z of h, cosine of h with wi)` over the normals h that are visible from a direction of cosine `mu`.
fn over_visible_normals(mu: f64, alpha: f64, points: u32, f: impl Fn(f64, f64) -> f64) -> f64 {
    // wi = (sin, 0, mu), stretched to v = (x, 0, z). The disk's axes are y and (−z, 0, x).
    let sin = (1.0 - mu * mu).sqrt();
    let length = (alpha * alpha * sin * sin + mu * mu).sqrt();
    let (x, z) = (alpha * sin / length, mu / length);
    let lift = 0.5 * (1.0 + z);
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..points {
        // Denser towards the disk's rim, where GGX has its long tail: u = 1 − x⁴.
        let rim = (f64::from(i) + 0.5) / f64::from(points);
        let (r, density) = ((1.0 - rim.powi(4)).sqrt(), 4.0 * rim.powi(3));
        weights += density * f64::from(points);
        for j in 0..points {
            let (s, c) = (PI * ((f64::from(j) + 0.5) / f64::from(points) - 0.5)).sin_cos();
            let p1 = r * c;
            let p2 = (1.0 - lift) * (1.0 - p1 * p1).sqrt() + lift * r * s;
            let up = (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt();
            let h = [alpha * (x * up - z * p2), alpha * p1, (x * p2 + z * up).max(0.0)];
            let length = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            sum += density * f(h[2] / length, (sin * h[0] + mu * h[2]) / length);
        }
    }
    sum / weights
}

/// Albedo of reflection by perfectly mirroring microfacets: the light that is not shadowed.
fn reflected(alpha: f64, mu: f64, points: u32) -> f64 {
    let here = 1.0 + lambda(alpha, mu);
    over_visible_normals(mu, alpha, points, |h_z, cos| {
        let out = 2.0 * cos * h_z - mu;
        if out > 0.0 { here / (here + lambda(alpha, out)) } else { 0.0 }
    })
}

/// Albedo of reflection and refraction together.
fn through_glass(alpha: f64, mu: f64, eta: f64, points: u32) -> f64 {
    let here = 1.0 + lambda(alpha, mu);
    over_visible_normals(mu, alpha, points, |h_z, cos| {
        let (f, refraction) = fresnel(cos, eta);
        let up = 2.0 * cos * h_z - mu;
        let up = if up > 0.0 { f * here / (here + lambda(alpha, up)) } else { 0.0 };
        // Walter et al. 2007, eq. 40. An index of 1 changes no direction and nothing is shadowed then. From inside, Cycles' tables also
        // count refractions that end on the wrong side of the surface: the light that they lose is not compensated.
        let passed = refraction.map_or(0.0, |cos_t| {
            let down = (cos / eta - cos_t) * h_z - mu / eta;
            let shadow = if (eta - 1.0).abs() < 1e-4 { 1.0 } else { here / (here + lambda(alpha, down)) };
            (1.0 - f) * shadow
        });
        up + passed
    })
}

/// Average position of the reflectance between its value at normal incidence and 1, without shadowing.
fn fresnel_share(alpha: f64, mu: f64, eta: f64) -> f64 {
    let f0 = fresnel(1.0, eta).0;
    over_visible_normals(mu, alpha, POINTS, |h_z, cos| {
        if 2.0 * cos * h_z - mu > 0.0 {
            ((fresnel(cos, eta).0 - f0) / (1.0 - f0)).clamp(0.0, 1.0)
        } else {
            0.0
        }
    })
}

/// Average over the cosine-weighted hemisphere, at the middles of steps in μ², where 2μ dμ is uniform.
fn average(f: impl Fn(f64) -> f64) -> f64 {
    let cosine = |i: u32| ((f64::from(i) + 0.5) / f64::from(COSINES)).sqrt();
    (0..COSINES).map(|i| f(cosine(i))).sum::<f64>() / f64::from(COSINES)
}

/// Coordinate of entry `i` of `n`, from 0 to 1; clamped away from 0 where a division by 0 would follow.
fn place(i: usize, n: usize) -> f64 {
    (i as f64 / (n - 1) as f64).clamp(1e-4, 1.0)
}

/// Index of refraction at a table coordinate: its reflectance at normal incidence is the coordinate to the 4th power.
fn index_at(place: f64) -> f64 {
    let root = if place <= 1e-4 { 0.0 } else { place.min(0.99).powi(2) };
    (1.0 + root) / (1.0 - root)
}

/// All entries of `[z][y][x]`, x fastest.
fn grid(x: usize, y: usize, z: usize, f: impl Fn(f64, f64, f64) -> f64 + Sync) -> Vec<f32> {
    let entries = (0..x * y * z).into_par_iter().map(|i| {
        let (a, b, c) = (place(i % x, x), place(i / x % y, y.max(2)), place(i / (x * y), z.max(2)));
        f(a, b, c).clamp(0.0, 1.0) as f32
    });
    entries.collect()
}

fn main() {
    let path = std::env::args().nth(1).expect("where to write the tables");
    let alpha = |roughness: f64| roughness * roughness;
    let tables = [
        grid(32, 32, 1, |r, mu, _| reflected(alpha(r), mu, POINTS)),
        grid(32, 1, 1, |r, _, _| average(|mu| reflected(alpha(r), mu, POINTS_OF_AVERAGE))),
        grid(16, 16, 16, |r, mu, z| fresnel_share(alpha(r), mu, index_at(z))),
        grid(16, 16, 16, |r, mu, z| through_glass(alpha(r), mu, index_at(z), POINTS)),
        grid(16, 16, 1, |r, z, _| average(|mu| through_glass(alpha(r), mu, index_at(z), POINTS_OF_AVERAGE))),
        grid(16, 16, 16, |r, mu, z| through_glass(alpha(r), mu, 1.0 / index_at(z), POINTS)),
        grid(16, 16, 1, |r, z, _| {
            average(|mu| through_glass(alpha(r), mu, 1.0 / index_at(z), POINTS_OF_AVERAGE))
        }),
    ];
    let bytes: Vec<u8> = tables.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(path, bytes).expect("the tables written");
}
