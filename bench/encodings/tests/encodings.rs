//! Tests that every encoding decodes to its volume, has the size that its layout gives, and finds the first hits of a fine ray march.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail by panicking, in its helpers too")]

use std::collections::HashSet;

use glam::{DAffine3, DVec3};
use pumice_core::{CompressedVolume, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_encodings::{
    Encoding, EncodingTracer, Form, Reuse, Subdivision, Types, merge_in_turn, merge_on_all_cores,
};
use pumice_oracle::volumes::blobs;
use pumice_transport::RayInWorld;

const SIDES: [Option<u32>; 4] = [Some(8), Some(16), Some(32), None];

fn all_forms(volume: &CompressedVolume, side: Option<u32>) -> Vec<(bool, Encoding)> {
    let boxes = Subdivision::new(volume, side);
    let types = Types::dealt(volume.labels().len(), 7);
    let mut all = Vec::new();
    for with_fields in [false, true] {
        let per_type = Encoding::types(&boxes, &types, with_fields);
        let shared = per_type.shared(merge_in_turn(per_type.dags(), with_fields)).unwrap();
        let octrees = Encoding::octrees(&boxes, with_fields);
        all.extend([octrees, per_type, shared].map(|e| (with_fields, e)));
    }
    all
}

fn noise(dims: [u32; 3], labels: u32) -> CompressedVolume {
    let mut s = 9u64;
    let ids = (0..dims.iter().product::<u32>())
        .map(|_| {
            s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (s >> 40) as u32 % (labels + 1)
        })
        .collect();
    compress_labels(VolumeInfo::new(dims, LabelType::U32), LabelBuffer::U32(ids)).unwrap()
}

#[test]
fn each_form_is_decoded_back() {
    let (_, bodies) = blobs([70, 50, 90], 40, 9, 3);
    // Noise in a box of 16³ needs every possible node, so this tests that pointers of 12 bits suffice.
    let full = noise([16; 3], 1);
    for volume in [&*bodies, &full, &noise([33, 20, 17], 1), &noise([16; 3], 200), &noise([1; 3], 1)] {
        for side in SIDES {
            for (with_fields, e) in all_forms(volume, side) {
                assert_eq!(e.verify(volume), Ok(()), "{:?} {side:?} {with_fields}", e.form());
            }
        }
    }
}

/// Negative control: verification against a volume that differs in one voxel fails, wherever the voxel is.
#[test]
fn another_volume_is_told_apart() {
    let dims = [40, 30, 70];
    let ids = |at: usize, id: u32| {
        let mut ids = vec![0u32; 40 * 30 * 70];
        ids[5_000..60_000].fill(1);
        ids[61_000..61_500].fill(2);
        ids[at] = id;
        compress_labels(VolumeInfo::new(dims, LabelType::U32), LabelBuffer::U32(ids)).unwrap()
    };
    let encodings = all_forms(&ids(0, 1), Some(16));
    for (at, id) in [(10, 1), (5_500, 0), (5_501, 2), (61_499, 1), (83_999, 2)] {
        let other = ids(at, id);
        for (_, e) in &encodings {
            let wrong = e.verify(&other).unwrap_err();
            assert_ne!(wrong.expected, wrong.got);
        }
    }
}

/// Sizes computed by hand, of a full box and a box with two voxels in two cells.
#[test]
fn bytes_are_those_of_the_layouts() {
    let mut ids = vec![0u32; 16 * 16 * 48];
    ids[..16 * 16 * 16].fill(1);
    ids[16 * 16 * 40] = 2;
    ids[16 * 16 * 47 + 255] = 2;
    let volume =
        compress_labels(VolumeInfo::new([16, 16, 48], LabelType::U32), LabelBuffer::U32(ids)).unwrap();
    let boxes = Subdivision::new(&volume, Some(16));
    // Label 2: voxels (0, 0, 40) and (15, 15, 47), one box of 16 × 16 × 8, with two cells.
    assert_eq!(boxes.boxes().len(), 2);
    for with_fields in [false, true] {
        let e = Encoding::octrees(&boxes, with_fields);
        assert_eq!(e.box_bytes(), 64);
        // Eight children of the root, eight of each of two octants, and for each cell a field or two groups.
        let cell = if with_fields { 8 } else { 2 * 16 };
        assert_eq!(e.tree_bytes(), 16 + 2 * 16 + 2 * cell);
        assert_eq!(e.own_tree_bytes(), Some(vec![0, e.tree_bytes()]));
        let types = Encoding::types(&boxes, &Types::dealt(2, 2), with_fields);
        // Each graph has the two uniform leaves. The second also has a root, two nodes of 8³, and the fields of the cells or their
        // octants: cell (0, 0, 0) with voxel 0, and cell (3, 3, 1) with voxel 63.
        let cells = if with_fields { 2 } else { 2 + 2 };
        assert_eq!(types.dags().iter().map(|d| d.nodes().len()).collect::<Vec<_>>(), [2, 2 + 1 + 2 + cells]);
        assert_eq!(types.tree_bytes(), 32 * (4 + 3 + cells as u64) + 8);
    }
}

#[test]
fn no_two_nodes_are_equal_and_merging_in_either_way_makes_the_same_graph() {
    let (_, bodies) = blobs([96, 64, 64], 60, 8, 5);
    let boxes = Subdivision::new(&bodies, Some(16));
    let types = Types::of_volume(&bodies);
    assert_eq!(types.count(), bodies.labels().len());
    for with_fields in [false, true] {
        let per_type = Encoding::types(&boxes, &types, with_fields);
        let in_turn = merge_in_turn(per_type.dags(), with_fields);
        assert!(in_turn.growth.is_sorted() && in_turn.growth.last() == Some(&in_turn.dag.nodes().len()));
        let at_once = rayon_pool(3, || merge_on_all_cores(per_type.dags(), with_fields));
        // Merging must give the graph that is built when all labels have one type.
        let whole = Encoding::types(&boxes, &Types::dealt(bodies.labels().len(), 1), with_fields);
        for merged in [&in_turn.dag, &at_once.dag, &whole.dags()[0]] {
            let different: HashSet<_> = merged.nodes().iter().collect();
            assert_eq!(different.len(), merged.nodes().len());
            assert_eq!(merged.nodes().len(), whole.dags()[0].nodes().len());
        }
        assert_eq!(per_type.shared(at_once).unwrap().verify(&bodies), Ok(()));
        let separate: usize = per_type.dags().iter().map(|d| d.nodes().len()).sum();
        assert!(separate > whole.dags()[0].nodes().len());
    }
}

fn rayon_pool<T: Send>(threads: usize, f: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(f)
}

/// Compares first hits with a march in f64 whose steps are far smaller than a voxel, for rays in general position.
#[test]
fn first_hits_are_those_of_a_march() {
    let (_, bodies) = blobs([60, 50, 40], 25, 9, 11);
    let visible: Vec<bool> = (0..bodies.labels().len()).map(|l| l % 3 != 1).collect();
    let place = DAffine3::from_scale(DVec3::new(0.5, 1.0, 2.0)) * DAffine3::from_rotation_z(0.3);
    let march = |ray: &RayInWorld| {
        let (o, d) =
            (place.inverse().transform_point3(ray.origin), place.inverse().transform_vector3(ray.direction));
        (0..40_000).find_map(|i| {
            let t = f64::from(i) * 2e-4;
            let at = (o + t * d).floor();
            let inside = at.min_element() >= 0.0 && at.cmplt(DVec3::new(60.0, 50.0, 40.0)).all();
            let voxel = [at.x as u32, at.y as u32, at.z as u32];
            let label = bodies.label_at(voxel).expect("memory").filter(|_| inside)?;
            visible[label as usize].then_some((t, label, voxel))
        })
    };
    let mut s = 4u64;
    let mut random = || {
        s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (s >> 11) as f64 / (1u64 << 53) as f64
    };
    let rays: Vec<RayInWorld> = (0..300)
        .map(|_| {
            let mut point = |scale: f64| DVec3::new(random() - 0.5, random() - 0.5, random() - 0.5) * scale;
            let target = place.transform_point3(DVec3::new(30.0, 25.0, 20.0) + point(40.0));
            let origin = place.transform_point3(DVec3::new(30.0, 25.0, 20.0) + point(250.0));
            RayInWorld { origin, direction: (target - origin) * 0.2 }
        })
        .collect();
    let expected: Vec<_> = rays.iter().map(march).collect();
    let hits = expected.iter().flatten().count();
    assert!(hits > 120 && hits < 290, "{hits}");
    for side in SIDES {
        for (with_fields, e) in all_forms(&bodies, side) {
            let ways =
                [EncodingTracer::new(&e, place, &visible), EncodingTracer::discarding(&e, place, &visible)];
            for tracer in ways.map(Result::unwrap) {
                let mut nodes = 0;
                let mut apart = 0;
                for (ray, expected) in rays.iter().zip(&expected) {
                    let got = tracer.first_hit(ray, &mut nodes);
                    let same = match (&got, expected) {
                        (None, None) => true,
                        (Some(g), Some((t, label, voxel))) => {
                            (g.label, g.voxel) == (*label, *voxel) && g.t <= *t && g.t > t - 3e-4
                        }
                        _ => false,
                    };
                    apart += usize::from(!same);
                }
                // A step of the march may skip a corner whose chord is shorter than the step.
                assert!(apart <= 2, "{apart} of 300: {:?} {side:?} {with_fields}", e.form());
                assert!(nodes > 300);
            }
        }
    }
}

/// With boxes drawn solid, the hit is the first box along the ray; expected values are computed by hand.
#[test]
fn coarse_hits_are_the_boxes() {
    let mut ids = vec![0u32; 32 * 32 * 32];
    ids[5 + 32 * (6 + 32 * 7)] = 9;
    ids[20 + 32 * (21 + 32 * 22)] = 9;
    let volume = compress_labels(VolumeInfo::new([32; 3], LabelType::U32), LabelBuffer::U32(ids)).unwrap();
    let boxes = Subdivision::new(&volume, None);
    let e = Encoding::octrees(&boxes, true);
    let tracer = EncodingTracer::new(&e, DAffine3::IDENTITY, &[true]).unwrap();
    let ray = RayInWorld { origin: DVec3::new(10.5, -3.0, 10.5), direction: DVec3::Y };
    assert_eq!(tracer.first_hit(&ray, &mut 0), None);
    let hit = tracer.coarse(true).first_hit(&ray, &mut 0).unwrap();
    assert_eq!((hit.t, hit.label, hit.voxel, hit.axis), (9.0, 0, [10, 6, 10], Some(1)));
}

/// Two boxes share one root: each node below it is referenced once by its parent, the root twice.
#[test]
fn uses_are_counted() {
    let mut ids = vec![0u32; 16 * 16 * 48];
    for z in [0, 40] {
        for (x, y, dz) in [(0, 0, 0), (15, 15, 7)] {
            ids[x + 16 * (y + 16 * (z + dz))] = 1 + z as u32;
        }
    }
    let volume =
        compress_labels(VolumeInfo::new([16, 16, 48], LabelType::U32), LabelBuffer::U32(ids)).unwrap();
    let boxes = Subdivision::new(&volume, Some(16));
    let e = Encoding::types(&boxes, &Types::dealt(2, 1), true);
    assert_eq!(e.form(), Form::DagPerType);
    let reuse = Reuse::of(&e, true).unwrap();
    let levels: Vec<_> = reuse.levels.iter().map(|l| (l.side, l.nodes, l.references, l.once)).collect();
    assert_eq!(levels, [(4, 2, 2, 2), (8, 2, 2, 2), (16, 1, 2, 0)]);
    assert_eq!(reuse.ranked, [2, 1, 1, 1, 1]);
}
