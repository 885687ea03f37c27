//! Tests `node.glsl`, `volume.glsl`, `index_ray.glsl` and the search for the box of a voxel, bit for bit.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use pumice_core::{CompressedVolume, LabelBuffer, LabelType, VolumeInfo, compress_labels};
use pumice_cpu::traverse::{TracedInstance, VolumeTracer};
use pumice_transport::geometry::{Detail, DetailLevel, LodChoice, visible_boxes};
use pumice_vulkan::layout::{NONE, SceneHeader};
use pumice_vulkan::pack::{PackedBoxes, PackedNodes};

use super::gpu::Gpu;
use super::gpu::scene::{Form, Uploaded};
use super::words::{Random, Reader};

/// Round bodies in several chunks. One voxel in `noise` is random, and every voxel whose x is below `all_noise`, so that cells of all
/// classes occur.
fn volume(noise: u32, all_noise: u32) -> Arc<CompressedVolume> {
    let dims = [1100u32, 40, 30];
    let mut random = Random(51);
    let ids = (0..dims[0] * dims[1] * dims[2])
        .map(|i| {
            let p = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
            let center = [p[0] / 40 * 40 + 20, 20, 15];
            let d2: u32 = (0..3).map(|a| p[a].abs_diff(center[a]).pow(2)).sum();
            match random.below(if p[0] < all_noise { 1 } else { noise }) {
                0 => 1 + random.below(5),
                _ if d2 < 140 => 6 + p[0] / 40,
                _ => 0,
            }
        })
        .collect();
    let info = VolumeInfo::new(dims, LabelType::U32);
    Arc::new(compress_labels(info, LabelBuffer::U32(ids)).expect("compressed"))
}

fn traced(volume: &Arc<CompressedVolume>, lod: LodChoice) -> TracedInstance {
    let visible = (0..volume.labels().len()).map(|l| l % 5 != 2).collect();
    TracedInstance { volume: Arc::clone(volume), world_from_index: DAffine3::IDENTITY, visible, lod }
}

#[test]
fn boxes_are_read_as_compressed() {
    // In the first volume no slices repeat; in the second nearly all do.
    for (noise, all_noise, long_words) in [(1, 0, 4), (2, 64, 3)] {
        let volume = volume(noise, all_noise);
        // Two chunks, each with leaves of its own.
        let [leaves, _] = volume.leaves() else { panic!("{} chunks", volume.leaves().len()) };
        assert_eq!(leaves.long_words(), long_words);
        assert!(long_words == 4 || !leaves.rare().is_empty());
        boxes_of_volume_are_read_as_compressed(&volume);
    }
}

fn boxes_of_volume_are_read_as_compressed(volume: &Arc<CompressedVolume>) {
    let gpu = Gpu::new();
    let eye = DVec3::new(-30.0, 20.0, 15.0);
    let lod = LodChoice::Distance { eye_in_world: eye, world_per_distance: 0.02, world_constant: 0.0 };
    let traced = traced(volume, lod);
    let Detail::ByDistance(by) = lod.placed(&DAffine3::IDENTITY) else { panic!("by distance") };
    let nodes = PackedNodes::new(volume, &traced.visible);
    assert!(nodes.len_bytes() < 2 * volume.nodes().len() as u64, "hidden labels' nodes are left out");
    assert_eq!(2 * nodes.packed(volume).expect("packed").len() as u64, nodes.len_bytes());
    let packed = PackedBoxes::new(volume, &nodes, &traced.visible, false).expect("packed");
    let mut uploaded = Uploaded::new(&gpu, std::slice::from_ref(&traced), Form::Bricks);
    let scene = uploaded.header(&gpu, SceneHeader::default());
    let mut random = Random(52);
    let inputs: Vec<_> =
        (0..packed.boxes.len() as u32).flat_map(|b| [0; 6].map(|_| [b, random.below(64)])).collect();
    let rows: Vec<_> = inputs.iter().map(|i| i.to_vec()).collect();
    let out = gpu.probe(false, 10, scene, &rows, 10);
    // The number of each box in the volume, found by label and lowest voxel; no two boxes have both the same.
    let by_place: std::collections::HashMap<_, _> = visible_boxes(volume, &traced.visible, false)
        .expect("boxes")
        .into_iter()
        .map(|(_, index)| {
            let b = volume.get_box(index as usize);
            let level = by.level(b.origin, b.extent);
            ((volume.label_of_box(index as usize), b.origin), (b, level))
        })
        .collect();
    assert_eq!(by_place.len(), packed.boxes.len());
    let mut levels = [0; 3];
    for ([_, cell], row) in inputs.iter().zip(&out) {
        let mut r = Reader(row);
        let origin = [r.word(), r.word(), r.word()];
        let (extent, level, label) = ([r.word(), r.word(), r.word()], r.word(), r.word());
        let (b, expected_level) = &by_place[&(label, origin)];
        assert_eq!((extent, level), (b.extent, *expected_level as u32));
        assert_eq!(r.long(), b.node.field(*cell), "cell {cell} of the box at {origin:?}");
        levels[*expected_level as usize] += 1;
    }
    assert!(
        levels[DetailLevel::Voxels as usize] > 0 && levels[2] > 0,
        "{levels:?}: several levels of detail"
    );
}

#[test]
fn boxes_are_found_by_voxel() {
    let gpu = Gpu::new();
    let volume = volume(40, 0);
    for lod in [LodChoice::Voxels, LodChoice::Cells] {
        let traced = traced(&volume, lod);
        let tracer = VolumeTracer::new(0, &traced).expect("a tracer");
        let mut uploaded = Uploaded::new(&gpu, std::slice::from_ref(&traced), Form::Bricks);
        let scene = uploaded.header(&gpu, SceneHeader::default());
        let mut random = Random(53);
        let labels = volume.labels().len() as u32;
        let mut inputs: Vec<[u32; 4]> = (0..20_000)
            .map(|_| [random.below(labels), random.below(1104), random.below(44), random.below(34)])
            .collect();
        for i in inputs.iter_mut().step_by(2) {
            // Often exactly the label of the voxel.
            i[0] = tracer.label_at([i[1], i[2], i[3]]).unwrap_or(i[0]);
        }
        let rows: Vec<_> = inputs.iter().map(|i| i.to_vec()).collect();
        let mut found = 0;
        for (&[label, x, y, z], row) in inputs.iter().zip(gpu.probe(false, 11, scene, &rows, 1)) {
            let here = tracer.label_at([x, y, z]);
            if row[0] != NONE {
                found += 1;
                // Elements of coarse levels overlap: the CPU answers with the lowest label, and other labels may be there too.
                assert!(here.is_some_and(|l| l == label || lod != LodChoice::Voxels && l < label));
            } else {
                assert!(here != Some(label), "label {label} at {:?}", [x, y, z]);
            }
        }
        assert!(found > 500, "{found}");
    }
}
