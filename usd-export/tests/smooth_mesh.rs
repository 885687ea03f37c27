//! Compares smoothed surfaces with closed forms of balls and tori, with a relaxation of the whole volume, and with their own definition:
//! closed, and with common borders.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use pumice_core::{CompressedVolume, Error, Job};
use pumice_export::{Corners, ExportError, Interfaces, QuadMesh, SmoothMesh, VoxelRegion};
use pumice_oracle::{Dense, volumes};

fn smooth(volume: &CompressedVolume, region: Option<VoxelRegion>) -> SmoothMesh {
    let visible = vec![true; volume.labels().len()];
    SmoothMesh::new(volume, &visible, region, &Job::new(), |_| Ok(())).unwrap()
}

fn position(mesh: &SmoothMesh, vertex: u32) -> DVec3 {
    DVec3::from_array(mesh.position(vertex).map(f64::from))
}

fn triangles(mesh: &SmoothMesh) -> Vec<[u32; 3]> {
    mesh.quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

fn area(mesh: &SmoothMesh) -> f64 {
    let of = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
    triangles(mesh).into_iter().map(|t| of(t.map(|v| position(mesh, v)))).sum()
}

/// What is enclosed, by the divergence theorem.
fn enclosed(mesh: &SmoothMesh) -> f64 {
    let of = |[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)) / 6.0;
    triangles(mesh).into_iter().map(|t| of(t.map(|v| position(mesh, v)))).sum()
}

/// Vertices − edges + faces, where each edge has a face on either side and points of a label are one; none where an edge is open.
fn euler_characteristic(mesh: &SmoothMesh) -> Option<i64> {
    let mut edges: BTreeMap<[u32; 2], i64> = BTreeMap::new();
    let points = |quad: &[u32; 4]| quad.map(|v| mesh.vertices[v as usize].point);
    for quad in &mesh.quads {
        let p = points(quad);
        (0..4).for_each(|i| *edges.entry([p[i], p[(i + 1) % 4]]).or_default() += 1);
    }
    let is_closed = edges.iter().all(|(&[a, b], count)| edges.get(&[b, a]) == Some(count));
    let used: BTreeSet<u32> = mesh.quads.iter().flat_map(points).collect();
    assert_eq!(used.len(), mesh.points.len(), "no point is unused");
    is_closed.then(|| used.len() as i64 - edges.len() as i64 / 2 + mesh.quads.len() as i64)
}

/// A volume of one label, where `surface` is negative.
fn solid(dims: [u32; 3], surface: impl Fn(DVec3) -> f64) -> CompressedVolumeOf {
    volumes::volume(dims, |x, y, z| {
        u32::from(surface(DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5) < 0.0)
    })
}

type CompressedVolumeOf = (Dense, std::sync::Arc<CompressedVolume>);

#[test]
fn a_ball_and_a_torus_are_themselves() {
    let middle = DVec3::new(24.1, 23.9, 24.3);
    let ball = |radius: f64| move |p: DVec3| (p - middle).length() - radius;
    let torus = move |p: DVec3| {
        let from = p - middle;
        (from.truncate().length() - 14.0).hypot(from.z) - 7.0
    };
    let pi = std::f64::consts::PI;
    let of_ball = |r: f64| (4.0 * pi * r * r, 4.0 / 3.0 * pi * r.powi(3));
    let of_torus = (4.0 * pi * pi * 14.0 * 7.0, 2.0 * pi * pi * 14.0 * 49.0);
    type Distance = Box<dyn Fn(DVec3) -> f64>;
    let cases: [(Distance, (f64, f64), i64); 3] = [
        (Box::new(ball(10.3)), of_ball(10.3), 2),
        (Box::new(ball(20.2)), of_ball(20.2), 2),
        (Box::new(torus), of_torus, 0),
    ];
    for (distance, (expected_area, expected_volume), characteristic) in cases {
        let (dense, volume) = solid([48, 48, 48], &distance);
        let mesh = smooth(&volume, None);
        assert_eq!(euler_characteristic(&mesh), Some(characteristic));
        // What is round shrinks, by 0.1 voxel here, and what is left of the steps adds area: 0.994 and 1.003 of the balls', 0.999 of the
        // torus'. The voxels' faces have 1.5 times the area.
        let (ratio, voxels) = (area(&mesh) / expected_area, mesh.quads.len() as f64 / expected_area);
        assert!((0.98..1.02).contains(&ratio) && voxels > 1.4, "{ratio} {voxels}");
        let ratio = enclosed(&mesh) / expected_volume;
        let filled = dense.labels.iter().filter(|l| **l != 0).count() as f64 / expected_volume;
        assert!((0.96..1.01).contains(&ratio) && (filled - 1.0).abs() < 0.01, "{ratio} {filled}");
        // The surface passes between the centres of the voxels at a corner, which are √3/2 from it; smoothed points are nearer.
        let distances: Vec<f64> =
            mesh.points.iter().map(|p| distance(DVec3::from_array(p.map(f64::from)))).collect();
        let farthest = distances.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        let mean = distances.iter().sum::<f64>() / distances.len() as f64;
        let spread = distances.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / distances.len() as f64;
        // Corners of voxels spread by 0.41.
        assert!(farthest < 0.75f64.sqrt() && spread.sqrt() < 0.15, "{farthest} {spread}");
        // Normals are the gradient; at 10 voxels' radius a face of a voxel turns by 1/10, and steps are not all gone.
        for vertex in &mesh.vertices {
            let p = DVec3::from_array(mesh.points[vertex.point as usize].map(f64::from));
            let slope = |axis: DVec3| (distance(p + 1e-4 * axis) - distance(p - 1e-4 * axis)) / 2e-4;
            let normal = DVec3::from_array(vertex.normal.map(f64::from));
            assert!((normal.length() - 1.0).abs() < 1e-6);
            let cosine = normal.dot(DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)));
            assert!(cosine > 0.9, "{cosine} at {p}");
        }
        // Control: without a face it is open.
        let mut open = mesh.clone();
        open.quads.pop();
        open.quads.push(open.quads[0]);
        assert_ne!(euler_characteristic(&open), Some(characteristic));
    }
}

/// Where corners of voxels go, by relaxing the whole volume in double precision; those without an entry stay. `at` goes on beyond the ends.
fn relaxed(at: impl Fn([i64; 3]) -> u32, low: [i64; 3], high: [i64; 3]) -> BTreeMap<[i64; 3], [f64; 3]> {
    let plus = |p: [i64; 3], axis: usize, n: i64| {
        let mut p = p;
        p[axis] += n;
        p
    };
    // The different labels around the edge from a corner towards a side.
    let around = |corner: [i64; 3], axis: usize, step: i64| {
        let first = plus(corner, axis, if step > 0 { 0 } else { -1 });
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let voxels = [(0, 0), (0, -1), (-1, 0), (-1, -1)].map(|(m, n)| plus(plus(first, b, m), c, n));
        voxels.map(&at).into_iter().collect::<BTreeSet<u32>>().len()
    };
    let sides: Vec<(usize, i64)> = (0..3).flat_map(|axis| [(axis, -1), (axis, 1)]).collect();
    let mut links: BTreeMap<[i64; 3], Vec<(usize, i64)>> = BTreeMap::new();
    for z in low[2]..=high[2] {
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                let meeting = |least: usize| {
                    let found = sides.iter().filter(|(axis, step)| around([x, y, z], *axis, *step) >= least);
                    found.copied().collect::<Vec<_>>()
                };
                let mut chosen = if meeting(3).len() > 1 { meeting(3) } else { meeting(2) };
                if !chosen.is_empty() {
                    let ends = [low, high];
                    chosen.retain(|&(axis, step)| ends[usize::from(step > 0)][axis] != [x, y, z][axis]);
                    links.insert([x, y, z], chosen);
                }
            }
        }
    }
    let mut places: BTreeMap<[i64; 3], [f64; 3]> =
        links.keys().map(|corner| (*corner, corner.map(|c| c as f64))).collect();
    for _ in 0..6 {
        let former = places.clone();
        for (corner, place) in &mut places {
            for axis in 0..3 {
                let others = links[corner].iter().map(|&(a, step)| former[&plus(*corner, a, step)][axis]);
                let middle = others.sum::<f64>() / links[corner].len() as f64;
                let goal = 0.5 * (former[corner][axis] + middle);
                let was = corner[axis] as f64;
                let is_at_end = corner[axis] == low[axis] || corner[axis] == high[axis];
                place[axis] = if is_at_end { was } else { goal.clamp(was - 0.4, was + 0.4) };
            }
        }
    }
    places
}

/// Compares a mesh with the relaxation: its points, and which labels have faces where.
fn check(dense: &Dense, volume: &CompressedVolume, region: Option<VoxelRegion>) {
    let (low, high) = region.map_or(([0; 3], dense.dims), |r| (r.low(), r.high()));
    let (low, high) = (low.map(i64::from), high.map(i64::from));
    let at = |v: [i64; 3]| if (0..3).all(|a| (low[a]..high[a]).contains(&v[a])) { dense.at(v) } else { 0 };
    let mesh = smooth(volume, region);
    let continued = |v: [i64; 3]| dense.at([0, 1, 2].map(|a| v[a].clamp(low[a], high[a] - 1)));
    let expected = relaxed(continued, low, high);
    for point in &mesh.points {
        // No corner has moved by half a voxel.
        let corner = point.map(|c| c.round() as i64);
        for axis in 0..3 {
            // Six steps of single precision, and its rounding of places up to 256.
            let there = expected.get(&corner).map_or(corner[axis] as f64, |place| place[axis]);
            let difference = (f64::from(point[axis]) - there).abs();
            assert!(difference < 4e-5, "{point:?}: {there} on axis {axis}");
        }
    }
    // Faces of voxels, as label and corners.
    type Face = (u32, BTreeSet<[i64; 3]>);
    let mut faces: Vec<Face> = Vec::new();
    for z in low[2]..high[2] {
        for y in low[1]..high[1] {
            for x in low[0]..high[0] {
                let label = at([x, y, z]);
                for axis in (0..3).filter(|_| label != 0) {
                    for side in [0, 1] {
                        let mut beyond = [x, y, z];
                        beyond[axis] += 2 * side - 1;
                        if at(beyond) != label {
                            let corners = (0..8).map(|c| [x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)]);
                            let of_side = corners.filter(|c| c[axis] == [x, y, z][axis] + side);
                            faces.push((label - 1, of_side.collect()));
                        }
                    }
                }
            }
        }
    }
    let of_quad = |quad: &[u32; 4]| {
        let corners = quad.map(|v| mesh.position(v).map(|c| c.round() as i64));
        (mesh.label(quad), corners.into_iter().collect())
    };
    let mut got: Vec<Face> = mesh.quads.iter().map(of_quad).collect();
    got.sort();
    faces.sort();
    assert!(got == faces);
}

/// Volumes beyond a block's side, with and without a region.
#[test]
fn matches_a_relaxation_of_the_whole_volume() {
    for (dense, volume) in [
        volumes::blobs([68, 15, 12], 30, 22, 4),
        volumes::noise([9, 9, 66], 0.5, 4, 2),
        volumes::checkerboard([9, 12, 8]),
        volumes::sheets([21, 18, 17]),
    ] {
        check(&dense, &volume, None);
        let region = VoxelRegion::new([2, 3, 4], [dense.dims[0] - 1, 9, dense.dims[2]]).unwrap();
        check(&dense, &volume, Some(region));
    }
}

/// The check notices another volume.
#[test]
#[should_panic(expected = "got == faces")]
fn a_voxel_more_is_noticed() {
    let (mut dense, volume) = volumes::volume([12, 12, 12], |x, y, z| u32::from(x + y + z == 4));
    dense.labels[12 * 12 * 12 - 1] = 1;
    check(&dense, &volume, None);
}

/// Labels that touch have the same triangles there, one of each seen from its side; what is left is closed too.
#[test]
fn borders_are_common_to_the_last_bit() {
    let (_, volume) = volumes::blobs([70, 30, 23], 40, 30, 7);
    let mesh = smooth(&volume, None);
    let mut sides: BTreeMap<[[u32; 3]; 3], Vec<(bool, u32)>> = BTreeMap::new();
    for t in triangles(&mesh) {
        let corners = t.map(|v| mesh.position(v).map(f32::to_bits));
        let mut sorted = corners;
        sorted.sort_unstable();
        // Whether the order is the sorted one, turned around or not.
        let is_even = (0..3).any(|i| [corners[i], corners[(i + 1) % 3], corners[(i + 2) % 3]] == sorted);
        sides.entry(sorted).or_default().push((is_even, mesh.vertices[t[0] as usize].label));
    }
    assert!(sides.values().all(|s| s.len() <= 2));
    let common: Vec<_> = sides.values().filter(|s| s.len() == 2).collect();
    assert!(common.iter().all(|s| s[0].0 != s[1].0 && s[0].1 != s[1].1));
    let visible = vec![true; volume.labels().len()];
    let faces = |interfaces| {
        QuadMesh::new(&volume, &visible, interfaces, Corners::Own, &Job::new()).unwrap().quads.len()
    };
    let [all, outside] = [Interfaces::All, Interfaces::Outside].map(faces);
    assert_eq!((mesh.quads.len(), common.len(), sides.len()), (all, all - outside, all + outside));
    assert!(common.len() > 1000);
    // Points of a label are shared, so each label is closed where no voxels of it touch along an edge alone.
    assert!(euler_characteristic(&mesh).is_some());
    // What labels enclose is together what the outside encloses: the triangles that only one label has.
    let outside = |mesh: &SmoothMesh| {
        let key = |t: [u32; 3]| {
            let mut corners = t.map(|v| mesh.position(v).map(f32::to_bits));
            corners.sort_unstable();
            corners
        };
        let alone = triangles(mesh).into_iter().filter(|t| sides[&key(*t)].len() == 1);
        let of = |[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)) / 6.0;
        alone.map(|t| of(t.map(|v| position(mesh, v)))).sum::<f64>()
    };
    // Sums of 10⁵ products up to 10⁵ in double precision.
    assert!((outside(&mesh) - enclosed(&mesh)).abs() < 1e-5);
}

#[test]
fn what_is_thin_stays() {
    // A sheet of one voxel keeps its thickness but for seven voxels from its border, and a fibre a fifth of its width.
    let (_, volume) = volumes::volume([40, 40, 9], |_, _, z| u32::from(z == 4));
    let mesh = smooth(&volume, None);
    assert!(mesh.points.iter().all(|p| p[2] == 4.0 || p[2] == 5.0), "the volume ends where the sheet does");
    let (_, volume) = volumes::volume([60, 60, 9], |x, y, z| {
        u32::from(z == 4 && (10..50).contains(&x) && (10..50).contains(&y))
    });
    let mesh = smooth(&volume, None);
    let inner: Vec<_> =
        mesh.points.iter().filter(|p| p[..2].iter().all(|c| (17.5..42.5).contains(c))).collect();
    assert!(inner.len() > 1000 && inner.iter().all(|p| p[2] == 4.0 || p[2] == 5.0));
    let (_, volume) =
        volumes::volume([9, 9, 40], |x, y, z| u32::from(x == 4 && y == 4 && (5..35).contains(&z)));
    let mesh = smooth(&volume, None);
    assert_eq!(euler_characteristic(&mesh), Some(2));
    for axis in [0, 1] {
        let of_axis = mesh.points.iter().map(|p| p[axis]);
        let [least, most] = of_axis.fold([9f32, 0.0], |[l, m], c| [l.min(c), m.max(c)]);
        assert!(most - least > 0.199, "{least} {most}");
    }
    // Where a region ends, the surface is flat, and its normals are those of the plane.
    let (_, volume) = volumes::blobs([40, 36, 30], 12, 12, 3);
    let region = VoxelRegion::new([4, 0, 7], [36, 36, 20]).unwrap();
    let mesh = smooth(&volume, Some(region));
    for (axis, place, side) in [(0, 4.0, -1.0), (0, 36.0, 1.0), (2, 7.0, -1.0), (2, 20.0, 1.0)] {
        let mut normal = [0.0; 3];
        normal[axis] = side;
        let is_there = |q: &&[u32; 4]| q.iter().all(|&v| mesh.position(v)[axis] == place);
        let there: Vec<_> = mesh.quads.iter().filter(is_there).collect();
        assert!(there.len() > 300, "{axis} {place}");
        assert!(there.iter().all(|q| q.iter().all(|&v| mesh.vertices[v as usize].normal == normal)));
    }
}

#[test]
fn the_mesh_does_not_depend_on_threads() {
    let (_, volume) = volumes::blobs([150, 30, 20], 60, 50, 6);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| smooth(&volume, None))
    };
    assert!(with(1) == with(3));
}

#[test]
fn wrong_visibility_limits_and_cancelling_are_errors() {
    let (_, volume) = volumes::noise([20, 20, 20], 0.5, 3, 7);
    let of = |visible: &[bool], job: &Job| {
        let mut left = 100u64;
        let found = |faces: u64| {
            left = left.checked_sub(faces).ok_or(Error::Caller("too many".into()))?;
            Ok(())
        };
        SmoothMesh::new(&volume, visible, None, job, found).unwrap_err()
    };
    assert_eq!(of(&[true], &Job::new()).to_string(), "visible: expected 3 values, one a label, got 1");
    assert_eq!(of(&[true; 3], &Job::new()).to_string(), "too many");
    let job = Job::new();
    job.cancel();
    assert!(matches!(of(&[true; 3], &job), ExportError::Volume(Error::Cancelled)));
}
