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

/// Balls at random places with a few stray voxels, which cut cells in so many ways that some fields are rare leaves.
fn balls(dims: [u32; 3], labels: u64) -> Vec<u64> {
    let mut random = Random(9);
    let mut ids = vec![0; (dims[0] * dims[1] * dims[2]) as usize];
    for label in 1..=labels {
        for _ in 0..60 {
            let center = dims.map(|d| (random.next() % u64::from(16 * d)) as f64 / 16.0);
            let radius = 3.0 + (random.next() % 1000) as f64 / 120.0;
            let low = center.map(|c| (c - radius).max(0.0) as u32);
            let high = [0, 1, 2].map(|a| ((center[a] + radius) as u32 + 1).min(dims[a]));
            for z in low[2]..high[2] {
                for y in low[1]..high[1] {
                    for x in low[0]..high[0] {
                        let from = [x, y, z].into_iter().zip(center).map(|(v, c)| (f64::from(v) - c).powi(2));
                        if from.sum::<f64>() < radius * radius {
                            let stray = if random.next().is_multiple_of(10) { 10 } else { 0 };
                            ids[(x + dims[0] * (y + dims[1] * z)) as usize] = 10 * label + stray;
                        }
                    }
                }
            }
        }
    }
    ids
}

/// Parts that are read one after another and joined are what the part with all their labels is.
#[test]
fn labels_are_added_in_any_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let cases = [([33, 17, 2100], ids([33, 17, 2100])), ([192, 192, 96], balls([192, 192, 96], 16))];
    let (mut rare, mut joined_nodes, mut separate_nodes) = (0, 0, 0);
    for (case, (dims, ids)) in cases.into_iter().enumerate() {
        let volume = compress_labels(VolumeInfo::new(dims, LabelType::U64), LabelBuffer::U64(ids)).unwrap();
        let labels = volume.labels().len();
        rare += volume.leaves().iter().map(|leaves| leaves.rare().len()).sum::<usize>();
        let mut random = Random(case as u64);
        for level in [CompressionLevel::Fast, CompressionLevel::Default] {
            volume.save(&path, level, &Job::new()).unwrap();
            let open = |chosen: &[bool]| {
                CompressedVolume::open_labels(&path, |_| chosen.to_vec(), &Job::new()).unwrap()
            };
            for round in 0..3 {
                // Each label comes in one of four steps, or never; in the first round no label comes at first, and all come at last.
                let step: Vec<u64> =
                    (0..labels).map(|_| if round == 0 { 3 } else { random.next() % 5 }).collect();
                let mut held = vec![false; labels];
                let mut joined = open(&held);
                for now in 0..4 {
                    let more: Vec<bool> = step.iter().map(|&s| s == now).collect();
                    held.iter_mut().zip(&more).for_each(|(held, &more)| *held |= more);
                    let part = open(&more);
                    separate_nodes += part.nodes().len();
                    joined = joined.with_more_labels(&part).unwrap();
                    let at_once = open(&held);
                    assert!(
                        joined.decode_ids([0; 3], dims).unwrap() == at_once.decode_ids([0; 3], dims).unwrap(),
                        "{level:?}, round {round}, step {now}"
                    );
                    assert_eq!((joined.info(), joined.labels()), (at_once.info(), at_once.labels()));
                    assert_eq!(
                        (joined.runs(), joined.chunks().len()),
                        (at_once.runs(), at_once.chunks().len())
                    );
                    assert_eq!(joined.content_hash(), volume.content_hash());
                    assert_eq!(joined.nodes().len(), at_once.nodes().len(), "equal nodes are stored once");
                    let places = |v: &CompressedVolume| -> Vec<_> {
                        (0..v.boxes().len()).map(|b| (v.get_box(b).origin, v.label_of_box(b))).collect()
                    };
                    assert!(places(&joined) == places(&at_once));
                    let bytes = |v: &CompressedVolume| v.leaves().iter().map(Leaves::bytes).sum::<u64>();
                    assert_eq!(bytes(&joined), bytes(&at_once));
                    assert!((0..labels).all(|label| joined.holds(label as u32) == held[label]));
                }
                joined_nodes += joined.nodes().len();
                // All labels are a volume like any other: it is saved, though not in the bytes of the file.
                assert_eq!(joined.is_whole(), round == 0);
                if round == 0 {
                    let again = folder.path().join("again.pumice");
                    for level in [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small]
                    {
                        joined.save(&again, level, &Job::new()).unwrap();
                        let read = CompressedVolume::open(&again, &Job::new()).unwrap();
                        let same = read.decode_ids([0; 3], dims).unwrap()
                            == volume.decode_ids([0; 3], dims).unwrap();
                        assert!(same && read.content_hash() == volume.content_hash(), "{level:?}");
                    }
                }
            }
        }
    }
    assert!(rare > 100, "{rare} rare leaves");
    assert!(joined_nodes < separate_nodes, "some nodes are in several parts");
}

/// Chunks whose lowest voxels have more bits than a cell's place has.
#[test]
fn labels_far_away_are_added() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let dims = [1, 1, 6_000_000];
    let mut ids = vec![0u8; dims[2] as usize];
    for (i, z) in
        [3, 900, 2_097_151, 2_097_152, 2_098_000, 4_194_304, 4_194_305, 5_999_999].into_iter().enumerate()
    {
        ids[z] = 1 + (i % 3) as u8;
    }
    let info = VolumeInfo::new(dims, LabelType::U8);
    let volume = compress_labels(info, LabelBuffer::U8(ids.clone())).unwrap();
    volume.save(&path, CompressionLevel::Fast, &Job::new()).unwrap();
    let open =
        |chosen: [bool; 3]| CompressedVolume::open_labels(&path, |_| chosen.to_vec(), &Job::new()).unwrap();
    let joined = open([true, false, false]).with_more_labels(&open([false, true, false])).unwrap();
    let joined = joined.with_more_labels(&open([false, false, true])).unwrap();
    assert_eq!((joined.runs(), joined.chunks().len()), (volume.runs(), volume.chunks().len()));
    assert!(volume.chunks().len() > 4);
    for (z, &id) in ids.iter().enumerate().filter(|(z, id)| **id > 0 || z % 99_991 == 0) {
        let found = joined.label_at([0, 0, z as u32]).unwrap();
        assert_eq!(found.map_or(0, |label| label + 1), u32::from(id), "{z}");
    }
}

#[test]
fn what_cannot_be_added_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("a.pumice"), folder.path().join("b.pumice"));
    let dims = [33, 17, 20];
    let volume = |ids| compress_labels(VolumeInfo::new(dims, LabelType::U64), LabelBuffer::U64(ids)).unwrap();
    let whole = volume(ids(dims));
    whole.save(&path, CompressionLevel::Default, &Job::new()).unwrap();
    volume(ids(dims).into_iter().rev().collect())
        .save(&other, CompressionLevel::Default, &Job::new())
        .unwrap();
    let open = |path, chosen: [bool; 2]| {
        CompressedVolume::open_labels(path, |_| chosen.to_vec(), &Job::new()).unwrap()
    };
    let part = open(&path, [true, false]);
    for (more, said) in [
        (&open(&path, [true, true]), "label 1000003 is there already"),
        (&open(&other, [false, true]), "they are of another volume"),
        (&whole, "holds all of its labels"),
    ] {
        let error = part.with_more_labels(more).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    let memory = std::sync::Arc::new(Residency::new(1 << 20));
    let paged = CompressedVolume::open_paged(&path, 64, folder.path(), &memory, &Job::new()).unwrap();
    let error = part.with_more_labels(&paged).unwrap_err().to_string();
    assert!(error.contains("on disk"), "{error}");
}
