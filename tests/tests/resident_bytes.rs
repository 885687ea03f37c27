//! Tests that Pumice allocates the bytes that it reports, and never anything as large as the decompressed volume.
//!
//! A counting allocator serves the whole process. This file has only one test, so that nothing else allocates at the same time.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail by panicking, in its helpers too")]

#[path = "counting_allocator/mod.rs"]
mod counting_allocator;

use std::hint::black_box;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use counting_allocator::{Counted, measured};
use glam::DVec3;
use pumice_core::{
    ArraySource, CompressOptions, CompressedVolume, CompressionLevel, Job, LabelBuffer, LabelType, VolumeInfo,
};
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_transport::geometry::LodChoice;
use pumice_transport::geometry::bvh::BUILD_BYTES_A_BOX;
use pumice_transport::{PathOrigin, RayInWorld, Tracer};

const DIMS: [u32; 3] = [256, 256, 512];

/// Share of 4 bytes a voxel that the volume and what rays need of it may take, in per cent. It takes 3.4; with a hierarchy it would take 3.8, and
/// with bricks that hold masks and labels as they are 4.4.
const HELD_PERCENT: f64 = 3.6;

#[test]
fn reported_bytes_are_allocated_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let file = compressed_connectome(folder.path());
    let voxels = DIMS.iter().map(|&d| d as usize).product::<usize>();

    // Opening: the bytes kept are those reported.
    let (volume, opening) = measured(|| Arc::new(CompressedVolume::open(&file, &Job::new()).unwrap()));
    let reported: u64 = volume.resident_parts().iter().map(|p| p.1).sum();
    agree("volume", opening.kept, reported);
    assert_eq!(volume.info().dims, DIMS);

    // Mapped bytes are not allocated.
    let fast = folder.path().join("mapped.pumice");
    volume.save(&fast, CompressionLevel::Fast, &Job::new()).unwrap();
    let (mapped, mapping) = measured(|| CompressedVolume::open_mapped(&fast, &Job::new()).unwrap());
    assert!(mapped.mapped_bytes() > reported / 2, "{} of {reported}", mapped.mapped_bytes());
    agree("mapped volume", mapping.kept, reported - mapped.mapped_bytes());
    drop(mapped);

    // Building the tracer: the bytes kept are those reported.
    let instance = || TracedInstance {
        volume: volume.clone(),
        world_from_index: volume.info().world_from_index,
        visible: vec![true; volume.labels().len()],
        lod: LodChoice::Voxels,
    };
    let (tracer, building) = measured(|| SceneTracer::new(&[instance()]).unwrap());
    agree("acceleration", building.kept, tracer.bytes());
    agree("together", opening.kept + building.kept, reported + tracer.bytes());

    // Beside the bricks there is no hierarchy, only which labels are shown. Together they stay below a share of 4 bytes a voxel.
    assert_eq!(tracer.bytes() - tracer.brick_bytes(), volume.labels().len() as u64);
    let held = 100.0 * (opening.kept + building.kept) as f64 / (4 * voxels) as f64;
    println!("{held:.3} % of 4 bytes a voxel are held: volume {} and tracer {}", opening.kept, building.kept);
    assert!(held < HELD_PERCENT, "{held:.3} %");

    // Tracing keeps nothing and needs very little: the stack of a ray, never the volume.
    let (hits, tracing) = measured(|| trace(&tracer, &volume));
    assert!(hits > 1_000, "only {hits} rays hit, which is too few for a test");
    assert_eq!(tracing.kept, 0);
    assert!(tracing.peak < 64 << 10, "{tracing:?}");

    // An array of labels has at least one byte per voxel. No step may allocate that much at once.
    for (what, counted) in [("opening", &opening), ("building", &building), ("tracing", &tracing)] {
        println!("{what}: {counted:?}");
        assert!(!is_volume_sized(counted, voxels), "{what}: {counted:?}");
    }
    // A hierarchy, which there is where bricks are not possible, has a stricter limit: the bytes per box that
    // `pumice_transport::geometry::bvh` states, and none per voxel. (64 KiB are for queues, stacks and the visible labels, which do not grow.)
    let (by_hierarchy, building) = measured(|| SceneTracer::without_bricks(&[instance()]).unwrap());
    agree("hierarchy", building.kept, by_hierarchy.bytes());
    let boxes = tracer.instance(0).unwrap().boxes();
    let bar = (boxes * BUILD_BYTES_A_BOX) as isize + (64 << 10);
    assert!(building.peak <= bar, "building {boxes} boxes: {building:?}, at most {bar}");
    // The limit is tight: 2 % less would be exceeded.
    assert!(building.peak as f64 > 0.98 * bar as f64, "building {boxes} boxes: {building:?}, of {bar}");
    println!("reported {reported} + {} bytes", tracer.bytes());

    // Negative control: an array of a byte per voxel is detected although it is freed, and so are 2.5 % of lost bytes.
    let (_, control) = measured(|| drop(black_box(vec![1u8; voxels])));
    assert!(is_volume_sized(&control, voxels));
    let ((), lost) = measured(|| std::mem::forget(black_box(vec![1u8; reported as usize / 40])));
    assert!(off(opening.kept + lost.kept, reported) > 0.02, "2.5 % more than reported goes unseen");
}

fn is_volume_sized(counted: &Counted, voxels: usize) -> bool {
    counted.peak >= voxels as isize
}

/// Asserts the requirement that both agree within 2 %.
fn agree(what: &str, counted: isize, reported: u64) {
    let off = off(counted, reported);
    assert!(off <= 0.02, "{what}: {counted} bytes are held, {reported} reported: {:.2} % off", 100.0 * off);
}

fn off(counted: isize, reported: u64) -> f64 {
    (counted as f64 / reported as f64 - 1.0).abs()
}

/// Traces rays from all around through the volume, each with up to four bounces; returns the number of hits.
fn trace(tracer: &SceneTracer, volume: &CompressedVolume) -> usize {
    let world = volume.info().world_from_index;
    let centre = world.transform_point3(DVec3::from(DIMS.map(f64::from)) / 2.0);
    let radius = world.transform_vector3(DVec3::from(DIMS.map(f64::from))).length();
    let mut hits = 0;
    for i in 0..4_000 {
        // A Fibonacci spiral over the sphere, which is even and has no two equal directions.
        let (turn, height) = (2.399_963_23 * f64::from(i), 1.0 - 2.0 * (f64::from(i) + 0.5) / 4_000.0);
        let ring = (1.0 - height * height).sqrt();
        let outward = DVec3::new(ring * turn.cos(), ring * turn.sin(), height);
        let mut ray = RayInWorld { origin: centre + radius * outward, direction: -outward };
        let mut from = PathOrigin::Free;
        for _ in 0..4 {
            let Some(hit) = tracer.first_hit(&ray, from, f64::INFINITY) else { break };
            hits += 1;
            let direction =
                ray.direction - 2.0 * ray.direction.dot(hit.normal_in_world) * hit.normal_in_world;
            ray = RayInWorld { origin: ray.origin + hit.t * ray.direction, direction };
            from = PathOrigin::Face(hit.surface);
        }
    }
    hits
}

/// Compresses the shipped connectome to a `.pumice` file. Reads it without Pumice's readers: gzip data after a blank line.
fn compressed_connectome(folder: &Path) -> PathBuf {
    let nrrd = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/connectomics_32x32x40nm.nrrd");
    let bytes = std::fs::read(&nrrd).unwrap_or_else(|e| panic!("{}: {e}", nrrd.display()));
    let data = bytes.windows(2).position(|w| w == b"\n\n").unwrap() + 2;
    let mut raw = Vec::new();
    flate2::read::GzDecoder::new(&bytes[data..]).read_to_end(&mut raw).unwrap();
    let labels: Vec<u32> = raw.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();

    let mut info = VolumeInfo::new(DIMS, LabelType::U32);
    info.world_from_index = glam::DAffine3::from_scale(DVec3::new(32.0, 32.0, 40.0));
    let mut source = ArraySource::new(info, LabelBuffer::U32(labels)).unwrap();
    let volume = pumice_core::compress(&mut source, &CompressOptions::default(), &Job::new()).unwrap();
    let path = folder.join("connectome.pumice");
    volume.save(&path, CompressionLevel::Default, &Job::new()).unwrap();
    path
}
