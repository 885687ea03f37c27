//! A time series in one file: every voxel of every frame, whatever the order, the threads and the limit; what is refused.

use std::path::{Path, PathBuf};

use pumice_core::{
    BlockSource, CompressOptions, CompressedVolume, CompressionLevel, Error, Job, LabelBlock, LabelBuffer,
    LabelNote, LabelType, Residency, Result, Series, SeriesSource, VolumeInfo, WrittenVolume,
    compress_series_to_file, compress_to_file, frames_in_file,
};

const LEVELS: [CompressionLevel; 3] =
    [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small];

/// Two chunks along z; the larger part stands still, a ball moves, a label comes and goes.
const DIMS: [u32; 3] = [40, 33, 1040];

/// The id of a voxel: `at` is its place. Frame 3 has nothing at all.
fn id(frame: u32, [x, y, z]: [u32; 3]) -> u32 {
    if frame == 3 {
        return 0;
    }
    let ball = [x as i32 - 12 - 3 * frame as i32, y as i32 - 15, z as i32 - 1022 - 2 * frame as i32];
    if ball.iter().map(|d| d * d).sum::<i32>() < 60 {
        return 500;
    }
    if frame == 2 && x < 9 && z > 1030 {
        return 77;
    }
    if z % 97 > 20 {
        return 0;
    }
    1 + (x / 11 + 4 * (y / 13) + (z + x * y % 3) / 97 % 3) * 1_000_003
}

fn voxels(frame: u32) -> Vec<u32> {
    let [w, h, d] = DIMS;
    let places = (0..d).flat_map(|z| (0..h).flat_map(move |y| (0..w).map(move |x| [x, y, z])));
    places.map(|at| id(frame, at)).collect()
}

/// The blocks of one frame: slabs along z, cut where `cut` says, in any order.
struct Blocks {
    info: VolumeInfo,
    blocks: Vec<LabelBlock>,
}

impl BlockSource for Blocks {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }
    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        Ok(self.blocks.pop())
    }
}

struct Frames {
    next: u32,
    frames: u32,
    /// Slices of a block, and whether the last comes first.
    cut: u32,
    reversed: bool,
    change: fn(u32, &mut VolumeInfo),
}

impl Frames {
    fn of(frames: u32) -> Self {
        Self { next: 0, frames, cut: 16, reversed: false, change: |_, _| {} }
    }
}

fn blocks(frame: u32, cut: u32, reversed: bool) -> Blocks {
    let (all, [w, h, d]) = (voxels(frame), DIMS);
    let slab = |z: u32| {
        let n = cut.min(d - z);
        let from = (w * h * z) as usize;
        let labels = all[from..from + (w * h * n) as usize].to_vec();
        LabelBlock::x_fastest([0, 0, z], [w, h, n], LabelBuffer::U32(labels))
    };
    let mut blocks: Vec<LabelBlock> = (0..d).step_by(cut as usize).map(slab).collect();
    if reversed {
        blocks.reverse();
    }
    let mut info = VolumeInfo::new(DIMS, LabelType::U32);
    info.notes.push(LabelNote { id: 500, name: Some(format!("ball of {frame}")), color_srgb: None });
    if frame == 2 {
        info.notes.push(LabelNote { id: 77, name: Some("guest".into()), color_srgb: None });
    }
    Blocks { info, blocks }
}

impl SeriesSource for Frames {
    fn frames(&self) -> u32 {
        self.frames
    }
    fn name(&self, frame: u32) -> String {
        format!("frame_{frame}.tif")
    }
    fn next_frame(&mut self) -> Result<Box<dyn BlockSource + '_>> {
        let frame = self.next;
        self.next += 1;
        let mut of_frame = blocks(frame, self.cut, self.reversed);
        (self.change)(frame, &mut of_frame.info);
        Ok(Box::new(of_frame))
    }
}

fn write(
    mut source: Frames,
    path: &Path,
    level: CompressionLevel,
    options: &CompressOptions,
) -> Result<WrittenVolume> {
    compress_series_to_file(&mut source, path, level, options, &mut |_| Ok(()), &Job::new())
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("pumice-series-{}-{name}", std::process::id()));
    // (Without the folder, writing into it fails.)
    let _ = std::fs::create_dir_all(&folder);
    folder
}

#[test]
fn every_voxel_of_every_frame_comes_back_at_each_level() {
    let folder = folder("voxels");
    for level in LEVELS {
        let path = folder.join(format!("{level:?}.pumice"));
        let written = write(Frames::of(5), &path, level, &CompressOptions::default()).unwrap();
        assert_eq!((written.frames, frames_in_file(&path).unwrap()), (5, 5));
        let series = Series::open(&path, &Job::new()).unwrap();
        assert_eq!(series.info().notes.iter().map(|n| n.id).collect::<Vec<_>>(), [77, 500]);
        let mut total = vec![0; series.labels().len()];
        // In an order of no kind: a frame needs no other.
        for frame in [4, 0, 3, 2, 1] {
            let volume = series.frame(frame, &Job::new()).unwrap();
            let expected: Vec<u64> = voxels(frame).into_iter().map(u64::from).collect();
            assert!(volume.decode_ids([0; 3], DIMS).unwrap() == expected, "{level:?}, frame {frame}");
            assert_eq!(volume.frame().map(|of| (of.number, of.frames)), Some((frame, 5)));
            // The table is that of all frames, with the voxels of this one.
            assert!(volume.labels().ids() == series.labels().ids() && volume.is_whole());
            assert!(volume.labels().contacts() == series.labels().contacts());
            for (label, &count) in volume.labels().voxels().iter().enumerate() {
                let id = volume.labels().ids()[label];
                assert_eq!(count, expected.iter().filter(|&&other| other == id).count() as u64, "{id}");
                total[label] += count;
            }
            assert_eq!(
                volume.label_at([12 + 3 * frame, 15, 1022 + 2 * frame]).unwrap().is_some(),
                frame != 3
            );
        }
        assert_eq!(series.labels().voxels(), total);
        // A control: the frames differ.
        assert!(voxels(0) != voxels(1) && total.iter().sum::<u64>() > 0);
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// Chosen labels of a frame are those of the whole frame, and the others are not held.
#[test]
fn some_labels_of_a_frame_alone() {
    let folder = folder("labels");
    for level in [CompressionLevel::Fast, CompressionLevel::Default] {
        let path = folder.join(format!("{level:?}.pumice"));
        write(Frames::of(3), &path, level, &CompressOptions::default()).unwrap();
        let series = Series::open(&path, &Job::new()).unwrap();
        let whole = series.frame(2, &Job::new()).unwrap();
        let odd = |labels: &pumice_core::LabelTable| (0..labels.len()).map(|i| i % 2 == 1).collect();
        let some = series.frame_labels(2, odd, &Job::new()).unwrap();
        let ids = some.labels().ids();
        let expected: Vec<u64> = whole
            .decode_ids([0; 3], DIMS)
            .unwrap()
            .into_iter()
            .map(|id| if ids.binary_search(&id).is_ok_and(|i| i % 2 == 1) { id } else { 0 })
            .collect();
        assert!(some.decode_ids([0; 3], DIMS).unwrap() == expected && expected.iter().any(|&id| id > 0));
        assert!(some.boxes().len() < whole.boxes().len() && !some.is_whole());
        assert_eq!(some.content_hash(), whole.content_hash());
        assert_eq!(some.labels().voxels(), whole.labels().voxels());

        // The others are added; those of another frame are not.
        let even = |labels: &pumice_core::LabelTable| (0..labels.len()).map(|i| i % 2 == 0).collect();
        let all = some.with_more_labels(&series.frame_labels(2, even, &Job::new()).unwrap()).unwrap();
        assert!(all.decode_ids([0; 3], DIMS).unwrap() == whole.decode_ids([0; 3], DIMS).unwrap());
        assert_eq!((all.frame(), all.nodes().len()), (whole.frame(), whole.nodes().len()));
        let of_another = series.frame_labels(1, even, &Job::new()).unwrap();
        let said = some.with_more_labels(&of_another).unwrap_err().to_string();
        assert!(said.contains("of another volume"), "{said}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// A frame that is read chunk by chunk into pages has the boxes and counts of the frame in memory.
#[test]
fn a_frame_from_disk_is_the_frame_in_memory() {
    let folder = folder("paged");
    let memory = std::sync::Arc::new(Residency::new(1 << 24));
    for level in LEVELS {
        let path = folder.join(format!("{level:?}.pumice"));
        write(Frames::of(4), &path, level, &CompressOptions::default()).unwrap();
        let series = Series::open(&path, &Job::new()).unwrap();
        let mut of_all = Vec::new();
        for step in 0..4 {
            let expected = series.frame(step, &Job::new()).unwrap();
            let paged = series.frame_paged(step, 64, &folder, &memory, &Job::new()).unwrap();
            let pages = paged.pages().unwrap();
            assert_eq!((paged.labels(), paged.frame()), (expected.labels(), expected.frame()));
            assert_eq!(paged.content_hash(), expected.content_hash());
            assert_eq!(pages.boxes(), expected.boxes().len() as u64, "{level:?}, frame {step}");
            let boxes = |volume: &CompressedVolume| {
                let mut boxes = Vec::new();
                volume.for_each_box(|label, of| {
                    boxes.push((label, of.origin, of.extent, of.node.fields().collect::<Vec<_>>()));
                });
                boxes.sort_unstable();
                boxes
            };
            assert!(boxes(&paged) == boxes(&expected), "{level:?}, frame {step}");
            of_all.push(boxes(&expected));
        }
        // A control: the frames differ, and the last one is empty.
        assert!(of_all[0] != of_all[1] && !of_all[0].is_empty() && of_all[3].is_empty());
        let said = series.frame_paged(4, 64, &folder, &memory, &Job::new()).unwrap_err().to_string();
        assert!(said.contains("--time-step 4 is out of range"), "{said}");
        let said = series.frame_paged(0, 48, &folder, &memory, &Job::new()).unwrap_err().to_string();
        assert!(said.contains("pages: expected 64"), "{said}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// The bytes do not depend on blocks, their order, threads or the limit.
#[test]
fn the_bytes_depend_on_the_voxels_alone() {
    let folder = folder("bytes");
    for level in LEVELS {
        let bytes = |name: &str, cut, reversed, threads, limit| {
            let path = folder.join(name);
            let source = Frames { cut, reversed, ..Frames::of(4) };
            let options =
                CompressOptions { threads, memory_limit_bytes: limit, ..CompressOptions::default() };
            write(source, &path, level, &options).unwrap();
            std::fs::read(path).unwrap()
        };
        let expected = bytes("a.pumice", 16, false, 2, None);
        assert!(expected == bytes("b.pumice", 7, true, 1, None), "{level:?}");
        assert!(expected == bytes("c.pumice", 64, true, 3, Some(1 << 20)), "{level:?}");
        // A control: another series has other bytes.
        let other = folder.join("d.pumice");
        write(Frames::of(5), &other, level, &CompressOptions::default()).unwrap();
        assert!(expected != std::fs::read(other).unwrap());
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// A series of one frame is a file without time, byte for byte; and frames of a series share what stands still.
#[test]
fn one_frame_is_a_plain_file_and_frames_share_nodes() {
    let folder = folder("share");
    let options = CompressOptions::default();
    for level in LEVELS {
        let (one, plain) = (folder.join("one.pumice"), folder.join("plain.pumice"));
        let of_one = write(Frames::of(1), &one, level, &options).unwrap();
        let mut nothing = |_: &mut CompressedVolume| Ok(());
        let mut alone = |frame: u32| {
            let mut source = blocks(frame, 16, false);
            compress_to_file(&mut source, &plain, level, &options, &mut nothing, &Job::new()).unwrap()
        };
        assert_eq!(of_one, alone(0));
        assert!(std::fs::read(&one).unwrap() == std::fs::read(&plain).unwrap(), "{level:?}");
        assert!(CompressedVolume::open(&one, &Job::new()).unwrap().frame().is_none());
        let error = Series::open(&one, &Job::new()).unwrap_err().to_string();
        assert!(error.contains("one volume, and no time steps"), "{error}");

        if level != CompressionLevel::Small {
            let series = write(Frames::of(3), &one, level, &options).unwrap();
            let separate: u64 = (0..3).map(|frame| alone(frame).bytes_disk).sum();
            // Two thirds of the boxes stand still; the tables of labels are once in one file.
            assert!(4 * series.bytes_disk < 3 * separate, "{level:?}: {} of {separate}", series.bytes_disk);
        }
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// What a frame must have as the first one, in one line that names both.
#[test]
fn frames_that_differ_are_refused() {
    let folder = folder("differ");
    let path = folder.join("a.pumice");
    type Change = fn(u32, &mut VolumeInfo);
    let cases: [(Change, &str); 3] = [
        (
            |t, info| info.dims[1] += t / 2,
            "frame_2.tif: voxels: expected 40 × 33 × 1040, got 40 × 34 × 1040, as frame_0.tif has",
        ),
        (
            |t, info| info.label_type = if t == 1 { LabelType::U8 } else { LabelType::U32 },
            "frame_1.tif: label type: expected u32, got u8, as frame_0.tif has",
        ),
        (
            |t, info| info.world_from_index.matrix3.z_axis.z = if t == 1 { 2.5 } else { 1.0 },
            "frame_1.tif: spacing: expected [1.0, 1.0, 1.0], got [1.0, 1.0, 2.5], as frame_0.tif has",
        ),
    ];
    for (change, expected) in cases {
        let source = Frames { change, ..Frames::of(4) };
        let error = write(source, &path, CompressionLevel::Fast, &CompressOptions::default()).unwrap_err();
        assert_eq!(error.to_string(), expected);
        assert!(!path.exists());
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_series_asks_for_a_frame_that_it_has() {
    let folder = folder("ask");
    let path = folder.join("a.pumice");
    write(Frames::of(4), &path, CompressionLevel::Default, &CompressOptions::default()).unwrap();
    let job = Job::new();
    let none = |_: &pumice_core::LabelTable| Vec::new();
    for error in [
        CompressedVolume::open(&path, &job),
        CompressedVolume::open_mapped(&path, &job),
        CompressedVolume::open_labels(&path, none, &job),
    ] {
        let error = error.unwrap_err();
        assert!(matches!(error, Error::Frames { frames: 4, .. }));
        let end = "a.pumice: the file has 4 time steps, and each is a separate volume; choose one with --time-step (0 to 3)";
        assert!(error.to_string().ends_with(end), "{error}");
    }
    let error = CompressedVolume::open_frame(&path, 4, &job).unwrap_err().to_string();
    assert!(
        error
            .contains("--time-step 4 is out of range, counted from 0; the number of time steps is 4: 0 to 3"),
        "{error}"
    );
    // A frame is no file of its own: its table has the labels of others.
    let frame = CompressedVolume::open_frame(&path, 1, &job).unwrap();
    let error = frame.save(&folder.join("b.pumice"), CompressionLevel::Fast, &job).unwrap_err().to_string();
    assert!(error.contains("time step 1 of a series"), "{error}");
    std::fs::remove_dir_all(folder).unwrap();
}

/// Blocks of nothing: background throughout, held once.
struct Nothing(VolumeInfo, bool);

impl BlockSource for Nothing {
    fn info(&self) -> &VolumeInfo {
        &self.0
    }
    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let block = || LabelBlock {
            origin: [0; 3],
            dims: self.0.dims,
            strides: [0; 3],
            labels: LabelBuffer::U8(vec![0]),
        };
        Ok((!std::mem::replace(&mut self.1, true)).then(block))
    }
}

struct Empty(u32);

impl SeriesSource for Empty {
    fn frames(&self) -> u32 {
        self.0
    }
    fn name(&self, frame: u32) -> String {
        frame.to_string()
    }
    fn next_frame(&mut self) -> Result<Box<dyn BlockSource + '_>> {
        Ok(Box::new(Nothing(VolumeInfo::new([64; 3], LabelType::U8), false)))
    }
}

#[test]
fn a_hundred_thousand_frames_of_nothing_are_a_small_file() {
    let folder = folder("nothing");
    let path = folder.join("a.pumice");
    for level in LEVELS {
        let options = CompressOptions { threads: 1, ..CompressOptions::default() };
        let written = compress_series_to_file(
            &mut Empty(100_000),
            &path,
            level,
            &options,
            &mut |_| Ok(()),
            &Job::new(),
        );
        let written = written.unwrap();
        assert_eq!((written.frames, written.labels, written.boxes), (100_000, 0, 0));
        // A content hash of 16 bytes a frame.
        assert!(written.bytes_disk < 1_700_000, "{}", written.bytes_disk);
        let last = CompressedVolume::open_frame(&path, 99_999, &Job::new()).unwrap();
        assert_eq!(last.label_at([1, 2, 3]).unwrap(), None);
    }
    std::fs::remove_dir_all(folder).unwrap();
}
