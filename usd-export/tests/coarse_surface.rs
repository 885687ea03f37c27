//! Compares coarse surfaces with closed forms of balls and boxes, and with their own definition: closed, few faces, of shown labels only.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};
use pumice_core::{CompressedVolume, Error, Job, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_export::{CoarseSurface, ExportError};
use pumice_oracle::volumes;

fn coarse(volume: &CompressedVolume, most_faces: usize) -> CoarseSurface {
    CoarseSurface::new(volume, &vec![true; volume.labels().len()], most_faces, &Job::new()).unwrap()
}

fn corners(surface: &CoarseSurface, quad: &[u32; 4]) -> [DVec3; 4] {
    quad.map(|v| DVec3::from_array(surface.vertices[v as usize].map(f64::from)))
}

/// What is enclosed, by the divergence theorem.
fn enclosed(surface: &CoarseSurface) -> f64 {
    let of = |[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)) / 6.0;
    let of_quad = |quad| {
        let [a, b, c, d] = corners(surface, quad);
        of([a, b, c]) + of([a, c, d])
    };
    surface.quads.iter().map(of_quad).sum()
}

/// Whether each edge has as many faces on one side as on the other.
fn is_closed(surface: &CoarseSurface) -> bool {
    let mut edges: BTreeMap<[u32; 2], i64> = BTreeMap::new();
    for quad in &surface.quads {
        (0..4).for_each(|i| *edges.entry([quad[i], quad[(i + 1) % 4]]).or_default() += 1);
    }
    edges.iter().all(|(&[a, b], count)| edges.get(&[b, a]) == Some(count))
}

/// A ball of 40 voxels' radius with the middle (50, 47, 52).
fn ball() -> std::sync::Arc<CompressedVolume> {
    volumes::volume([100, 96, 104], |x, y, z| u32::from(distance([x, y, z].map(f64::from)) < 40.0)).1
}

/// Of the middle of a voxel from that of the ball.
fn distance(voxel: [f64; 3]) -> f64 {
    (DVec3::from_array(voxel) + 0.5).distance(DVec3::new(50.0, 47.0, 52.0))
}

/// Farthest that a vertex is from the ball's surface, moved by `shift` voxels along x.
fn farthest(surface: &CoarseSurface, shift: f64) -> f64 {
    let off = |v: &[f32; 3]| {
        (distance([f64::from(v[0]) - 0.5 + shift, f64::from(v[1]) - 0.5, f64::from(v[2]) - 0.5]) - 40.0).abs()
    };
    surface.vertices.iter().map(off).fold(0.0, f64::max)
}

#[test]
fn a_ball_stays_a_ball_with_ever_fewer_faces() {
    let volume = ball();
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 40f64.powi(3);
    for (most, least) in [(20_000, 7_000), (5_000, 3_000), (1_200, 700)] {
        let surface = coarse(&volume, most);
        let faces = surface.quads.len();
        assert!((least..=most).contains(&faces), "{faces} of {most}");
        assert!(is_closed(&surface));
        let side = f64::from(surface.cell[0]);
        // A vertex is in its 2³ cells, within half a cell of where shares change, and the corners of voxels stand out by half a diagonal.
        let allowed = 0.87 + 0.5 * side;
        assert!(farthest(&surface, 0.0) < allowed, "{} {allowed}", farthest(&surface, 0.0));
        assert!(farthest(&surface, 1.0 + side) > allowed, "a shift is noticed");
        // A shell of a fifth of a cell around the ball has 3 · 0.2 · side / 40 of its volume.
        let more = enclosed(&surface) / exact - 1.0;
        assert!((0.0..0.015 * side + 0.01).contains(&more), "{more} {side}");
    }
}

#[test]
fn planes_lie_where_the_voxels_end_also_at_the_end_of_the_volume() {
    let (_, volume) = volumes::volume([64, 40, 80], |_, _, z| u32::from((16..48).contains(&z)));
    let surface = coarse(&volume, 1000);
    assert!(surface.cell[0] > 2, "{:?}", surface.cell);
    for axis in 0..3 {
        let ends = [[0.0, 64.0], [0.0, 40.0], [16.0, 48.0]][axis];
        let along =
            |take: fn(f32, f32) -> f32, from| surface.vertices.iter().map(|v| v[axis]).fold(from, take);
        let got = [along(f32::min, 1e9), along(f32::max, -1e9)];
        for (got, end) in got.into_iter().zip(ends) {
            // Nothing is outside of the volume; elsewhere a fifth of a cell, and less or more where a cell does not end with the voxels.
            let allowed = if axis < 2 { 0.0 } else { 0.35 * surface.cell[2] as f32 };
            assert!((got - end).abs() <= allowed, "axis {axis}: {got} {end} {:?}", surface.cell);
        }
    }
}

#[test]
fn a_fibre_of_one_voxel_does_not_vanish_in_large_cells() {
    let (_, volume) = volumes::volume([90, 90, 90], |x, y, z| u32::from(x == y && z == 40));
    let surface = coarse(&volume, 100);
    let side = surface.cell[0] as f32;
    assert!(side > 4.0 && is_closed(&surface));
    let reach = |take: fn(f32, f32) -> f32, from: f32| surface.vertices.iter().map(|v| v[0]).fold(from, take);
    assert!(reach(f32::min, 90.0) < side && reach(f32::max, 0.0) > 90.0 - side);
    // Every cell along it has a part.
    for at in (0..90).step_by(surface.cell[0] as usize) {
        let near = |v: &&[f32; 3]| (v[0] - at as f32).abs() <= side && (v[1] - at as f32).abs() <= side;
        assert!(surface.vertices.iter().any(|v| near(&v)), "nothing at {at}");
    }
}

#[test]
fn faces_have_the_label_that_is_there_and_none_that_is_hidden() {
    let (dense, volume) = volumes::blobs([60, 50, 40], 40, 30, 7);
    let visible: Vec<bool> = (0..volume.labels().len()).map(|label| label % 4 != 2).collect();
    let surface = CoarseSurface::new(&volume, &visible, 1500, &Job::new()).unwrap();
    assert!(surface.quads.len() > 700 && is_closed(&surface) && enclosed(&surface) > 0.0);
    let reach = i64::from(surface.cell[0]) + 1;
    for (quad, label) in surface.quads.iter().zip(&surface.labels) {
        assert!(visible[*label as usize]);
        let middle = corners(&surface, quad).into_iter().sum::<DVec3>() / 4.0;
        let [x, y, z] = middle.floor().to_array().map(|c| c as i64);
        let mut around = (-reach..=reach).flat_map(|dz| {
            (-reach..=reach).flat_map(move |dy| (-reach..=reach).map(move |dx| [x + dx, y + dy, z + dz]))
        });
        assert!(around.any(|v| dense.at(v) == label + 1), "label {label} is not near {middle}");
    }
}

#[test]
fn cells_are_cubes_in_the_units_of_the_volume() {
    let mut info = VolumeInfo::new([80, 80, 32], LabelType::U32);
    info.world_from_index = DAffine3::from_scale(DVec3::new(16.0, 16.0, 40.0));
    let volume = compress_labels(info, LabelBuffer::U32(vec![5; 80 * 80 * 32])).unwrap();
    let surface = coarse(&volume, 1000);
    let [x, y, z] = surface.cell;
    assert!(x == y && x > 2 * z - 1 && x <= 3 * z + 1, "{:?}", surface.cell);
}

#[test]
fn nothing_shown_gives_nothing_and_bad_input_is_refused() {
    let volume = ball();
    let job = Job::new();
    assert_eq!(CoarseSurface::new(&volume, &[false], 100, &job).unwrap(), CoarseSurface::default());
    assert_eq!(CoarseSurface::new(&volume, &[true], 6, &job).unwrap().quads.len(), 6);
    let refused =
        |visible: &[bool], faces, job: &Job| CoarseSurface::new(&volume, visible, faces, job).unwrap_err();
    assert_eq!(refused(&[true; 2], 100, &job).to_string(), "visible: expected 1 values, one a label, got 2");
    assert_eq!(refused(&[true], 5, &job).to_string(), "faces: expected at least 6, got 5");
    job.cancel();
    assert!(matches!(refused(&[true], 100, &job), ExportError::Volume(Error::Cancelled)));
}
