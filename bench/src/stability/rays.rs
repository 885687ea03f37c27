//! Compares first hits, and rays that bounce from faces, with the exact oracle.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::CompressedVolume;
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_oracle::rays::{CLASSES, Class, ray, snap};
use pumice_oracle::tally::Tally;
use pumice_oracle::volumes::{Random, blobs, checkerboard, noise, sheets, volume};
use pumice_oracle::{Dense, ExactRay, describe, in_world, judge};
use pumice_session::error::Result;
use pumice_transport::geometry::LodChoice;
use pumice_transport::{PathOrigin, Tracer};

use super::Case;

type Tell<'a> = dyn FnMut(Case) -> Result<()> + 'a;

/// A voxel in which the ray's chord is shorter than this may be skipped: its planes are within rounding of a tie (`box_walk`).
const TIE_CHORD: f64 = 2e-5;
/// Renderers do not return hits. The same oracle checks those of the shaders in `vulkan-renderer/tests/exactness.rs`.
const PROCESSOR_ONLY: &str = "it tests the traversal itself, which renderers do not expose";
const REASON: &str = "planes of a box within 6e-6 of each other may be taken for one";

fn tracer(volume: &Arc<CompressedVolume>, world_from_index: DAffine3) -> Result<SceneTracer> {
    let visible = vec![true; volume.labels().len()];
    let traced =
        TracedInstance { volume: Arc::clone(volume), world_from_index, visible, lod: LodChoice::Voxels };
    Ok(SceneTracer::new(&[traced])?)
}

fn case(name: String, tally: Tally) -> Case {
    let error = if tally.wrong > 0 { f64::INFINITY } else { tally.worst_chord };
    Case {
        note: tally.first_wrong,
        processor_only: Some(PROCESSOR_ONLY),
        ..Case::new("rays", name, error, "longest skipped chord, voxels", TIE_CHORD, REASON)
    }
}

/// Measures about `count` rays per case; returns the number of all rays.
pub(super) fn measure(count: u32, tell: &mut Tell<'_>) -> Result<u64> {
    let mut rays = 0;
    let volumes = [
        ("noise of 3 %", noise([64, 64, 64], 0.03, 4, 2)),
        ("checkerboard", checkerboard([33, 34, 35])),
        ("sheets of one voxel", sheets([66, 70, 50])),
        ("round bodies", blobs([64, 64, 64], 60, 12, 4)),
    ];
    let here = DAffine3::IDENTITY;
    for class in CLASSES {
        let mut tally = Tally::default();
        for (_, (dense, compressed)) in &volumes {
            first_hits(dense, &tracer(compressed, here)?, &here, class, 20, count, &mut tally);
        }
        rays += tally.rays;
        tell(case(spoken(class).into(), tally))?;
    }
    for (name, (dense, compressed)) in &volumes {
        let mut tally = Tally::default();
        bounces(dense, &tracer(compressed, here)?, count, &mut tally);
        rays += tally.rays;
        tell(case(format!("bounces from faces, {name}"), tally))?;
    }
    // Matrices have powers of two and whole numbers, so that the ray in the world is exactly the image of the oracle's ray.
    for (name, place) in places() {
        let mut tally = Tally::default();
        for (_, (dense, compressed)) in &volumes[..3] {
            let tracer = tracer(compressed, place)?;
            for class in [Class::Random, Class::Lattice, Class::ThroughCorner, Class::Inside] {
                first_hits(dense, &tracer, &place, class, 14, count / 4, &mut tally);
            }
        }
        rays += tally.rays;
        tell(case(name.into(), tally))?;
    }
    let long = noise([1 << 20, 4, 4], 0.003, 5, 9);
    let sheet = volume([100_000, 8, 8], |_, _, z| u32::from(z == 5));
    for (name, (dense, compressed)) in
        [("2^20 voxels long", long), ("a sheet of one voxel, 10^5 long", sheet)]
    {
        let mut tally = Tally::default();
        for class in [Class::Random, Class::Inside, Class::Grazing, Class::AxisParallel, Class::InFace] {
            first_hits(&dense, &tracer(&compressed, here)?, &here, class, 20, count / 4, &mut tally);
        }
        rays += tally.rays;
        tell(case(name.into(), tally))?;
    }
    Ok(rays)
}

fn spoken(class: Class) -> &'static str {
    match class {
        Class::Random => "any direction",
        Class::Lattice => "lattice diagonals, as in isometric views",
        Class::InFace => "in a plane between voxels",
        Class::AlongEdge => "along edges",
        Class::ThroughCorner => "through corners",
        Class::AxisParallel => "parallel to an axis",
        Class::Grazing => "1e-7 rad off a face",
        Class::Far1e6 => "from 1e6 voxels away",
        Class::Far1e9 => "from 1e9 voxels away",
        Class::Inside => "from inside a solid voxel",
    }
}

fn places() -> Vec<(&'static str, DAffine3)> {
    let of = |x: [f64; 3], y: [f64; 3], z: [f64; 3]| DMat3::from_cols(x.into(), y.into(), z.into());
    let diagonal = |x, y, z| DMat3::from_diagonal(DVec3::new(x, y, z));
    let near = DVec3::new(1024.0, -77.0, 3.0);
    let placed = |matrix3, translation| DAffine3 { matrix3, translation };
    let (tiny, huge) = ((-30f64).exp2(), 20f64.exp2());
    vec![
        ("spacing 2^-30, about 1e-9", placed(DMat3::IDENTITY * tiny, DVec3::ZERO)),
        ("spacing 2^20, about 1e6", placed(DMat3::IDENTITY * huge, near)),
        ("spacing 1 : 1000", placed(diagonal(1.0, 1.0, 1000.0), near)),
        ("spacing 1000 : 1", placed(diagonal(1000.0, 1000.0, 1.0), near)),
        ("mirrored, axes swapped", placed(of([-16., 0., 0.], [0., 0., 40.], [0., 16., 0.]), near)),
        ("sheared", placed(of([3., 1., 0.], [-1., 5., 2.], [7., 0., -11.]), near)),
        ("1e6 voxels from the origin", placed(DMat3::IDENTITY, DVec3::splat(huge))),
        ("1e9 voxels from the origin", placed(DMat3::IDENTITY, DVec3::new(30f64.exp2(), 7.0, -30f64.exp2()))),
    ]
}

fn first_hits(
    dense: &Dense,
    tracer: &SceneTracer,
    place: &DAffine3,
    class: Class,
    fine: u32,
    count: u32,
    tally: &mut Tally,
) {
    let mut random = Random(u64::from(count) ^ class as u64);
    for _ in 0..count {
        let (o, d) = ray(class, dense.dims, fine, &mut random);
        let hit = tracer.first_hit(&in_world(o, d, place), PathOrigin::Free, f64::INFINITY);
        let verdict = judge(dense, &ExactRay::new(o, d), hit.as_ref());
        tally.add(verdict, hit.is_some(), || describe(o, d, PathOrigin::Free, hit.as_ref()));
    }
}

/// Rays from points on exposed faces into the outer half-space, some of them nearly in the face's plane.
fn bounces(dense: &Dense, tracer: &SceneTracer, count: u32, tally: &mut Tally) {
    let mut random = Random(5);
    for _ in 0..4 * count {
        let (o, d) = ray(Class::Random, dense.dims, 20, &mut random);
        let world = in_world(o, d, &DAffine3::IDENTITY);
        let Some(first) = tracer.first_hit(&world, PathOrigin::Free, f64::INFINITY) else { continue };
        let (s, axis) = (first.surface, usize::from(first.surface.axis));
        let outward = if s.positive { 1.0 } else { -1.0 };
        let mut outer = s.voxel.map(i64::from);
        outer[axis] += outward as i64;
        if first.from_inside || dense.at(outer) != 0 {
            continue;
        }
        let (_, mut d) = ray(Class::Inside, dense.dims, 20, &mut random);
        d[axis] = outward
            * match random.below(8) {
                0 => snap(1e-7 * random.unit() + 1e-12, 46),
                _ => d[axis].abs() + (-20f64).exp2(),
            };
        let mut o = [0, 1, 2].map(|a| f64::from(s.voxel[a]) + snap(0.01 + 0.98 * random.unit(), 20));
        o[axis] = f64::from(s.plane);
        let from = PathOrigin::Face(s);
        let hit = tracer.first_hit(&in_world(o, d, &DAffine3::IDENTITY), from, f64::INFINITY);
        let verdict = judge(dense, &ExactRay::new(o, d), hit.as_ref());
        tally.add(verdict, hit.is_some(), || describe(o, d, from, hit.as_ref()));
        if tally.rays >= u64::from(count) {
            return;
        }
    }
}
