//! A file that is written while the volume is compressed has the bytes of one that is saved, whatever blocks, limit and threads.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

#[path = "../../tests/tests/turns/mod.rs"]
mod turns;

use std::path::Path;

use pumice_core::*;
use turns::of_today;

const LEVELS: [CompressionLevel; 3] =
    [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small];

/// Slabs of a generated volume, in a given order of their first slices; nothing is stored.
struct Slabs<F> {
    info: VolumeInfo,
    id: F,
    thick: u32,
    left: Vec<u32>,
}

impl<F: Fn([u32; 3]) -> u32> Slabs<F> {
    fn new(dims: [u32; 3], thick: u32, id: F) -> Self {
        let left = (0..dims[2]).step_by(thick as usize).collect();
        Self { info: VolumeInfo::new(dims, LabelType::U32), id, thick, left }
    }
}

impl<F: Fn([u32; 3]) -> u32 + Send> BlockSource for Slabs<F> {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }
    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        // From the middle to both ends, so that neighbours seldom come one after another.
        let at = self.left.len() / 2;
        if self.left.is_empty() {
            return Ok(None);
        }
        let first = self.left.remove(at);
        let [w, h, d] = self.info.dims;
        let dims = [w, h, self.thick.min(d - first)];
        let mut labels = Vec::new();
        for z in first..first + dims[2] {
            for y in 0..h {
                labels.extend((0..w).map(|x| (self.id)([x, y, z])));
            }
        }
        Ok(Some(LabelBlock::x_fastest([0, 0, first], dims, LabelBuffer::U32(labels))))
    }
}

/// The id of a voxel.
type Label = fn([u32; 3]) -> u32;

fn mix([x, y, z]: [u32; 3]) -> u32 {
    let h = (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA6B) ^ z.wrapping_mul(0xC2B2_AE35))
        .wrapping_mul(0x27D4_EB2F);
    h ^ h >> 15
}

/// Two labels that are larger than what is divided in memory under a small limit, one of them full of holes, and small ones.
fn large_labels(p: [u32; 3]) -> u32 {
    match p[0] {
        0..100 => 1 + mix(p) % 17 / 16 * (p[2] % 5),
        100..170 => 7 * (mix(p) % 3 / 2),
        _ => 100 + p[0] / 9 + 50 * (p[1] / 7) + 1000 * (p[2] / 6),
    }
}

/// Labels across the faces of chunks along two axes, with noise in one chunk.
fn across_chunks(p: [u32; 3]) -> u32 {
    let lump = (p[0] + p[1] / 3 + p[2]) / 19 % 6;
    if p[0] > 1024 && mix(p).is_multiple_of(4) { 9 } else { lump * 1_000_003 }
}

fn written<F: Fn([u32; 3]) -> u32 + Send>(
    path: &Path,
    mut source: Slabs<F>,
    level: CompressionLevel,
    options: &CompressOptions,
) -> (Vec<u8>, WrittenVolume) {
    let mut describe = |_: &mut CompressedVolume| Ok(());
    let told = compress_to_file(&mut source, path, level, options, &mut describe, &Job::new()).unwrap();
    (std::fs::read(path).unwrap(), told)
}

#[test]
fn written_files_are_those_that_are_saved() {
    let folder = tempfile::tempdir().unwrap();
    let (saved, path) = (folder.path().join("saved.pumice"), folder.path().join("written.pumice"));
    let volumes: [([u32; 3], Label); 5] = [
        ([190, 124, 120], large_labels),
        ([1033, 3, 1030], across_chunks),
        ([1, 1, 1], |_| 5),
        ([9, 8, 7], |_| 0),
        ([0, 4, 4], |_| 0),
    ];
    for (dims, id) in volumes {
        let whole =
            compress(&mut Slabs::new(dims, 16, id), &CompressOptions::default(), &Job::new()).unwrap();
        // (Three levels and four ways: in twelve days each level is written in each way.)
        for level in of_today(&LEVELS) {
            whole.save(&saved, level, &Job::new()).unwrap();
            let expected = std::fs::read(&saved).unwrap();
            // A file without boxes takes in memory what it does when it is opened.
            let opened = CompressedVolume::open(&saved, &Job::new()).unwrap();
            let bytes_volume: u64 = opened.resident_parts().iter().map(|part| part.1).sum();
            let ways = [(7, 1, Some(1 << 18)), (16, 2, None), (64, 3, Some(1 << 20)), (5, 2, Some(64 << 20))];
            for (thick, threads, limit) in of_today(&ways) {
                let options =
                    CompressOptions { threads, memory_limit_bytes: limit, ..CompressOptions::default() };
                let (bytes, told) = written(&path, Slabs::new(dims, thick, id), level, &options);
                assert!(bytes == expected, "{dims:?} {level:?} {thick} {limit:?}");
                assert_eq!(
                    told,
                    WrittenVolume {
                        dims,
                        labels: whole.labels().len() as u64,
                        frames: 1,
                        boxes: whole.boxes().len() as u64,
                        bytes_volume,
                        bytes_disk: expected.len() as u64,
                    }
                );
            }
        }
        if dims[0] > 0 {
            assert!(opened_voxels(&path) == opened_voxels(&saved));
        }
    }
}

fn opened_voxels(path: &Path) -> Vec<u64> {
    let volume = CompressedVolume::open(path, &Job::new()).unwrap();
    volume.decode_ids([0; 3], volume.info().dims).unwrap()
}

/// The voxels of a label that was divided on disk are the source's.
#[test]
fn what_is_divided_on_disk_is_lossless() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let dims = [190, 124, 120];
    let options = CompressOptions { memory_limit_bytes: Some(1 << 18), ..CompressOptions::default() };
    written(&path, Slabs::new(dims, 6, large_labels), CompressionLevel::Default, &options);
    let volume = CompressedVolume::open(&path, &Job::new()).unwrap();
    let same = verify(&volume, &mut Slabs::new(dims, 31, large_labels), &Job::new()).unwrap();
    assert_eq!(same, Verification::Same { voxels: 190 * 124 * 120 });
    // Control: another volume is told apart.
    let other = |p: [u32; 3]| large_labels(p) + u32::from(p == [3, 4, 5]);
    let differs = verify(&volume, &mut Slabs::new(dims, 31, other), &Job::new()).unwrap();
    assert!(matches!(differs, Verification::OtherLabel { voxel: [3, 4, 5], .. }), "{differs:?}");
}

#[test]
fn a_table_of_labels_beyond_the_limit_is_refused_and_no_file_remains() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let mut source = Slabs::new([64, 64, 64], 8, |p| 1 + p[0] + 64 * (p[1] + 64 * p[2]));
    let options = CompressOptions { memory_limit_bytes: Some(1 << 20), ..CompressOptions::default() };
    let mut describe = |_: &mut CompressedVolume| Ok(());
    let error =
        compress_to_file(&mut source, &path, CompressionLevel::Fast, &options, &mut describe, &Job::new())
            .unwrap_err();
    assert!(matches!(&error, Error::Limit { limit, got, .. } if *limit == 1 << 20 && got > limit), "{error}");
    assert!(error.to_string().contains("table of"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn what_describes_labels_is_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let mut source = Slabs::new([9, 9, 9], 4, |p| 1 + p[0] / 5);
    let types = TypeTable::parse_csv("1,soma\n").unwrap();
    let options = CompressOptions { types: Some(types), ..CompressOptions::default() };
    let table = AnnotationTable::new(vec![2], vec!["axon".into()], vec![String::new()], vec![None], vec![]);
    let table = table.unwrap();
    let mut describe = |volume: &mut CompressedVolume| volume.annotate(&table).map(|_| ());
    compress_to_file(&mut source, &path, CompressionLevel::Default, &options, &mut describe, &Job::new())
        .unwrap();
    let volume = CompressedVolume::open(&path, &Job::new()).unwrap();
    assert_eq!(volume.labels().type_names(), ["soma"]);
    assert_eq!(volume.note(1).and_then(|n| n.name.as_deref()), Some("axon"));
}
