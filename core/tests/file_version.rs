//! Files of another version are refused in one line that gives the version, its offset, the expected version and a way out.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::{Path, PathBuf};

use pumice_core::{
    CompressedVolume, CompressionLevel, Error, Job, LabelBuffer, LabelType, VolumeInfo, compress_labels,
};

const LEVELS: [CompressionLevel; 3] =
    [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small];
const VERSION: u32 = 6;

/// Saves a small volume as a file of each level.
fn files(folder: &Path) -> Vec<PathBuf> {
    let labels = (0..1000).map(|i| (i / 7 % 3) as u8).collect();
    let info = VolumeInfo::new([10, 10, 10], LabelType::U8);
    let volume = compress_labels(info, LabelBuffer::U8(labels)).unwrap();
    let file = |level| {
        let path = folder.join(format!("{level:?}.pumice"));
        volume.save(&path, level, &Job::new()).unwrap();
        path
    };
    LEVELS.map(file).to_vec()
}

/// Writes a number into the header at `at`, and recomputes the checksum of header and table, so that nothing else is wrong.
fn set_number(path: &Path, at: usize, number: u32) {
    let mut bytes = std::fs::read(path).unwrap();
    bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
    let sections = u32::from_le_bytes(bytes[32..36].try_into().unwrap()) as usize;
    let mut hash = xxhash_rust::xxh3::Xxh3::new();
    hash.update(&bytes[..56]);
    hash.update(&bytes[64..64 + 48 * sections]);
    let checksum = hash.digest();
    bytes[56..64].copy_from_slice(&checksum.to_le_bytes());
    std::fs::write(path, bytes).unwrap();
}

/// Opens a file in each of the three ways: whole, mapped, and with chosen labels.
fn open_in_all_ways(path: &Path) -> [Result<CompressedVolume, Error>; 3] {
    [
        CompressedVolume::open(path, &Job::new()),
        CompressedVolume::open_mapped(path, &Job::new()),
        CompressedVolume::open_labels(path, |labels| vec![true; labels.len()], &Job::new()),
    ]
}

#[test]
fn other_versions_are_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    for path in files(folder.path()) {
        let good = std::fs::read(&path).unwrap();
        assert_eq!(good[8..12], VERSION.to_le_bytes(), "{}", path.display());
        for (version, way_out) in [
            (0, "an older pumice wrote it: compress the source volume again"),
            (1, "an older pumice wrote it: compress the source volume again"),
            (5, "an older pumice wrote it: compress the source volume again"),
            (7, "a newer pumice wrote it: open it with that one, or compress the source volume again"),
            (u32::MAX, "a newer pumice wrote it: open it with that one, or compress the source volume again"),
        ] {
            set_number(&path, 8, version);
            for opened in open_in_all_ways(&path) {
                let error = opened.unwrap_err();
                assert!(matches!(&error, Error::Version { got, .. } if *got == version), "{error:?}");
                let expected = format!(
                    "{}: file version at byte 8: expected 6, got {version}; {way_out}",
                    path.display()
                );
                assert_eq!(error.to_string(), expected);
            }
        }
        // A control of the test above: with its own version the file is the one that was written, and opens.
        set_number(&path, 8, VERSION);
        assert_eq!(std::fs::read(&path).unwrap(), good);
        assert!(open_in_all_ways(&path).iter().all(Result::is_ok));
    }
}

/// The header says whether a file holds boxes or voxels. With the other number, or with an unknown one, the file is refused.
#[test]
fn the_contents_of_the_other_kind_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for path in files(folder.path()) {
        let own = std::fs::read(&path).unwrap()[12];
        for (number, expected) in [
            (1 - u32::from(own), "expected the section, got none"),
            (3, "contents: expected 0 (boxes), 1 (voxels) or 2 (a part), got 3"),
        ] {
            set_number(&path, 12, number);
            for opened in open_in_all_ways(&path) {
                let error = opened.unwrap_err().to_string();
                assert!(error.contains(expected) && !error.contains('\n'), "{error}");
            }
        }
    }
}
