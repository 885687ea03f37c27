//! Compares cut surfaces with rays: along many lines, what the surface encloses is what is left of the labels.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::Job;
use pumice_export::{CutPolygon, CutRegion, Faces, Interfaces, Merging, Rectangle, for_each_cut_block};
use pumice_oracle::{Dense, volumes};
use pumice_scene::CutShape;
use pumice_transport::geometry::DetailLevel;

/// Whether a point of index space is removed, by the definition of the shapes.
fn is_removed(p_in_world: DVec3, shapes: &[CutShape]) -> bool {
    shapes.iter().any(|shape| match shape {
        CutShape::Plane { point, normal } => {
            (p_in_world - DVec3::from_array(*point)).dot(DVec3::from_array(*normal)) > 0.0
        }
        CutShape::Box { world_from_box } => {
            world_from_box.inverse().transform_point3(p_in_world).abs().max_element() < 1.0
        }
    })
}

/// Where a line along z meets convex polygons: (z, whether it enters, label), by z.
fn crossings(polygons: &[CutPolygon], x: f64, y: f64) -> Vec<(f64, bool, u32)> {
    let mut found: Vec<(f64, bool, u32)> = polygons
        .iter()
        .filter_map(|polygon| {
            let c = &polygon.corners;
            let sides = (0..c.len()).map(|i| {
                let (a, b) = (c[i], c[(i + 1) % c.len()]);
                (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x)
            });
            let sides: Vec<f64> = sides.collect();
            if !(sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0)) {
                return None;
            }
            let normal = (1..c.len() - 1).map(|i| (c[i] - c[0]).cross(c[i + 1] - c[0])).sum::<DVec3>();
            let z = c[0].z - (normal.x * (x - c[0].x) + normal.y * (y - c[0].y)) / normal.z;
            Some((z, normal.z < 0.0, polygon.label))
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

fn polygon_of(rectangle: &Rectangle) -> CutPolygon {
    let corners = rectangle.corners().map(|c| DVec3::from_array(c.map(f64::from))).to_vec();
    CutPolygon { corners, label: rectangle.label }
}

/// Follows lines along z through what is left of the labels, in short steps, and compares where it begins and ends with the surface.
fn check(dense: &Dense, polygons: &[CutPolygon], world_from_index: DAffine3, shapes: &[CutShape]) -> usize {
    let dims = dense.dims;
    let mut seen = 0;
    for line in 0..400u32 {
        // Lines that miss the corners of voxels.
        let x = f64::from(dims[0]) * (f64::from(line) * 0.618_033_988_7 + 0.137).fract();
        let y = f64::from(dims[1]) * (f64::from(line) * 0.754_877_666_2 + 0.291).fract();
        let last = f64::from(dims[2]) - 1e-9;
        let there = |z: f64| {
            let v = [x, y, z].map(|c| c as u32);
            dense.labels[((v[2] * dims[1] + v[1]) * dims[0] + v[0]) as usize]
        };
        let label = |z: f64| {
            let world = world_from_index.transform_point3(DVec3::new(x, y, z));
            if is_removed(world, shapes) { 0 } else { there(z) }
        };
        // 100 steps a voxel; the ends between two steps are where the surface must be.
        let step = 0.01;
        let count = (f64::from(dims[2]) / step) as u32;
        let mut expected = Vec::new();
        let mut before = 0;
        for i in 0..=count {
            let z = (f64::from(i) + 0.5) * step;
            let now = if i == count { 0 } else { label(z) };
            if (before == 0) != (now == 0) {
                expected.push((z - 0.5 * step, now != 0, if now != 0 { now } else { before }));
            }
            before = now;
        }
        // Entry and exit closer than two steps are too thin for the march.
        let mut got = crossings(polygons, x, y);
        let mut i = 0;
        while i + 1 < got.len() {
            if got[i + 1].0 - got[i].0 < 2.0 * step {
                got.drain(i..i + 2);
            } else {
                i += 1;
            }
        }
        let mut i = 0;
        while i + 1 < expected.len() {
            if expected[i + 1].0 - expected[i].0 < 3.0 * step {
                expected.drain(i..i + 2);
            } else {
                i += 1;
            }
        }
        assert_eq!(got.len(), expected.len(), "line {line}: {got:?} {expected:?}");
        for (got, expected) in got.iter().zip(&expected) {
            assert!((got.0 - expected.0).abs() < 1.5 * step, "line {line}: {got:?} {expected:?}");
            assert_eq!(got.1, expected.1, "line {line} at {}", expected.0);
            // Within a step of a face between two labels the march does not know which of them it is.
            let near = [-1.5, 1.5].map(|steps| there((expected.0 + steps * step).clamp(0.0, last)));
            assert!(got.2 + 1 == expected.2 || near.contains(&(got.2 + 1)), "line {line} at {}", expected.0);
            seen += 1;
        }
    }
    seen
}

fn surface(
    dense: &Dense,
    volume: &pumice_core::CompressedVolume,
    world_from_index: DAffine3,
    shapes: &[CutShape],
) -> usize {
    let regions: Vec<CutRegion> = shapes.iter().map(|s| CutRegion::new(s, &world_from_index)).collect();
    let [plain, merged] = [Merging::Plain, Merging::Merged].map(|merging| {
        let polygons = polygons_of(volume, &regions, merging, Interfaces::Outside);
        (check(dense, &polygons, world_from_index, shapes), polygons.len())
    });
    assert!(plain.0 == merged.0 && plain.1 > merged.1, "{plain:?} {merged:?}");
    plain.0
}

fn polygons_of(
    volume: &pumice_core::CompressedVolume,
    regions: &[CutRegion],
    merging: Merging,
    interfaces: Interfaces,
) -> Vec<CutPolygon> {
    let mut polygons = Vec::new();
    let visible = vec![true; volume.labels().len()];
    let faces = Faces { interfaces, merging };
    for_each_cut_block(volume, &visible, DetailLevel::Voxels, faces, regions, &Job::new(), |whole, cut| {
        polygons.extend(whole.iter().map(polygon_of));
        polygons.extend_from_slice(cut);
        Ok(())
    })
    .unwrap();
    polygons
}

fn world() -> DAffine3 {
    let turned = DMat3::from_rotation_y(0.3) * DMat3::from_diagonal(DVec3::new(2.0, -2.0, 5.0));
    DAffine3::from_mat3_translation(turned, DVec3::new(-10.0, 7.0, 1.0))
}

/// The volume has two blocks of the export, of which the box reaches one.
#[test]
fn what_is_left_is_enclosed() {
    let (dense, volume) = volumes::blobs([100, 36, 30], 30, 9, 3);
    let world = world();
    let middle = world.transform_point3(DVec3::new(20.0, 18.0, 15.0));
    let oblique = CutShape::Plane { point: middle.to_array(), normal: [0.3, 0.5, 0.8] };
    let turned = DMat3::from_rotation_x(0.7) * DMat3::from_diagonal(DVec3::new(15.0, 12.0, 30.0));
    let hole = CutShape::Box { world_from_box: DAffine3::from_mat3_translation(turned, middle) };
    let across = CutShape::Plane { point: middle.to_array(), normal: [-1.0, 0.2, 0.0] };
    for shapes in [vec![oblique], vec![hole], vec![oblique, across], vec![hole, across, oblique]] {
        let seen = surface(&dense, &volume, world, &shapes);
        assert!(seen > 100, "{seen}");
    }
}

/// Planes between voxels, where caps coincide with faces; two cuts with a common plane.
#[test]
fn planes_between_voxels_leave_whole_voxels() {
    let (dense, volume) = volumes::blobs([40, 36, 30], 12, 9, 3);
    let spacing = DAffine3::from_scale(DVec3::new(0.1, 0.1, 0.3));
    let above = CutShape::Plane { point: [0.0, 0.0, 17.0 * 0.3], normal: [0.0, 0.0, 2.0] };
    let low = DVec3::new(-1.0, -1.0, 17.0 * 0.3);
    let high = DVec3::new(1.7, 5.0, 9.0);
    let half = DMat3::from_diagonal(0.5 * (high - low));
    let corner = CutShape::Box { world_from_box: DAffine3::from_mat3_translation(half, 0.5 * (low + high)) };
    let below = CutShape::Plane { point: [0.0, 0.0, 6.0 * 0.3], normal: [0.0, 0.0, -1.0] };
    for shapes in [vec![above], vec![corner], vec![above, corner], vec![corner, below, above]] {
        assert!(surface(&dense, &volume, spacing, &shapes) > 100);
    }
}

/// The check notices a plane that is off by a quarter of a voxel.
#[test]
#[should_panic(expected = "line")]
fn a_plane_that_is_off_is_noticed() {
    let (dense, volume) = volumes::blobs([40, 36, 30], 12, 9, 3);
    let plane = |z: f64| CutShape::Plane { point: [0.0, 0.0, z], normal: [0.0, 0.0, 1.0] };
    let regions = [CutRegion::new(&plane(15.75), &DAffine3::IDENTITY)];
    let polygons = polygons_of(&volume, &regions, Merging::Plain, Interfaces::Outside);
    check(&dense, &polygons, DAffine3::IDENTITY, &[plane(15.5)]);
}

/// The faces of single labels, with those to others as `interfaces` says, compared with what is left of that label alone.
fn labels_alone(interfaces: Interfaces, shapes: &[CutShape]) -> usize {
    let (dense, volume) = volumes::blobs([40, 36, 30], 12, 9, 3);
    let regions: Vec<CutRegion> = shapes.iter().map(|s| CutRegion::new(s, &DAffine3::IDENTITY)).collect();
    let polygons = polygons_of(&volume, &regions, Merging::Plain, interfaces);
    let of_label = |label: u32| {
        let only = dense.labels.iter().map(|&l| if l == label { l } else { 0 }).collect();
        let alone = Dense { dims: dense.dims, labels: only };
        let own: Vec<CutPolygon> = polygons.iter().filter(|p| p.label + 1 == label).cloned().collect();
        check(&alone, &own, DAffine3::IDENTITY, shapes)
    };
    (1..=4).map(of_label).sum()
}

/// Caps lie within voxels, and between voxels, where the other label of such a place is gone.
#[test]
fn faces_between_labels_close_each_label() {
    let plane = |z: f64, normal| CutShape::Plane { point: [20.0, 18.0, z], normal };
    for shapes in [vec![], vec![plane(17.0, [0.0, 0.0, 1.0])], vec![plane(15.0, [0.3, 0.5, 0.8])]] {
        assert!(labels_alone(Interfaces::All, &shapes) > 100);
    }
}

/// Without them a label is open where another one touches it.
#[test]
#[should_panic(expected = "line")]
fn missing_faces_between_labels_are_noticed() {
    labels_alone(Interfaces::Outside, &[]);
}
