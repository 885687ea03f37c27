//! White furnaces: scenes whose picture is known exactly, each mean within 0.1 %.

#![allow(clippy::expect_used, reason = "test helpers: a failure is a failed test")]

mod naive;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use naive::Dense;
use pumice_core::Job;
use pumice_cpu::{Lights, Looks, PathTracer, Sky, Surroundings};
use pumice_render::Tracer;
use pumice_scene::{Camera, Film, Filter, Material, Projection, Settings};

fn lambert(albedo: f32, emission: f32) -> Material {
    Material { base_color: [albedo; 3], specular: 0.0, emission: [emission; 3], ..Material::default() }
}

fn camera(from: DVec3, to: DVec3, fov_rad: f64) -> Camera {
    let z = (from - to).normalize();
    let x = DVec3::Z.cross(z).normalize();
    let matrix = DMat3::from_cols(x, z.cross(x), z);
    Camera {
        world_from_camera: DAffine3::from_mat3_translation(matrix, from),
        projection: Projection::Perspective { fov_rad },
        shift: [0.0; 2],
        clip: [0.0, f64::MAX],
    }
}

const FILM: Film = Film { width: 32, height: 32, filter: Filter::Box { width: 1.0 } };

/// Mean of channel 0 over the pixels whose middle hits something.
fn mean(dense: Dense, material: Material, sky: f32, settings: Settings, camera: Camera, spp: u32) -> f64 {
    let around = Surroundings {
        lights: Lights::new(Sky::Constant(Vec3::splat(sky)), Vec::new(), None).into(),
        looks: vec![Looks::same(material).into()],
        settings,
    };
    let mut tracer = PathTracer::new(dense, around, &camera, &FILM);
    tracer.add_samples(spp, &Job::new()).expect("nobody cancels");
    let image = tracer.film().mean();
    let (mut sum, mut n) = (0.0, 0.0);
    for y in 0..32 {
        for x in 0..32 {
            let inside = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].iter().all(|&(cx, cy)| {
                let (ray, t_max) = tracer.rays().ray(f64::from(cx), f64::from(cy));
                tracer.tracer().first_hit(&ray, pumice_render::PathOrigin::Free, t_max).is_some()
            });
            if inside {
                sum += f64::from(image.pixels[(y * 32 + x) as usize][0]);
                n += 1.0;
            }
        }
    }
    assert!(n > 100.0, "the camera sees {n} pixels of the shape");
    sum / n
}

/// A shape full of pits and tunnels.
fn sponge() -> Dense {
    Dense::new([12, 12, 12], |[x, y, z]| u32::from((x * 7 + y * 5 + z * 3 + x * y + y * z) % 5 < 3))
}

fn cube() -> Dense {
    Dense::new([8, 8, 8], |_| 1)
}

fn cavity() -> Dense {
    Dense::new([10, 8, 9], |v| u32::from((0..3).any(|a| v[a] == 0 || v[a] == [9, 7, 8][a]) || v == [3, 3, 3]))
}

fn outside() -> Camera {
    camera(DVec3::new(24.0, -16.0, 20.0), DVec3::splat(5.0), 0.35)
}

fn inside() -> Camera {
    camera(DVec3::new(7.3, 5.2, 5.1), DVec3::new(1.0, 1.5, 2.0), 1.2)
}

#[test]
fn open_world_of_white_is_one() {
    for russian_roulette in [false, true] {
        let settings = Settings { bounces: 1_000_000, russian_roulette, ..Settings::default() };
        let m = mean(sponge(), lambert(1.0, 0.0), 1.0, settings, outside(), 16);
        assert!((m - 1.0).abs() < 1e-3, "roulette {russian_roulette}: {m}");
    }
    // The check notices a bound on bounces.
    let settings = Settings { bounces: 1, ..Settings::default() };
    assert!(mean(sponge(), lambert(1.0, 0.0), 1.0, settings, outside(), 16) < 0.99);
}

#[test]
fn convex_body_shows_its_albedo() {
    for albedo in [0.2f32, 0.7] {
        let m = mean(cube(), lambert(albedo, 0.0), 1.0, Settings::default(), outside(), 16);
        assert!((m / f64::from(albedo) - 1.0).abs() < 1e-3, "{albedo}: {m}");
    }
}

/// With `bounces` B as in Cycles, B + 1 vertices scatter and the last ray still collects emission: N = B + 1 scatterings make
/// 1 + a + … + aᴺ = (1 − aᴺ⁺¹) / (1 − a).
#[test]
fn cavity_is_a_geometric_sum() {
    for (bounces, albedo) in [(0u32, 0.5f64), (1, 0.9), (3, 0.8), (31, 0.5)] {
        let exact = (1.0 - albedo.powi(bounces as i32 + 2)) / (1.0 - albedo);
        for russian_roulette in [false, true] {
            let settings = Settings { bounces, russian_roulette, ..Settings::default() };
            let m = mean(cavity(), lambert(albedo as f32, 1.0), 7.0, settings, inside(), 256);
            assert!(
                (m / exact - 1.0).abs() < 1e-3,
                "{bounces} bounces, roulette {russian_roulette}: {m} for {exact}"
            );
        }
    }
}

/// Under an even sky of 1 nothing is brighter than 1. Single-scatter GGX of roughness 1 keeps some 45 %: more than 40 % is asked.
#[test]
fn glossy_bodies_never_give_more_than_they_get() {
    for roughness in [0.0f32, 0.3, 1.0] {
        for metallic in [0.0f32, 1.0] {
            let m = Material { base_color: [1.0; 3], roughness, metallic, ..Material::default() };
            let m = mean(cube(), m, 1.0, Settings::default(), outside(), 64);
            assert!(m < 1.002 && m > 0.4, "roughness {roughness}, metallic {metallic}: {m}");
        }
    }
}

#[test]
fn threads_and_slices_do_not_change_the_picture() {
    let picture = |threads: usize, steps: &[u32]| {
        let around = Surroundings {
            lights: Lights::new(Sky::Constant(Vec3::ONE), Vec::new(), None).into(),
            looks: vec![Looks::same(Material::default()).into()],
            settings: Settings::default(),
        };
        let mut tracer = PathTracer::new(sponge(), around, &outside(), &FILM);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            steps.iter().for_each(|&s| tracer.add_samples(s, &Job::new()).expect("nobody cancels"))
        });
        tracer.film().mean()
    };
    let one = picture(1, &[7]);
    assert_eq!(one, picture(3, &[1, 2, 7]));
    assert_ne!(one, picture(1, &[8]));
}
