//! First hits for arbitrary f64 matrices, origins and directions: rotated, sheared and mirrored volumes, with all mantissa bits in use. The
//! rational oracle of `exact::rational`, which takes the f64 numbers as exact, judges them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod exact;

use std::sync::Arc;

use exact::cases::{MAKES, Make, volumes_both_ways};
use exact::rational::judge::judge;
use exact::rational::{ExactPlace, RationalRay};
use exact::tally::Tally;
use exact::volumes::Random;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use pumice_core::CompressedVolume;
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Tracer};

/// The target of a ray; the matrix then rounds each of its numbers once more, so that all bits are in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    /// A point anywhere.
    Random,
    /// A corner of voxels.
    Corner,
    /// A point on an edge.
    Edge,
    /// Along an axis of the volume.
    AlongAxis,
    /// Nearly along a plane between voxels, close to it.
    Grazing,
    /// From inside the volume.
    Inside,
    /// From 10⁶ voxels away.
    Far1e6,
    /// In a plane between voxels, except for rounding.
    InPlane,
    /// Along an edge, except for rounding.
    AlongEdge,
}

const CLASSES: [Class; 9] = [
    Class::Random,
    Class::Corner,
    Class::Edge,
    Class::AlongAxis,
    Class::Grazing,
    Class::Inside,
    Class::Far1e6,
    Class::InPlane,
    Class::AlongEdge,
];

impl Class {
    /// Whether whole chords lie within rounding of a plane, so that either side of it is right.
    fn stays_in_planes(self) -> bool {
        matches!(self, Self::InPlane | Self::AlongEdge)
    }
}

/// A random number of 53 bits in [0, 1).
fn unit(random: &mut Random) -> f64 {
    let bits = u64::from(random.bits()) << 21 ^ u64::from(random.bits() >> 11);
    bits as f64 / (1u64 << 53) as f64
}

fn vector(random: &mut Random) -> DVec3 {
    loop {
        let v = DVec3::from([0; 3].map(|_| 2.0 * unit(random) - 1.0));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v;
        }
    }
}

fn world_ray(class: Class, dims: [u32; 3], place: &DAffine3, random: &mut Random) -> RayInWorld {
    let size = DVec3::from(dims.map(f64::from));
    let point = |random: &mut Random| size * DVec3::from([0; 3].map(|_| unit(random)));
    let a = random.below(3) as usize;
    let (mut target, mut d) = (point(random), vector(random));
    let distance = match class {
        Class::Far1e6 => 1e6,
        Class::Inside => 0.0,
        _ => 1.5 * size.length(),
    };
    match class {
        Class::Random | Class::Inside | Class::Far1e6 => {}
        Class::Corner => target = target.round(),
        Class::Edge => {
            let along = target[a];
            target = target.round();
            target[a] = along;
        }
        Class::AlongAxis => {
            d = DVec3::ZERO;
            d[a] = if random.below(2) == 0 { 1.0 } else { -1.0 };
        }
        Class::Grazing => {
            d[a] = 1e-7 * (unit(random) - 0.5);
            target[a] = target[a].round() + 1e-5 * (unit(random) - 0.5);
        }
        Class::InPlane => {
            d[a] = 0.0;
            target[a] = target[a].round();
        }
        Class::AlongEdge => {
            (d, target) = (DVec3::ZERO, target.round());
            d[a] = if random.below(2) == 0 { 1.0 } else { -1.0 };
        }
    }
    let start = target - d.normalize() * distance;
    let origin = place.transform_point3(start);
    // Towards the target's position in the world, so that both ends are rounded; where there is no way to it, the image of d.
    let direction = match class {
        Class::Corner | Class::Edge => place.transform_point3(target) - origin,
        _ => place.transform_vector3(d * (0.5 + unit(random))),
    };
    RayInWorld { origin, direction }
}

fn places() -> Vec<(&'static str, DAffine3)> {
    let turn = |x: f64, y: f64, z: f64| DMat3::from_quat(DQuat::from_xyzw(x, y, z, 0.83).normalize());
    let spaced = DMat3::from_diagonal;
    let at = |matrix3: DMat3, x: f64, y: f64, z: f64| DAffine3 { matrix3, translation: DVec3::new(x, y, z) };
    vec![
        ("unrotated", at(DMat3::IDENTITY, 0.1, -0.7, 3.3)),
        ("30° about z", at(DMat3::from_rotation_z(std::f64::consts::FRAC_PI_6), 0.0, 0.0, 0.0)),
        ("rotated, nm", at(turn(0.3, -0.5, 0.2) * spaced(DVec3::new(32.0, 32.0, 40.0)), 1e4, -7e3, 0.3)),
        ("1:1000", at(turn(-0.1, 0.4, 0.7) * spaced(DVec3::new(0.013, 13.0, 0.7)), 0.5, 0.25, -9.0)),
        (
            "sheared, mirrored",
            at(
                turn(0.9, 0.1, -0.2) * spaced(DVec3::new(-1.1, 3.7, 0.9)) * turn(0.2, 0.6, 0.1),
                17.3,
                5.1,
                0.01,
            ),
        ),
        ("far away", at(turn(0.7, 0.7, -0.1) * spaced(DVec3::splat(4e-3)), 3.1e4, -2.7e4, 1.9e4)),
    ]
}

fn tracer(make: Make, volume: &Arc<CompressedVolume>, world_from_index: DAffine3) -> SceneTracer {
    make(&[TracedInstance {
        volume: Arc::clone(volume),
        world_from_index,
        visible: vec![true; volume.labels().len()],
        lod: LodChoice::Voxels,
    }])
    .unwrap()
}

type Trace<'a> = &'a dyn Fn(&SceneTracer, RayInWorld) -> Option<Hit>;

/// One tally for each class, over all volumes and placements, with `n` rays for each of these.
fn tallies(classes: &[Class], n: u32, trace: Trace<'_>) -> Vec<(Class, Tally)> {
    let mut all: Vec<_> = classes.iter().map(|&c| (c, Tally::default())).collect();
    for (name, dense, compressed, make) in volumes_both_ways() {
        for (place_name, place) in places() {
            let (tracer, exact) = (tracer(make, &compressed, place), ExactPlace::new(place));
            for (class, tally) in &mut all {
                let mut random = Random(u64::from(n) ^ *class as u64);
                for _ in 0..n {
                    let ray = world_ray(*class, dense.dims, &place, &mut random);
                    let hit = trace(&tracer, ray);
                    let said = RationalRay::new(&exact, ray.origin, ray.direction);
                    tally.add(judge(&dense, &said, hit.as_ref()), hit.is_some(), || {
                        format!("{name}, {place_name}: {ray:?} {hit:?}")
                    });
                }
            }
        }
    }
    all
}

const FIRST_HIT: Trace<'_> = &|tracer, ray| tracer.first_hit(&ray, PathOrigin::Free, f64::INFINITY);

fn assert_exact(n: u32) {
    for (class, tally) in tallies(&CLASSES, n, FIRST_HIT) {
        tally.assert_right(&format!("{class:?}"));
        assert!(tally.hits > tally.rays / 4, "{class:?}: {tally:?} proves little");
        if !class.stays_in_planes() {
            assert!(tally.worst_chord <= exact::REAL_CHORD, "{class:?}: {tally:?}");
        }
        // Only rays that aim at edges touch them.
        let touches_allowed = match class {
            Class::Corner | Class::Edge => tally.rays / 10,
            Class::InPlane | Class::AlongEdge => tally.rays,
            _ => tally.rays / 1000,
        };
        assert!(tally.touches <= touches_allowed, "{class:?}: {tally:?}");
    }
}

#[test]
fn first_hits_are_exact_in_any_placement() {
    assert_exact(400);
}

#[test]
#[ignore = "full: a million rays"]
fn first_hits_are_exact_in_any_placement_on_many_rays() {
    assert_exact(3_500);
}

/// Negative control: origins with only f32 precision, or off by 10⁻¹⁰ of the distance, are noticed.
#[test]
fn careless_rebasing_is_convicted() {
    let in_f32: Trace<'_> = &|tracer, ray| {
        let origin = ray.origin.as_vec3().as_dvec3();
        FIRST_HIT(tracer, RayInWorld { origin, ..ray })
    };
    let a_little_off: Trace<'_> =
        &|tracer, ray| FIRST_HIT(tracer, RayInWorld { origin: ray.origin * (1.0 + 1e-10), ..ray });
    for (name, trace, share) in [("f32", in_f32, 0.9), ("1e-10", a_little_off, 0.9)] {
        for (class, tally) in tallies(&[Class::Random, Class::Edge, Class::AlongAxis], 50, trace) {
            tally.report(&format!("{name}, {class:?}"));
            assert!(tally.wrong as f64 > share * tally.hits as f64, "{name}, {class:?}: {tally:?}");
        }
    }
}

/// Bounces in any placement: from the point where a ray in the world hit an exposed face, including directions along the face and nearly
/// so.
#[test]
fn paths_from_faces_are_exact_in_any_placement() {
    // (In the sparsest noise, a path hits too little.)
    for (name, dense, compressed, make) in volumes_both_ways().skip(MAKES.len()) {
        for (place_name, place) in places() {
            let (tracer, exact) = (tracer(make, &compressed, place), ExactPlace::new(place));
            let (mut random, mut tally) = (Random(6), Tally::default());
            while tally.rays < 600 {
                // Half of them start at the edges of faces.
                let class = if random.below(2) == 0 { Class::Random } else { Class::Edge };
                let ray = world_ray(class, dense.dims, &place, &mut random);
                let Some(first) = FIRST_HIT(&tracer, ray) else { continue };
                let (s, axis) = (first.surface, usize::from(first.surface.axis));
                let outward = if s.positive { 1.0 } else { -1.0 };
                let mut outer = s.voxel.map(i64::from);
                outer[axis] += outward as i64;
                if dense.at(outer) != 0 {
                    continue; // an edge was touched: the face is not exposed
                }
                let mut d = vector(&mut random);
                d[axis] = outward
                    * match random.below(4) {
                        0 => 0.0,
                        1 => 1e-9 * unit(&mut random),
                        _ => d[axis].abs(),
                    };
                let direction = place.transform_vector3(d);
                let bounce = RayInWorld { origin: ray.origin + ray.direction * first.t, direction };
                if direction.dot(first.normal_in_world) <= 0.0 {
                    continue; // a path ends here, too
                }
                let hit = tracer.first_hit(&bounce, PathOrigin::Face(s), f64::INFINITY);
                let met = |h: &Hit| (h.surface.axis, h.surface.plane, h.surface.positive);
                assert!(
                    hit.is_none_or(|h| met(&h) != met(&first)),
                    "{name}, {place_name}: a path met the plane that it left: {bounce:?} {first:?} {hit:?}"
                );
                let said = RationalRay::new(&exact, bounce.origin, direction)
                    .leaving_face(s.voxel, axis, s.plane, s.positive);
                tally.add(judge(&dense, &said, hit.as_ref()), hit.is_some(), || {
                    format!("{place_name}: {bounce:?} from {s:?}: {hit:?}")
                });
            }
            tally.assert_right(&format!("{name}, {place_name}"));
            assert!(tally.hits > tally.rays / 8 && tally.worst_chord <= exact::REAL_CHORD, "{tally:?}");
        }
    }
}
