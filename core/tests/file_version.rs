//! Files of versions that the program does not read are refused in one line: the version, where it stands, what is read, a way out.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::{Path, PathBuf};

use pumice_core::{CompressedVolume, Error, Job, LabelBuffer, LabelType, Level, VolumeInfo, compress_labels};

const LEVELS: [(Level, u32); 3] = [(Level::Fast, 3), (Level::Default, 3), (Level::Small, 4)];

/// A small volume as a file of each level, and the version that the level has.
fn files(folder: &Path) -> Vec<(PathBuf, u32)> {
    let labels = (0..1000).map(|i| (i / 7 % 3) as u8).collect();
    let info = VolumeInfo::new([10, 10, 10], LabelType::U8);
    let volume = compress_labels(info, LabelBuffer::U8(labels)).unwrap();
    let file = |(level, version)| {
        let path = folder.join(format!("{level:?}.pumice"));
        volume.save(&path, level, &Job::new()).unwrap();
        (path, version)
    };
    LEVELS.map(file).to_vec()
}

/// Gives a file another version, and makes the checksum of header and table right again: nothing but the version is wrong then.
fn set_version(path: &Path, version: u32) {
    let mut bytes = std::fs::read(path).unwrap();
    bytes[8..12].copy_from_slice(&version.to_le_bytes());
    let sections = u32::from_le_bytes(bytes[32..36].try_into().unwrap()) as usize;
    let mut hash = xxhash_rust::xxh3::Xxh3::new();
    hash.update(&bytes[..56]);
    hash.update(&bytes[64..64 + 48 * sections]);
    let checksum = hash.digest();
    bytes[56..64].copy_from_slice(&checksum.to_le_bytes());
    std::fs::write(path, bytes).unwrap();
}

/// Opens a file in each of the three ways.
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
    for (path, own) in files(folder.path()) {
        let good = std::fs::read(&path).unwrap();
        assert_eq!(good[8..12], own.to_le_bytes(), "{}", path.display());
        for (version, way_out) in [
            (0, "an older pumice wrote it: compress the source volume again"),
            (1, "an older pumice wrote it: compress the source volume again"),
            (2, "an older pumice wrote it: compress the source volume again"),
            (5, "a newer pumice wrote it: open it with that one, or compress the source volume again"),
            (u32::MAX, "a newer pumice wrote it: open it with that one, or compress the source volume again"),
        ] {
            set_version(&path, version);
            for opened in open_in_all_ways(&path) {
                let error = opened.unwrap_err();
                assert!(matches!(&error, Error::Version { got, .. } if *got == version), "{error:?}");
                let expected = format!(
                    "{}: file version at byte 8: expected 3 (boxes) or 4 (voxels), got {version}; {way_out}",
                    path.display()
                );
                assert_eq!(error.to_string(), expected);
            }
        }
        // A control of the above: with its own version the file is the one that was written, and opens.
        set_version(&path, own);
        assert_eq!(std::fs::read(&path).unwrap(), good);
        assert!(open_in_all_ways(&path).iter().all(Result::is_ok));
    }
}

/// The version says which sections there are, so that a file of boxes is none of voxels.
#[test]
fn the_version_of_the_other_kind_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (path, own) in files(folder.path()) {
        set_version(&path, if own == 3 { 4 } else { 3 });
        for opened in open_in_all_ways(&path) {
            let error = opened.unwrap_err().to_string();
            assert!(error.contains("expected the section, got none") && !error.contains('\n'), "{error}");
        }
    }
}
