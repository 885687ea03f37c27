//! Cuts: the first surface of the remaining parts, compared with points that are classified one by one in the world. The oracle uses
//! neither hierarchies nor planes in index space: it collects every t at which a ray may enter something else, and classifies points in
//! between.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

mod exact;

use std::sync::Arc;

use exact::Dense;
use exact::volumes::{Random, blobs, neurites, noise, sheets};
use glam::{DAffine3, DMat3, DVec3};
use pumice_core::CompressedVolume;
use pumice_cpu::traverse::{TracedInstance, VolumeTracer};
use pumice_scene::CutShape;
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, RayInWorld, SurfaceKind, Tracer};

fn tracer(volume: &Arc<CompressedVolume>, place: DAffine3, cuts: &[CutShape]) -> VolumeTracer {
    let visible = vec![true; volume.labels().len()];
    let traced = TracedInstance {
        volume: Arc::clone(volume),
        world_from_index: place,
        visible,
        lod: LodChoice::Voxels,
    };
    VolumeTracer::new(0, &traced).unwrap().with_cuts(cuts)
}

/// Whether a cut removes a point.
fn takes(cut: &CutShape, p: DVec3) -> bool {
    match cut {
        CutShape::Plane { point, normal } => DVec3::from(*normal).dot(p - DVec3::from(*point)) > 0.0,
        CutShape::Box { world_from_box } => {
            world_from_box.inverse().transform_point3(p).abs().max_element() < 1.0
        }
    }
}

/// A surface: t, label + 1, whether it is a cap, whether the ray leaves the label through it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    t: f64,
    label: u32,
    cap: bool,
    from_inside: bool,
}

/// The values of t at which the ray may cross a cut.
fn crossings(cut: &CutShape, ray: &RayInWorld, into: &mut Vec<f64>) {
    match cut {
        CutShape::Plane { point, normal } => {
            let n = DVec3::from(*normal);
            into.push(n.dot(DVec3::from(*point) - ray.origin) / n.dot(ray.direction));
        }
        CutShape::Box { world_from_box } => {
            let inverse = world_from_box.inverse();
            let (o, d) = (inverse.transform_point3(ray.origin), inverse.transform_vector3(ray.direction));
            for a in 0..3 {
                into.extend([(-1.0 - o[a]) / d[a], (1.0 - o[a]) / d[a]]);
            }
        }
    }
}

/// The first surface, by classification of points.
fn oracle(dense: &Dense, place: &DAffine3, cuts: &[CutShape], ray: &RayInWorld) -> Option<Seen> {
    let inverse = place.inverse();
    let (o, d) = (inverse.transform_point3(ray.origin), inverse.transform_vector3(ray.direction));
    let mut all = Vec::new();
    for a in 0..3 {
        all.extend((0..=dense.dims[a]).map(|p| (f64::from(p) - o[a]) / d[a]));
    }
    cuts.iter().for_each(|cut| crossings(cut, ray, &mut all));
    all.retain(|&t| t > 0.0 && t.is_finite());
    all.sort_by(f64::total_cmp);
    let is_taken = |t: f64| cuts.iter().any(|cut| takes(cut, ray.origin + ray.direction * t));
    let label_at = |t: f64| {
        if is_taken(t) { 0 } else { dense.at((o + d * t).floor().to_array().map(|x| x as i64)) }
    };
    let (mut start, mut first) = (0.0, None);
    for (i, &t) in all.iter().enumerate() {
        let next = all.get(i + 1).map_or(t + 1.0, |n| *n);
        let before = 0.5 * (start + t);
        let first = *first.get_or_insert_with(|| label_at(before));
        // A cut along faces: both are at the same t, and the interval between them is empty.
        if next - t <= 1e-9 * (1.0 + t) {
            continue;
        }
        let after = 0.5 * (t + next);
        let behind = label_at(after);
        if first != 0 && behind != first {
            return Some(Seen { t, label: first, cap: is_taken(after), from_inside: true });
        }
        if first == 0 && behind != 0 {
            return Some(Seen { t, label: behind, cap: is_taken(before), from_inside: false });
        }
        start = t;
    }
    None
}

fn seen(hit: &Hit) -> Seen {
    let s = hit.surface;
    Seen { t: hit.t, label: s.label + 1, cap: s.kind == SurfaceKind::Cap, from_inside: hit.from_inside }
}

/// Tolerance for the rounding of t in both methods: some operations on coordinates of a few hundred.
fn agree(a: Option<Seen>, b: Option<Seen>) -> bool {
    match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => (a.t - b.t).abs() <= 1e-8 * (1.0 + a.t) && Seen { t: a.t, ..b } == a,
        _ => false,
    }
}

fn direction(random: &mut Random) -> DVec3 {
    loop {
        let v = DVec3::from([0; 3].map(|_| 2.0 * random.unit() - 1.0));
        if v.length() > 0.1 && v.length() < 1.0 {
            return v;
        }
    }
}

fn point(random: &mut Random, dims: [u32; 3], beyond: f64) -> DVec3 {
    let dims = DVec3::from(dims.map(f64::from));
    let at = DVec3::from([0; 3].map(|_| random.unit()));
    at * dims * (1.0 + 2.0 * beyond) - dims * beyond
}

/// Random planes and boxes, some of them along the axes, and some of these between voxels.
fn cuts(random: &mut Random, dims: [u32; 3], place: &DAffine3) -> Vec<CutShape> {
    let count = 1 + (random.unit() * 4.0) as usize;
    let one = |random: &mut Random| {
        let mut at = point(random, dims, 0.0);
        let along = random.unit() < 0.5;
        if along && random.unit() < 0.5 {
            at = at.round();
        }
        let at = place.transform_point3(at);
        if random.unit() < 0.5 {
            let normal = if along {
                let axis = [DVec3::X, DVec3::Y, DVec3::Z][(random.unit() * 3.0) as usize];
                place.matrix3.inverse().transpose() * axis * if random.unit() < 0.5 { 7.0 } else { -0.1 }
            } else {
                direction(random)
            };
            return CutShape::Plane { point: at.into(), normal: normal.into() };
        }
        let size = point(random, dims, 0.0) * 0.5 + 0.5;
        let sides = if along {
            place.matrix3 * DMat3::from_diagonal(size.round() * 0.5)
        } else {
            place.matrix3
                * DMat3::from_cols(direction(random), direction(random), direction(random))
                * DMat3::from_diagonal(size * 0.5)
        };
        CutShape::Box { world_from_box: DAffine3::from_mat3_translation(sides, at) }
    };
    (0..count).map(|_| one(random)).collect()
}

fn places() -> [DAffine3; 3] {
    let spacing = DAffine3::from_scale(DVec3::new(16.0, 16.0, 40.0));
    let sheared =
        DMat3::from_cols(DVec3::new(1.0, 0.2, 0.0), DVec3::new(-0.3, -1.1, 0.4), DVec3::new(0.1, 0.0, 0.7));
    [
        DAffine3::IDENTITY,
        DAffine3::from_translation(DVec3::new(1e6, -3e5, 12.5)) * spacing,
        DAffine3::from_mat3_translation(sheared, DVec3::new(3.0, -7.0, 0.5)),
    ]
}

fn volumes() -> [(Dense, Arc<CompressedVolume>); 4] {
    [noise([21, 34, 19], 0.3, 5, 3), sheets([40, 22, 35]), blobs([40, 31, 33], 12, 20, 5), neurites()]
}

/// Numbers of wrong rays, of caps, and of all rays; a t that is off by rounding alone counts as right.
fn wrong_of(fault: f64) -> (u32, u32, u32) {
    let (mut wrong, mut caps, mut all) = (0, 0, 0);
    let mut random = Random(99);
    for (dense, compressed) in volumes() {
        for place in places() {
            // t of the oracle and of the tracer are compared in the world: far away the unit of f64 is coarse.
            for _ in 0..12 {
                let shapes = cuts(&mut random, dense.dims, &place);
                let drawn = tracer(&compressed, place, &shapes);
                let expected: Vec<CutShape> = shapes
                    .iter()
                    .map(|cut| match *cut {
                        CutShape::Plane { point, normal } => {
                            let moved = DVec3::from(point) + fault * DVec3::from(normal).normalize();
                            CutShape::Plane { point: moved.into(), normal }
                        }
                        whole @ CutShape::Box { .. } => whole,
                    })
                    .collect();
                for _ in 0..60 {
                    let origin = place.transform_point3(point(&mut random, dense.dims, 0.3));
                    let towards = place.transform_point3(point(&mut random, dense.dims, 0.0));
                    let ray = RayInWorld { origin, direction: (towards - origin).normalize() };
                    let hit = drawn.first_hit(&ray, PathOrigin::Free, f64::INFINITY);
                    let hit = hit.as_ref().map(seen);
                    let expected = oracle(&dense, &place, &expected, &ray);
                    all += 1;
                    caps += u32::from(expected.is_some_and(|e| e.cap));
                    if !agree(expected, hit) {
                        if wrong == 0 && fault == 0.0 {
                            eprintln!("{ray:?} {shapes:?}: expected {expected:?}, got {hit:?}");
                        }
                        wrong += 1;
                    }
                    // `occluded` agrees with the hit.
                    if let Some(h) = hit {
                        for (t_max, blocked) in [(h.t * 0.999, false), (h.t * 1.001, true)] {
                            assert_eq!(
                                drawn.occluded(&ray, PathOrigin::Free, t_max),
                                blocked,
                                "{ray:?} {t_max}"
                            );
                        }
                    } else {
                        assert!(!drawn.occluded(&ray, PathOrigin::Free, f64::INFINITY), "{ray:?}");
                    }
                }
            }
        }
    }
    (wrong, caps, all)
}

#[test]
fn rays_meet_what_the_cuts_left() {
    let (wrong, caps, all) = wrong_of(0.0);
    println!("{all} rays, {caps} caps");
    assert_eq!(wrong, 0);
    // Caps were tested, and not caps alone.
    assert!(caps > all / 20 && caps < all / 2, "{caps} of {all}");
    // Negative control: planes off by a thousandth of a unit are noticed.
    let (wrong, ..) = wrong_of(1e-3);
    assert!(wrong > caps / 10, "{wrong}");
}

/// A cut between voxels equals a volume without the voxels behind it, to the bit, and its caps are in the places of their faces.
#[test]
fn a_cut_between_voxels_leaves_whole_voxels() {
    let mut random = Random(7);
    let mut caps = 0;
    for (dense, compressed) in volumes() {
        for axis in 0..3 {
            for up in [false, true] {
                let plane = (dense.dims[axis] / 2) as usize;
                let kept = |v: [usize; 3]| (v[axis] >= plane) != up;
                let [w, h, _] = dense.dims.map(|d| d as usize);
                let labels = dense
                    .labels
                    .iter()
                    .enumerate()
                    .map(|(i, &l)| if kept([i % w, i / w % h, i / (w * h)]) { l } else { 0 })
                    .collect();
                let shaved = Dense { dims: dense.dims, labels };
                // With a spacing of a tenth, a plane of the world, k/10, divided by the spacing is a whole number except for rounding.
                let place = DAffine3::from_scale(DVec3::new(0.1, 0.3, 0.7));
                let mut at = [0.0; 3];
                at[axis] = plane as f64 * [0.1, 0.3, 0.7][axis];
                let mut normal = [0.0; 3];
                normal[axis] = if up { 2.0 } else { -2.0 };
                let drawn = tracer(&compressed, place, &[CutShape::Plane { point: at, normal }]);
                let mut met = 0;
                for _ in 0..2000 {
                    let origin = place.transform_point3(point(&mut random, dense.dims, 0.5));
                    let inside = point(&mut random, dense.dims, 0.0);
                    let voxel = inside.floor().to_array().map(|x| x as i64);
                    let ray = RayInWorld { origin, direction: place.transform_point3(inside) - origin };
                    let index = place.inverse().transform_point3(origin);
                    if shaved.at(index.floor().to_array().map(|x| x as i64)) != 0 || dense.at(voxel) == 0 {
                        continue;
                    }
                    let hit = drawn.first_hit(&ray, PathOrigin::Free, f64::INFINITY);
                    let expected = oracle(&shaved, &place, &[], &ray);
                    let same = match (&hit, &expected) {
                        (Some(hit), Some(e)) => {
                            (hit.t - e.t).abs() <= 1e-9 && hit.surface.label + 1 == e.label
                        }
                        (None, None) => true,
                        _ => false,
                    };
                    assert!(same, "axis {axis} {up}: {ray:?}: expected {expected:?}, got {hit:?}");
                    met += u32::from(hit.is_some_and(|h| h.surface.kind == SurfaceKind::Cap));
                }
                caps += met;
                assert!(met > 0, "{met} caps");
            }
        }
    }
    assert!(caps > 1000, "{caps}");
}

/// Paths that continue from a cap: outward, a path never hits that cap or anything under it again; inward, it starts in the label of the
/// cap.
#[test]
fn paths_go_on_from_caps() {
    let mut random = Random(1234);
    let (mut outward, mut inward, mut at_once) = (0, 0, 0);
    for (dense, compressed) in volumes() {
        for place in places() {
            let scale = place.matrix3.determinant().abs().cbrt();
            for _ in 0..25 {
                let shapes = cuts(&mut random, dense.dims, &place);
                let drawn = tracer(&compressed, place, &shapes);
                for _ in 0..40 {
                    let origin = place.transform_point3(point(&mut random, dense.dims, 0.3));
                    let towards = place.transform_point3(point(&mut random, dense.dims, 0.0));
                    let ray = RayInWorld { origin, direction: towards - origin };
                    let Some(hit) = drawn.first_hit(&ray, PathOrigin::Free, f64::INFINITY) else { continue };
                    if hit.surface.kind != SurfaceKind::Cap {
                        continue;
                    }
                    let out = hit.normal_in_world;
                    assert!((out.length() - 1.0).abs() < 1e-12);
                    assert_eq!(hit.from_inside, out.dot(ray.direction) > 0.0, "{hit:?}");
                    let at = ray.origin + ray.direction * hit.t;
                    for _ in 0..4 {
                        let d = direction(&mut random).normalize();
                        let next = RayInWorld { origin: at, direction: d };
                        let found = drawn.first_hit(&next, PathOrigin::Face(hit.surface), f64::INFINITY);
                        // The oracle starts a little further along the ray, because it does not know surfaces.
                        let ahead = 1e-6 * scale;
                        let moved = RayInWorld { origin: at + d * ahead, direction: d };
                        let expected = oracle(&dense, &place, &shapes, &moved);
                        let steep = d.dot(out).abs() > 0.01;
                        let far = expected.is_none_or(|e| e.t > 100.0 * ahead);
                        if !steep || !far {
                            continue;
                        }
                        // Very close to a face of a voxel or to another cut either result is right. That is rare, while hitting the cap
                        // that the path leaves would not be.
                        if found.as_ref().is_some_and(|f| f.t <= 100.0 * ahead) {
                            at_once += 1;
                            continue;
                        }
                        let same = match (&found, &expected) {
                            (None, None) => true,
                            (Some(f), Some(e)) => {
                                (f.t - e.t - ahead).abs() <= 1e-3 * ahead && Seen { t: e.t, ..seen(f) } == *e
                            }
                            _ => false,
                        };
                        assert!(same, "{shapes:?} {hit:?} {next:?}: expected {expected:?}, got {found:?}");
                        if d.dot(out) > 0.0 {
                            outward += 1;
                        } else {
                            inward += 1;
                            assert!(
                                found.is_some_and(|f| f.from_inside && f.surface.label == hit.surface.label)
                            );
                        }
                    }
                }
            }
        }
    }
    println!("{outward} outward, {inward} inward, {at_once} met something at once");
    assert!(outward > 1000 && inward > 1000, "{outward} {inward}");
    // A point is within 100 of these steps (1e-4 voxels) of one of its voxel's six faces about once in a thousand times.
    assert!(200 * at_once < outward + inward, "{at_once} paths met something at once");
}

/// Rays along cuts, in the middle of voxels and between them; cuts that remove everything, nothing, or lie beyond the volume.
#[test]
fn cuts_at_their_limits() {
    let (dense, compressed) = noise([16, 16, 16], 1.0, 1, 1);
    assert!(dense.labels.iter().all(|&l| l != 0));
    let plane = |z: f64, up: f64| CutShape::Plane { point: [0.0, 0.0, z], normal: [0.0, 0.0, up] };
    let along = |z: f64| RayInWorld { origin: DVec3::new(-5.0, 8.3, z), direction: DVec3::X };
    let hit = |cuts: &[CutShape], ray: &RayInWorld| {
        tracer(&compressed, DAffine3::IDENTITY, cuts).first_hit(ray, PathOrigin::Free, f64::INFINITY)
    };
    // The ray is parallel to the plane: only its position counts, at less than a voxel.
    for (cut, z, meets) in [
        (plane(8.3, 1.0), 8.2, true),
        (plane(8.3, 1.0), 8.4, false),
        (plane(8.3, -1.0), 8.2, false),
        (plane(8.3, -1.0), 8.4, true),
        (plane(8.0, 1.0), 7.999, true),
        (plane(8.0, 1.0), 8.001, false),
    ] {
        assert_eq!(hit(&[cut], &along(z)).is_some(), meets, "{cut:?} {z}");
    }
    // Tiny and huge normals give the same result.
    for length in [1e-300, 1e300] {
        assert!(hit(&[plane(8.3, length)], &along(8.4)).is_none());
        assert_eq!(hit(&[plane(8.3, length)], &along(8.2)).unwrap().t, 5.0);
    }
    let down = RayInWorld { origin: DVec3::new(8.3, 8.3, 40.0), direction: -DVec3::Z };
    assert!(hit(&[plane(-1.0, 1.0)], &down).is_none(), "all is taken");
    assert_eq!(hit(&[plane(17.0, 1.0)], &down).unwrap().surface.kind, SurfaceKind::Face);
    // A thousand overlapping boxes, each a slice: t is the end of the last one.
    let slices: Vec<CutShape> = (0..1000)
        .map(|i| {
            let at = DVec3::new(8.0, 8.0, 16.0 - 0.01 * f64::from(i));
            let sides = DMat3::from_diagonal(DVec3::new(20.0, 20.0, 0.006));
            CutShape::Box { world_from_box: DAffine3::from_mat3_translation(sides, at) }
        })
        .collect();
    let found = hit(&slices, &down).unwrap();
    assert!((found.t - (40.0 - (16.0 - 9.99 - 0.006))).abs() < 1e-9, "{found:?}");
    assert!((found.normal_in_world - DVec3::Z).length() < 1e-12);
    // A box much thinner than a voxel splits the voxel: a ray from above hits the cap below the slit, and a ray from below the one above
    // it.
    let slit = slices[400];
    let up = RayInWorld { origin: DVec3::new(8.3, 8.3, -4.0), direction: DVec3::Z };
    for ray in [down, up] {
        let t = |cuts: &[CutShape], from: PathOrigin, r: &RayInWorld| {
            tracer(&compressed, DAffine3::IDENTITY, cuts).first_hit(r, from, f64::INFINITY)
        };
        let first = t(&[slit], PathOrigin::Free, &ray).unwrap();
        assert_eq!(first.surface.kind, SurfaceKind::Face);
        let within = RayInWorld { origin: ray.origin + ray.direction * first.t, ..ray };
        let end = t(&[slit], PathOrigin::Face(first.surface), &within).unwrap();
        assert!(end.from_inside && end.surface.kind == SurfaceKind::Cap, "{end:?}");
        assert!((end.normal_in_world - ray.direction).length() < 1e-12);
        let gap = RayInWorld { origin: within.origin + ray.direction * end.t, ..ray };
        let over = t(&[slit], PathOrigin::Face(end.surface), &gap).unwrap();
        assert!(!over.from_inside && (over.t - 0.012).abs() < 1e-9, "{over:?}");
    }
}
