//! Compares surfaces with their definition, evaluated voxel by voxel on a dense array.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;

use pumice_core::{CompressedVolume, Error, Job};
use pumice_export::{ExportError, Merging, Rectangle, for_each_surface_block};
use pumice_oracle::{Dense, volumes};
use pumice_transport::geometry::DetailLevel;

/// One side of a voxel: voxel, axis, whether it is the upper side.
type Face = ([u32; 3], usize, bool);

const LEVELS: [DetailLevel; 3] = [DetailLevel::Voxels, DetailLevel::Cells, DetailLevel::Boxes];

/// The label that is drawn at each voxel, as dense index + 1, by the definition of the level.
fn drawn(dense: &Dense, volume: &CompressedVolume, visible: &[bool], level: DetailLevel) -> Vec<u32> {
    let dims = dense.dims;
    let place = |[x, y, z]: [u32; 3]| ((z * dims[1] + y) * dims[0] + x) as usize;
    let mut drawn = vec![0u32; dense.labels.len()];
    let mut fill = |low: [u32; 3], extent: [u32; 3], label: u32| {
        for z in low[2]..(low[2] + extent[2]).min(dims[2]) {
            for y in low[1]..(low[1] + extent[1]).min(dims[1]) {
                for x in low[0]..(low[0] + extent[0]).min(dims[0]) {
                    let there = &mut drawn[place([x, y, z])];
                    *there = if *there == 0 { label } else { (*there).min(label) };
                }
            }
        }
    };
    if level == DetailLevel::Boxes {
        volume.for_each_box(|label, view| {
            if visible[label as usize] {
                fill(view.origin, view.extent, label + 1);
            }
        });
        return drawn;
    }
    for i in 0..dense.labels.len() as u32 {
        let voxel = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        let label = dense.labels[place(voxel)];
        if label != 0 && visible[label as usize - 1] {
            match level {
                DetailLevel::Cells => fill(voxel.map(|v| v & !3), [4; 3], label),
                _ => fill(voxel, [1; 3], label),
            }
        }
    }
    drawn
}

/// Every side of a drawn voxel with nothing drawn before it, with its label.
fn naive(drawn: &[u32], dims: [u32; 3]) -> BTreeMap<Face, u32> {
    let mut faces = BTreeMap::new();
    let at = |[x, y, z]: [u32; 3]| drawn[((z * dims[1] + y) * dims[0] + x) as usize];
    for i in 0..drawn.len() as u32 {
        let voxel = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        for axis in 0..3 {
            let [mut below, mut above] = [voxel; 2];
            above[axis] += 1;
            let is_free_above = above[axis] == dims[axis] || at(above) == 0;
            let is_free_below = voxel[axis] == 0 || {
                below[axis] -= 1;
                at(below) == 0
            };
            for (is_up, is_free) in [(false, is_free_below), (true, is_free_above)] {
                if at(voxel) != 0 && is_free {
                    faces.insert((voxel, axis, is_up), at(voxel) - 1);
                }
            }
        }
    }
    faces
}

fn rectangles(
    volume: &CompressedVolume,
    visible: &[bool],
    level: DetailLevel,
    merging: Merging,
) -> Vec<Rectangle> {
    let mut all = Vec::new();
    for_each_surface_block(volume, visible, level, merging, &Job::new(), |block| {
        all.extend_from_slice(block);
        Ok(())
    })
    .unwrap();
    all
}

/// The sides of voxels that rectangles cover; panics where two cover the same.
fn covered(rectangles: &[Rectangle]) -> BTreeMap<Face, u32> {
    let mut faces = BTreeMap::new();
    for r in rectangles {
        let axis = usize::from(r.axis);
        for b in 0..u32::from(r.size[1]) {
            for a in 0..u32::from(r.size[0]) {
                let mut voxel = r.low;
                voxel[(axis + 1) % 3] += a;
                voxel[(axis + 2) % 3] += b;
                voxel[axis] -= u32::from(r.is_up);
                assert!(faces.insert((voxel, axis, r.is_up), r.label).is_none(), "{r:?} covers a face again");
            }
        }
    }
    faces
}

#[test]
fn every_level_is_what_its_definition_says() {
    let cases = [
        volumes::noise([1, 1, 1], 1.0, 1, 1),
        volumes::noise([17, 9, 5], 0.05, 4, 2),
        volumes::noise([66, 65, 7], 0.02, 30, 3),
        volumes::blobs([70, 64, 63], 40, 30, 4),
        volumes::checkerboard([9, 70, 10]),
        volumes::sheets([40, 33, 129]),
        volumes::blobs([262, 20, 18], 30, 20, 5),
    ];
    for (c, (dense, volume)) in cases.iter().enumerate() {
        let labels = volume.labels().len();
        for visible in [vec![true; labels], (0..labels).map(|l| l % 3 == 0).collect()] {
            for level in LEVELS {
                let expected = naive(&drawn(dense, volume, &visible, level), dense.dims);
                let plain = rectangles(volume, &visible, level, Merging::Plain);
                let merged = rectangles(volume, &visible, level, Merging::Merged);
                assert!(covered(&plain) == expected, "case {c}, {level:?}");
                assert!(covered(&merged) == expected, "case {c}, {level:?}, merged");
                assert!(merged.len() <= plain.len());
                let side = if level == DetailLevel::Voxels { 1 } else { 4 };
                assert!(plain.iter().all(|r| r.size.iter().all(|&s| s <= side)), "case {c}, {level:?}");
            }
        }
    }
}

/// A slab of one label needs six rectangles in each block; squares only where the surface turns at every voxel.
#[test]
fn merging_pays() {
    let (_, slab) = volumes::volume([60, 50, 40], |_, _, _| 3);
    assert_eq!(rectangles(&slab, &[true], DetailLevel::Voxels, Merging::Merged).len(), 6);
    let (_, blobs) = volumes::blobs([70, 64, 63], 40, 30, 4);
    let visible = vec![true; blobs.labels().len()];
    let [merged, plain] =
        [Merging::Merged, Merging::Plain].map(|m| rectangles(&blobs, &visible, DetailLevel::Voxels, m).len());
    assert!(10 * merged < 7 * plain, "{merged} of {plain}");
}

/// Corners run counter-clockwise as seen from outside: the normal points away from the label's voxel.
#[test]
fn corners_turn_outwards() {
    let (_, volume) = volumes::blobs([40, 30, 20], 10, 8, 5);
    let visible = vec![true; volume.labels().len()];
    for r in rectangles(&volume, &visible, DetailLevel::Voxels, Merging::Merged) {
        let p = r.corners().map(|corner| corner.map(i64::from));
        let (e, f) = ([0, 1, 2].map(|a| p[1][a] - p[0][a]), [0, 1, 2].map(|a| p[2][a] - p[1][a]));
        let normal = [0, 1, 2].map(|a| e[(a + 1) % 3] * f[(a + 2) % 3] - e[(a + 2) % 3] * f[(a + 1) % 3]);
        let area = i64::from(r.size[0]) * i64::from(r.size[1]);
        let mut expected = [0; 3];
        expected[usize::from(r.axis)] = if r.is_up { area } else { -area };
        assert_eq!(normal, expected, "{r:?}");
    }
}

#[test]
fn the_order_does_not_depend_on_threads() {
    let (_, volume) = volumes::blobs([300, 70, 66], 60, 50, 6);
    let visible = vec![true; volume.labels().len()];
    for level in LEVELS {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| rectangles(&volume, &visible, level, Merging::Merged))
        };
        assert_eq!(with(1), with(3));
    }
}

#[test]
fn wrong_visibility_and_cancelling_are_errors() {
    let (_, volume) = volumes::noise([20, 20, 20], 0.5, 3, 7);
    let all = |visible: &[bool], job: &Job| {
        let visit = |_: &[Rectangle]| panic!("nothing is visited");
        for_each_surface_block(&volume, visible, DetailLevel::Boxes, Merging::Merged, job, visit).unwrap_err()
    };
    let refused = all(&[true], &Job::new()).to_string();
    assert_eq!(refused, "visible: expected 3 values, one a label, got 1");
    let job = Job::new();
    job.cancel();
    assert!(matches!(all(&[true; 3], &job), ExportError::Volume(Error::Cancelled)));
}
