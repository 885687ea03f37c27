//! `bsdf.glsl`.
//!
//! Sums and products of floats, divisions and roots that a device may round by 2.5 units, a sine: numbers agree to 2⁻¹⁷ where nothing
//! cancels. A half vector is off by δ = 2⁻²² when its direction is sampled; the lobe, ∝ (sin² + α² cos²)⁻², then by 2δ/α of itself.

use glam::{DVec3, Vec3};
use pumice_cpu::bsdf::{Bsdf, albedo_table, sample_cosine};
use pumice_scene::Material;
use pumice_vulkan::layout::SceneHeader;

use super::gpu::Gpu;
use super::words::{Random, Reader, Row, close, close_beside};

/// What nothing amplifies.
const PLAIN: f32 = 1.0 / 131_072.0;

/// Schlick's (1 − cos)⁵ is off by up to 5 times a half vector's error where nothing else reflects; a lobe is chosen with a chance of
/// 1/10 at least, so that what it reflects is at most 10 times its density.
const FRESNEL: f32 = 10.0 * 5.0 / 4_194_304.0;

fn material(random: &mut Random) -> Material {
    let mut often = |ends: [f32; 2]| match random.below(4) {
        0 => ends[0],
        1 => ends[1],
        _ => ends[0] + (ends[1] - ends[0]) * random.unit(),
    };
    Material {
        metallic: often([0.0, 1.0]),
        roughness: often([0.0, 1.0]),
        specular: often([0.0, 1.0]),
        ior: often([1.0, 2.5]),
        base_color: [often([0.0, 1.0]), often([0.0, 1.0]), often([0.2, 0.8])],
        ..Material::default()
    }
}

fn upper(random: &mut Random) -> Vec3 {
    let z = if random.below(8) == 0 { 1e-6 } else { random.unit().max(1e-6) };
    let (s, c) = (random.unit() * std::f32::consts::TAU).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * c, r * s, z)
}

/// How far a sampled half vector may be off, in doubles from the formulas of Heitz 2018: the height √(1 − p1² − p2²) is what is left
/// of a subtraction, and stretching back by α turns a normal near the horizon by up to 1/α of its error.
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
    // Where nothing is left, the root of the rounding is.
    let error = rounding + (rounding / height.max(1e-30)).min(rounding.sqrt());
    (error * (alpha / (n.z * n.z + alpha * alpha)).max(1.0)) as f32
}

#[test]
fn surfaces_scatter_alike() {
    let gpu = Gpu::new();
    let table = gpu.buffer_of(albedo_table());
    let scene = gpu.buffer_of(&[SceneHeader { albedo: table.address, ..Default::default() }]);
    let mut random = Random(41);
    let inputs: Vec<_> = (0..60_000)
        .map(|_| {
            let (m, wi) = (material(&mut random), upper(&mut random));
            let mut wo = upper(&mut random);
            if random.below(3) == 0 {
                // Near the mirror direction, where sharp lobes are.
                wo = (Vec3::new(-wi.x, -wi.y, wi.z) + 0.01 * wo).normalize();
            }
            if random.below(50) == 0 {
                wo.z = -wo.z;
            }
            (m, wi, wo, [random.unit(), random.unit()], random.unit())
        })
        .collect();
    let rows: Vec<_> = inputs
        .iter()
        .map(|(m, wi, wo, u, choice)| {
            let numbers = m.base_color.into_iter().chain([m.metallic, m.roughness, m.specular, m.ior]);
            let vectors = wi.to_array().into_iter().chain(wo.to_array());
            let all = numbers.chain(vectors).chain(*u).chain([*choice]);
            let mut row = all.fold(Row::default(), Row::float).0;
            row.resize(19, 0);
            row
        })
        .collect();
    let (mut specular, mut below, mut compared) = (0, 0, 0);
    for ((m, wi, wo, u, choice), row) in inputs.iter().zip(gpu.probe(false, 9, scene.address, &rows, 15)) {
        let bsdf = Bsdf::new(m, *wi);
        let what = || format!("{m:?} wi {wi} wo {wo} u {u:?} choice {choice}");
        let mut r = Reader(&row);
        let alpha = (m.roughness * m.roughness).max(1e-4);
        let lobe = PLAIN + 2.0 * 2f32.powi(-22) / alpha;
        // Evaluated at one direction for both: the half vector is computed alike but for units in the last place.
        let (f, pdf) = bsdf.eval(*wo);
        for e in f.to_array() {
            close_beside(r.float(), e, lobe, FRESNEL * pdf, &what());
        }
        close(r.float(), pdf, lobe, &what());
        // Sampled: the direction within a float's error, density and weight there.
        let got = Vec3::new(r.float(), r.float(), r.float());
        let weight = [r.float(), r.float(), r.float()];
        let got_pdf = r.float();
        match bsdf.sample(*u, *choice) {
            None => {
                below += 1;
                assert!(got_pdf == 0.0 || got.z < 1e-6, "{}: {got} {got_pdf}", what());
            }
            Some(s) => {
                specular += usize::from(s.pdf > 10.0);
                // A mirror doubles the half vector's error.
                let error = 2.0 * half_vector_error(*wi, alpha, *u);
                assert!((got - s.wo).length() < error, "{}: {got} {}", what(), s.wo);
                // What that does to a cosine near the horizon and to the lobe; compared where it is little.
                let relative = PLAIN + 4.0 * error / s.wo.z.max(1e-6) + 4.0 * error / alpha;
                if relative < 0.1 {
                    compared += 1;
                    close(got_pdf, s.pdf, relative, &what());
                    for (w, e) in weight.into_iter().zip(s.weight.to_array()) {
                        close_beside(w, e, relative, FRESNEL, &what());
                    }
                }
            }
        }
        assert_eq!(r.word() != 0, bsdf.has_two_lobes(), "{}", what());
        let cosine = Vec3::new(r.float(), r.float(), r.float());
        assert!((cosine - sample_cosine(*u)).length() < 2f32.powi(-21), "{u:?}: {cosine}");
    }
    assert!(specular > 1_000 && below > 100, "{specular} sharp samples, {below} below the surface");
    assert!(compared > inputs.len() / 2, "{compared} weights compared");
}
