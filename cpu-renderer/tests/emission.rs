//! Light sampling of emissive labels and meshes: compared with closed forms and with BSDF sampling alone, and how much noise it removes.

#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used, reason = "tests")]

#[path = "emission/stage.rs"]
mod stage;

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_oracle::volumes::volume;
use pumice_scene::{CutShape, Material};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{LightStrategy, PathOrigin, RayInWorld, Receiver, Tracer};
use stage::{Stage, glowing, lambert};

/// A floor (label 1, z < 2), and above it the labels that `at` returns (2 and up).
fn over_a_floor(at: impl Fn(u32, u32, u32) -> u32) -> Arc<pumice_core::CompressedVolume> {
    volume([24, 24, 20], |x, y, z| if z < 2 { 1 } else { at(x, y, z) }).1
}

/// A block of 6 × 4 × 3 voxels above the floor, with a step, across a border of boxes.
fn block(x: u32, y: u32, z: u32) -> u32 {
    let inside = (8..14).contains(&x) && (9..13).contains(&y) && (9..12).contains(&z);
    2 * u32::from(inside && !(x > 11 && z == 9))
}

/// 108 labels of one voxel each.
fn sparse(x: u32, y: u32, z: u32) -> u32 {
    let one = x % 4 == 1 && y % 4 == 2 && z % 6 == 5;
    if one { 2 + (x / 4 + 6 * (y / 4) + 36 * (z / 6)) } else { 0 }
}

fn sheared() -> DMat3 {
    DMat3::from_cols_array(&[1.0, 0.2, 0.1, -0.3, 1.1, -0.2, 0.25, 0.1, 0.9])
}

/// Scenes by name; each is lit only by its own emissive surfaces.
fn scenes() -> Vec<(&'static str, Stage)> {
    let shine = glowing([4.0, 3.0, 2.0]);
    let plain = |place: DMat3| {
        let place = DAffine3 { matrix3: place, translation: DVec3::new(3.0, -2.0, 1.0) };
        Stage::new().with_volume(&over_a_floor(block), place, &[lambert(0.7), shine], LodChoice::Voxels)
    };
    let mut list = vec![
        ("a block", plain(DMat3::IDENTITY)),
        ("anisotropic voxels", plain(DMat3::from_diagonal(DVec3::new(1.0, 0.7, 2.5)))),
        ("sheared", plain(sheared())),
        ("mirrored and sheared", plain(sheared() * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)))),
    ];
    // Voxels of a nanometre, far from the origin.
    let small = DAffine3 { matrix3: sheared() * 1e-9, translation: DVec3::new(1e-3, 2e-3, -3e-3) };
    let labels = [lambert(0.7), shine];
    list.push((
        "1e-9 wide, 1e6 voxels away",
        Stage::new().with_volume(&over_a_floor(block), small, &labels, LodChoice::Voxels),
    ));
    // The light is partly hidden by alpha and by glass, and itself has a coat and alpha below 1.
    let many = over_a_floor(|x, y, z| match block(x, y, z) {
        0 if (9..11).contains(&x) && (9..13).contains(&y) && (5..7).contains(&z) => 3,
        0 if (12..14).contains(&x) && (9..13).contains(&y) && (5..7).contains(&z) => 4,
        // Adjacent to the block.
        0 if (14..16).contains(&x) && (9..13).contains(&y) && (9..12).contains(&z) => 3,
        block => block,
    });
    let shining =
        Material { coat: 0.8, coat_roughness: 0.5, coat_tint: [0.9, 0.7, 0.5], alpha: 0.7, ..shine };
    let clear = Material { alpha: 0.4, ..lambert(0.5) };
    let glass = Material { transmission: 1.0, roughness: 0.6, base_color: [0.9; 3], ..Material::default() };
    let labels = [Material { roughness: 0.4, specular: 0.8, ..lambert(0.6) }, shining, clear, glass];
    let place = DAffine3::IDENTITY;
    list.push((
        "behind glass and alpha, coated",
        Stage::new().with_volume(&many, place, &labels, LodChoice::Voxels),
    ));
    // Cut obliquely, and along faces.
    let cuts = [
        CutShape::Plane { point: [10.5, 10.0, 10.0], normal: [1.0, 0.3, 0.8] },
        CutShape::Plane { point: [0.0, 12.0, 0.0], normal: [0.0, 1.0, 0.0] },
        CutShape::Box { world_from_box: DAffine3::from_translation(DVec3::new(9.0, 10.0, 10.0)) },
    ];
    let labels = [lambert(0.7), shine];
    list.push((
        "cut",
        Stage::new().with_volume(&over_a_floor(block), place, &labels, LodChoice::Voxels).cut(&cuts),
    ));
    list.push(("coarse", Stage::new().with_volume(&over_a_floor(block), place, &labels, LodChoice::Cells)));
    let near = LodChoice::Distance {
        eye_in_world: DVec3::new(2.0, 2.0, 8.0),
        world_per_distance: 0.3,
        world_constant: 0.0,
    };
    let labels: Vec<Material> = (0..120).map(|i| if i == 0 { lambert(0.7) } else { shine }).collect();
    list.push(("coarse where far", Stage::new().with_volume(&over_a_floor(sparse), place, &labels, near)));
    // A mesh that emits to both sides, a volume with two emissive labels, and a second instance without emission.
    let (_, floor) = volume([24, 24, 2], |_, _, _| 1);
    let (_, lamp) = volume([5, 3, 2], |x, y, _| 1 + (x + y) % 2);
    let turned = DAffine3 { matrix3: sheared(), translation: DVec3::new(4.0, 5.0, 8.0) };
    list.push((
        "a mesh and two instances",
        Stage::new()
            .with_volume(&floor, place, &[lambert(0.7)], LodChoice::Voxels)
            .with_volume(&lamp, turned, &[shine, lambert(0.2)], LodChoice::Voxels)
            .with_volume(
                &lamp,
                DAffine3::from_translation(DVec3::new(14.0, 12.0, 6.0)),
                &[lambert(0.5), glowing([0.0, 1.0, 5.0])],
                LodChoice::Voxels,
            )
            .with_mesh(
                &stage::tent(),
                DAffine3 { matrix3: sheared() * 1.5, translation: DVec3::new(8.0, 15.0, 5.0) },
                &[lambert(0.5), glowing([3.0, 0.5, 0.2])],
            ),
    ));
    // Together with other lights.
    list.push(("under a sky and a sun", plain(DMat3::IDENTITY).under_a_sky()));
    list
}

/// Light sampling, BSDF sampling and both: means of 48 seeds differ by less than four standard errors of their difference; light that is
/// off by 2 % does not pass where both have so little noise.
#[test]
fn three_ways_to_find_emission_agree() {
    let mut convicted = 0;
    for (name, stage) in scenes() {
        let [both, aimed, scattered] =
            [LightStrategy::Mis, LightStrategy::LightsOnly, LightStrategy::BsdfOnly]
                .map(|f| stage.estimate(f, 48, 32));
        for (what, other) in [("aimed", aimed), ("scattered", scattered)] {
            let apart = |factor: f64| (factor * both.0 - other.0).abs() / (both.1 + other.1).sqrt();
            assert!(
                apart(1.0) < 4.0,
                "{name}: both {both:?}, {what} {other:?}: {} standard errors",
                apart(1.0)
            );
            convicted += u32::from(apart(1.02) > 4.0);
        }
        println!("{name}: {both:?} {aimed:?} {scattered:?}");
        assert!(both.0 > 0.0, "{name} is dark");
    }
    assert!(convicted >= 10, "2 % go unnoticed but in {convicted} cases");
}

/// The density of a sample equals the one that `pdf` gives for a ray that hits its point; samples lie on emissive surfaces.
#[test]
fn densities_are_those_of_sampling() {
    for (name, stage) in scenes() {
        let Some(emitters) = stage.emitters() else {
            assert_eq!(name, "coarse");
            continue;
        };
        let (mut met, mut seen) = (0, 0);
        for i in 0..4_000u32 {
            let number = |j: u32| {
                f64::from((i * 8 + j).wrapping_mul(2_654_435_769).wrapping_mul(i | 1) >> 8)
                    / f64::from(1 << 24)
            };
            let (lo, hi) = stage.bounds();
            let point = lo + (hi - lo) * DVec3::new(number(0), number(1), 0.3 * number(2));
            let normal = Vec3::new(number(3) as f32 - 0.5, number(4) as f32 - 0.5, 0.5).normalize();
            let from = Receiver { point, normal, both_sides: i % 4 == 0 };
            let [a, b, c, d, e] = [5, 6, 7, 0, 3].map(|j| number(j) as f32);
            let Some(s) = emitters.sample(&from, a, [b, c], [d, e]) else { continue };
            met += 1;
            let ray = RayInWorld { origin: point, direction: s.direction };
            let Some(hit) = stage.tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY) else { continue };
            // Occlusion and cuts are covered by other tests.
            if (hit.t - s.distance).abs() > 1e-5 * s.distance || hit.is_seen_from_within() {
                continue;
            }
            seen += 1;
            let found = emitters.pdf(&from, &hit.surface, || stage.tracer.box_origin(&hit.surface), hit.t);
            // Distances and heights are f32.
            assert!((found / s.pdf - 1.0).abs() < 1e-4, "{name}: {found} instead of {} at {hit:?}", s.pdf);
        }
        assert!(met > 1_000 && seen > met / 20, "{name}: {met}, {seen}");
    }
}

/// Radiance below the middle of a rectangle with these half sides at this height: irradiance over π (Howell, *Radiation Configuration
/// Factors*, B-3).
fn below_the_middle(half: [f64; 2], height: f64) -> f64 {
    let [a, b] = half.map(|h| h / height);
    let part = |a: f64, b: f64| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
    4.0 * (part(a, b) + part(b, a)) / (2.0 * PI)
}

/// One flat block of one label above one voxel of floor: the radiance straight below it has a closed form.
#[test]
fn a_square_face_gives_its_form_factor() {
    for (name, scale, shift) in [
        ("cubes", DVec3::ONE, DVec3::ZERO),
        ("flat voxels, far away", DVec3::new(2.0, 0.5, 3.0), DVec3::new(1e6, -1e6, 1e5)),
        ("nanometres", DVec3::splat(1e-9), DVec3::ZERO),
    ] {
        let above =
            |x: u32, y: u32, z: u32| 2 * u32::from((8..16).contains(&x) && (10..14).contains(&y) && z == 7);
        let place = DAffine3 { matrix3: DMat3::from_diagonal(scale), translation: shift };
        let labels = [lambert(0.5), glowing([2.0; 3])];
        let stage = Stage::new()
            .with_volume(&over_a_floor(above), place, &labels, LodChoice::Voxels)
            .seen_at(place.transform_point3(DVec3::new(12.0, 12.0, 2.0)), 1e-3 * scale.min_element());
        let expected = 0.5 * 2.0 * below_the_middle([4.0 * scale.x, 2.0 * scale.y], 5.0 * scale.z);
        for finding in [LightStrategy::Mis, LightStrategy::LightsOnly] {
            let (sum, variance) = stage.estimate(finding, 16, 64);
            let (mean, error) = (sum / 3.0, variance.sqrt() / 3.0);
            assert!((mean - expected).abs() < 4.0 * error, "{name}: {mean} ± {error} instead of {expected}");
            // Negative control: an area that is off by 2 %.
            assert!((1.02 * mean - expected).abs() > 4.0 * error, "{name}: 2 % go unnoticed at ± {error}");
        }
    }
}

/// At equal samples: one emissive voxel, and a thousand of them, in a big dark room.
#[test]
fn aiming_takes_noise_away() {
    let one = |x: u32, y: u32, z: u32| 2 * u32::from([x, y, z] == [12, 12, 17]);
    let cases = [("a voxel", over_a_floor(one), 1_000.0), ("108 labels", over_a_floor(sparse), 5.0)];
    for (name, volume, least) in cases {
        let mut labels = vec![glowing([5.0; 3]); 120];
        labels[0] = lambert(0.5);
        let stage = Stage::new()
            .with_volume(&volume, DAffine3::IDENTITY, &labels, LodChoice::Voxels)
            .seen_at(DVec3::new(12.0, 12.0, 2.0), 8.0);
        let (mean, both) = stage.estimate(LightStrategy::Mis, 24, 8);
        let (_, scattered) = stage.estimate(LightStrategy::BsdfOnly, 24, 8);
        println!("{name}: mean {mean}, variance {scattered:e} -> {both:e}: {}", scattered / both);
        assert!(scattered > least * both, "{name}: variance {scattered} becomes {both}");
    }
}

/// Memory of a hundred thousand emissive labels: for each, two nodes of 28 bytes, 44 bytes of its own, 4 for the order of keys, and 2 for
/// each face.
#[test]
fn a_label_that_shines_costs_a_hundred_bytes() {
    let dims = [94u32, 94, 94];
    let (_, many) = volume(dims, |x, y, z| {
        let all_even = x % 2 == 0 && y % 2 == 0 && z % 2 == 0;
        if all_even { 1 + x / 2 + 47 * (y / 2) + 47 * 47 * (z / 2) } else { 0 }
    });
    let labels = vec![glowing([1.0; 3]); 47 * 47 * 47];
    let stage = Stage::new().with_volume(&many, DAffine3::IDENTITY, &labels, LodChoice::Voxels);
    let emitters = stage.emitters().unwrap();
    assert_eq!(emitters.emitters().len(), 103_823);
    assert_eq!(emitters.faces().len(), 6 * 103_823);
    let each = emitters.bytes() as f64 / 103_823.0;
    assert!(each < 2.0 * 28.0 + 44.0 + 4.0 + 12.0 + 0.5, "{each} bytes a label");
}
