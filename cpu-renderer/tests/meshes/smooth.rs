//! Meshes with smooth normals: normals and light compared with those of the ball that the mesh approximates, in closed form.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_core::MeshData;
use pumice_cpu::traverse::{MeshTracer, SceneTracer};
use pumice_cpu::{PathTracer, Surroundings};
use pumice_scene::{Camera, Film, Filter, Material, Mode, Projection, Settings, Sun};
use pumice_transport::{Lights, MaterialTable, PathOrigin, RayInWorld, ReadySun, Sky, Tracer};

use crate::shapes::{Random, bumpy_ball};

/// Half axes of an ellipsoid. (For a ball, blending over a flat triangle is exact: positions and normals are blended alike.)
const LONG: DVec3 = DVec3::new(1.0, 0.8, 0.6);

/// An ellipsoid of 8 · 4ⁿ triangles whose corners have the ellipsoid's own normals.
fn ellipsoid(times: usize, half: DVec3) -> Arc<MeshData> {
    let rough = bumpy_ball(times, &mut Random(1));
    let on_ball: Vec<_> = rough.positions().iter().map(|p| DVec3::from(*p).normalize()).collect();
    let positions: Vec<_> = on_ball.iter().map(|&p| (p * half).to_array()).collect();
    let normals: Vec<_> = on_ball.iter().map(|&p| (p / half * 3.0).as_vec3().to_array()).collect();
    let mesh = MeshData::new(positions, rough.triangles().to_vec(), Vec::new()).unwrap();
    Arc::new(mesh.with_corner_normals(&normals).unwrap())
}

/// The largest angle between the normals of hits from all sides and the normal of the transformed ellipsoid, at the point of its surface in
/// the direction of the hit from its middle: (smooth, flat).
fn worst_angles(mesh: &Arc<MeshData>, world_from_mesh: DAffine3, inside: bool) -> (f64, f64) {
    let tracer = MeshTracer::new(0, 4, mesh, world_from_mesh).unwrap();
    assert!(tracer.is_smooth());
    let normals = world_from_mesh.matrix3.inverse().transpose();
    let mut random = Random(3);
    let (mut worst, mut worst_flat) = (0.0f64, 0.0f64);
    for _ in 0..4000 {
        let target = random.direction() * 0.5 * random.next();
        let from = if inside { target * 0.5 } else { random.direction() * 5.0 };
        let ray = RayInWorld {
            origin: world_from_mesh.transform_point3(from),
            direction: world_from_mesh.transform_vector3(if inside {
                random.direction()
            } else {
                target - from
            }),
        };
        let Some(hit) = tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY) else { continue };
        let point = ray.origin + ray.direction * hit.t;
        let smooth = tracer.smooth_normal(&hit.surface, point).expect("a normal");
        assert!((smooth.length() - 1.0).abs() < 1e-12);
        let on_ball = (world_from_mesh.inverse().transform_point3(point) / LONG).normalize();
        let expected = (normals * (on_ball / LONG)).normalize();
        // The outer side, like the geometric normal, even though the ray came from inside.
        assert!(smooth.dot(hit.normal_in_world) > 0.0 && hit.from_inside == inside);
        worst = worst.max(smooth.angle_between(expected));
        worst_flat = worst_flat.max(hit.normal_in_world.angle_between(expected));
    }
    (worst, worst_flat)
}

/// Blending is of second order: each division of all triangles in four divides the error by four, and that of flat normals by two.
#[test]
fn normals_converge_to_the_surfaces() {
    let turned = DAffine3::from_scale_rotation_translation(
        DVec3::splat(0.01),
        glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 1.1),
        DVec3::new(1e4, -300.0, 7.0),
    );
    let errors: Vec<_> = (1..6).map(|n| worst_angles(&ellipsoid(n, LONG), turned, n % 2 == 0)).collect();
    for pair in errors.windows(2) {
        let [(a, flat_a), (b, flat_b)] = pair else { unreachable!() };
        let (factor, flat) = (a / b, flat_a / flat_b);
        assert!((2.5..6.0).contains(&factor) && (1.5..2.5).contains(&flat), "{errors:?}");
    }
    // Encoded normals are off by 7e-5 rad.
    let (smooth, flat) = errors[4];
    assert!(smooth < 1e-3 && flat > 0.02, "{errors:?}");
}

/// By the inverse transpose: mirrored, sheared, stretched, tiny, huge, far from the origin.
#[test]
fn normals_follow_their_mesh() {
    let mesh = ellipsoid(5, LONG);
    let shear =
        DMat3::from_cols(DVec3::new(1.0, 0.0, 0.0), DVec3::new(0.7, 1.2, 0.0), DVec3::new(-0.3, 0.2, 0.5));
    let places = [
        DAffine3::from_mat3(shear),
        DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)),
        DAffine3::from_scale(DVec3::new(16.0, -16.0, -40.0)),
        DAffine3::from_mat3(shear * DMat3::from_diagonal(DVec3::new(1e-9, -1e-9, 2e-9))),
        DAffine3::from_mat3_translation(shear * 1e6, DVec3::new(3e7, 1e7, -5e6)),
    ];
    for place in places {
        let (smooth, flat) = worst_angles(&mesh, place, false);
        // Stretching magnifies the error of a normal by at most its factor; all factors here are below 4.
        assert!(smooth < 4e-3 && flat > 0.02, "{place:?}: {smooth} {flat}");
    }
}

/// Light of one direction on a Lambertian ball: albedo / π · strength · cos, with the cosine of the ball's normal. With flat normals the
/// same mesh is off.
#[test]
fn light_is_that_of_a_ball() {
    let (albedo, strength) = (0.8, 2.0);
    let towards = DVec3::new(0.5, -0.6, 1.0).normalize();
    let sun =
        ReadySun::new(&Sun { direction: (-towards).to_array(), strength, color: [1.0; 3], angle_rad: 0.0 });
    let material = Material { base_color: [albedo; 3], specular: 0.0, roughness: 1.0, ..Material::default() };
    let around = Surroundings {
        lights: Arc::new(Lights::new(Sky::Constant(Vec3::ZERO), vec![sun], None)),
        materials: vec![Arc::new(MaterialTable::same(material))].into(),
        settings: Settings { mode: Mode::OneBounce, ..Settings::default() },
    };
    let side = 64;
    let camera = Camera::new(
        DAffine3::from_translation(DVec3::new(0.0, 0.0, 5.0)),
        Projection::Orthographic { scale: 2.2 },
    );
    let film = Film::new(side, side, Filter::Box { width: 1.0 });
    let worst = |mesh: &Arc<MeshData>| {
        let tracer = MeshTracer::new(0, 0, mesh, DAffine3::IDENTITY).unwrap();
        let scene = SceneTracer::of(Vec::new()).with_meshes(vec![Arc::new(tracer)]);
        let mut tracer = PathTracer::new(scene, around.clone(), &camera, &film).unwrap();
        tracer.add_samples(64, &pumice_core::Job::new()).unwrap();
        let (picture, mut worst, mut compared) = (tracer.picture().unwrap(), 0.0f32, 0);
        for (i, color) in picture.color.pixels.iter().enumerate() {
            let at = |v: usize| (f64::from(v as u32) + 0.5) / f64::from(side) * 2.2 - 1.1;
            let (x, y) = (at(i % side as usize), -at(i / side as usize));
            // Away from the rim, where a pixel sees much of the ball, and where triangles do not shadow themselves.
            let normal = DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
            if normal.z < 0.4 || normal.dot(towards) < 0.15 {
                continue;
            }
            compared += 1;
            let expected = albedo / PI * strength * normal.dot(towards) as f32;
            worst = worst.max((color[0] - expected).abs());
            let told = picture.normal.as_ref().unwrap().pixels[i];
            worst = worst.max(0.3 * (Vec3::from(told) - normal.as_vec3()).length());
        }
        assert!(compared > 1000, "{compared}");
        worst
    };
    let mesh = ellipsoid(4, DVec3::ONE);
    let flat = MeshData::new(mesh.positions().to_vec(), mesh.triangles().to_vec(), Vec::new()).unwrap();
    let (smooth, flat) = (worst(&mesh), worst(&Arc::new(flat)));
    // The distance of the triangles below the ball's surface, 1e-3 of its radius, times the slope of the cosine towards the rim; 64 samples
    // of a pixel.
    assert!(smooth < 0.008 && flat > 3.0 * smooth, "{smooth} {flat}");
}

/// Smooth normals equal to the flat ones change nothing, and a triangle without normals keeps its own among smooth ones.
#[test]
fn flat_stays_flat() {
    let corners = vec![[0.0; 3], [2.0, 0.0, 0.0], [2.0, 2.0, 0.5], [0.0, 2.0, 0.0]];
    let mesh = MeshData::new(corners, vec![[0, 1, 2], [0, 2, 3]], Vec::new()).unwrap();
    let tilted = [[0.2, 0.0, 1.0]; 3];
    let half = mesh.clone().with_triangle_normals(&[tilted, [[0.0; 3]; 3]].concat()).unwrap();
    let tracer = MeshTracer::new(0, 0, &Arc::new(half), DAffine3::IDENTITY).unwrap();
    let hit = |x: f64, y: f64| {
        let ray = RayInWorld { origin: DVec3::new(x, y, 9.0), direction: DVec3::NEG_Z };
        let hit = tracer.first_hit(&ray, PathOrigin::Free, 100.0).unwrap();
        tracer.smooth_normal(&hit.surface, ray.origin + ray.direction * hit.t)
    };
    let expected = DVec3::new(0.2, 0.0, 1.0).normalize();
    assert!((hit(1.5, 0.5).unwrap() - expected).length() < 1e-4);
    assert_eq!(hit(0.5, 1.5), None);
    let plain = MeshTracer::new(0, 0, &Arc::new(mesh), DAffine3::IDENTITY).unwrap();
    assert!(!plain.is_smooth() && tracer.is_smooth());
}
