//! Rays against triangles.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::MeshData;
use pumice_cpu::traverse::MeshTracer;
use pumice_transport::{PathOrigin, RayInWorld, SurfaceKind, Tracer};

use crate::shapes::{Random, bumpy_ball, cube};

fn tracer(mesh: &Arc<MeshData>, world_from_mesh: DAffine3) -> MeshTracer {
    MeshTracer::new(0, 4, mesh, world_from_mesh).unwrap()
}

type Whole = [i128; 3];

fn minus(a: Whole, b: Whole) -> Whole {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn cross(a: Whole, b: Whole) -> Whole {
    [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn dot(a: Whole, b: Whole) -> i128 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// Whether, and at which t, the exact line through `o` along `d` meets a triangle; t is a fraction with a denominator above 0. `Err` where
/// the line passes an edge by less than a thousandth of a unit: the mesh is a hundred wide, of which f32 resolves a hundred thousandth of
/// that.
fn exact(o: Whole, d: Whole, [a, b, c]: [Whole; 3]) -> Result<Option<(i128, i128)>, ()> {
    let [a, b, c] = [a, b, c].map(|p| minus(p, o));
    let size = |v: Whole| (dot(v, v) as f64).sqrt();
    let edges = [(b, c), (c, a), (a, b)].map(|(p, q)| {
        let volume = dot(d, cross(p, q));
        let close = (volume as f64).abs() < 1e-3 * size(cross(d, minus(q, p)));
        (volume, close)
    });
    if edges.iter().any(|e| e.1) {
        return Err(());
    }
    let above = edges.iter().filter(|e| e.0 > 0).count();
    if above != 0 && above != 3 {
        return Ok(None);
    }
    let normal = cross(minus(b, a), minus(c, a));
    let (over, under) = (dot(normal, a), dot(normal, d));
    Ok(Some(if under < 0 { (-over, -under) } else { (over, under) }))
}

#[test]
fn random_triangles_are_hit_where_whole_numbers_say() {
    let mut random = Random(1);
    let (mut compared, mut hits, mut close) = (0, 0, 0);
    for round in 0..60 {
        let mut corner = || [0; 3].map(|_| i128::from(random.whole(50)));
        let soup: Vec<[Whole; 3]> = (0..40).map(|_| [corner(), corner(), corner()]).collect();
        let positions = soup.iter().flatten().map(|p| p.map(|v| v as f64)).collect();
        let triangles = (0..40u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Arc::new(MeshData::new(positions, triangles, Vec::new()).unwrap());
        let tracer = tracer(&mesh, DAffine3::IDENTITY);
        for _ in 0..200 {
            // From far away too: the ray is then first moved to the mesh.
            let reach = if round % 2 == 0 { 60 } else { 1_000_000 };
            let o = [0; 3].map(|_| i128::from(random.whole(reach)));
            let aim = [0; 3].map(|_| i128::from(random.whole(50)));
            let d = minus(aim, o);
            if d == [0; 3] {
                continue;
            }
            let met: Result<Vec<_>, ()> = soup.iter().map(|&triangle| exact(o, d, triangle)).collect();
            let Ok(met) = met else {
                close += 1;
                continue;
            };
            let ahead = met.iter().enumerate().filter_map(|(i, t)| t.map(|t| (i, t)));
            let nearest = ahead
                .filter(|(_, (over, _))| *over > 0)
                .min_by(|(_, a), (_, b)| (a.0 * b.1).cmp(&(b.0 * a.1)));
            let vector = |v: Whole| DVec3::from([0, 1, 2].map(|i| v[i] as f64));
            let ray = RayInWorld { origin: vector(o), direction: vector(d) };
            let hit = tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY);
            compared += 1;
            let expected = nearest.map(|(i, (over, under))| (i as u32, over as f64 / under as f64));
            match (hit, expected) {
                (None, None) => {}
                (Some(hit), Some((triangle, t))) => {
                    hits += 1;
                    let s = hit.surface;
                    let got = (s.kind, s.plane, s.label, s.instance);
                    assert_eq!(got, (SurfaceKind::Triangle, triangle, 0, 4));
                    // f64 throughout, except for the corners, which are whole numbers here and exact in f32.
                    assert!((hit.t - t).abs() <= 1e-9 * t, "{} for {t}", hit.t);
                    let [a, b, c] = soup[triangle as usize];
                    let normal = vector(cross(minus(b, a), minus(c, a))).normalize();
                    assert!(hit.normal_in_world.distance(normal) < 1e-12);
                    assert_eq!(hit.from_inside, normal.dot(ray.direction) > 0.0);
                    // Nothing occludes the ray before the hit, and the triangle itself does after it.
                    assert!(tracer.occluded(&ray, PathOrigin::Free, t * (1.0 + 1e-8)));
                    assert!(!tracer.occluded(&ray, PathOrigin::Free, t * (1.0 - 1e-8)));
                }
                (got, expected) => panic!("got {got:?}, expected {expected:?} from {o:?} along {d:?}"),
            }
        }
    }
    assert!(compared > 10_000 && hits > 3_000 && close < 1_000, "{compared}, {hits}, {close}");
}

/// Möller and Trumbore 1997 in f32, as published: a negative control that has cracks.
fn with_cracks(o: DVec3, d: DVec3, corners: [DVec3; 3]) -> bool {
    let [a, b, c] = corners.map(|p| p.as_vec3());
    let (o, d) = (o.as_vec3(), d.as_vec3());
    let (e1, e2) = (b - a, c - a);
    let p = d.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let s = o - a;
    let u = s.dot(p) * inverse;
    let q = s.cross(e1);
    let v = d.dot(q) * inverse;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && e2.dot(q) * inverse > 0.0
}

#[test]
fn nothing_gets_out_of_a_closed_mesh() {
    let mut random = Random(2);
    let mesh = bumpy_ball(4, &mut random);
    let corners = |t: &[u32; 3]| t.map(|c| DVec3::from(mesh.positions()[c as usize]));
    let far = DAffine3 {
        matrix3: DMat3::from_rotation_x(0.4) * DMat3::from_diagonal(DVec3::new(3.0, -0.2, 1.0)),
        translation: DVec3::new(700.0, -3.0, 1e5),
    };
    let mut lost_by_control = 0;
    for place in [DAffine3::IDENTITY, far] {
        let tracer = tracer(&mesh, place);
        for (i, triangle) in mesh.triangles().iter().enumerate() {
            let [a, b, c] = corners(triangle);
            // At corners, at edges, and into the middle.
            let middle = (a + b + c) / 3.0;
            for aim in [a, (a + b) / 2.0, b * 0.3 + c * 0.7, middle] {
                let from = random.direction() * 0.3 * random.next();
                let origin = place.transform_point3(from);
                let ray = RayInWorld { origin, direction: place.transform_point3(aim) - origin };
                let hit = tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY);
                let hit = hit.unwrap_or_else(|| panic!("out of triangle {i} at {aim}"));
                // (At a corner, a ray may merely touch a part that bulges inward.)
                assert!(hit.from_inside || aim != middle, "seen from within, in a mirrored place too");
                assert!(tracer.occluded(&ray, PathOrigin::Free, f64::INFINITY));
                if place == DAffine3::IDENTITY {
                    let mut all = mesh.triangles().iter().map(corners);
                    lost_by_control += usize::from(!all.any(|t| with_cracks(from, aim - from, t)));
                }
            }
        }
    }
    assert!(lost_by_control > 0, "these rays find no cracks");
}

#[test]
fn a_path_from_a_convex_mesh_never_meets_it_again() {
    let mut random = Random(3);
    let turned = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_y(-0.3);
    let sheared = DMat3::from_cols(DVec3::X * 5.0, DVec3::new(2.0, 0.3, 0.1), DVec3::new(0.0, 1.0, -1.0));
    let (mut again_if_free, mut asked) = (0, 0);
    for (side, matrix3, translation) in [
        (1.0, DMat3::IDENTITY, DVec3::ZERO),
        (0.3, turned, DVec3::new(1e5, -3e5, 7.0)),
        (1e-6, turned * sheared, DVec3::new(3.0, 1.0, 4.0)),
        (1e6, sheared, DVec3::new(1e7, 0.0, 0.0)),
    ] {
        let place = DAffine3 { matrix3, translation };
        let mesh = cube(side, 6);
        let tracer = tracer(&mesh, place);
        for _ in 0..4_000 {
            let middle = place.transform_point3(DVec3::splat(side / 2.0));
            let out = place.transform_vector3(random.direction() * side * 3.0);
            let ray = RayInWorld { origin: middle + out, direction: -out };
            let hit = tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY).unwrap();
            assert!(!hit.from_inside && hit.normal_in_world.dot(out) > 0.0);
            // Away from the surface, often nearly along it.
            let n = hit.normal_in_world;
            let along = random.direction();
            let along = along - n * along.dot(n);
            let rise = 10f64.powf(-9.0 * random.next());
            let ray = RayInWorld { origin: ray.origin + ray.direction * hit.t, direction: along + n * rise };
            let from = PathOrigin::Face(hit.surface);
            assert!(!tracer.occluded(&ray, from, f64::INFINITY), "{rise} at {side}");
            assert_eq!(tracer.first_hit(&ray, from, f64::INFINITY), None);
            again_if_free += usize::from(tracer.occluded(&ray, PathOrigin::Free, f64::INFINITY));
            // Through the surface: the other side of the cube.
            let inward = RayInWorld { direction: -(along + n * rise), ..ray };
            let through = tracer.first_hit(&inward, from, f64::INFINITY);
            asked += usize::from(through.is_some_and(|h| h.from_inside && h.t > 0.0));
        }
    }
    assert!(again_if_free > 1_000, "a path that knows not where it started meets its own surface");
    // Rays that enter at less than the rounding angle may leave between faces.
    assert!(asked > 15_000, "{asked} of 16,000 found the way out");
}

#[test]
fn a_mesh_elsewhere_is_hit_as_one_whose_corners_are_there() {
    let mut random = Random(4);
    let ball = bumpy_ball(3, &mut random);
    // Mirrored and sheared.
    let place = DAffine3 {
        matrix3: DMat3::from_cols(
            DVec3::new(-2.0, 0.5, 0.0),
            DVec3::new(0.0, 1.5, 0.0),
            DVec3::new(0.3, 0.0, 1.0),
        ),
        translation: DVec3::new(4.0, 5.0, -6.0),
    };
    let moved = ball.positions().iter().map(|&p| place.transform_point3(p.into()).to_array()).collect();
    let moved = Arc::new(MeshData::new(moved, ball.triangles().to_vec(), Vec::new()).unwrap());
    let (here, there) = (tracer(&ball, place), tracer(&moved, DAffine3::IDENTITY));
    let mut same = 0;
    for _ in 0..3_000 {
        let origin = place.translation + random.direction() * 8.0;
        let aim = place.transform_point3(random.direction() * 0.5);
        let ray = RayInWorld { origin, direction: aim - origin };
        let hits = [&here, &there].map(|t| t.first_hit(&ray, PathOrigin::Free, f64::INFINITY));
        let [Some(a), Some(b)] = hits else { panic!("{hits:?}") };
        // Corners are rounded to f32 in two grids; near an edge the hit may be on another triangle.
        assert!((a.t - b.t).abs() < 1e-4, "{} and {}", a.t, b.t);
        if a.surface == b.surface {
            same += 1;
            assert!((a.t - b.t).abs() < 2e-6);
            // A mirrored mesh keeps its outside; corners that were mirrored turn the other way.
            assert!(a.normal_in_world.distance(-b.normal_in_world) < 1e-4);
            assert_eq!((a.from_inside, b.from_inside), (false, true));
        }
    }
    assert!(same > 2_990, "{same} of 3,000");
}
