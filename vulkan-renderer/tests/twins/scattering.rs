//! Tests `bsdf.glsl`, and with it `fresnel.glsl`, `ggx.glsl`, `tables.glsl`, `sheen.glsl` and `coat.glsl`.
//!
//! These use sums and products of floats, divisions and roots that a device may round by 2.5 units, and a sine: numbers agree to 2⁻¹⁷ where
//! nothing cancels. A half vector is off by δ = 2⁻²² when its direction is sampled; the lobe, ∝ (sin² + α² cos²)⁻², then has a relative
//! error of 2δ/α.

use glam::{DVec3, Vec3};
use pumice_scene::Material;
use pumice_transport::bsdf::tables::{SHEEN, TABLES, table_2d};
use pumice_transport::bsdf::{Bsdf, LEAST_ALPHA_SQUARED, LEAST_BEND, emitted, sample_cosine};
use pumice_vulkan::layout::SceneHeader;

use super::gpu::Gpu;
use super::words::{Random, Reader, Row, close, close_beside};

/// Tolerance where nothing amplifies errors.
const PLAIN: f32 = 1.0 / 131_072.0;

/// Schlick's (1 − cos)⁵ is off by up to 5 times a half vector's error where nothing else reflects. A lobe is chosen with a probability of
/// at least 1/10, so what it reflects is at most 10 times its density.
const FRESNEL: f32 = 10.0 * 5.0 / 4_194_304.0;

fn material(random: &mut Random) -> Material {
    let mut often = |ends: [f32; 2]| match random.below(4) {
        0 => ends[0],
        1 => ends[1],
        _ => ends[0] + (ends[1] - ends[0]) * random.unit(),
    };
    let m = Material {
        metallic: often([0.0, 1.0]),
        roughness: often([0.0, 1.0]),
        specular: often([0.0, 1.0]),
        ior: often([1.0, 2.5]),
        base_color: [often([0.0, 1.0]), often([0.0, 1.0]), often([0.2, 0.8])],
        specular_tint: [often([0.0, 1.0]), often([0.5, 1.0]), often([0.2, 0.8])],
        transmission: often([0.0, 1.0]),
        coat: often([0.0, 1.0]),
        coat_roughness: often([0.0, 1.0]),
        // Not down to 1: there the colour's exponent reaches 1,000 at grazing angles, and the error of GLSL's `pow` grows with it.
        coat_ior: often([1.2, 2.5]),
        coat_tint: [often([0.2, 1.0]), often([0.5, 1.0]), 1.0],
        sheen: often([0.0, 1.0]),
        sheen_roughness: often([0.0, 1.0]),
        sheen_tint: [often([0.0, 1.0]), often([0.5, 1.0]), 1.0],
        emission: [often([0.0, 1.0]), 0.5, 0.0],
        ..Material::default()
    };
    let multiscatter = random.below(2) == 0;
    // Mostly one part alone: all together would hide errors of each.
    let (bare, smooth, plain) = (random.below(2) == 0, random.below(2) == 0, random.below(3));
    Material {
        multiscatter,
        coat: if bare { 0.0 } else { m.coat },
        sheen: if smooth { 0.0 } else { m.sheen },
        transmission: if plain == 0 { 0.0 } else { m.transmission },
        metallic: if plain == 1 { 0.0 } else { m.metallic },
        ..m
    }
}

/// Refractive index beyond the surface over that before it.
fn eta_of(m: &Material, from_inside: bool) -> f32 {
    if from_inside { 1.0 / m.ior } else { m.ior }
}

/// Tolerance of a reflectance near the critical angle of total reflection, where the curve is a square root of the distance to that angle.
fn bend_error(cos: f32, eta: f32) -> f32 {
    2f32.powi(-20) / (eta * eta - 1.0 + cos * cos).abs().sqrt().max(1e-6)
}

/// Relative tolerance of what passes through near that angle: 1 minus the reflectance is in proportion to the root there, whose square is
/// off by some units in the last place of 1, more where a device fuses products and sums.
fn pass_error(cos: f32, eta: f32) -> f32 {
    2f32.powi(-21) / (eta * eta - 1.0 + cos * cos).abs().max(1e-6)
}

fn upper(random: &mut Random) -> Vec3 {
    let z = if random.below(8) == 0 { 1e-6 } else { random.unit().max(1e-6) };
    let (s, c) = (random.unit() * std::f32::consts::TAU).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * c, r * s, z)
}

/// Tolerance of a sampled half vector, in doubles, from the formulas of Heitz 2018. The height √(1 − p1² − p2²) is the result of a
/// subtraction, and stretching back by α turns a normal near the horizon by up to 1/α of its error.
fn half_vector_error(wi: Vec3, alpha: f32, u: [f32; 2]) -> f32 {
    let (wi, alpha) = (wi.as_dvec3(), f64::from(alpha));
    let v = DVec3::new(alpha * wi.x, alpha * wi.y, wi.z).normalize();
    let across = DVec3::Z.cross(v);
    let t1 = if across.length_squared() > 0.0 { across.normalize() } else { DVec3::X };
    let (r, phi) = (f64::from(u[0]).sqrt(), std::f64::consts::TAU * f64::from(u[1]));
    let (p1, s) = (r * phi.cos(), 0.5 * (1.0 + v.z));
    let p2 = (1.0 - s) * (1.0 - p1 * p1).max(0.0).sqrt() + s * r * phi.sin();
    let height = (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt();
    let n = t1 * p1 + v.cross(t1) * p2 + v * height;
    let rounding = 2f64.powi(-22);
    // Where the difference vanishes, the error is the root of the rounding error.
    let error = rounding + (rounding / height.max(1e-30)).min(rounding.sqrt());
    (error * (alpha / (n.z * n.z + alpha * alpha)).max(1.0)) as f32
}

struct Input {
    m: Material,
    inside: bool,
    wi: Vec3,
    wo: Vec3,
    u: [f32; 2],
    choice: f32,
}

impl Input {
    fn new(random: &mut Random) -> Self {
        let (m, inside, wi) = (material(random), random.below(2) == 0, upper(random));
        let eta = eta_of(&m, inside);
        let mut wo = upper(random);
        match random.below(6) {
            // Near the mirror direction, where sharp lobes are.
            0 | 1 => wo = (Vec3::new(-wi.x, -wi.y, wi.z) + 0.01 * wo).normalize(),
            // Near the refracted direction.
            2 => {
                let down = (1.0 - (1.0 - wi.z * wi.z) / (eta * eta)).max(0.0).sqrt();
                wo = (Vec3::new(-wi.x / eta, -wi.y / eta, -down) + 0.1 * wo).normalize();
            }
            3 => wo.z = -wo.z,
            _ => {}
        }
        Self { m, inside, wi, wo, u: [random.unit(), random.unit()], choice: random.unit() }
    }

    fn row(&self) -> Vec<u32> {
        let m = &self.m;
        let colors =
            [m.base_color, m.specular_tint, m.coat_tint, m.emission, m.sheen_tint].into_iter().flatten();
        let numbers = [
            m.metallic,
            m.roughness,
            m.specular,
            m.ior,
            m.transmission,
            m.coat,
            m.coat_roughness,
            m.coat_ior,
            m.sheen,
            m.sheen_roughness,
        ];
        let mut row = colors.chain(numbers).fold(Row::default(), Row::float).0;
        row.extend([u32::from(m.multiscatter), u32::from(self.inside)]);
        let vectors = self.wi.to_array().into_iter().chain(self.wo.to_array());
        row.extend(vectors.chain(self.u).chain([self.choice]).fold(Row::default(), Row::float).0);
        row
    }
}

#[test]
fn surfaces_scatter_alike() {
    let gpu = Gpu::new();
    let table = gpu.buffer_of(&TABLES);
    let scene = gpu.buffer_of(&[SceneHeader { tables: table.address, ..Default::default() }]);
    let mut random = Random(41);
    let inputs: Vec<_> = (0..60_000).map(|_| Input::new(&mut random)).collect();
    let rows: Vec<_> = inputs.iter().map(Input::row).collect();
    let (mut specular, mut lost, mut below, mut mirrors, mut compared, mut other) = (0, 0, 0, 0, 0, 0);
    let (mut shared, mut fibrous) = (0, 0);
    for (input, row) in inputs.iter().zip(gpu.probe(false, 9, scene.address, &rows, 29)) {
        let Input { m, inside, wi, wo, u, choice } = input;
        let bsdf = Bsdf::new(m, *wi, *inside);
        let what = || format!("{m:?} inside {inside} wi {wi} wo {wo} u {u:?} choice {choice}");
        let mut r = Reader(&row);
        let base = (m.roughness * m.roughness).max(LEAST_ALPHA_SQUARED.sqrt());
        let coat = (m.coat_roughness * m.coat_roughness).max(LEAST_ALPHA_SQUARED.sqrt());
        let alpha = if m.coat > 0.0 { base.min(coat) } else { base };
        let eta = eta_of(m, *inside);
        // How narrow the sheen's lobe is. A of its matrix is the smallest length that is normalised when the lobe is sampled, and the
        // smallest divisor of its density.
        let fibres = if m.sheen > 0.0 {
            table_2d(SHEEN, 32, wi.z, m.sheen_roughness.max(1e-3)).max(1e-5)
        } else {
            1.0
        };

        // Evaluated at one direction for both sides. The half vector is equal up to units in the last place; through the surface it is the
        // difference of two vectors of lengths 1 and η.
        let half = if wo.z > 0.0 { *wi + *wo } else { *wi + eta * *wo };
        let short = half.length().clamp(1e-6, 1.0);
        let cos = wi.dot(half) / half.length().max(1e-6);
        let bend = bend_error(cos, eta);
        let pass = if wo.z < 0.0 { pass_error(cos, eta) } else { 0.0 };
        let lobe =
            PLAIN + (4.0 / alpha + 8.0) * 2f32.powi(-22) / short + bend + pass + 2f32.powi(-20) / fibres;
        let (f, pdf) = bsdf.eval(*wo);
        let (got_f, got_pdf) = ([r.float(), r.float(), r.float()], r.float());
        // At an index of refraction of 1 nothing is reflected but the square of a rounding error, times the lobe's height. (Division on a
        // device may be off by 2.5 units in the last place.)
        let nothing = 2f32.powi(-40) / (alpha * alpha);
        if lobe < 0.1 {
            for (g, e) in got_f.into_iter().zip(f.to_array()) {
                close_beside(g, e, lobe, (FRESNEL + bend) * pdf + nothing, &what());
            }
            close_beside(got_pdf, pdf, lobe, nothing, &what());
        }

        // Sampled: the direction is within a float's error; density and weight are compared at it.
        let got = Vec3::new(r.float(), r.float(), r.float());
        let weight = Vec3::new(r.float(), r.float(), r.float());
        let got_pdf = r.float();
        match bsdf.sample(*u, *choice) {
            None => {
                lost += 1;
                assert!(got_pdf == 0.0 || got.z.abs() < 1e-5, "{}: {got} {got_pdf}", what());
            }
            // The choice was within a rounding error of the probability, so the other lobe was taken.
            Some(s) if (got.z > 0.0) != (s.wo.z > 0.0) || s.pdf.is_infinite() != got_pdf.is_infinite() => {
                other += 1
            }
            Some(s) => {
                specular += usize::from(s.pdf > 10.0);
                below += usize::from(s.wo.z < 0.0);
                let through = s.wo.z < 0.0;
                let is_mirror = s.pdf.is_infinite();
                mirrors += usize::from(is_mirror);
                // A mirror reflection doubles the half vector's error. Which of two lobes was drawn is unknown here, so the larger error
                // counts.
                let of = |a: f32| half_vector_error(*wi, a, *u);
                let error = if is_mirror && (eta - 1.0).abs() >= LEAST_BEND {
                    2f32.powi(-20)
                } else {
                    2.0 * of(base).max(of(coat)).max(2f32.powi(-22) / fibres)
                };
                let bend = bend_error(1.0, eta).max(2f32.powi(-20) / s.wo.z.abs().max(1e-6));
                let turned = if through { error * (1.0 + 1.0 / eta) + bend } else { error };
                // Two vectors are normalised on the way, by divisions that a device may get wrong by 2.5 units in the last place each, and
                // reflecting doubles that: 10·2⁻²³, beside what lavapipe rounds. (A card was off by 1.24·10⁻⁶.)
                assert!((got - s.wo).length() < turned.max(2f32.powi(-19)), "{}: {got} {}", what(), s.wo);
                // What that does to a cosine near the horizon and to the lobe. Compared only where it is small.
                let cos = if through {
                    ((eta * s.wo + *wi).normalize()).dot(*wi)
                } else {
                    ((s.wo + *wi).normalize()).dot(*wi)
                };
                let sharp = if is_mirror { 0.0 } else { 4.0 * error / alpha.min(fibres) };
                let close_to_one =
                    if through && !is_mirror { error / (eta - 1.0).abs().max(1e-6) } else { 0.0 };
                let relative = PLAIN
                    + 4.0 * error / s.wo.z.abs().max(1e-6)
                    + sharp
                    + 8.0 * close_to_one
                    + bend_error(cos, eta) * (1.0 + error * 2f32.powi(20))
                    + if through { pass_error(cos, eta) } else { 0.0 };
                if relative < 0.1 {
                    compared += 1;
                    fibrous += usize::from(m.sheen > 0.5 && m.sheen_roughness > 0.2 && wi.z < 0.7);
                    if !is_mirror {
                        close(got_pdf, s.pdf, relative, &what());
                    }
                    for (w, e) in weight.to_array().into_iter().zip(s.weight.to_array()) {
                        close_beside(w, e, relative, FRESNEL, &what());
                    }
                }
            }
        }
        let cosine = Vec3::new(r.float(), r.float(), r.float());
        assert!((cosine - sample_cosine(*u)).length() < 2f32.powi(-21), "{u:?}: {cosine}");
        for e in emitted(m, wi.z).to_array() {
            close(r.float(), e, PLAIN, &what());
        }

        // The diffuse part is off by as much as f, relative to f. Where f is 0 on one side, that is all of it.
        let share = bsdf.diffuse_share(*wo, f).to_array();
        for ((e, f), got_f) in share.into_iter().zip(f.to_array()).zip(got_f) {
            let g = r.float();
            let error = lobe + (FRESNEL + bend) * pdf / f;
            if error < 0.1 && got_f > 0.0 {
                shared += usize::from(e > 0.01 && e < 0.99);
                close_beside(g, e, PLAIN, error, &what());
            }
        }
        // One minus a reflected part: beside the relative error it has one relative to the whole, which multiple scattering may raise by
        // some units.
        for e in bsdf.colors(m).into_iter().flat_map(|c| c.to_array()) {
            close_beside(r.float(), e, PLAIN, 4.0 * PLAIN, &what());
        }
    }
    let counts = format!("{specular} sharp, {lost} lost, {below} through, {mirrors} mirrored, {other} other");
    assert!(specular > 1_000 && lost > 100 && below > 1_000 && mirrors > 1_000, "{counts}");
    assert!(other < 60, "{counts}");
    assert!(shared > 1_000, "{shared} mixtures");
    assert!(compared > inputs.len() / 3, "{compared} weights compared; {counts}");
    assert!(fibrous > 3_000, "{fibrous} weights with sheen compared");
}
