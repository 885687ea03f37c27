//! Files that former versions of the program wrote, kept as they were: 70 × 60 × 37 voxels of cortex, 53 labels.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::PathBuf;

use pumice_core::{CompressedVolume, Job, LabelBuffer, Level, compress_labels};

fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/former_versions").join(name)
}

fn version(name: &str) -> u32 {
    u32::from_le_bytes(std::fs::read(file(name)).unwrap()[8..12].try_into().unwrap())
}

#[test]
fn files_of_former_versions_hold_the_same_volume() {
    // Voxels need no node, large or small: what follows from them is what all must hold.
    let voxels = CompressedVolume::open(&file("2_small.pumice"), &Job::new()).unwrap();
    let dims = voxels.info().dims;
    assert_eq!((dims, voxels.labels().len(), version("2_small.pumice")), ([70, 60, 37], 53, 2));
    let ids = voxels.decode_ids([0; 3], dims).unwrap();
    let anew = compress_labels(voxels.info().clone(), LabelBuffer::U64(ids.clone())).unwrap();
    for name in ["1_fast.pumice", "1_default.pumice", "1_small.pumice"] {
        assert_eq!(version(name), 1);
        let former = CompressedVolume::open(&file(name), &Job::new()).unwrap();
        assert_eq!(former.decode_ids([0; 3], dims).unwrap(), ids, "{name}");
        assert_eq!((former.boxes(), former.nodes()), (anew.boxes(), anew.nodes()), "{name}");
        assert_eq!((former.leaves(), former.chunks()), (anew.leaves(), anew.chunks()), "{name}");
        assert_eq!(former.labels(), voxels.labels(), "{name}");
        // Chosen labels: all are read.
        let chosen =
            CompressedVolume::open_labels(&file(name), |l| vec![true; l.len() / 2], &Job::new()).unwrap();
        assert!(chosen.is_whole());
        assert_eq!(chosen.content_hash(), voxels.content_hash());
    }
}

/// A whole number from 0 to 2³² that looks random, as `examples/write_samples.rs` has it.
fn mix(voxel: [u32; 3], seed: u32) -> u32 {
    let mut h = voxel.iter().fold(seed, |h, &v| (h ^ v).wrapping_mul(0x9E37_79B1).rotate_left(13));
    h = (h ^ h >> 16).wrapping_mul(0x85EB_CA6B);
    h = (h ^ h >> 13).wrapping_mul(0xC2B2_AE35);
    h ^ h >> 16
}

/// Noise; labels that all differ, so that each is a number; three pieces, one above the other.
#[test]
fn voxels_of_version_2_are_those_that_were_written() {
    type Id = fn([u32; 3]) -> u64;
    let files: [(&str, [u32; 3], Id); 3] = [
        ("2_noise.pumice", [33, 18, 40], |p| u64::from(mix(p, 1) & 1)),
        ("2_different.pumice", [9, 10, 11], |[x, y, z]| u64::from(x + 9 * (y + 10 * z)) * 0x1_0000_0003),
        ("2_long.pumice", [3, 2, 2100], |[x, y, z]| u64::from((z / 5 + x + y) % 4)),
    ];
    for (name, dims, id) in files {
        assert_eq!(version(name), 2);
        let volume = CompressedVolume::open(&file(name), &Job::new()).unwrap();
        let [w, h, d] = dims;
        let voxels = (0..d).flat_map(|z| (0..h).flat_map(move |y| (0..w).map(move |x| [x, y, z])));
        assert_eq!(volume.decode_ids([0; 3], dims).unwrap(), voxels.map(id).collect::<Vec<u64>>(), "{name}");
    }
}

#[test]
fn a_former_file_is_written_as_a_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("anew.pumice");
    let former = CompressedVolume::open(&file("1_fast.pumice"), &Job::new()).unwrap();
    let voxels = CompressedVolume::open(&file("2_small.pumice"), &Job::new()).unwrap();
    assert_eq!(voxels.content_hash(), former.content_hash());
    for (level, version) in [(Level::Fast, 3u32), (Level::Default, 3), (Level::Small, 4)] {
        former.save(&path, level, &Job::new()).unwrap();
        assert_eq!(std::fs::read(&path).unwrap()[8..12], version.to_le_bytes());
        let back = CompressedVolume::open(&path, &Job::new()).unwrap();
        assert_eq!(back.content_hash(), former.content_hash());
    }
}

#[test]
fn a_later_version_is_refused_by_its_number() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("later.pumice");
    let mut bytes = std::fs::read(file("1_fast.pumice")).unwrap();
    bytes[8] = 5;
    std::fs::write(&path, bytes).unwrap();
    let error = CompressedVolume::open(&path, &Job::new()).unwrap_err().to_string();
    assert!(error.contains("expected 1 to 4, got 5") && !error.contains('\n'), "{error}");
}
