//! Compares faces with their definition, evaluated voxel by voxel on a dense array.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeSet;

use pumice_core::{CompressedVolume, Error, Job};
use pumice_export::{Corners, Interfaces, QuadMesh, for_each_face_block};
use pumice_oracle::{Dense, volumes};

type Face = ([[i64; 3]; 4], u32);

/// The visible label at a voxel: 0 for background, for hidden labels, and outside the volume.
fn shown(dense: &Dense, visible: &[bool], v: [i64; 3]) -> u32 {
    if (0..3).any(|a| v[a] < 0 || v[a] >= i64::from(dense.dims[a])) {
        return 0;
    }
    let [x, y, z] = v.map(|c| c as usize);
    let label = dense.labels[(z * dense.dims[1] as usize + y) * dense.dims[0] as usize + x];
    if label != 0 && visible[label as usize - 1] { label } else { 0 }
}

/// Every face by definition, with its corners sorted.
fn naive(dense: &Dense, visible: &[bool], interfaces: Interfaces) -> BTreeSet<Face> {
    let mut faces = BTreeSet::new();
    let dims = dense.dims.map(i64::from);
    for i in 0..dims[0] * dims[1] * dims[2] {
        let v = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
        let label = shown(dense, visible, v);
        let steps = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
        for step in steps.iter().filter(|_| label != 0) {
            let other = shown(dense, visible, [0, 1, 2].map(|a| v[a] + step[a]));
            if other == 0 || (interfaces == Interfaces::All && other != label) {
                // Of the eight corners of the voxel, those on the face's side.
                let mut corners: Vec<[i64; 3]> = (0..8)
                    .map(|c| [v[0] + (c & 1), v[1] + (c >> 1 & 1), v[2] + (c >> 2)])
                    .filter(|c| (0..3).all(|a| step[a] == 0 || c[a] - v[a] == (step[a] + 1) / 2))
                    .collect();
                corners.sort_unstable();
                faces.insert((corners.try_into().unwrap(), label - 1));
            }
        }
    }
    faces
}

fn sorted(mesh: &QuadMesh) -> BTreeSet<Face> {
    let quads = mesh.quads.iter().zip(&mesh.labels);
    quads
        .map(|(quad, &label)| {
            let mut corners = quad.map(|v| mesh.vertices[v as usize].map(i64::from));
            corners.sort_unstable();
            (corners, label)
        })
        .collect()
}

/// Whether the middle of each quad, moved half a voxel against its normal, lies in a voxel of its label, and moved along it, elsewhere.
fn normals_point_out(dense: &Dense, visible: &[bool], mesh: &QuadMesh) -> bool {
    mesh.quads.iter().zip(&mesh.labels).all(|(quad, &label)| {
        let p = quad.map(|v| mesh.vertices[v as usize].map(i64::from));
        let (e, f) = ([0, 1, 2].map(|a| p[1][a] - p[0][a]), [0, 1, 2].map(|a| p[2][a] - p[1][a]));
        let normal = [0, 1, 2].map(|a| e[(a + 1) % 3] * f[(a + 2) % 3] - e[(a + 2) % 3] * f[(a + 1) % 3]);
        // Twice the middle, plus or minus the normal, is odd on all three axes, which makes it the middle of a voxel.
        let twice = [0, 1, 2].map(|a| p[0][a] + p[2][a]);
        let voxel = |side: i64| [0, 1, 2].map(|a| (twice[a] + side * normal[a]).div_euclid(2));
        let is_unit = normal.iter().map(|n| n.abs()).sum::<i64>() == 1;
        is_unit
            && shown(dense, visible, voxel(-1)) == label + 1
            && shown(dense, visible, voxel(1)) != label + 1
    })
}

fn mesh(volume: &CompressedVolume, visible: &[bool], interfaces: Interfaces, corners: Corners) -> QuadMesh {
    QuadMesh::new(volume, visible, interfaces, corners, &Job::new()).unwrap()
}

/// Volumes with extents below, at and above a block's side, with all labels or some of them visible.
#[test]
fn matches_naive() {
    let cases = [
        volumes::noise([1, 1, 1], 1.0, 1, 1),
        volumes::noise([17, 9, 5], 0.6, 4, 2),
        volumes::noise([66, 65, 7], 0.5, 300, 3),
        volumes::blobs([70, 64, 63], 40, 30, 4),
        volumes::checkerboard([9, 70, 10]),
        volumes::sheets([40, 33, 129]),
    ];
    for (c, (dense, volume)) in cases.iter().enumerate() {
        let labels = volume.labels().len();
        let all = vec![true; labels];
        let every_third: Vec<bool> = (0..labels).map(|l| l % 3 == 0).collect();
        for visible in [&all, &every_third] {
            for interfaces in [Interfaces::Outside, Interfaces::All] {
                let expected = naive(dense, visible, interfaces);
                let own = mesh(volume, visible, interfaces, Corners::Own);
                assert_eq!(own.quads.len(), expected.len(), "case {c}: none twice");
                assert_eq!(sorted(&own), expected, "case {c}, {interfaces:?}");
                assert!(normals_point_out(dense, visible, &own), "case {c}");
                assert_eq!(own.vertices.len(), 4 * own.quads.len());

                let shared = mesh(volume, visible, interfaces, Corners::Shared);
                assert_eq!(sorted(&shared), expected, "case {c}, shared");
                assert!(normals_point_out(dense, visible, &shared), "case {c}, shared");
                let places: BTreeSet<_> = shared.vertices.iter().collect();
                assert_eq!(places.len(), shared.vertices.len(), "case {c}: one vertex at each place");
                let used: BTreeSet<u32> = shared.quads.iter().flatten().copied().collect();
                assert_eq!(used.len(), shared.vertices.len(), "case {c}: none unused");
            }
        }
    }
}

/// A control: the check of normals notices a quad with reversed corners.
#[test]
fn reversed_quads_are_noticed() {
    let (dense, volume) = volumes::blobs([30, 30, 30], 10, 8, 5);
    let visible = vec![true; volume.labels().len()];
    let mut mesh = mesh(&volume, &visible, Interfaces::Outside, Corners::Shared);
    assert!(normals_point_out(&dense, &visible, &mesh));
    mesh.quads[7].reverse();
    assert!(!normals_point_out(&dense, &visible, &mesh));
}

#[test]
fn the_order_does_not_depend_on_threads() {
    let (_, volume) = volumes::noise([130, 70, 66], 0.3, 9, 6);
    let visible = vec![true; volume.labels().len()];
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| mesh(&volume, &visible, Interfaces::Outside, Corners::Shared))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn wrong_visibility_and_cancelling_are_errors() {
    let (_, volume) = volumes::noise([20, 20, 20], 0.5, 3, 7);
    let refused = QuadMesh::new(&volume, &[true], Interfaces::All, Corners::Own, &Job::new()).unwrap_err();
    assert_eq!(refused.to_string(), "visible: expected 3 values, one a label, got 1");
    let job = Job::new();
    job.cancel();
    let visit = |_| panic!("nothing is visited");
    let cancelled = for_each_face_block(&volume, &[true; 3], Interfaces::All, &job, visit);
    assert!(matches!(cancelled, Err(Error::Cancelled)));
}
