//! Parts of a time series, joined in any order, are the file of the whole series; what does not belong together is refused by name.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

#[path = "../../tests/tests/turns/mod.rs"]
mod turns;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use pumice_core::*;
use turns::of_today;

const LEVELS: [CompressionLevel; 3] =
    [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small];

/// Chunks 2 × 2 × 1, cut off at the volume's ends.
const DIMS: [u32; 3] = [1100, 1050, 3];
const FRAMES: u32 = 4;

/// A pattern that stands still, a block that moves across the faces of chunks, and a label of its own at each frame. Nothing is at frame 3.
/// Chunk 1 has labels from frame 2 on, chunk 2 at frame 0 alone. Labels 7000 and 7001 are neighbours across the face between chunks 1 and 3, but not
/// at the same frame: they do not touch.
fn id(frame: u32, [x, y, z]: [u32; 3]) -> u64 {
    let chunk = x / 1024 + 2 * (y / 1024);
    if frame == 3 || (chunk == 1 && frame < 2) || (chunk == 2 && frame > 0) {
        return 0;
    }
    match (frame, y) {
        (2, 1023) if x >= 1090 => return 7000,
        (0, 1024) if x >= 1090 => return 7001,
        _ => {}
    }
    let at = 1000 + 7 * frame;
    if x.abs_diff(at) < 30 && y.abs_diff(at) < 25 {
        return 900 + u64::from((x ^ y ^ z) % 3);
    }
    if x / 16 == 3 + frame && y < 40 {
        return 5_000_000_000 + u64::from(frame);
    }
    match (x / 37 + y / 29 + z / 3) % 6 {
        0 => 0,
        n => u64::from(n * (1 + x / 400) + (x * y % 7) / 6),
    }
}

/// The voxels of some chunks at a frame, chunk after chunk in slabs; those of the whole volume where no chunks are given.
struct Blocks {
    info: VolumeInfo,
    frame: u32,
    left: Vec<VoxelRegion>,
}

impl BlockSource for Blocks {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }
    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let Some([xs, ys, zs]) = self.left.pop() else { return Ok(None) };
        let mut labels = Vec::new();
        for z in zs[0]..zs[1] {
            for y in ys[0]..ys[1] {
                labels.extend((xs[0]..xs[1]).map(|x| id(self.frame, [x, y, z])));
            }
        }
        let dims = [xs, ys, zs].map(|[low, high]| high - low);
        Ok(Some(LabelBlock::x_fastest([xs[0], ys[0], zs[0]], dims, LabelBuffer::U64(labels))))
    }
}

struct Frames {
    frames: u32,
    next: u32,
    dims: [u32; 3],
    chunks: Option<ChunkSet>,
}

impl Frames {
    fn new(frames: u32, chunks: Option<&str>) -> Self {
        Self { frames, next: 0, dims: DIMS, chunks: chunks.map(|text| text.parse().unwrap()) }
    }
}

impl SeriesSource for Frames {
    fn frames(&self) -> u32 {
        self.frames
    }
    fn name(&self, frame: u32) -> String {
        format!("frame {frame}")
    }
    fn next_frame(&mut self) -> Result<Box<dyn BlockSource + '_>> {
        let (frame, grid) = (self.next, ChunkGrid::new(self.dims));
        self.next += 1;
        let regions: Vec<VoxelRegion> = match &self.chunks {
            Some(chunks) => chunks.iter().filter_map(|n| grid.region(n)).collect(),
            None => vec![self.dims.map(|d| [0, d])],
        };
        let slabs = |r: VoxelRegion| {
            (r[2][0]..r[2][1]).step_by(2).map(move |z| [r[0], r[1], [z, (z + 2).min(r[2][1])]])
        };
        let mut info = VolumeInfo::new(self.dims, LabelType::U64);
        let note = |id, name: String| LabelNote { id, name: Some(name), color_srgb: None };
        info.notes = vec![
            note(900, format!("of frame {frame}")),
            note(5_000_000_000 + u64::from(frame), "own".into()),
        ];
        Ok(Box::new(Blocks { info, frame, left: regions.into_iter().flat_map(slabs).collect() }))
    }
}

/// The frames, of which one cannot be read and each is counted.
struct Interrupted {
    frames: Frames,
    fails_at: u32,
    blocks: Arc<AtomicU32>,
}

/// The blocks of a frame that are counted, or an error instead of them.
struct Counted<'a>(Box<dyn BlockSource + 'a>, bool, Arc<AtomicU32>);

impl SeriesSource for Interrupted {
    fn frames(&self) -> u32 {
        self.frames.frames
    }
    fn name(&self, frame: u32) -> String {
        self.frames.name(frame)
    }
    fn next_frame(&mut self) -> Result<Box<dyn BlockSource + '_>> {
        let fails = self.frames.next == self.fails_at;
        Ok(Box::new(Counted(self.frames.next_frame()?, fails, Arc::clone(&self.blocks))))
    }
}

impl BlockSource for Counted<'_> {
    fn info(&self) -> &VolumeInfo {
        self.0.info()
    }
    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        if self.1 {
            return Err(Error::Source("interrupted".into()));
        }
        self.2.fetch_add(1, Relaxed);
        self.0.next_block()
    }
}

/// Time steps that were read before an interrupt are not read again.
#[test]
fn frames_that_were_kept_are_not_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (chunks, of) = ("1-2".parse::<ChunkSet>().unwrap(), from("a", ""));
    let expected = part(at("alone"), Frames::new(FRAMES, Some("1-2")), &of, &options(1, None));
    for limit in [None, Some(1 << 20)] {
        let go_on = |fails_at: u32| {
            let frames = Frames::new(FRAMES, Some("1-2"));
            let mut source = Interrupted { frames, fails_at, blocks: Arc::default() };
            let mut kept =
                KeptRecords::open(folder.path(), "000001", &chunks, &ChunkGrid::new(DIMS)).unwrap();
            let (path, options) = (at("kept"), options(2, limit));
            let parts = [(chunks.clone(), &*path)];
            let made =
                compress_series_parts(&mut source, &parts, &of, Some(&mut kept), &options, &Job::new());
            (made.is_ok(), source.blocks.load(Relaxed), kept)
        };
        let (done, first, _) = go_on(1);
        assert!(!done && first > 1);
        let (done, second, _) = go_on(FRAMES - 1);
        assert!(!done && second == first * (FRAMES - 2), "{second}");
        let (done, rest, kept) = go_on(u32::MAX);
        assert!(done && rest == first, "{rest}");
        kept.remove().unwrap();
        assert!(std::fs::read(at("kept")).unwrap() == std::fs::read(&expected).unwrap());
    }
}

fn options(threads: usize, memory_limit_bytes: Option<u64>) -> CompressOptions {
    CompressOptions { threads, memory_limit_bytes, ..CompressOptions::default() }
}

fn from(fingerprint: &str, reading: &str) -> PartSource {
    PartSource { name: "generated".into(), fingerprint: fingerprint.into(), reading: reading.into() }
}

fn part(path: PathBuf, mut source: Frames, of: &PartSource, options: &CompressOptions) -> PathBuf {
    let chunks = source.chunks.clone().unwrap();
    compress_series_parts(&mut source, &[(chunks, &path)], of, None, options, &Job::new()).unwrap();
    path
}

fn merged(
    parts: &[PathBuf],
    path: &Path,
    level: CompressionLevel,
    options: &CompressOptions,
) -> Result<WrittenVolume> {
    merge_parts(parts, path, level, options, &mut |_| Ok(()), &Job::new())
}

#[test]
fn parts_of_any_partition_in_any_order_are_the_whole_series() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let of = from("a", "");
    let part_of = |chunks: &str, limit| {
        part(at(&format!("{chunks}.part")), Frames::new(FRAMES, Some(chunks)), &of, &options(2, limit))
    };
    let partitions: Vec<Vec<PathBuf>> = vec![
        vec![part_of("0-3", None)],
        vec![part_of("3", None), part_of("0", Some(1 << 20)), part_of("2", None), part_of("1", None)],
        vec![part_of("1-2", Some(1 << 20)), part_of("0,3", None)],
    ];
    for (i, level) in of_today(&[0, 1, 2]).into_iter().map(|i| (i, LEVELS[i])) {
        let (whole, out) = (at("whole.pumice"), at("merged.pumice"));
        let told = compress_series_to_file(
            &mut Frames::new(FRAMES, None),
            &whole,
            level,
            &options(2, None),
            &mut |_| Ok(()),
            &Job::new(),
        )
        .unwrap();
        // Coding voxels takes as long as all else together.
        let tried = if level == CompressionLevel::Small { &partitions[2..] } else { &partitions[..] };
        for (k, parts) in tried.iter().enumerate() {
            let (threads, limit) = [(1, None), (2, Some(4 << 20)), (3, None)][(i + k) % 3];
            assert_eq!(merged(parts, &out, level, &options(threads, limit)).unwrap(), told, "{parts:?}");
            assert!(std::fs::read(&out).unwrap() == std::fs::read(&whole).unwrap(), "{level:?}: {parts:?}");
        }
    }
    let joined = at("joined");
    merge_into_part(
        &[partitions[1][0].clone(), partitions[1][1].clone()],
        &joined,
        &options(2, None),
        &Job::new(),
    )
    .unwrap();
    assert!(std::fs::read(joined).unwrap() == std::fs::read(at("0,3.part")).unwrap());
    // What the whole series is compared with is right by itself: every voxel of every frame.
    let series = Series::open(&at("merged.pumice"), &Job::new()).unwrap();
    for frame in 0..FRAMES {
        let volume = series.frame(frame, &Job::new()).unwrap();
        let ids = volume.decode_ids([0; 3], DIMS).unwrap();
        let [w, h, _] = DIMS;
        let place = |i: u32| [i % w, i / w % h, i / (w * h)];
        assert!((0..).zip(&ids).all(|(i, &found)| found == id(frame, place(i))), "frame {frame}");
    }
    assert_eq!(read_part(&at("0,3.part"), &Job::new()).unwrap().frames, FRAMES);
}

#[test]
fn parts_of_other_series_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let small = |frames, chunks| Frames { dims: [1100, 9, 5], ..Frames::new(frames, Some(chunks)) };
    let make = |name: &str, source, of: &PartSource| part(at(name), source, of, &options(1, None));
    let zero = make("zero", small(3, "0"), &from("a", ""));
    let rest = make("rest", small(3, "1"), &from("a", ""));
    let longer = make("longer", small(4, "1"), &from("a", ""));
    let other = make("other", small(3, "1"), &from("b", ""));
    let later = make("later", small(3, "1"), &from("a", "--time-steps 1-3"));
    let out = at("out.pumice");
    let refused = |parts: &[&PathBuf]| {
        let parts: Vec<PathBuf> = parts.iter().map(|&path| path.clone()).collect();
        let error =
            merged(&parts, &out, CompressionLevel::Default, &options(1, None)).unwrap_err().to_string();
        assert!(!out.exists() && error.lines().count() == 1, "{error}");
        error
    };
    assert!(refused(&[&zero, &longer]).contains("longer: expected a part of the volume that"));
    assert!(refused(&[&zero, &longer]).ends_with("expected 3 time steps, got 4"));
    assert!(refused(&[&zero, &other]).contains("made from another source"));
    assert!(refused(&[&zero, &later]).contains("read with `--time-steps 1-3`, expected no options"));
    assert!(refused(&[&zero]).contains("the parts lack 1 of the volume's 2 chunks: 1 "));
    assert!(refused(&[&zero, &rest, &zero]).contains("both have chunk 0"));
    // A part of a series is no series.
    let error = Series::open(&zero, &Job::new()).unwrap_err().to_string();
    assert!(error.contains("got a part of one (pumice merge"), "{error}");
    // The negative control.
    merged(&[rest, zero], &out, CompressionLevel::Default, &options(1, None)).unwrap();
    assert_eq!(frames_in_file(&out).unwrap(), 3);

    // Chunks that the volume does not have, and a frame of another size.
    let mut source = small(3, "0");
    let path = at("wrong");
    let parts = [("0,2".parse().unwrap(), &*path)];
    let error =
        compress_series_parts(&mut source, &parts, &from("a", ""), None, &options(1, None), &Job::new());
    assert!(error.unwrap_err().to_string().contains("expected numbers from 0 to 1"));
    assert!(!path.exists());
}

/// Each changed byte is one line, and leaves no file behind.
#[test]
fn damaged_parts_of_a_series_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let small = |chunks| Frames { dims: [1100, 9, 5], ..Frames::new(3, Some(chunks)) };
    let make = |name: &str, chunks| part(at(name), small(chunks), &from("a", ""), &options(1, None));
    let (parts, out) = ([make("good", "1"), make("bad", "0")], at("out.pumice"));
    merged(&parts, &out, CompressionLevel::Default, &options(1, None)).unwrap();
    let expected = std::fs::read(&out).unwrap();
    let whole = std::fs::read(&parts[1]).unwrap();
    let mut refused = 0;
    for i in (0..whole.len()).step_by(37) {
        let mut bytes = whole.clone();
        bytes[i] ^= 1 << (i % 8);
        std::fs::write(&parts[1], bytes).unwrap();
        std::fs::remove_file(&out).unwrap();
        match merged(&parts, &out, CompressionLevel::Default, &options(1, None)) {
            // Padding between sections decides nothing.
            Ok(_) => assert!(std::fs::read(&out).unwrap() == expected, "byte {i}"),
            Err(error) => {
                let text = error.to_string();
                assert!(
                    text.lines().count() == 1 && text.contains("bad") && !out.exists(),
                    "byte {i}: {text}"
                );
                std::fs::write(&out, "").unwrap();
                refused += 1;
            }
        }
    }
    assert!(refused > 50, "{refused}");
}
