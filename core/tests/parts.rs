//! Parts of a volume, joined in any order, are the file of the whole volume; what does not belong together is refused by name.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

#[path = "../../tests/tests/turns/mod.rs"]
mod turns;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use pumice_core::*;
use turns::of_today;

const LEVELS: [CompressionLevel; 3] =
    [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small];

/// Chunks 3 × 2 × 1, cut off at the volume's ends, not at multiples of four.
const DIMS: [u32; 3] = [2099, 1030, 7];

/// Ids of which each chunk has some of its own, and some that all have; the lowest voxels of the last chunk touch all neighbours. Chunk 4
/// has none.
fn id([x, y, z]: [u32; 3]) -> u64 {
    if x >= 2048 && y < 1024 {
        return 0;
    }
    let noise =
        (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA6B) ^ z.wrapping_mul(0xC2B2_AE35)) >> 7;
    let near_face = x % 1024 > 1000 || x % 1024 < 24 || y % 1024 > 1000 || y % 1024 < 24;
    match (near_face, (x / 37 + y / 29) % 5) {
        (true, 0) => u64::from(noise % 3) * 11,
        (_, 1) => 1_000_000_007 * u64::from(1 + (x / 512 + 7 * (y / 512)) % 9),
        (_, 2) => u64::from(5 + x / 37),
        (true, _) => u64::from(3 + (x / 8 + z / 2) % 4),
        _ => 0,
    }
}

/// The voxels of some chunks of a generated volume, in slabs; those of the whole volume where no chunks are given.
struct Generated {
    info: VolumeInfo,
    left: Vec<VoxelRegion>,
}

impl Generated {
    fn new(dims: [u32; 3], chunks: Option<&ChunkSet>) -> Self {
        let grid = ChunkGrid::new(dims);
        let regions: Vec<VoxelRegion> = match chunks {
            Some(chunks) => chunks.iter().map(|n| grid.region(n).unwrap()).collect(),
            None => vec![dims.map(|d| [0, d])],
        };
        let slabs = |r: VoxelRegion| {
            (r[2][0]..r[2][1]).step_by(3).map(move |z| [r[0], r[1], [z, (z + 3).min(r[2][1])]])
        };
        Self {
            info: VolumeInfo::new(dims, LabelType::U64),
            left: regions.into_iter().flat_map(slabs).collect(),
        }
    }
}

impl BlockSource for Generated {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }
    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let Some([xs, ys, zs]) = self.left.pop() else { return Ok(None) };
        let mut labels = Vec::new();
        for z in zs[0]..zs[1] {
            for y in ys[0]..ys[1] {
                labels.extend((xs[0]..xs[1]).map(|x| id([x, y, z])));
            }
        }
        let dims = [xs, ys, zs].map(|[low, high]| high - low);
        Ok(Some(LabelBlock::x_fastest([xs[0], ys[0], zs[0]], dims, LabelBuffer::U64(labels))))
    }
}

fn from(fingerprint: &str, reading: &str) -> PartSource {
    PartSource { name: "generated".into(), fingerprint: fingerprint.into(), reading: reading.into() }
}

fn part(path: &Path, dims: [u32; 3], chunks: &str, source: &PartSource) -> PathBuf {
    let chunks: ChunkSet = chunks.parse().unwrap();
    let options = CompressOptions { threads: 2, ..CompressOptions::default() };
    let mut voxels = Generated::new(dims, Some(&chunks));
    compress_parts(&mut voxels, &[(chunks, path)], source, &options, &Job::new()).unwrap();
    path.to_owned()
}

fn merged(parts: &[PathBuf], path: &Path, level: CompressionLevel) -> Result<WrittenVolume> {
    let options = CompressOptions { threads: 2, ..CompressOptions::default() };
    merge_parts(parts, path, level, &options, &mut |_| Ok(()), &Job::new())
}

/// A number that follows from the last one; its upper bits look random.
fn next(state: &mut u64) -> usize {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state >> 33) as usize
}

#[test]
fn parts_of_any_partition_in_any_order_are_the_whole_volume() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let options = CompressOptions { threads: 2, ..CompressOptions::default() };
    let whole: Vec<(CompressionLevel, Vec<u8>, WrittenVolume)> = of_today(&LEVELS)
        .into_iter()
        .map(|level| {
            let (path, mut source) = (at("whole.pumice"), Generated::new(DIMS, None));
            let told =
                compress_to_file(&mut source, &path, level, &options, &mut |_| Ok(()), &Job::new()).unwrap();
            (level, std::fs::read(path).unwrap(), told)
        })
        .collect();
    let chunks = ChunkGrid::new(DIMS).chunks();
    assert_eq!(chunks, 6);
    let (mut made, mut state) = (HashMap::<String, PathBuf>::new(), 7);
    // (In five days, so that in fifteen each meets each level.)
    let turns = of_today(&[0, 1, 2, 3, 4]);
    for round in 0..20 {
        // Each chunk goes to one of up to six groups; the first round has one part with all, the second six.
        let groups: Vec<usize> =
            (0..6).map(|c| if round < 2 { c * round } else { next(&mut state) % 6 }).collect();
        if round >= 2 && !turns.contains(&(round % 5)) {
            continue;
        }
        let mut parts = Vec::new();
        for group in 0..6 {
            let set = ChunkSet::of((0..6u64).filter(|&c| groups[c as usize] == group)).to_string();
            if !set.is_empty() {
                let path = at(&format!("{set}.part"));
                parts.push(
                    made.entry(set.clone())
                        .or_insert_with(|| part(&path, DIMS, &set, &from("a", "")))
                        .clone(),
                );
            }
        }
        for i in (1..parts.len()).rev() {
            parts.swap(i, next(&mut state) % (i + 1));
        }
        for (level, bytes, expected) in &whole {
            let out = at("merged.pumice");
            let told = merged(&parts, &out, *level).unwrap();
            assert!(std::fs::read(&out).unwrap() == *bytes, "round {round}, {level:?}: {groups:?}");
            assert_eq!(told, *expected);
        }
    }
    // The negative control: a part of other voxels gives another file.
    let all = merged(&[at("0-5.part")], &at("merged.pumice"), LEVELS[1]);
    assert!(all.is_ok() && made.len() > 8 + 2 * turns.len(), "{} parts", made.len());
    let volume = CompressedVolume::open(&at("merged.pumice"), &Job::new()).unwrap();
    let labels = volume.labels();
    assert!(labels.contacts().len() > 10);
    assert_eq!(volume.find_contacts(&Job::new()).unwrap(), *labels.contacts());
}

/// Parts that are made from voxels which are read once are those that each gives by itself, in memory and in scratch files.
#[test]
fn parts_of_one_reading_are_those_of_several() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let sets = ["1,4", "0", "2-3"];
    let (names, paths): (Vec<ChunkSet>, Vec<PathBuf>) =
        sets.iter().map(|set| (set.parse::<ChunkSet>().unwrap(), at(&format!("{set} at once")))).unzip();
    let parts: Vec<(ChunkSet, &Path)> = names.into_iter().zip(paths.iter().map(PathBuf::as_path)).collect();
    let all: ChunkSet = "0-4".parse().unwrap();
    for memory_limit_bytes in [None, Some(4 << 20)] {
        let options = CompressOptions { threads: 2, memory_limit_bytes, ..CompressOptions::default() };
        let job = Job::new();
        let mut voxels = Generated::new(DIMS, Some(&all));
        let told = compress_parts(&mut voxels, &parts, &from("a", ""), &options, &job).unwrap();
        assert_eq!(job.fraction(), Some(1.0));
        for ((set, path), told) in sets.iter().zip(&paths).zip(told) {
            let bytes = std::fs::read(path).unwrap();
            assert_eq!(told.bytes_disk, bytes.len() as u64);
            assert!(bytes == std::fs::read(part(&at("alone"), DIMS, set, &from("a", ""))).unwrap(), "{set}");
        }
    }
    let twice = [("0,2".parse().unwrap(), at("a")), ("1-2".parse().unwrap(), at("b"))];
    let twice = twice.each_ref().map(|(set, path): &(ChunkSet, PathBuf)| (set.clone(), &**path));
    let mut voxels = Generated::new(DIMS, Some(&all));
    let error = compress_parts(&mut voxels, &twice, &from("a", ""), &CompressOptions::default(), &Job::new());
    assert!(error.unwrap_err().to_string().contains("got chunk 2 for "));
    assert!(!at("a").exists());
}

/// A source that delivers a voxel of one of several parts twice is refused.
#[test]
fn voxels_that_come_twice_are_refused_in_each_part() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a", "b"].map(|name| folder.path().join(name));
    let parts: Vec<(ChunkSet, &Path)> =
        (0..).map(|n| ChunkSet::of([n])).zip(paths.iter().map(PathBuf::as_path)).collect();
    let dims = [2048, 4, 4];
    let mut voxels = Generated::new(dims, None);
    // The last slab of the second chunk again, in place of one that has no label of its own.
    voxels.left =
        vec![[[0, 1024], [0, 4], [0, 4]], [[1024, 1536], [0, 4], [0, 4]], [[1024, 1536], [0, 4], [0, 4]]];
    let error = compress_parts(&mut voxels, &parts, &from("a", ""), &CompressOptions::default(), &Job::new());
    assert!(error.unwrap_err().to_string().contains("blocks of the source overlap"));
    assert!(paths[0].exists() && !paths[1].exists());
}

/// Parts of parts, in any order and of chunks side by side or not, are the parts that compressing their chunks gives.
#[test]
fn parts_join_to_the_part_of_their_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let options = CompressOptions { threads: 2, ..CompressOptions::default() };
    let one: Vec<PathBuf> =
        (0..6).map(|n| part(&at(&format!("{n}")), DIMS, &n.to_string(), &from("a", "-x"))).collect();
    let join = |parts: &[&PathBuf], name: &str| {
        let parts: Vec<PathBuf> = parts.iter().map(|&path| path.clone()).collect();
        (merge_into_part(&parts, &at(name), &options, &Job::new()), at(name))
    };
    let (told, left) = join(&[&one[3], &one[0], &one[5]], "left");
    let expected = part(&at("0,3,5"), DIMS, "0,3,5", &from("a", "-x"));
    assert!(std::fs::read(&left).unwrap() == std::fs::read(expected).unwrap());
    assert_eq!(told.unwrap().bytes_disk, std::fs::metadata(&left).unwrap().len());
    let right = join(&[&one[1], &one[2], &one[4]], "right").1;
    let (_, all) = join(&[&right, &left], "all");
    assert!(
        std::fs::read(&all).unwrap()
            == std::fs::read(part(&at("0-5"), DIMS, "0-5", &from("a", "-x"))).unwrap()
    );
    let (flat, tree) = (at("flat.pumice"), at("tree.pumice"));
    merged(&one, &flat, CompressionLevel::Default).unwrap();
    merged(&[left.clone(), right], &tree, CompressionLevel::Default).unwrap();
    assert!(std::fs::read(flat).unwrap() == std::fs::read(tree).unwrap());
    // A chunk that comes twice, other sources, and nothing.
    let refused = |parts: &[&PathBuf]| {
        let (told, path) = join(parts, "refused");
        assert!(!path.exists());
        told.unwrap_err().to_string()
    };
    assert!(refused(&[&left, &one[5]]).ends_with("5 both have chunk 5: expected each chunk once"));
    let other = part(&at("other"), DIMS, "4", &from("b", "-x"));
    assert!(refused(&[&left, &other]).contains("made from another source"));
    assert!(refused(&[]).contains("expected parts of a volume, got none"));
}

#[test]
fn what_does_not_belong_together_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let dims = [3000, 5, 5];
    let (zero, rest) =
        (part(&at("zero"), dims, "0", &from("a", "")), part(&at("rest"), dims, "1-2", &from("a", "")));
    let last = part(&at("last"), dims, "2", &from("a", ""));
    let other = part(&at("other"), dims, "1-2", &from("b", ""));
    let coarse = part(&at("coarse"), dims, "1-2", &from("a", "--scale 1"));
    let wide = part(&at("wide"), [3000, 6, 5], "1-2", &from("a", ""));
    let (out, level) = (at("out.pumice"), CompressionLevel::Default);
    let cases: [(&[&PathBuf], &str); 7] = [
        (&[&zero, &last], "the parts lack 1 of the volume's 3 chunks: 1 "),
        (&[&last], "the parts lack 2 of the volume's 3 chunks: 0-1 "),
        (&[&rest, &zero, &last], "last both have chunk 2: expected each chunk once"),
        (&[&zero, &other], "other: expected a part of the volume that"),
        (&[&zero, &coarse], "its source was read with `--scale 1`, expected no options"),
        (&[&zero, &wide], "expected 3000 × 5 × 5 voxels, got 3000 × 6 × 5"),
        (&[], "expected parts of a volume, got none"),
    ];
    for (parts, why) in cases {
        let parts: Vec<PathBuf> = parts.iter().map(|&path| path.clone()).collect();
        let error = merged(&parts, &out, level).unwrap_err().to_string();
        assert!(error.contains(why) && error.lines().count() == 1, "{why}: {error}");
        assert!(!out.exists());
    }
    // A part is no volume, and a volume no part.
    let error = CompressedVolume::open(&zero, &Job::new()).unwrap_err().to_string();
    assert!(error.contains("got a part of one (pumice merge"), "{error}");
    let error =
        CompressedVolume::open_labels(&zero, |l| vec![true; l.len()], &Job::new()).unwrap_err().to_string();
    assert!(error.contains("got a part of one"), "{error}");
    merged(&[zero.clone(), rest.clone()], &out, level).unwrap();
    let error = merged(std::slice::from_ref(&out), &at("again"), level).unwrap_err().to_string();
    assert!(error.contains("expected a part of a volume, got a volume"), "{error}");
    let info = read_part(&rest, &Job::new()).unwrap();
    assert_eq!((info.chunks.to_string(), info.source, info.volume.dims), ("1-2".into(), from("a", ""), dims));

    // Blocks of other chunks than were asked for.
    let set: ChunkSet = "0".parse().unwrap();
    let mut source = Generated::new(dims, Some(&"2".parse().unwrap()));
    let path = at("wrong");
    let options = CompressOptions::default();
    let parts = [(set, &*path)];
    let error = compress_parts(&mut source, &parts, &from("a", ""), &options, &Job::new()).unwrap_err();
    assert!(error.to_string().contains("blocks"), "{error}");
    assert!(!path.exists());
}

/// Each cut and each changed byte is one line, and leaves no file behind.
#[test]
fn damaged_parts_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let dims = [1500, 40, 5];
    let good = part(&at("good"), dims, "0", &from("a", ""));
    let damaged = part(&at("damaged"), dims, "1", &from("a", ""));
    let bytes = std::fs::read(&damaged).unwrap();
    let parts = [good, damaged.clone()];
    let out = at("out.pumice");
    merged(&parts, &out, CompressionLevel::Default).unwrap();
    let expected = std::fs::read(&out).unwrap();
    std::fs::remove_file(&out).unwrap();
    let check = |bytes: &[u8], what: &str| {
        std::fs::write(&damaged, bytes).unwrap();
        match merged(&parts, &out, CompressionLevel::Default) {
            Err(error) => {
                let text = error.to_string();
                assert!(text.lines().count() == 1 && text.contains("damaged"), "{what}: {text}");
                assert!(!out.exists(), "{what}");
            }
            // Padding between sections decides nothing.
            Ok(_) => {
                assert!(std::fs::read(&out).unwrap() == expected, "{what}");
                std::fs::remove_file(&out).unwrap();
            }
        }
    };
    for cut in [0, 7, 63, 64, 200, bytes.len() / 2, bytes.len() - 8, bytes.len() - 1] {
        check(&bytes[..cut], &format!("cut at {cut}"));
    }
    for at in (0..bytes.len()).step_by(41) {
        let mut bytes = bytes.clone();
        bytes[at] ^= 1 << (at % 8);
        check(&bytes, &format!("byte {at}"));
    }
}
