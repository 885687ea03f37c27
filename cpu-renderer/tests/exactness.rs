//! Judges every first hit with the exact oracle of `exact`: in no class of rays, on no volume, may a chord above 10⁻³ voxels be lost.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod exact;

use std::sync::Arc;

use exact::cases::{MAKES, Make, volumes_both_ways};
use exact::rays::{CLASSES, Class, ray, snap};
use exact::tally::Tally;
use exact::volumes::{Random, noise};
use exact::{Dense, ExactRay, describe, in_world, judge, value};
use glam::{DAffine3, DMat3, DVec3};
use pumice_core::CompressedVolume;
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, Tracer};

fn tracer(make: Make, volume: &Arc<CompressedVolume>, world_from_index: DAffine3) -> SceneTracer {
    make(&[TracedInstance {
        volume: Arc::clone(volume),
        world_from_index,
        visible: vec![true; volume.labels().len()],
        lod: LodChoice::Voxels,
    }])
    .unwrap()
}

fn trace_class(
    dense: &Dense,
    tracer: &SceneTracer,
    place: &DAffine3,
    class: Class,
    fine: u32,
    n: u32,
) -> Tally {
    let mut random = Random(u64::from(n) ^ class as u64);
    let mut tally = Tally::default();
    for _ in 0..n {
        let (o, d) = ray(class, dense.dims, fine, &mut random);
        let exact = ExactRay::new(o, d);
        let hit = tracer.first_hit(&in_world(o, d, place), PathOrigin::Free, f64::INFINITY);
        tally.add(judge(dense, &exact, hit.as_ref()), hit.is_some(), || {
            describe(o, d, PathOrigin::Free, hit.as_ref())
        });
        // The any-hit query gives the same result.
        assert_eq!(tracer.occluded(&in_world(o, d, place), PathOrigin::Free, f64::INFINITY), hit.is_some());
    }
    tally
}

fn all_classes(n: u32) {
    for (name, dense, compressed, make) in volumes_both_ways() {
        let tracer = tracer(make, &compressed, DAffine3::IDENTITY);
        for class in CLASSES {
            trace_class(&dense, &tracer, &DAffine3::IDENTITY, class, 20, n)
                .assert_right(&format!("{name}, {class:?}"));
        }
    }
}

/// Each tracer is built as its name says.
#[test]
fn both_ways_are_traced() {
    for (name, _, compressed, make) in volumes_both_ways() {
        assert_eq!(tracer(make, &compressed, DAffine3::IDENTITY).brick_bytes() > 0, name.ends_with("bricks"));
    }
}

#[test]
fn first_hits_are_exact() {
    all_classes(10_000);
}

#[test]
#[ignore = "full: ten million rays"]
fn first_hits_are_exact_on_many_rays() {
    all_classes(170_000);
}

/// Spacings of 1:1000 and 1000:1, shear, mirroring: whole-number matrices, so that the world's ray is exactly the image of the oracle's.
#[test]
fn placements_are_exact() {
    let columns = |x: [f64; 3], y: [f64; 3], z: [f64; 3]| DMat3::from_cols(x.into(), y.into(), z.into());
    let places = [
        ("1:1000", columns([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1000.0])),
        ("1000:1", columns([1000.0, 0.0, 0.0], [0.0, 1000.0, 0.0], [0.0, 0.0, 1.0])),
        ("mirrored", columns([-16.0, 0.0, 0.0], [0.0, 0.0, 40.0], [0.0, 16.0, 0.0])),
        ("sheared", columns([3.0, 1.0, 0.0], [-1.0, 5.0, 2.0], [7.0, 0.0, -11.0])),
    ];
    for (name, dense, compressed, make) in volumes_both_ways() {
        for (place_name, matrix) in &places {
            let place = DAffine3 { matrix3: *matrix, translation: DVec3::new(1024.0, -77.0, 3.0) };
            let tracer = tracer(make, &compressed, place);
            for class in [Class::Random, Class::Lattice, Class::ThroughCorner, Class::Inside] {
                trace_class(&dense, &tracer, &place, class, 14, 3_000)
                    .assert_right(&format!("{name}, {place_name}, {class:?}"));
            }
        }
    }
}

/// Bounces: from the interior, the edges and the corners of exposed faces, in all directions of the outer half-space.
#[test]
fn paths_from_faces_are_exact() {
    for (name, dense, compressed, make) in volumes_both_ways() {
        let tracer = tracer(make, &compressed, DAffine3::IDENTITY);
        let mut random = Random(5);
        let mut tally = Tally::default();
        while tally.rays < 30_000 {
            let (o, d) = ray(Class::Random, dense.dims, 20, &mut random);
            let Some(first) =
                tracer.first_hit(&in_world(o, d, &DAffine3::IDENTITY), PathOrigin::Free, f64::INFINITY)
            else {
                continue;
            };
            let (s, axis) = (first.surface, usize::from(first.surface.axis));
            let outward = if s.positive { 1.0 } else { -1.0 };
            let mut outer = s.voxel.map(i64::from);
            outer[axis] += outward as i64;
            if dense.at(outer) != 0 {
                continue; // a touch: the face is not exposed
            }
            let (_, mut d) = ray(Class::Inside, dense.dims, 20, &mut random);
            // One ray in eight lies in the plane, and one in eight nearly in it.
            d[axis] = match random.below(8) {
                0 => 0.0,
                1 => snap(1e-7 * random.unit() + 1e-12, 46),
                _ => d[axis].abs() + f64::from(2f32.powi(-20)),
            } * outward;
            let mut o = [0, 1, 2].map(|a| f64::from(s.voxel[a]) + snap(0.01 + 0.98 * random.unit(), 20));
            o[axis] = f64::from(s.plane);
            let from = PathOrigin::Face(s);
            let hit = tracer.first_hit(&in_world(o, d, &DAffine3::IDENTITY), from, f64::INFINITY);
            // The oracle knows no faces: a ray in the plane belongs to the voxel above, so it starts in the outer voxel.
            let mut o_exact = o;
            if d[axis] == 0.0 && !s.positive {
                o_exact[axis] -= 0.5;
            }
            if let Some(h) = hit {
                assert!(
                    h.surface != s
                        && (h.surface.axis, h.surface.plane, h.surface.positive)
                            != (s.axis, s.plane, s.positive),
                    "{name}: a path met the plane that it left: {}",
                    describe(o, d, from, hit.as_ref())
                );
            }
            tally.add(judge(&dense, &ExactRay::new(o_exact, d), hit.as_ref()), hit.is_some(), || {
                describe(o, d, from, hit.as_ref())
            });
        }
        tally.assert_right(&format!("{name}, from faces"));
    }
}

/// The axes whose planes the ray crosses at once where it enters the hit voxel, and whether the voxel in front of each face is empty.
fn faces_met(dense: &Dense, ray: &ExactRay, hit: &Hit) -> Vec<(usize, bool)> {
    let voxel = hit.surface.voxel.map(i64::from);
    let entry = |a: usize| value(ray.plane(a, voxel[a] + i64::from(ray.d[a] < 0)));
    let moving = || (0..3).filter(|&a| ray.d[a] != 0);
    let last = moving().map(entry).fold(0.0, f64::max);
    let is_open = |a: usize| {
        let mut before = voxel;
        before[a] -= ray.d[a].signum() as i64;
        dense.at(before) == 0
    };
    // Equal except for the rounding of the quotients.
    moving().filter(|&a| last - entry(a) <= 1e-12 * last).map(|a| (a, is_open(a))).collect()
}

/// On an edge or a corner several faces are hit at once. An open one is reported if there is one, because a path that continued from a
/// closed face would start inside a solid voxel.
#[test]
fn faces_with_nothing_before_them_are_preferred() {
    let (mut hits, mut ties, mut all_closed, mut lowest_closed) = (0, 0, 0, 0);
    for (name, dense, compressed, make) in volumes_both_ways() {
        let tracer = tracer(make, &compressed, DAffine3::IDENTITY);
        for class in [Class::Lattice, Class::ThroughCorner, Class::InFace, Class::Random] {
            let mut random = Random(77);
            for _ in 0..3_000 {
                let (o, d) = ray(class, dense.dims, 20, &mut random);
                let world = in_world(o, d, &DAffine3::IDENTITY);
                let Some(hit) = tracer.first_hit(&world, PathOrigin::Free, f64::INFINITY) else { continue };
                let met = faces_met(&dense, &ExactRay::new(o, d), &hit);
                if hit.from_inside {
                    continue;
                }
                let told = met.iter().find(|m| m.0 == usize::from(hit.surface.axis));
                let any_open = met.iter().any(|m| m.1);
                assert!(
                    told.is_some_and(|t| t.1) || !any_open,
                    "{name}, {class:?}: {met:?}: {}",
                    describe(o, d, PathOrigin::Free, Some(&hit))
                );
                hits += 1;
                ties += u32::from(met.len() > 1);
                all_closed += u32::from(!any_open);
                lowest_closed += u32::from(any_open && !met[0].1);
            }
        }
    }
    // Negative control: always reporting the lowest axis would be noticed.
    println!("{hits} hits, {ties} ties: all faces closed {all_closed}, the lowest alone {lowest_closed}");
    assert!(lowest_closed > 1000);
}

/// A volume of 2²⁰ voxels along one axis, sparse: the hierarchy's f32 has a resolution of 1/16 voxel there.
#[test]
fn long_volumes_are_exact() {
    let (dense, compressed) = noise([1 << 20, 4, 4], 0.003, 5, 9);
    for (way, make) in MAKES {
        let tracer = tracer(make, &compressed, DAffine3::IDENTITY);
        for class in [Class::Random, Class::Inside, Class::Grazing, Class::AxisParallel, Class::InFace] {
            trace_class(&dense, &tracer, &DAffine3::IDENTITY, class, 20, 2_000)
                .assert_right(&format!("2^20 voxels long, {way}, {class:?}"));
        }
    }
}
