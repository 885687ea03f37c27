//! Tests of volumes whose boxes and nodes stay in their mapped file.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use pumice_core::*;

/// Blobs of a few labels that take several boxes.
fn volume(dims: [u32; 3]) -> CompressedVolume {
    let [x, y, z] = dims;
    let label = |i: u32| {
        let p = [i % x, i / x % y, i / x / y];
        (p.map(|c| c / 7).iter().sum::<u32>() % 5 + (p[0] * p[1] + p[2]) % 11 / 10) as u8
    };
    let labels = (0..x * y * z).map(label).collect();
    compress_labels(VolumeInfo::new(dims, LabelType::U8), LabelBuffer::U8(labels)).unwrap()
}

fn voxels(volume: &CompressedVolume) -> Vec<u32> {
    volume.decode_block([0; 3], volume.info().dims).unwrap()
}

fn open_mapped(path: &Path) -> std::result::Result<CompressedVolume, String> {
    CompressedVolume::open_mapped(path, &Job::new()).map_err(|e| e.to_string())
}

#[test]
fn files_of_the_fast_level_are_mapped_and_others_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    for dims in [[70, 33, 29], [5, 4, 3], [0, 7, 9]] {
        let volume = volume(dims);
        for level in [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small] {
            volume.save(&path, level, &Job::new()).unwrap();
            let mapped = open_mapped(&path).unwrap();
            let arrays = (8 * volume.boxes().len() + 2 * volume.nodes().len()) as u64;
            assert_eq!(mapped.mapped_bytes(), if level == CompressionLevel::Fast { arrays } else { 0 });
            assert_eq!((mapped.boxes(), mapped.nodes()), (volume.boxes(), volume.nodes()));
            assert_eq!(
                mapped.resident_parts(),
                CompressedVolume::open(&path, &Job::new()).unwrap().resident_parts()
            );
            assert_eq!(voxels(&mapped), voxels(&volume));
        }
    }
}

#[test]
fn a_mapped_volume_outlives_what_is_saved_over_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let (first, second) = (volume([70, 33, 29]), volume([40, 40, 8]));
    first.save(&path, CompressionLevel::Fast, &Job::new()).unwrap();
    let mapped = open_mapped(&path).unwrap();
    second.save(&path, CompressionLevel::Fast, &Job::new()).unwrap();
    assert_eq!(voxels(&mapped), voxels(&first));
    // A mapped volume can be saved over its own file.
    let mapped = open_mapped(&path).unwrap();
    mapped.save(&path, CompressionLevel::Fast, &Job::new()).unwrap();
    assert_eq!(voxels(&open_mapped(&path).unwrap()), voxels(&second));
    std::fs::remove_file(&path).unwrap();
    assert_eq!(voxels(&mapped), voxels(&second));
}

#[test]
fn what_is_wrong_with_a_mapped_file_is_said_as_for_one_that_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    volume([70, 33, 29]).save(&path, CompressionLevel::Fast, &Job::new()).unwrap();
    let good = std::fs::read(&path).unwrap();
    let said = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let read = CompressedVolume::open(&path, &Job::new()).map_err(|e| e.to_string());
        (open_mapped(&path).err(), read.err())
    };
    assert_eq!(said(&good), (None, None));
    // A wrong bit in every region of the file, and files cut to many lengths.
    for at in (0..good.len()).step_by(good.len() / 97) {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        let (mapped, read) = said(&bytes);
        assert_eq!(mapped, read, "bit 0 of byte {at}");
        let (mapped, read) = said(&good[..at]);
        assert!(mapped.is_some() && mapped == read, "cut to {at} bytes: {mapped:?}");
    }
    assert!(open_mapped(folder.path()).is_err() && open_mapped(&folder.path().join("none")).is_err());
}
