//! Tests that compressing keeps to its limit of memory, whatever the voxels are.
//!
//! A counting allocator serves the whole process. This file has only one test, so that nothing else allocates at the same time.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail by panicking, in its helpers too")]

#[path = "../../tests/tests/counting_allocator/mod.rs"]
mod counting_allocator;
#[path = "../../tests/tests/turns/mod.rs"]
mod turns;

use std::path::Path;

use counting_allocator::measured;
use pumice_core::{
    BlockSource, CompressOptions, CompressedVolume, CompressionLevel, Job, LabelBlock, LabelBuffer,
    LabelType, Result, VolumeInfo, compress_to_file,
};
use turns::of_today;

const MIB: isize = 1 << 20;

/// The limit that is given.
const LIMIT: isize = 8 * MIB;

/// What may be allocated at once. Of each thread that reads, a block of voxels (1 MiB), which the limit excludes, and one that waits; and
/// 4.5 MiB of records that are grouped. This is less than the 64 MiB that a process may take beyond its limit, because a process takes some for
/// itself, and the allocator keeps some of what is freed.
const MOST: isize = LIMIT + THREADS as isize * (2 * MIB + 9 * MIB / 2);

const THREADS: usize = 2;

/// Slabs of four slices of a generated volume; nothing is stored.
struct Slabs {
    info: VolumeInfo,
    label: fn([u32; 3]) -> u32,
    next: u32,
}

impl BlockSource for Slabs {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let ([w, h, d], first) = (self.info.dims, self.next);
        if first >= d {
            return Ok(None);
        }
        let dims = [w, h, 4.min(d - first)];
        self.next += dims[2];
        let voxels = dims.iter().product::<u32>();
        let place = |i: u32| [i % w, i / w % h, first + i / (w * h)];
        let labels = LabelBuffer::U32((0..voxels).map(|i| (self.label)(place(i))).collect());
        Ok(Some(LabelBlock::x_fastest([0, 0, first], dims, labels)))
    }
}

fn mix([x, y, z]: [u32; 3]) -> u32 {
    let h = (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA6B) ^ z.wrapping_mul(0xC2B2_AE35))
        .wrapping_mul(0x27D4_EB2F);
    h ^ h >> 15
}

/// Some 150,000 labels of ragged outline, each of which touches some thirty others.
fn many_that_touch(p: [u32; 3]) -> u32 {
    let h = mix(p.map(|c| c / 2));
    let q = [p[0] + h % 5, p[1] + (h >> 8) % 5, p[2] + (h >> 16) % 5].map(|c| c / 3);
    1 + q[0] + 90 * (q[1] + 90 * q[2])
}

/// Each voxel has one of 255 labels or none by chance: cells have a record for almost each of their voxels.
fn noise(p: [u32; 3]) -> u32 {
    mix(p) % 256
}

fn peak(path: &Path, dims: [u32; 3], label: fn([u32; 3]) -> u32, level: CompressionLevel) -> (isize, u64) {
    let options = CompressOptions {
        threads: THREADS,
        memory_limit_bytes: Some(LIMIT as u64),
        ..CompressOptions::default()
    };
    let mut source = Slabs { info: VolumeInfo::new(dims, LabelType::U32), label, next: 0 };
    let mut describe = |_: &mut CompressedVolume| Ok(());
    let (told, counted) = measured(|| {
        compress_to_file(&mut source, path, level, &options, &mut describe, &Job::new()).unwrap()
    });
    (counted.peak, told.labels)
}

#[test]
fn many_labels_and_noise_keep_to_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    for level in of_today(&[CompressionLevel::Default, CompressionLevel::Fast]) {
        let (of_many, labels) = peak(&path, [256, 256, 64], many_that_touch, level);
        assert!(labels > 140_000, "{labels}");
        let contacts = CompressedVolume::open(&path, &Job::new()).unwrap().labels().contacts().len();
        assert!(contacts > 1_500_000, "{contacts}");
        let (of_noise, labels) = peak(&path, [256, 256, 64], noise, level);
        assert_eq!(labels, 255);
        println!("{level:?}: {} and {} KiB", of_many >> 10, of_noise >> 10);
        assert!(of_many.max(of_noise) <= MOST, "{level:?}: {of_many} and {of_noise} of {MOST} bytes");
    }
}
