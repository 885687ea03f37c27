//! Compression of a source that is read in order: what was read before an interrupt is not read again, and the parts have the same bytes.

#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use pumice_core::*;

/// Two layers along z of 2 × 1 chunks; the upper one is thin.
const DIMS: [u32; 3] = [1040, 7, 1050];

fn id([x, y, z]: [u32; 3]) -> u64 {
    let hash = (x / 9).wrapping_mul(0x9E37_79B1)
        ^ (y / 3).wrapping_mul(0x85EB_CA6B)
        ^ (z / 6).wrapping_mul(0xC2B2_AE35);
    if hash >> 29 < 3 { 0 } else { 1_000_000_007 * u64::from(hash % 50) }
}

/// Slabs of three voxels along z, from `begin` to where the source fails.
struct Slabs {
    info: VolumeInfo,
    regions: Vec<VoxelRegion>,
    z: u32,
    fails_at: u32,
    delivered: Arc<AtomicU64>,
}

impl Slabs {
    fn new(regions: Vec<VoxelRegion>, fails_at: u32, delivered: &Arc<AtomicU64>) -> Self {
        let z = regions.iter().map(|r| r[2][0]).min().unwrap_or(u32::MAX);
        Self {
            info: VolumeInfo::new(DIMS, LabelType::U64),
            regions,
            z,
            fails_at,
            delivered: Arc::clone(delivered),
        }
    }
}

impl BlockSource for Slabs {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }
    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        if self.z >= self.fails_at {
            return Err(Error::Source("interrupted".into()));
        }
        // (All regions of a layer begin and end alike.)
        let of_layer: Vec<_> =
            self.regions.iter().filter(|r| r[2][0] <= self.z && self.z < r[2][1]).collect();
        let Some(first) = of_layer.first() else {
            match self.regions.iter().map(|r| r[2][0]).filter(|&z| z > self.z).min() {
                Some(z) if self.z != u32::MAX => self.z = z,
                _ => return Ok(None),
            }
            return self.next_block();
        };
        let [lo, hi] = [0, 1].map(|end| {
            let of = of_layer.iter().map(|r| r[0][end]);
            if end == 0 { of.min().unwrap() } else { of.max().unwrap() }
        });
        let zs = [self.z, (self.z / 3 * 3 + 3).min(first[2][1])];
        self.z = zs[1];
        let mut labels = Vec::new();
        for z in zs[0]..zs[1] {
            for y in 0..DIMS[1] {
                labels.extend((lo..hi).map(|x| id([x, y, z])));
            }
        }
        self.delivered.fetch_add(labels.len() as u64, Relaxed);
        let dims = [hi - lo, DIMS[1], zs[1] - zs[0]];
        Ok(Some(LabelBlock::x_fastest([lo, 0, zs[0]], dims, LabelBuffer::U64(labels))))
    }
}

fn of() -> PartSource {
    PartSource { name: "generated".into(), fingerprint: "a".into(), reading: String::new() }
}

fn options(threads: usize, memory_limit_bytes: Option<u64>) -> CompressOptions {
    CompressOptions { threads, memory_limit_bytes, ..CompressOptions::default() }
}

/// The chunks of the lower layer, and those of one part each.
fn lower(paths: &[PathBuf]) -> Vec<(ChunkSet, &Path)> {
    (0..2).zip(paths).map(|(chunk, path)| (ChunkSet::of([chunk]), path.as_path())).collect()
}

fn bytes_of(paths: &[PathBuf]) -> Vec<Vec<u8>> {
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// Compresses missing parts of the lower layer; returns how many voxels were read.
fn go_on(
    folder: &Path,
    parts: &[(ChunkSet, &Path)],
    fails_at: u32,
    options: &CompressOptions,
) -> (Result<()>, u64) {
    let grid = ChunkGrid::new(DIMS);
    let wanted = ChunkSet::of(parts.iter().flat_map(|(chunks, _)| chunks.iter()));
    let slab = u64::from(DIMS[0] * DIMS[1]) * 100;
    let mut kept = KeptRecords::open(folder, "000000", &wanted, &grid).unwrap().after_each(slab);
    let delivered = Arc::default();
    let mut regions: Vec<_> = wanted.iter().map(|n| grid.region(n).unwrap()).collect();
    regions.iter_mut().for_each(|r| r[2][0] = r[2][0].max(kept.reached()));
    regions.retain(|r| r[2][0] < r[2][1]);
    // The layer above follows in the same stream.
    regions.extend([2, 3].map(|n| grid.region(n).unwrap()));
    let mut source = LayerSource::new(Box::new(Slabs::new(regions, fails_at, &delivered)), 2);
    let made = compress_layer_parts(&mut source, parts, &of(), &mut kept, options, &Job::new());
    let result = made.and_then(|_| kept.remove());
    (result, delivered.load(Relaxed))
}

#[test]
fn what_was_read_before_an_interrupt_is_not_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let alone: Vec<PathBuf> = ["a", "b"].map(at).into();
    for (chunk, path) in lower(&alone) {
        let regions = chunk.iter().map(|n| ChunkGrid::new(DIMS).region(n).unwrap()).collect();
        let mut source = Slabs::new(regions, u32::MAX, &Arc::default());
        compress_parts(&mut source, &[(chunk, path)], &of(), &options(1, None), &Job::new()).unwrap();
    }
    let expected = bytes_of(&alone);
    let paths: Vec<PathBuf> = ["0.part", "1.part"].map(at).into();
    let of_slice = u64::from(DIMS[0] * DIMS[1]);
    for options in [options(1, None), options(2, None), options(2, Some(1 << 20))] {
        // Twice interrupted: in the first slab, which costs all of it, and in the fourth, which costs less than two.
        assert!(go_on(folder.path(), &lower(&paths), 80, &options).0.is_err());
        assert!(go_on(folder.path(), &lower(&paths), 350, &options).0.is_err());
        // A killed process leaves bytes behind what it has told.
        let mut records = std::fs::OpenOptions::new().append(true).open(at("000000.records")).unwrap();
        std::io::Write::write_all(&mut records, &[7; 1000]).unwrap();
        let (done, voxels) = go_on(folder.path(), &lower(&paths), u32::MAX, &options);
        done.unwrap();
        let slices = voxels / of_slice;
        assert!((1024 - 350 + 3..=1024 - 350 + 160).contains(&slices), "{slices} slices");
        assert_eq!(bytes_of(&paths), expected);
        assert!(!at("000000.read").exists() && !at("000000.records").exists());

        // Interrupted while parts are made: nothing is read again, but the block behind the layer.
        std::fs::remove_file(&paths[0]).unwrap();
        std::fs::remove_file(&paths[1]).unwrap();
        let nowhere = [paths[0].clone(), at("nowhere/1.part")];
        assert!(go_on(folder.path(), &lower(&nowhere), u32::MAX, &options).0.is_err());
        let missing = &lower(&paths)[1..];
        let (done, voxels) = go_on(folder.path(), missing, 1, &options);
        done.unwrap();
        assert_eq!((voxels, bytes_of(&paths)), (0, expected.clone()));
        assert!(!at("000000.records").exists());
    }
    // A part of one chunk appears while the layer is half read: of the other, reading goes on where it ended.
    std::fs::remove_file(&paths[0]).unwrap();
    assert!(go_on(folder.path(), &lower(&paths), 350, &options(1, None)).0.is_err());
    std::fs::write(&paths[0], &expected[0]).unwrap();
    let (done, voxels) = go_on(folder.path(), &lower(&paths)[1..], u32::MAX, &options(1, None));
    done.unwrap();
    // (The block behind the layer, which is of its other chunks too, is read as well.)
    let slices = (voxels - 2 * of_slice) / u64::from((DIMS[0] - CHUNK_VOXELS) * DIMS[1]);
    assert!((1024 - 350..=1024 - 350 + 160).contains(&slices), "{slices} slices");
    assert_eq!(bytes_of(&paths), expected);
    // Of fewer chunks than are wanted, nothing is of use.
    assert!(go_on(folder.path(), &lower(&paths)[..1], 350, &options(1, None)).0.is_err());
    let all = "0-1".parse().unwrap();
    assert_eq!(KeptRecords::open(folder.path(), "000000", &all, &ChunkGrid::new(DIMS)).unwrap().reached(), 0);
}

#[test]
fn damage_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let paths: Vec<PathBuf> = ["0.part", "1.part"].map(at).into();
    assert!(go_on(folder.path(), &lower(&paths), 350, &options(1, None)).0.is_err());
    let open = || KeptRecords::open(folder.path(), "000000", &"0-1".parse().unwrap(), &ChunkGrid::new(DIMS));
    assert!(open().unwrap().reached() >= 300);
    for name in ["000000.records", "000000.read"] {
        let good = std::fs::read(at(name)).unwrap();
        let mut changed = good.clone();
        changed[good.len() / 2] ^= 1;
        for bad in [&good[..good.len() - 1], &good[..10], &[], &changed] {
            std::fs::write(at(name), bad).unwrap();
            let text = open().unwrap_err().to_string();
            assert!(text.contains("000000.read: ") && text.lines().count() == 1, "{text}");
        }
        std::fs::write(at(name), good).unwrap();
    }
    assert!(open().is_ok());
}
