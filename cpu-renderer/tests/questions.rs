//! The other queries of the traversal, compared with naive definitions over dense arrays: which labels exist, where a label begins and
//! ends, levels of detail, several instances.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod exact;

use std::sync::Arc;

use exact::rays::{Class, ray};
use exact::volumes::{Random, blobs, noise, sheets};
use exact::{Dense, ExactRay, Verdict, describe, in_world, judge};
use glam::{DAffine3, DVec3};
use pumice_core::CompressedVolume;
use pumice_cpu::traverse::{SceneTracer, TracedInstance, VolumeTracer};
use pumice_scene::CutShape;
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Tracer};

const PLACE: DAffine3 = DAffine3::IDENTITY;

fn instance(volume: &Arc<CompressedVolume>, shown: impl Fn(u32) -> bool, lod: LodChoice) -> TracedInstance {
    TracedInstance {
        volume: Arc::clone(volume),
        world_from_index: PLACE,
        visible: (0..volume.labels().len() as u32).map(shown).collect(),
        lod,
    }
}

fn scene(volume: &Arc<CompressedVolume>, shown: impl Fn(u32) -> bool, lod: LodChoice) -> SceneTracer {
    SceneTracer::new(&[instance(volume, shown, lod)]).unwrap()
}

fn only(dense: &Dense, shown: impl Fn(u32) -> bool) -> Dense {
    let labels = dense.labels.iter().map(|&l| if l != 0 && shown(l - 1) { l } else { 0 }).collect();
    Dense { dims: dense.dims, labels }
}

fn voxels(dims: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..dims[2]).flat_map(move |z| (0..dims[1]).flat_map(move |y| (0..dims[0]).map(move |x| [x, y, z])))
}

fn volumes() -> [(Dense, Arc<CompressedVolume>); 3] {
    [noise([50, 41, 37], 0.2, 6, 21), sheets([50, 61, 35]), blobs([64, 50, 47], 40, 30, 5)]
}

fn assert_labels(tracer: &SceneTracer, expected: &Dense) {
    for v in voxels(expected.dims) {
        let found = tracer.label_at(0, v).map_or(0, |l| l + 1);
        assert_eq!(found, expected.at(v.map(i64::from)), "voxel {v:?}");
    }
    for a in 0..3 {
        let mut outside = [0; 3];
        outside[a] = expected.dims[a];
        assert_eq!(tracer.label_at(0, outside), None);
    }
    assert_eq!(tracer.label_at(1, [0; 3]), None);
}

/// Rays that start inside are left out where `outside_only` is set.
fn assert_rays_from(
    outside_only: bool,
    name: &str,
    volume: &Dense,
    classes: &[Class],
    n: u32,
    trace: impl Fn(&RayInWorld) -> Option<Hit>,
) {
    for &class in classes {
        let mut random = Random(u64::from(n) + class as u64);
        for _ in 0..n {
            let (o, d) = ray(class, volume.dims, 20, &mut random);
            let hit = trace(&in_world(o, d, &PLACE));
            if outside_only && volume.at(o.map(|x| x.floor() as i64)) != 0 {
                continue;
            }
            if let Verdict::Wrong(why) = judge(volume, &ExactRay::new(o, d), hit.as_ref()) {
                panic!("{name}, {class:?}: {why}: {}", describe(o, d, PathOrigin::Free, hit.as_ref()));
            }
        }
    }
}

fn assert_rays(
    name: &str,
    volume: &Dense,
    classes: &[Class],
    n: u32,
    trace: impl Fn(&RayInWorld) -> Option<Hit>,
) {
    assert_rays_from(false, name, volume, classes, n, trace);
}

#[test]
fn visible_labels_are_there_and_hidden_ones_are_not() {
    for (dense, compressed) in volumes() {
        for shown in [|_| true, |l| l % 2 == 0, |l| l == 1, |_| false] {
            let tracer = scene(&compressed, shown, LodChoice::Voxels);
            let expected = only(&dense, shown);
            assert_labels(&tracer, &expected);
            let classes = [Class::Random, Class::Lattice, Class::Inside];
            assert_rays("visible", &expected, &classes, 2000, |r| {
                tracer.first_hit(r, PathOrigin::Free, f64::INFINITY)
            });
        }
    }
}

/// Up to the next boundary of one label, the other labels are ignored, and seams between boxes are no surfaces.
#[test]
fn next_boundaries_match_the_label_alone() {
    for (dense, compressed) in volumes() {
        let tracer = scene(&compressed, |_| true, LodChoice::Voxels);
        for label in 0..3 {
            let alone = only(&dense, |l| l == label);
            let classes = [Class::Random, Class::Lattice, Class::Inside, Class::Grazing, Class::AxisParallel];
            assert_rays("boundary", &alone, &classes, 2000, |r| {
                tracer.next_boundary(r, 0, label, PathOrigin::Free, f64::INFINITY)
            });
        }
    }
}

/// Hits lie within the requested t interval, and an interval that ends at the hit contains nothing.
#[test]
fn t_max_is_exclusive() {
    let (dense, compressed) = blobs([64, 50, 47], 40, 30, 5);
    let tracer = scene(&compressed, |_| true, LodChoice::Voxels);
    let mut random = Random(3);
    for class in [Class::Random, Class::Inside] {
        for _ in 0..3000 {
            let (o, d) = ray(class, dense.dims, 20, &mut random);
            let r = in_world(o, d, &PLACE);
            let Some(hit) = tracer.first_hit(&r, PathOrigin::Free, f64::INFINITY) else { continue };
            assert!(hit.t > 0.0);
            let below = hit.t * (1.0 - 1e-12);
            assert_eq!(tracer.first_hit(&r, PathOrigin::Free, below), None);
            assert!(!tracer.occluded(&r, PathOrigin::Free, below));
            let above = hit.t * (1.0 + 1e-12);
            assert_eq!(tracer.first_hit(&r, PathOrigin::Free, above), Some(hit));
            assert!(tracer.occluded(&r, PathOrigin::Free, above));
        }
    }
}

/// The naive definition: each element of a label's box that holds a voxel becomes solid; the lowest label wins.
fn coarse(
    dense: &Dense,
    compressed: &CompressedVolume,
    shown: impl Fn(u32) -> bool,
    level: impl Fn([u32; 3], [u32; 3]) -> u32,
) -> Dense {
    let mut labels = vec![0u32; dense.labels.len()];
    let [nx, ny, _] = dense.dims.map(|d| d as usize);
    for i in 0..compressed.boxes().len() {
        let (b, label) = (compressed.get_box(i), compressed.label_of_box(i));
        if !shown(label) {
            continue;
        }
        let hi = [0, 1, 2].map(|a| (b.origin[a] + b.extent[a]).min(dense.dims[a]));
        let side = level(b.origin, b.extent);
        for v in voxels([0, 1, 2].map(|a| hi[a] - b.origin[a])) {
            let v = [0, 1, 2].map(|a| b.origin[a] + v[a]);
            let corner = v.map(|c| c / side * side);
            let any = side == 16
                || voxels([side; 3])
                    .any(|w| dense.at([0, 1, 2].map(|a| i64::from(corner[a] + w[a]))) == label + 1);
            let at = &mut labels[v[0] as usize + nx * (v[1] as usize + ny * v[2] as usize)];
            if any && (*at == 0 || *at > label + 1) {
                *at = label + 1;
            }
        }
    }
    Dense { dims: dense.dims, labels }
}

/// The same surface with the voxel behind the face instead of the element's corner, as the oracle expects it.
fn as_voxel(o: DVec3, d: DVec3, mut hit: Hit) -> Hit {
    let (p, s) = (o + hit.t * d, &mut hit.surface);
    let axis = usize::from(s.axis);
    s.voxel = [0, 1, 2].map(|a| p[a].max(0.0) as u32);
    s.voxel[axis] = s.plane - u32::from(s.positive);
    hit
}

#[test]
fn levels_of_detail_match_naive() {
    for (dense, compressed) in volumes() {
        let eye = DVec3::new(-20.0, 10.0, 70.0);
        // Coarse from 50 and from 25 voxels away.
        let distance =
            LodChoice::Distance { eye_in_world: eye, world_per_distance: 16.0 / 50.0, world_constant: 0.0 };
        let side_at = |o: [u32; 3], e: [u32; 3]| {
            let gap = |a: usize| (f64::from(o[a]) - eye[a]).max(eye[a] - f64::from(o[a] + e[a])).max(0.0);
            let d = (0..3).map(|a| gap(a).powi(2)).sum::<f64>().sqrt();
            if d >= 50.0 {
                16
            } else if d >= 12.5 {
                4
            } else {
                1
            }
        };
        type SideAt<'a> = &'a dyn Fn([u32; 3], [u32; 3]) -> u32;
        let levels: [(LodChoice, SideAt); 4] = [
            (LodChoice::Voxels, &|_, _| 1),
            (LodChoice::Cells, &|_, _| 4),
            (LodChoice::Boxes, &|_, _| 16),
            (distance, &side_at),
        ];
        for (lod, side) in levels {
            let shown = |l: u32| l % 3 != 2;
            let expected = coarse(&dense, &compressed, shown, side);
            let tracer = scene(&compressed, shown, lod);
            assert_labels(&tracer, &expected);
            // A hierarchy built for another choice, and a camera elsewhere, serves as well; only voxels have their own.
            let elsewhere = DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5));
            let far = LodChoice::Distance {
                eye_in_world: DVec3::ZERO,
                world_per_distance: 1.0,
                world_constant: 0.5,
            };
            for built in [LodChoice::Cells, far] {
                let built = SceneTracer::new(&[TracedInstance {
                    world_from_index: elsewhere,
                    ..instance(&compressed, shown, built)
                }]);
                let built = built.unwrap();
                match built.instance(0).unwrap().again(0, PLACE, lod).unwrap() {
                    Some(again) => assert_labels(&SceneTracer::of(vec![Arc::new(again)]), &expected),
                    None => assert_eq!(lod, LodChoice::Voxels),
                }
            }
            assert_eq!(
                tracer.instance(0).unwrap().again(0, PLACE, far).unwrap().is_none(),
                lod == LodChoice::Voxels
            );
            // Coarse elements of labels overlap: a ray that starts inside leaves the union of its label's elements, unlike in the array.
            assert_rays_from(true, "level", &expected, &[Class::Random, Class::AxisParallel], 4000, |r| {
                let hit = tracer.first_hit(r, PathOrigin::Free, f64::INFINITY)?;
                Some(as_voxel(r.origin, r.direction, hit))
            });
        }
    }
}

/// One hierarchy over all labels gives, to the bit, the best hit of one hierarchy for each label: neither the tree nor the order of
/// traversal matters. (Except at edges, where the other labels decide which of the faces is open.)
#[test]
fn the_hierarchy_does_not_change_the_answer() {
    for (dense, compressed) in volumes() {
        for lod in [LodChoice::Voxels, LodChoice::Cells, LodChoice::Boxes] {
            let together = SceneTracer::without_bricks(&[instance(&compressed, |_| true, lod)]).unwrap();
            let apart: Vec<_> = (0..compressed.labels().len() as u32)
                .map(|l| SceneTracer::without_bricks(&[instance(&compressed, |m| m == l, lod)]).unwrap())
                .collect();
            let mut random = Random(8);
            for class in [Class::Random, Class::Lattice, Class::InFace] {
                for _ in 0..1500 {
                    let (o, d) = ray(class, dense.dims, 20, &mut random);
                    let r = in_world(o, d, &PLACE);
                    let best = apart
                        .iter()
                        .filter_map(|t| t.first_hit(&r, PathOrigin::Free, f64::INFINITY))
                        .min_by(|a, b| (a.t, a.surface.label).partial_cmp(&(b.t, b.surface.label)).unwrap());
                    let hit = together.first_hit(&r, PathOrigin::Free, f64::INFINITY);
                    match hit {
                        // Inside a label, the other labels are ignored.
                        Some(h) if h.from_inside => assert_eq!(
                            hit,
                            apart[h.surface.label as usize].first_hit(&r, PathOrigin::Free, f64::INFINITY)
                        ),
                        // Of faces hit at once the open one is reported, and the voxel in front of the others may belong to another label.
                        _ if hit != best => {
                            let (h, b) = (hit.unwrap(), best.unwrap());
                            let bare = |h: &Hit| (h.t, h.surface.voxel, h.surface.label, h.from_inside);
                            assert_eq!(bare(&h), bare(&b));
                            // A little further along the ray is the voxel of the element that the ray enters.
                            let inside = r.origin + (b.t + 1e-6) * r.direction;
                            let mut before = inside.to_array().map(|x| x as u32);
                            let axis = usize::from(b.surface.axis);
                            before[axis] =
                                if b.surface.positive { b.surface.plane } else { b.surface.plane - 1 };
                            assert!(together.label_at(0, before).is_some(), "{h:?} {b:?}");
                        }
                        _ => {}
                    }
                }
            }
        }
    }
}

#[test]
fn the_nearest_of_several_instances_is_hit() {
    let (dense, compressed) = sheets([50, 61, 35]);
    let mut far = instance(&compressed, |_| true, LodChoice::Voxels);
    far.world_from_index = DAffine3::from_translation(DVec3::new(30.0, -20.0, 10.0));
    let near = instance(&compressed, |l| l == 0, LodChoice::Voxels);
    let both = SceneTracer::new(&[near.clone(), far.clone()]).unwrap();
    let each = [near, far].map(|i| SceneTracer::new(&[i]).unwrap());
    let mut random = Random(8);
    let mut from_second = 0;
    for _ in 0..5000 {
        let (o, d) = ray(Class::Random, dense.dims, 20, &mut random);
        let r = in_world(o, d, &PLACE);
        let hits = each.each_ref().map(|t| t.first_hit(&r, PathOrigin::Free, f64::INFINITY));
        let expected = match hits {
            [Some(a), Some(b)] if b.t < a.t => Some((1, b.t)),
            [Some(a), _] => Some((0, a.t)),
            [None, b] => b.map(|b| (1, b.t)),
        };
        let hit = both.first_hit(&r, PathOrigin::Free, f64::INFINITY);
        assert_eq!(hit.map(|h| (h.surface.instance, h.t)), expected);
        from_second += u32::from(hit.is_some_and(|h| h.surface.instance == 1));
    }
    assert!(from_second > 100);
    assert_eq!(both.bytes(), each.iter().map(SceneTracer::bytes).sum::<u64>());
}

#[test]
fn impossible_placements_and_rays_are_refused() {
    let (_, compressed) = sheets([20, 20, 20]);
    for column in [DVec3::ZERO, DVec3::new(f64::NAN, 0.0, 0.0), DVec3::new(f64::INFINITY, 0.0, 0.0)] {
        let mut bad = instance(&compressed, |_| true, LodChoice::Voxels);
        bad.world_from_index.matrix3.y_axis = column;
        let message = SceneTracer::new(&[bad]).unwrap_err().to_string();
        assert!(message.starts_with("instances[0]: world_from_index cannot be inverted"), "{message}");
    }
    let tracer = scene(&compressed, |_| true, LodChoice::Voxels);
    let numbers =
        [0.0, -0.0, 1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324, -5e-324, f64::MAX, 1e-310];
    for i in 0..numbers.len().pow(2) {
        let (x, y) = (numbers[i % numbers.len()], numbers[i / numbers.len()]);
        for t_max in [f64::INFINITY, 0.0, f64::NAN, 1.0] {
            for (origin, direction) in [
                (DVec3::new(x, y, 3.5), DVec3::new(y, x, x)),
                (DVec3::new(7.25, 8.5, 9.75), DVec3::new(x, y, y)),
            ] {
                let hit = tracer.first_hit(&RayInWorld { origin, direction }, PathOrigin::Free, t_max);
                assert!(
                    hit.is_none_or(|h| h.t > 0.0 && h.t < t_max),
                    "{origin} {direction} {t_max}: {hit:?}"
                );
            }
        }
    }
}

/// Where the camera is so near that all boxes are drawn as voxels, bricks are used as if the level were voxels, also after a move; where
/// some boxes are coarser, there are no bricks.
#[test]
fn distances_that_change_nothing_have_bricks() {
    for (dense, compressed) in volumes() {
        let at = |x: f64| LodChoice::Distance {
            eye_in_world: DVec3::new(x, 20.0, 20.0),
            world_per_distance: 0.04,
            world_constant: 0.0,
        };
        // Cells from 100 voxels away: the volumes are at most 64 wide.
        let (near, far) = (at(-20.0), at(-90.0));
        let made =
            VolumeTracer::new(0, &instance(&compressed, |_| true, near)).unwrap().with_bricks().unwrap();
        let again = |from: &VolumeTracer, lod| from.again(0, PLACE, lod).unwrap().unwrap();
        let moved = again(&made, far);
        let back = again(&moved, near);
        assert!(
            made.brick_bytes() > 0 && moved.brick_bytes() == 0 && back.brick_bytes() == made.brick_bytes()
        );
        let voxels = scene(&compressed, |_| true, LodChoice::Voxels);
        let mut random = Random(3);
        for _ in 0..2000 {
            let (o, d) = ray(Class::Random, dense.dims, 40, &mut random);
            let r = in_world(o, d, &PLACE);
            let hit = voxels.first_hit(&r, PathOrigin::Free, f64::INFINITY);
            assert_eq!(back.first_hit(&r, PathOrigin::Free, f64::INFINITY), hit, "{r:?}");
        }
    }
}

/// For any choice of labels, at any level that has bricks, with and without cuts: the same hits, and the same hits of paths that continue
/// from them.
#[test]
fn bricks_answer_what_boxes_do() {
    let (mut hits, mut bounced, mut inside) = (0, 0, 0);
    for (dense, compressed) in volumes() {
        let cut = CutShape::Plane { point: [20.3, 21.7, 18.1], normal: [0.7, -0.2, 0.4] };
        let choices: [fn(u32) -> bool; 3] = [|_| true, |l| l % 3 == 1, |l| l % 7 == 2];
        for lod in [LodChoice::Voxels, LodChoice::Cells, LodChoice::Boxes] {
            for (shown, cuts) in choices.into_iter().flat_map(|shown| [(shown, None), (shown, Some(&cut))]) {
                let boxes = || VolumeTracer::new(0, &instance(&compressed, shown, lod)).unwrap();
                let bricks = boxes().with_bricks().unwrap().with_cuts(cuts);
                let boxes = boxes().with_cuts(cuts);
                assert!(bricks.brick_bytes() > 0 && boxes.brick_bytes() == 0);
                let mut random = Random(u64::from(cuts.is_some()));
                for class in [Class::Random, Class::Inside] {
                    for _ in 0..1000 {
                        let (o, d) = ray(class, dense.dims, 40, &mut random);
                        let r = in_world(o, d, &PLACE);
                        let hit = bricks.first_hit(&r, PathOrigin::Free, f64::INFINITY);
                        assert_eq!(
                            hit,
                            boxes.first_hit(&r, PathOrigin::Free, f64::INFINITY),
                            "{lod:?} {r:?}"
                        );
                        let is_occluded = bricks.occluded(&r, PathOrigin::Free, f64::INFINITY);
                        assert_eq!(is_occluded, hit.is_some(), "{lod:?} {r:?}");
                        let Some(first) = hit else { continue };
                        (hits, inside) = (hits + 1, inside + u32::from(first.from_inside));
                        let (_, turned) = ray(Class::Inside, dense.dims, 40, &mut random);
                        let mut direction = DVec3::from(turned);
                        if direction.dot(first.normal_in_world) < 0.0 {
                            direction = -direction;
                        }
                        let bounce = RayInWorld { origin: r.origin + first.t * r.direction, direction };
                        let from = PathOrigin::Face(first.surface);
                        let second = bricks.first_hit(&bounce, from, f64::INFINITY);
                        assert_eq!(
                            second,
                            boxes.first_hit(&bounce, from, f64::INFINITY),
                            "{lod:?} {bounce:?}"
                        );
                        let is_occluded = bricks.occluded(&bounce, from, f64::INFINITY);
                        assert_eq!(
                            is_occluded,
                            boxes.occluded(&bounce, from, f64::INFINITY),
                            "{lod:?} {bounce:?}"
                        );
                        bounced += u32::from(second.is_some());
                    }
                }
            }
        }
    }
    assert!(hits > 20_000 && bounced > 3_000 && inside > 3_000, "{hits} {bounced} {inside}");
}
