//! Tests of damaged files: reading one never panics, and gives either an error or exactly the same volume.

#[path = "../../../tests/tests/turns/mod.rs"]
mod turns;

use std::collections::HashMap;
use std::io::Cursor;
use std::sync::Arc;

use super::format_error::Stop;
use super::label_subset::read_subset;
use super::layout::{ENTRY_BYTES, HEADER_BYTES, Layout, section_checksum};
use super::paged::read_pages;
use super::read::read;
use super::{CompressionLevel, codec, layout};
use crate::{
    BoxRecord, CompressedVolume, Job, LabelBuffer, LabelNote, LabelTable, LabelType, NumericColumn,
    Residency, VolumeInfo, compress_labels,
};
use turns::of_today;

/// Pseudorandom numbers that are the same on every machine (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

fn sample() -> CompressedVolume {
    let dims = [37, 21, 1030];
    let mut info = VolumeInfo::new(dims, LabelType::U32);
    info.notes.push(LabelNote { id: 1, name: Some("axon".into()), color_srgb: Some([0.25, 0.5, 1.0]) });
    let mut ids = Vec::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let near = (x / 7 + y / 9 + (z + x * y % 3) / 11) % 5;
                ids.push(if z % 100 > 30 { 0 } else { near * 1_000_003 + u32::from(near == 2 && x == y) });
            }
        }
    }
    let mut volume = compress_labels(info, LabelBuffer::U32(ids)).unwrap();
    let depths = (0..volume.labels.len()).map(|i| if i == 1 { f64::NAN } else { i as f64 / 3.0 }).collect();
    volume.labels.columns = vec![NumericColumn { name: "depth".into(), values: depths }];
    volume
}

fn file_bytes(volume: &CompressedVolume, level: CompressionLevel) -> Vec<u8> {
    let (layout, sections) = volume.encode_sections(level, &Job::new()).unwrap();
    laid_out(&layout, &sections)
}

fn laid_out(layout: &Layout, sections: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = layout.to_bytes();
    for section in sections {
        bytes.resize(layout::align(bytes.len() as u64) as usize, 0);
        bytes.extend(section);
    }
    bytes.resize(layout::align(bytes.len() as u64) as usize, 0);
    bytes
}

fn open(bytes: &[u8], check_hash: bool) -> Result<CompressedVolume, String> {
    read(&mut Cursor::new(bytes), bytes.len() as u64, None, check_hash, &Job::new()).map_err(in_words)
}

fn in_words(stop: Stop) -> String {
    match stop {
        Stop::Fault(f) => format!("{} at byte {} of section {}", f.what, f.at, f.section.escape_ascii()),
        Stop::Version(got) => format!("version {got}"),
        Stop::Frames(frames) => format!("{frames} frames"),
        Stop::Io(e) => e.to_string(),
        Stop::Core(e) => e.to_string(),
    }
}

/// Opens every second label of a file.
fn open_subset(bytes: &[u8]) -> Result<CompressedVolume, String> {
    let second = |labels: &LabelTable| (0..labels.len()).map(|i| i % 2 == 1).collect();
    read_subset(&mut Cursor::new(bytes), bytes.len() as u64, second, &Job::new()).map_err(in_words)
}

/// Divides a file into pages.
fn open_in_pages(bytes: &[u8], page_voxels: u32) -> Result<CompressedVolume, String> {
    let (folder, memory) = (std::env::temp_dir(), Arc::new(Residency::new(u64::MAX)));
    let mut file = Cursor::new(bytes);
    read_pages(&mut file, bytes.len() as u64, page_voxels, &folder, &memory, &Job::new()).map_err(in_words)
}

/// Recomputes all checksums, so that damage reaches the code behind them.
fn fix_checksums(bytes: &mut [u8]) {
    let u64_at = |b: &[u8], at: usize| u64::from_le_bytes(b[at..at + 8].try_into().unwrap()) as usize;
    let count = u32::from_le_bytes(bytes[32..36].try_into().unwrap()) as usize;
    let table = HEADER_BYTES + ENTRY_BYTES * count.min(layout::MAX_SECTIONS as usize);
    if table > bytes.len() {
        return;
    }
    for at in (HEADER_BYTES..table).step_by(ENTRY_BYTES) {
        let (offset, stored) = (u64_at(bytes, at + 8), u64_at(bytes, at + 16));
        if let Some(section) = offset.checked_add(stored).and_then(|end| bytes.get(offset..end)) {
            let checksum = section_checksum(section);
            bytes[at + 32..at + 40].copy_from_slice(&checksum.to_le_bytes());
        }
    }
    let mut hash = xxhash_rust::xxh3::Xxh3::new();
    hash.update(&bytes[..56]);
    hash.update(&bytes[HEADER_BYTES..table]);
    let checksum = hash.digest();
    bytes[56..64].copy_from_slice(&checksum.to_le_bytes());
}

/// Calls every query of a volume that passed the checks; none may panic.
fn use_all(volume: &CompressedVolume) {
    let _ = volume.content_hash();
    let _ = volume.label_bounds();
    let _ = volume.labels().contacts().iter().count();
    let dims = volume.info().dims;
    if volume.info().voxels() < 1 << 22 {
        let _ = volume.decode_ids([0; 3], dims).unwrap();
    }
    let _ = volume.label_at([3, 3, 3]).unwrap();
    let _ = volume.find_contacts(&Job::new());
}

#[test]
fn files_of_all_levels_round_trip() {
    let volume = sample();
    for level in [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small] {
        let back = open(&file_bytes(&volume, level), true).unwrap();
        assert_eq!(format!("{:?}", back.boxes), format!("{:?}", volume.boxes));
        assert!(back.nodes == volume.nodes && back.leaves == volume.leaves);
        assert!(back.runs == volume.runs && back.chunks == volume.chunks);
        assert!(back.labels == volume.labels && back.info == volume.info);
    }
}

/// The pages of a file have its boxes, each once among the pages' own, with the same voxels; and its label table and hash.
#[test]
fn pages_have_the_boxes_of_the_file() {
    let volume = sample();
    let boxes = |volume: &CompressedVolume| {
        let mut boxes = Vec::new();
        volume.for_each_box(|label, b| {
            boxes.push((label, b.origin, b.extent, b.node.fields().collect::<Vec<_>>()));
        });
        boxes.sort();
        boxes
    };
    for level in [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small] {
        for page_voxels in [64, 256, 1024] {
            let paged = open_in_pages(&file_bytes(&volume, level), page_voxels).unwrap();
            assert_eq!(boxes(&paged), boxes(&volume));
            let pages = paged.pages().unwrap();
            let held: usize = (0..pages.len()).map(|i| pages.read(i).unwrap().boxes().len()).sum();
            assert!(pages.failure().is_none() && held >= volume.boxes.len() && pages.len() > 1);
            assert_eq!((pages.boxes(), paged.boxes.len()), (volume.boxes.len() as u64, 0));
            assert!(paged.labels == volume.labels && paged.info == volume.info && paged.is_whole());
            assert_eq!(paged.content_hash(), volume.content_hash());
        }
    }
}

#[test]
fn truncated_files_are_refused() {
    for level in [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small] {
        let bytes = file_bytes(&sample(), level);
        let step = (bytes.len() / 700).max(1);
        for length in
            (0..400.min(bytes.len())).chain((400..bytes.len()).step_by(step)).chain([bytes.len() - 1])
        {
            assert!(open(&bytes[..length], true).is_err(), "{length} of {}", bytes.len());
            assert!(open_subset(&bytes[..length]).is_err(), "{length} of {}, chosen", bytes.len());
            assert!(open_in_pages(&bytes[..length], 64).is_err(), "{length} of {}, in pages", bytes.len());
        }
        let mut longer = bytes;
        longer.extend([0; 8]);
        assert!(open(&longer, true).is_err());
    }
}

#[test]
fn damage_is_found_by_the_checksums() {
    let volume = sample();
    for level in [CompressionLevel::Fast, CompressionLevel::Default] {
        let bytes = file_bytes(&volume, level);
        let mut random = Random(1);
        let (mut refused, mut in_pages_refused) = (0, 0);
        for i in 0..600 {
            let mut damaged = bytes.clone();
            let at = if i < 200 { i % damaged.len() } else { random.below(damaged.len()) };
            damaged[at] ^= 1 << random.below(8);
            match open(&damaged, true) {
                Err(_) => refused += 1,
                Ok(back) => assert_eq!(back.content_hash(), volume.content_hash(), "byte {at}"),
            }
            in_pages_refused += u32::from(open_in_pages(&damaged, 1024).is_err());
        }
        // Checksums cover everything but the padding between sections.
        assert!(refused > 590, "only {refused} of 600 refused");
        // (The content hash, which pages take over, is in the header, which has a checksum.)
        assert!(in_pages_refused >= refused, "only {in_pages_refused} of {refused} refused in pages");
    }
}

#[test]
fn damage_behind_right_checksums_never_panics() {
    let volume = sample();
    let levels =
        [(CompressionLevel::Fast, 1500), (CompressionLevel::Default, 1500), (CompressionLevel::Small, 250)];
    for (level, rounds) in of_today(&levels) {
        let bytes = file_bytes(&volume, level);
        let mut random = Random(2);
        let (mut passed, mut chosen_passed, mut pages_passed) = (0, 0, 0);
        for round in 0..rounds {
            let mut damaged = bytes.clone();
            for _ in 0..1 + random.below(3) {
                // Half of the damage goes into the header and the table, which hold the lengths.
                let end = if random.below(2) == 0 { HEADER_BYTES + 16 * ENTRY_BYTES } else { damaged.len() };
                let at = random.below(end.min(damaged.len()));
                match random.below(4) {
                    0 => damaged[at] ^= 1 << random.below(8),
                    1 => damaged[at] = random.next() as u8,
                    2 => damaged[at] = [0, 255, 127, 128][random.below(4)],
                    _ => {
                        let length = (1 + random.below(16)).min(damaged.len() - at);
                        damaged[at..at + length].iter_mut().for_each(|b| *b = random.next() as u8);
                    }
                }
            }
            fix_checksums(&mut damaged);
            if let Ok(back) = open(&damaged, false) {
                passed += 1;
                use_all(&back);
            }
            if let Ok(back) = open(&damaged, true) {
                assert_eq!(back.content_hash(), volume.content_hash(), "round {round}");
            }
            if let Ok(back) = open_in_pages(&damaged, 256) {
                pages_passed += 1;
                let _ = back.label_bounds();
            }
            if let Ok(back) = open_subset(&damaged) {
                chosen_passed += 1;
                use_all(&back);
            }
        }
        // A control on the test itself: some damage must get past every check but those of structure. A subset of labels is not compared
        // with the content hash; files of the level `small` are always read whole.
        assert!(pages_passed > 0, "{level:?}");
        assert!(passed > 0 && (level == CompressionLevel::Small || chosen_passed > passed));
    }
}

#[test]
fn damaged_arrays_never_panic() {
    // This changes the plain arrays of a `fast` file element by element, which triggers every rule of the check.
    let volume = sample();
    let bytes = file_bytes(&volume, CompressionLevel::Fast);
    let mut random = Random(3);
    let names = [
        "INFO", "LIDS", "LTYP", "LCOL", "LVOX", "LCON", "CHNK", "BOXS", "NODE", "RUNS", "LEAF", "SLIC",
        "RARE", "RUNS", "LEAF", "SLIC", "RARE",
    ];
    let (mut refused, mut refused_chosen) = (HashMap::new(), HashMap::new());
    for (s, name) in names.iter().enumerate() {
        let entry = HEADER_BYTES + s * ENTRY_BYTES;
        assert_eq!(&bytes[entry..entry + 4], name.as_bytes());
        let at = |k: usize| u64::from_le_bytes(bytes[entry + k..entry + k + 8].try_into().unwrap()) as usize;
        let (offset, stored) = (at(8), at(16));
        for _ in 0..if stored == 0 { 0 } else { 250 } {
            let mut damaged = bytes.clone();
            let place = offset + random.below(stored);
            damaged[place] = damaged[place].wrapping_add([1, 255, 128, 64][random.below(4)]);
            fix_checksums(&mut damaged);
            match open(&damaged, false) {
                Ok(back) => use_all(&back),
                Err(_) => *refused.entry(name).or_insert(0) += 1,
            }
            match open_subset(&damaged) {
                Ok(back) => use_all(&back),
                Err(_) => *refused_chosen.entry(name).or_insert(0) += 1,
            }
        }
    }
    // A subset has half of the labels, so about half of the damage concerns it.
    for name in ["CHNK", "RUNS", "LIDS", "LVOX", "LCON", "BOXS", "NODE"] {
        assert!(refused_chosen.get(&name).is_some_and(|&n| n > 25), "{name}: {refused_chosen:?}");
    }
    for name in ["CHNK", "RUNS", "LIDS", "LVOX", "LCON", "BOXS", "NODE", "LEAF"] {
        assert!(refused.get(&name).is_some_and(|&n| n > 50), "{name}: {refused:?}");
    }
}

/// A volume of one label in two boxes with different nodes.
fn two_nodes() -> CompressedVolume {
    let mut labels = vec![0u8; 64];
    (labels[0], labels[40], labels[41]) = (1, 1, 1);
    let volume =
        compress_labels(VolumeInfo::new([64, 1, 1], LabelType::U8), LabelBuffer::U8(labels)).unwrap();
    assert!(volume.boxes.len() == 2 && volume.boxes[0].node() == 0 && volume.boxes[1].node() > 0);
    volume
}

/// Plain arrays could hold nodes in any order. The reader accepted them, and saving the volume as streams, which number the nodes by first
/// use, then subtracted below zero (found by fuzzing).
#[test]
fn nodes_out_of_order_or_without_a_box_are_refused() {
    let good = two_nodes();
    assert!(open(&file_bytes(&good, CompressionLevel::Fast), true).is_ok());

    let mut swapped = two_nodes();
    let first_words = good.boxes[1].node() as usize;
    swapped.nodes = [&good.nodes[first_words..], &good.nodes[..first_words]].concat().into();
    let second = (good.nodes.len() - first_words) as u32;
    let moved = |(record, node): (&BoxRecord, u32)| BoxRecord::new(record.cell(), record.extent(), node);
    swapped.boxes = good.boxes.iter().zip([second, 0]).map(moved).collect::<Vec<_>>().into();
    // The swapped volume differs in nothing but the order.
    assert_eq!(
        swapped.decode_block([0; 3], [64, 1, 1]).unwrap(),
        good.decode_block([0; 3], [64, 1, 1]).unwrap()
    );
    let what = open(&file_bytes(&swapped, CompressionLevel::Fast), true).unwrap_err();
    assert!(what.contains("order of first use"), "{what}");

    let mut spare = two_nodes();
    spare.nodes = [&good.nodes[..], &good.nodes[..first_words]].concat().into();
    let what = open(&file_bytes(&spare, CompressionLevel::Fast), true).unwrap_err();
    assert!(what.contains("without a box"), "{what}");
}

/// Errors quote an unknown word of `INFO`; a line feed in it split the message into two lines (found by fuzzing).
#[test]
fn what_is_quoted_stays_on_one_line() {
    let mut bytes = file_bytes(&two_nodes(), CompressionLevel::Fast);
    let at = bytes.windows(9).position(|w| w == b"\"unknown\"").unwrap();
    bytes[at..at + 9].copy_from_slice(b"\"a\\nbcde\"");
    fix_checksums(&mut bytes);
    let what = open(&bytes, true).unwrap_err();
    assert!(what.contains("a\\nbcde") && !what.contains('\n'), "{what}");
}

/// A file of `volume` in which the section `name` is `content`, compressed, with right checksums.
fn with_section(volume: &CompressedVolume, name: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let (mut layout, mut sections) = volume.encode_sections(CompressionLevel::Default, &Job::new()).unwrap();
    let encoding = layout::Encoding { zstd: true, width: 1, ..layout::Encoding::default() };
    let place = layout.entries.iter().position(|e| e.name == *name).unwrap();
    sections[place] = codec::encode(content, encoding, 1, &Job::new()).unwrap();
    (layout.entries[place].encoding, layout.entries[place].decoded) = (encoding, content.len() as u64);
    let mut end = (HEADER_BYTES + ENTRY_BYTES * sections.len()) as u64;
    for (entry, section) in layout.entries.iter_mut().zip(&sections) {
        (entry.offset, entry.stored) = (layout::align(end), section.len() as u64);
        entry.checksum = section_checksum(section);
        end = entry.offset + entry.stored;
    }
    layout.file_bytes = layout::align(end);
    laid_out(&layout, &sections)
}

/// 100 kB with right checksums decoded to 6.3 GB: zstd yields up to 32,768 times its input.
#[test]
fn sections_that_decode_to_more_than_the_volume_can_need_are_refused() {
    let volume = two_nodes();
    // 64 voxels: 64 bytes each, and 4 KiB.
    let most = 64 * 64 + 4096;
    for name in [b"LIDS", b"LVOX", b"CHNK", b"RUNS", b"OCCU", b"BNOD", b"LCON"] {
        let refusal = |bytes: usize| open(&with_section(&volume, name, &vec![0; bytes]), false).unwrap_err();
        let (fits, exceeds) = (refusal(most), refusal(most + 8));
        assert!(!fits.contains("decoded size"), "{fits}");
        let text = format!("decoded size: expected at most {most} for this volume, got {}", most + 8);
        assert!(exceeds.starts_with(&text), "{exceeds}");
    }
    let spaces = vec![b' '; (16 << 20) + 1];
    let exceeds = open(&with_section(&volume, b"INFO", &spaces), false).unwrap_err();
    assert!(exceeds.starts_with("decoded size: expected at most 16777216 "), "{exceeds}");
    let fits = open(&with_section(&volume, b"INFO", &spaces[1..]), false).unwrap_err();
    assert!(fits.starts_with("JSON: "), "{fits}");
}

/// Overlapping boxes describe no valid volume. Saved as voxels they would look valid, so saving refuses them.
#[test]
fn overlapping_boxes_are_not_saved_as_voxels() {
    let mut labels = vec![0u8; 64];
    (labels[0], labels[40]) = (1, 2);
    let info = VolumeInfo::new([64, 1, 1], LabelType::U8);
    let mut volume = compress_labels(info, LabelBuffer::U8(labels)).unwrap();
    assert!(volume.encode_sections(CompressionLevel::Small, &Job::new()).is_ok());
    let [first, second] = volume.boxes[..] else { panic!("{:?}", volume.boxes) };
    volume.boxes = vec![first, BoxRecord::new(first.cell(), second.extent(), second.node())].into();
    volume.grid = std::sync::OnceLock::new();
    let what = volume.encode_sections(CompressionLevel::Small, &Job::new()).unwrap_err().to_string();
    assert_eq!(
        what,
        "two labels claim one voxel: expected 2 labelled voxels, got 1; compress the source volume again"
    );
}

/// Frames of a small time series: a part stands still, a bar moves, and the second frame has nothing.
struct Moving(u32, u32);

impl crate::SeriesSource for Moving {
    fn frames(&self) -> u32 {
        self.0
    }
    fn name(&self, frame: u32) -> String {
        frame.to_string()
    }
    fn next_frame(&mut self) -> crate::Result<Box<dyn crate::BlockSource + '_>> {
        let (frame, dims) = (self.1, [37u32, 21, 1030]);
        self.1 += 1;
        let mut ids = Vec::new();
        for (z, y, x) in
            (0..dims[2]).flat_map(|z| (0..dims[1]).flat_map(move |y| (0..dims[0]).map(move |x| (z, y, x))))
        {
            let moves = x.abs_diff(4 + 5 * frame) < 3 && z > 1000;
            let still = 1 + (x / 7 + y / 9 + z * x % 3) % 5;
            ids.push(if frame == 1 || z % 100 > 30 { 0 } else { if moves { 9 } else { still } });
        }
        let info = VolumeInfo::new(dims, LabelType::U32);
        Ok(Box::new(crate::ArraySource::new(info, LabelBuffer::U32(ids))?))
    }
}

fn series_bytes(level: CompressionLevel) -> Vec<u8> {
    let path = std::env::temp_dir().join(format!("pumice-damaged-{}-{level:?}.pumice", std::process::id()));
    let options = crate::CompressOptions::default();
    crate::compress_series_to_file(&mut Moving(3, 0), &path, level, &options, &mut |_| Ok(()), &Job::new())
        .unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    bytes
}

/// Opens a series and calls `visit` with each of its frames.
fn open_frames(
    bytes: &[u8],
    check_hash: bool,
    mut visit: impl FnMut(u32, Result<CompressedVolume, String>),
) -> Result<(), String> {
    let path = std::path::Path::new("a.pumice");
    let series = super::Series::read(&mut Cursor::new(bytes), bytes.len() as u64, path, &Job::new())
        .map_err(in_words)?;
    let all = None::<fn(&LabelTable) -> Vec<bool>>;
    for frame in 0..series.frames().min(5) {
        visit(
            frame,
            series.read_frame(&mut Cursor::new(bytes), frame, all, check_hash, &Job::new()).map_err(in_words),
        );
    }
    let second = |labels: &LabelTable| (0..labels.len()).map(|i| i % 2 == 1).collect();
    visit(
        2,
        series
            .read_frame(&mut Cursor::new(bytes), 2, Some(second), check_hash, &Job::new())
            .map_err(in_words),
    );
    Ok(())
}

/// Damage behind right checksums in a time series never panics; a frame is refused or the same.
#[test]
fn damaged_series_never_panic() {
    let levels =
        [(CompressionLevel::Fast, 120), (CompressionLevel::Default, 120), (CompressionLevel::Small, 30)];
    for (level, rounds) in of_today(&levels) {
        let bytes = series_bytes(level);
        let mut good: Vec<u128> = Vec::new();
        open_frames(&bytes, true, |_, frame| good.push(frame.unwrap().content_hash())).unwrap();
        assert!(good.len() == 4 && good[0] != good[2] && good[1] != good[0]);
        let sections = u32::from_le_bytes(bytes[32..36].try_into().unwrap()) as usize;
        let mut random = Random(4);
        let (mut refused, mut frames_refused, mut passed) = (0, 0, 0);
        for round in 0..rounds {
            let mut damaged = bytes.clone();
            let from = if round % 2 == 0 { 0 } else { HEADER_BYTES + ENTRY_BYTES * sections };
            let end = if round % 2 == 0 { HEADER_BYTES + ENTRY_BYTES * sections } else { damaged.len() };
            let at = from + random.below(end - from);
            damaged[at] = damaged[at].wrapping_add([1, 255, 128, 64][random.below(4)]);
            fix_checksums(&mut damaged);
            let whole = open_frames(&damaged, true, |n, frame| match frame {
                // A subset, which comes last, is not compared with the content hash.
                Ok(frame) if frame.is_whole() => {
                    let own = good.get(n as usize);
                    assert!(own.is_none_or(|hash| *hash == frame.content_hash()), "round {round}, frame {n}");
                    passed += 1;
                }
                Ok(frame) => use_all(&frame),
                Err(_) => frames_refused += 1,
            });
            refused += u32::from(whole.is_err());
            let _ = open_frames(&damaged, false, |_, frame| frame.iter().for_each(use_all));
        }
        // Controls: damage of each kind was met, and some of it concerns no frame but one.
        assert!(
            refused > 0 && frames_refused > 0 && passed > 0,
            "{level:?}: {refused} {frames_refused} {passed}"
        );
    }
}

/// What a series says of its frames: a number of hashes that is not theirs, an unknown frame, frames out of order.
#[test]
fn tables_of_frames_that_lie_are_refused() {
    let bytes = series_bytes(CompressionLevel::Fast);
    let entry = |name: &[u8; 4]| {
        let at =
            (0..).map(|s| HEADER_BYTES + s * ENTRY_BYTES).find(|&at| bytes[at..at + 4] == *name).unwrap();
        u64::from_le_bytes(bytes[at + 8..at + 16].try_into().unwrap()) as usize
    };
    let refusal = |at: usize, value: u32| {
        let mut changed = bytes.clone();
        changed[at..at + 4].copy_from_slice(&value.to_le_bytes());
        fix_checksums(&mut changed);
        open_frames(&changed, true, |_, _| {}).unwrap_err()
    };
    assert!(refusal(36, 4).contains("frames: expected 4, got 3"), "{}", refusal(36, 4));
    assert!(refusal(36, 0).contains("number of frames: expected 1 to "));
    assert!(refusal(36, u32::MAX).contains("number of frames: expected 1 to "));
    let chunks = entry(b"CHNK");
    // The second entry is the first chunk at frame 2, because frame 1 has nothing.
    assert!(refusal(chunks + 12, 3).contains("a frame below 3"));
    assert!(refusal(chunks + 40 + 12, 0).contains("chunk 1: expected a place, a frame and starts after"));
    assert!(refusal(chunks + 40 + 16, 0).contains("chunk 1: expected a place, a frame and starts after"));
    assert!(refusal(chunks + 40 + 32, 8).contains("chunk 1: expected a place, a frame and starts after"));
    // One file is not opened as a series, and a series not as one file.
    let what = open(&bytes, true).unwrap_err();
    assert!(what.contains("Frames") || what.contains("frames"), "{what}");
}
