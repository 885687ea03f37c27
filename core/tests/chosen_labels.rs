//! Tests of volumes that hold chosen labels of a file: they have exactly the voxels of these labels.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use pumice_core::*;

/// Pseudorandom numbers that are the same on every machine (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
}

/// Lumps of labels with noise, over three chunks.
fn ids(dims: [u32; 3]) -> Vec<u64> {
    let mut random = Random(5);
    let mut ids = Vec::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let lump = u64::from(x / 9 + 2 * (y / 7) + 5 * (z % 64 / 13)) % 12;
                let noise = random.next().is_multiple_of(50);
                ids.push(if noise { 7_000_000_000 } else { lump * 1_000_003 });
            }
        }
    }
    ids
}

#[test]
fn what_is_chosen_is_what_the_whole_volume_has() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let dims = [33, 17, 2100];
    let ids = ids(dims);
    let volume =
        compress_labels(VolumeInfo::new(dims, LabelType::U64), LabelBuffer::U64(ids.clone())).unwrap();
    assert!(volume.chunks().len() == 3 && volume.labels().len() == 12);
    let mut random = Random(1);
    for level in [CompressionLevel::Fast, CompressionLevel::Default] {
        volume.save(&path, level, &Job::new()).unwrap();
        for round in 0..12 {
            // No label, all labels, then random ones.
            let chosen: Vec<bool> = match round {
                0 => Vec::new(),
                1 => vec![true; 12],
                _ => (0..12).map(|_| random.next().is_multiple_of(3)).collect(),
            };
            let has = |i: usize| chosen.get(i).is_some_and(|&c| c);
            let part = CompressedVolume::open_labels(&path, |_| chosen.clone(), &Job::new()).unwrap();
            let expected: Vec<u64> = ids
                .iter()
                .map(|&id| volume.labels().index_of(id).filter(|&i| has(i as usize)).map_or(0, |_| id))
                .collect();
            assert!(part.decode_ids([0; 3], dims).unwrap() == expected, "{level:?}, round {round}");

            assert_eq!((part.info(), part.labels()), (volume.info(), volume.labels()));
            assert!((0..12).all(|i| part.holds(i as u32) == has(i)));
            assert_eq!(part.is_whole(), round == 1);
            assert_eq!(part.content_hash(), volume.content_hash());
            assert!(part.nodes().len() <= volume.nodes().len());
            for (chunk, leaves) in part.chunks().iter().zip(part.leaves()) {
                let c = volume.chunks().iter().position(|other| other.origin == chunk.origin).unwrap();
                let all = volume.leaves()[c].patterns();
                assert!(leaves.patterns().iter().all(|f| all.contains(f)));
            }
            if round == 0 {
                assert!(
                    part.boxes().is_empty()
                        && part.nodes().is_empty()
                        && part.chunks().is_empty()
                        && part.leaves().is_empty()
                );
            }
        }
    }
}

/// A file of voxels does not tell where a label is, so all of it is read.
#[test]
fn the_smallest_files_are_read_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let dims = [33, 17, 20];
    let volume = compress_labels(VolumeInfo::new(dims, LabelType::U64), LabelBuffer::U64(ids(dims))).unwrap();
    volume.save(&path, CompressionLevel::Small, &Job::new()).unwrap();
    let read = CompressedVolume::open_labels(&path, |_| Vec::new(), &Job::new()).unwrap();
    assert!(read.is_whole() && read.boxes() == volume.boxes());
}

#[test]
fn chosen_labels_are_not_saved_as_if_they_were_all() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("a.pumice"), folder.path().join("b.pumice"));
    let dims = [33, 17, 20];
    let volume = compress_labels(VolumeInfo::new(dims, LabelType::U64), LabelBuffer::U64(ids(dims))).unwrap();
    volume.save(&path, CompressionLevel::Default, &Job::new()).unwrap();
    let part = CompressedVolume::open_labels(&path, |_| vec![true, false, true], &Job::new()).unwrap();
    let said = part.save(&other, CompressionLevel::Default, &Job::new()).unwrap_err().to_string();
    assert!(said.contains("b.pumice: only chosen labels"), "{said}");
    assert!(!other.exists());
}
