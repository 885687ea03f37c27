//! The hierarchy over instances: compares rays through it with the plain definition, which asks each instance alone.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod exact;
#[path = "meshes/shapes.rs"]
#[expect(dead_code, reason = "made for another test too")]
mod shapes;

use std::sync::Arc;

use exact::volumes::{blobs, noise};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use pumice_cpu::traverse::{MeshTracer, SceneTracer, TracedInstance, VolumeTracer};
use pumice_scene::CutShape;
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Tracer};
use shapes::{Random, bumpy_ball};

/// The nearest of the hits of each instance alone; the first instance where several are equally near.
fn naive(scene: &SceneTracer, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
    let volumes = scene.volumes().iter().map(|v| v.first_hit(ray, from, t_max));
    let meshes = scene.meshes().iter().map(|m| m.first_hit(ray, from, t_max));
    let mut best: Option<Hit> = None;
    for hit in volumes.chain(meshes).flatten().filter(|h| h.t < t_max) {
        if best.is_none_or(|b| hit.t < b.t) {
            best = Some(hit);
        }
    }
    best
}

fn naive_occluded(scene: &SceneTracer, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> bool {
    scene.volumes().iter().any(|v| v.occluded(ray, from, t_max))
        || scene.meshes().iter().any(|m| m.occluded(ray, from, t_max))
}

/// Generates the placements of instances; `side` is about the length of one in its own space.
type Places = fn(&mut Random, usize, f64) -> DAffine3;

fn turned(random: &mut Random) -> DMat3 {
    DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, random.direction()))
}

fn somewhere(random: &mut Random, reach: f64) -> DVec3 {
    DVec3::new(random.next(), random.next(), random.next()) * reach
}

/// Each instance has a length of 1 in the world, unless its name says otherwise.
const PLACES: [(&str, Places); 11] = [
    ("turned", |r, _, side| {
        let m = turned(r) * (1.0 / side);
        DAffine3::from_mat3_translation(m, somewhere(r, 5.0))
    }),
    ("side by side in a lattice", |_, i, side| {
        let at = DVec3::new((i % 4) as f64, (i / 4 % 4) as f64, (i / 16) as f64);
        DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::splat(1.0 / side)), at)
    }),
    ("all at one place", |_, _, side| DAffine3::from_scale(DVec3::splat(1.0 / side))),
    ("two and two at one place, mirrored", |_, i, side| {
        let flip = if i % 2 == 0 { 1.0 } else { -1.0 };
        let m = DMat3::from_diagonal(DVec3::new(flip, 1.0, -flip) / side);
        DAffine3::from_mat3_translation(m, DVec3::splat((i / 2) as f64))
    }),
    ("sheared and squeezed", |r, _, side| {
        let shear = DMat3::from_cols(
            DVec3::new(1.0, 0.9, -0.4),
            DVec3::new(0.3, 0.001, 0.2),
            DVec3::new(-0.7, 0.1, 40.0),
        );
        DAffine3::from_mat3_translation(turned(r) * shear * (1.0 / side), somewhere(r, 30.0))
    }),
    ("nearly flat", |r, _, side| {
        let m = turned(r) * DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1e-7)) * turned(r);
        DAffine3::from_mat3_translation(m * (1.0 / side), somewhere(r, 5.0))
    }),
    ("of all sizes", |r, i, side| {
        let m = turned(r) * (10f64.powi(-((i % 7) as i32)) / side);
        DAffine3::from_mat3_translation(m, somewhere(r, 2.0))
    }),
    ("tiny", |r, _, side| DAffine3::from_mat3_translation(turned(r) * (1e-9 / side), somewhere(r, 5e-9))),
    ("huge", |r, _, side| DAffine3::from_mat3_translation(turned(r) * (1e9 / side), somewhere(r, 5e9))),
    ("far away", |r, _, side| {
        DAffine3::from_mat3_translation(turned(r) * (1.0 / side), DVec3::splat(1e7) + somewhere(r, 5.0))
    }),
    ("farther than doubles tell well", |r, _, side| {
        DAffine3::from_mat3_translation(turned(r) * (1.0 / side), DVec3::splat(-1e13) + somewhere(r, 5.0))
    }),
];

const COUNT: usize = 40;

/// Volumes, with and without cuts and at different levels of detail, with meshes among them.
fn scene(places: Places, seed: u64) -> (SceneTracer, SceneTracer) {
    let mut random = Random(seed);
    let volumes = [noise([21, 18, 24], 0.06, 3, 1).1, blobs([40, 33, 20], 14, 9, 2).1];
    let mesh = bumpy_ball(2, &mut random);
    let (mut of_volumes, mut of_meshes) = (Vec::new(), Vec::new());
    for i in 0..COUNT {
        if i % 4 != 3 {
            let volume = &volumes[i % 2];
            let world_from_index = places(&mut random, i, 24.0);
            let lod = if i % 5 == 0 { LodChoice::Cells } else { LodChoice::Voxels };
            let visible = vec![true; volume.labels().len()];
            let traced = TracedInstance { volume: Arc::clone(volume), world_from_index, visible, lod };
            let built = VolumeTracer::new(of_volumes.len() as u32, &traced).unwrap();
            let middle = world_from_index.transform_point3(DVec3::splat(10.0));
            let cut = CutShape::Plane { point: middle.into(), normal: random.direction().into() };
            of_volumes.push(Arc::new(if i % 6 == 0 { built.with_cuts([&cut]) } else { built }));
        } else {
            of_meshes.push(places(&mut random, i, 2.0));
        }
    }
    let first = of_volumes.len() as u32;
    let built = (0u32..).zip(of_meshes).map(|(i, at)| MeshTracer::new(i, first + i, &mesh, at).unwrap());
    let built: Vec<_> = built.map(Arc::new).collect();
    let linear = SceneTracer::of(of_volumes.clone()).with_meshes(built.clone());
    let (tree, made) = SceneTracer::of(of_volumes).with_meshes(built).with_tree(1).unwrap();
    assert!(made);
    (linear, tree)
}

/// A ray from a random point nearby to a point of some instance.
fn aimed(scene: &SceneTracer, random: &mut Random) -> RayInWorld {
    let mut point = || {
        let count = (scene.volumes().len() + scene.meshes().len()) as f64;
        let number = (random.next() * count) as usize;
        let (place, side) = match scene.volumes().get(number) {
            Some(volume) => (volume.placement().world_from_index, 24.0),
            None => {
                let mesh = &scene.meshes()[number - scene.volumes().len()];
                (mesh.placement().world_from_index, f64::from(1 << 20))
            }
        };
        let beside = if random.next() < 0.3 { 4.0 } else { 1.0 };
        let mut at = somewhere(random, beside);
        if random.next() < 0.3 {
            // On a lattice of faces, edges and corners.
            at = (at * 8.0).round() / 8.0;
        }
        place.transform_point3(at * side)
    };
    let (origin, target) = (point(), point());
    let mut direction = target - origin;
    if random.next() < 0.2 {
        let axis = (random.next() * 3.0) as usize;
        direction = DVec3::ZERO.with_axis(axis, direction[axis]);
    }
    RayInWorld { origin, direction }
}

trait WithAxis {
    fn with_axis(self, axis: usize, value: f64) -> Self;
}

impl WithAxis for DVec3 {
    fn with_axis(mut self, axis: usize, value: f64) -> Self {
        self[axis] = value;
        self
    }
}

/// First hits, shadows and picks with and without a limit, and for paths that continue from a hit: equal to the bit.
#[test]
fn hits_are_the_plain_definitions() {
    for (name, places) in PLACES {
        let (linear, tree) = scene(places, 5);
        let mut random = Random(77);
        let (mut hits, mut onward, mut shadows) = (0, 0, 0);
        for _ in 0..1500 {
            let (mut ray, mut from) = (aimed(&linear, &mut random), PathOrigin::Free);
            for bounce in 0..4 {
                let limit = if random.next() < 0.3 { 0.5 * random.next() } else { f64::INFINITY };
                let expected = naive(&linear, &ray, from, limit);
                for (way, scene) in [("in turn", &linear), ("by the tree", &tree)] {
                    let got = scene.first_hit(&ray, from, limit);
                    assert_eq!(got, expected, "{name}, {way}, bounce {bounce}: {ray:?} {from:?} to {limit}");
                    let got = scene.occluded(&ray, from, limit);
                    let expected = naive_occluded(&linear, &ray, from, limit);
                    assert_eq!(got, expected, "{name}, {way}: occluded {ray:?} {from:?} to {limit}");
                    shadows += usize::from(got);
                }
                // Limits at the hit and slightly beyond it: just missed, and just hit.
                if let Some(hit) = expected {
                    for limit in [hit.t, hit.t * (1.0 + 1e-15), hit.t * (1.0 + 1e-9)] {
                        let expected = naive(&linear, &ray, from, limit);
                        assert_eq!(tree.first_hit(&ray, from, limit), expected, "{name}: {ray:?} to {limit}");
                        assert_eq!(
                            linear.first_hit(&ray, from, limit),
                            expected,
                            "{name}: {ray:?} to {limit}"
                        );
                    }
                }
                let Some(hit) = expected else { break };
                hits += 1;
                onward += usize::from(bounce > 0);
                let mut direction = random.direction() * ray.direction.length();
                if (direction.dot(hit.normal_in_world) < 0.0) != (random.next() < 0.3) {
                    direction = -direction;
                }
                ray = RayInWorld { origin: ray.origin + ray.direction * hit.t, direction };
                from = PathOrigin::Face(hit.surface);
            }
        }
        println!("{name}: {hits} hits, {onward} of them onward, {shadows} shadows");
        assert!(hits > 600 && onward > 100, "{name}: {hits} hits, {onward} onward");
    }
}

/// Where instances coincide, so do their surfaces: the lowest index is reported, whatever the order of asking.
#[test]
fn the_first_of_equals_is_told() {
    let (linear, tree) = scene(PLACES[2].1, 9);
    let mut random = Random(3);
    let (mut equal, mut all) = (0, 0);
    for _ in 0..2000 {
        let ray = aimed(&linear, &mut random);
        let Some(hit) = tree.first_hit(&ray, PathOrigin::Free, f64::INFINITY) else { continue };
        let each = linear.volumes().iter().filter_map(|v| v.first_hit(&ray, PathOrigin::Free, f64::INFINITY));
        let as_near: Vec<u32> = each.filter(|h| h.t == hit.t).map(|h| h.surface.instance).collect();
        assert!(as_near.iter().all(|&i| i >= hit.surface.instance), "{hit:?} of {as_near:?}");
        all += 1;
        equal += usize::from(as_near.len() > 1);
    }
    assert!(equal * 2 > all && all > 500, "{equal} of {all}");
}

/// A thousand instances at one place: their bounds are equal, and the results are the same as without a hierarchy.
#[test]
fn many_at_one_place_are_as_in_turn() {
    let volume = blobs([16, 16, 16], 5, 6, 2).1;
    let visible = vec![true; volume.labels().len()];
    let traced =
        TracedInstance { volume, world_from_index: DAffine3::IDENTITY, visible, lod: LodChoice::Voxels };
    let first = VolumeTracer::new(0, &traced).unwrap();
    let others = (0..1000).map(|i| first.again(i, DAffine3::IDENTITY, LodChoice::Voxels).unwrap().unwrap());
    let volumes: Vec<_> = others.map(Arc::new).collect();
    let linear = SceneTracer::of(volumes.clone());
    let (tree, made) = SceneTracer::of(volumes).with_tree(4).unwrap();
    let levels = tree.tree().unwrap().bvh().depth();
    assert!(made && levels <= 6, "{levels} levels");
    // One hierarchy of boxes, however many instances share it.
    assert_eq!(linear.bytes(), first.bytes());
    let mut random = Random(1);
    for _ in 0..300 {
        let origin = random.direction() * 40.0 + 8.0;
        let ray = RayInWorld { origin, direction: somewhere(&mut random, 16.0) - origin };
        let hit = linear.first_hit(&ray, PathOrigin::Free, f64::INFINITY);
        assert_eq!(tree.first_hit(&ray, PathOrigin::Free, f64::INFINITY), hit);
        assert!(hit.is_none_or(|h| h.surface.instance == 0));
    }
}

/// Instances that draw nothing, no instances, invalid rays: there are no hits and no panics.
#[test]
fn nothing_is_met_where_nothing_is() {
    let volume = blobs([16, 16, 16], 5, 6, 2).1;
    let hidden = TracedInstance {
        visible: vec![false; volume.labels().len()],
        volume,
        world_from_index: DAffine3::IDENTITY,
        lod: LodChoice::Voxels,
    };
    let hidden: Vec<_> = (0..9).map(|i| Arc::new(VolumeTracer::new(i, &hidden).unwrap())).collect();
    let ray = RayInWorld { origin: DVec3::splat(-9.0), direction: DVec3::ONE };
    for volumes in [Vec::new(), hidden] {
        let (scene, made) = SceneTracer::of(volumes).with_tree(1).unwrap();
        assert!(!made && scene.tree().is_none());
        assert_eq!(scene.first_hit(&ray, PathOrigin::Free, f64::INFINITY), None);
    }
    let (_, tree) = scene(PLACES[0].1, 5);
    for bad in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
        let ray = RayInWorld { direction: bad, ..ray };
        assert_eq!(tree.first_hit(&ray, PathOrigin::Free, f64::INFINITY), None);
        assert!(!tree.occluded(&ray, PathOrigin::Free, f64::INFINITY));
        let ray = RayInWorld { origin: bad, direction: DVec3::ONE };
        let is_number = bad == DVec3::ZERO;
        assert!(is_number || tree.first_hit(&ray, PathOrigin::Free, f64::INFINITY).is_none());
    }
}
