//! Paths into labels, through them and out of them, compared with known results for glass and transparent surfaces.

#![allow(clippy::expect_used, clippy::unwrap_used, reason = "tests")]

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use pumice_core::{LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_cpu::Surroundings;
use pumice_cpu::crossing::{next_hit, visibility};
use pumice_cpu::path::radiance;
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_scene::{Material, Settings};
use pumice_transport::geometry::LodChoice;
use pumice_transport::sampler::PixelSampler;
use pumice_transport::{Lights, MaterialTable, PathOrigin, RayInWorld, Sky, Tracer};

/// 8³ voxels; label 1 fills x 2 to 3, label 2 fills x 4 to 5, both in y and z from 1 to 6.
fn two_slabs() -> SceneTracer {
    let n = 8u32;
    let label = |i: u32| {
        let at = [i % n, i / n % n, i / (n * n)];
        match at[1..].iter().all(|c| (1..7).contains(c)) {
            true => [0, 0, 1, 1, 2, 2, 0, 0][at[0] as usize],
            false => 0,
        }
    };
    let labels = LabelBuffer::U32((0..n * n * n).map(label).collect());
    let volume = compress_labels(VolumeInfo::new([n; 3], LabelType::U32), labels).expect("a volume");
    let volume = Arc::new(volume);
    let visible = vec![true; volume.labels().len()];
    let traced =
        TracedInstance { volume, world_from_index: DAffine3::IDENTITY, visible, lod: LodChoice::Voxels };
    SceneTracer::new(&[traced]).expect("a scene")
}

/// Surroundings with a uniform sky of radiance 1.
fn around(material: Material) -> Surroundings {
    Surroundings {
        lights: Lights::new(Sky::Constant(Vec3::ONE), Vec::new(), None).into(),
        materials: vec![MaterialTable::same(material).into()].into(),
        settings: Settings { bounces: 200, russian_roulette: false, ..Settings::default() },
    }
}

fn along_x(y: f64) -> RayInWorld {
    RayInWorld { origin: DVec3::new(-3.0, y, 3.4), direction: DVec3::X }
}

/// Mean radiance over rays that hit both slabs at an angle.
fn mean(tracer: &SceneTracer, around: &Surroundings, samples: u32) -> f32 {
    let direction = DVec3::new(1.0, 0.31, -0.12);
    let ray = RayInWorld { origin: DVec3::new(3.0, 3.3, 3.6) - direction * 4.0, direction };
    let of = |i| radiance(tracer, around, &PixelSampler::new(3, [1, 2], i), ray, f64::INFINITY, 0.5).x;
    (0..samples).map(of).sum::<f32>() / samples as f32
}

#[test]
fn the_back_of_a_label_is_followed_by_the_front_of_the_next() {
    let tracer = two_slabs();
    for (direction, expected) in [
        (1.0, [(2.0, 0, false), (4.0, 0, true), (4.0, 1, false), (6.0, 1, true)]),
        (-1.0, [(6.0, 1, false), (4.0, 1, true), (4.0, 0, false), (2.0, 0, true)]),
    ] {
        let mut ray = RayInWorld {
            origin: DVec3::new(4.0 - 9.0 * direction, 3.3, 3.4),
            direction: DVec3::new(direction, 0.0, 0.0),
        };
        let mut hit = tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY).expect("a slab");
        for (i, (x, label, from_inside)) in expected.into_iter().enumerate() {
            ray.origin += ray.direction * hit.t;
            assert_eq!((ray.origin.x, hit.surface.label, hit.from_inside), (x, label, from_inside), "{i}");
            let outward = ray.direction.dot(hit.normal_in_world) > 0.0;
            assert_eq!(outward, from_inside, "{i}");
            // The surface is the one that a ray from outside would hit.
            if !from_inside && i > 0 {
                assert_eq!(hit.surface.voxel[0], if direction > 0.0 { 4 } else { 3 });
                assert_eq!((hit.surface.plane, hit.surface.positive), (4, direction < 0.0));
            }
            let next = next_hit(&tracer, &ray, &hit, f64::INFINITY);
            assert_eq!(next.is_some(), i < 3, "{i}");
            hit = next.unwrap_or(hit);
        }
    }
}

#[test]
fn clear_surfaces_let_their_part_through() {
    let tracer = two_slabs();
    let black = Material { base_color: [0.0; 3], specular: 0.0, ..Material::default() };
    // Four surfaces, front and back of each slab.
    for alpha in [0.0, 0.1, 0.4, 1.0] {
        let around = around(Material { alpha, ..black });
        let expected = (1.0 - alpha).powi(4);
        // A random choice with probability `expected`: 5 σ of 4,096 samples; at the ends it is exact.
        let sigma = (expected * (1.0 - expected) / 4096.0).sqrt();
        let got = mean(&tracer, &around, 4096);
        assert!((got - expected).abs() <= 5.0 * sigma, "{alpha}: {got}, expected {expected}");

        // Shadow rays involve no chance. From a face of the first slab, through the other three surfaces.
        let ray = along_x(3.3);
        let front = tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY).expect("a slab");
        let ray = RayInWorld { origin: ray.origin + ray.direction * front.t, ..ray };
        let got = visibility(&tracer, &around, &ray, &front, f64::INFINITY);
        assert!((got - (1.0 - alpha).powi(3)).abs() < 1e-6, "{alpha}: {got}");
        // A light between the far faces of the slabs is behind two of them.
        let got = visibility(&tracer, &around, &ray, &front, 3.0);
        assert!((got - (1.0 - alpha).powi(2)).abs() < 1e-6, "{alpha}: {got}");
    }
}

/// White glass under a uniform sky is as bright as the sky, whatever it refracts and reflects inside: no light is lost or created.
#[test]
fn white_glass_cannot_be_seen_under_an_even_sky() {
    let tracer = two_slabs();
    // Four surfaces; in the last case the multiple-scattering compensation is interpolated between table entries of 1 and about 0.99.
    for (ior, roughness, tolerance) in
        [(1.5, 0.0, 1e-4), (1.0, 0.0, 1e-4), (2.4, 0.0, 1e-4), (1.000_05, 0.3, 5e-3)]
    {
        let glass =
            Material { base_color: [1.0; 3], transmission: 1.0, ior, roughness, ..Material::default() };
        let got = mean(&tracer, &around(glass), 500);
        assert!((got - 1.0).abs() < tolerance, "index {ior}, roughness {roughness}: {got}");
        // Negative control: tinted glass is visible.
        let tinted = Material { base_color: [0.9; 3], ..glass };
        assert!(mean(&tracer, &around(tinted), 500) < 0.95);
    }
}

/// Straight on through both slabs, clear glass of index n reflects R = ((n−1)/(n+1))² at each of four surfaces. Without bounces nothing
/// comes through; with as many bounces as surfaces, most does.
#[test]
fn light_needs_a_bounce_for_each_surface_of_glass() {
    let tracer = two_slabs();
    let glass = Material { base_color: [1.0; 3], transmission: 1.0, roughness: 0.0, ..Material::default() };
    let mut around = around(glass);
    let r = 0.04f32;
    for (bounces, least, most) in [(0, 0.0, r + 0.02), (3, (1.0 - r).powi(4) - 0.02, 1.0)] {
        around.settings.bounces = bounces;
        let of = |i| {
            radiance(&tracer, &around, &PixelSampler::new(5, [0, 0], i), along_x(3.3), f64::INFINITY, 0.5).x
        };
        let got = (0..4000).map(of).sum::<f32>() / 4000.0;
        // 2 %: 5 σ of 4,000 samples, and a little more.
        assert!(got >= least && got <= most, "{bounces} bounces: {got}");
    }
}
