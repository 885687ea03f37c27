//! A file is written completely or not at all.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use pumice_core::*;

fn volume() -> CompressedVolume {
    let mut info = VolumeInfo::new([20, 9, 7], LabelType::U16);
    // Numbers that a careless decimal conversion would not restore bit by bit.
    info.world_from_index.matrix3.x_axis.x = 0.1 + 0.2;
    info.world_from_index.translation.z = f64::MIN_POSITIVE;
    info.notes.push(LabelNote { id: 3, name: Some("\"näme\"\n".into()), color_srgb: Some([0.1, 0.2, 0.3]) });
    let labels = (0..20 * 9 * 7).map(|i| (i / 11 % 5) as u16).collect();
    let types = TypeTable::parse_csv("3,soma\n4,axon").unwrap();
    let options = CompressOptions { types: Some(types), ..Default::default() };
    let mut source = ArraySource::new(info, LabelBuffer::U16(labels)).unwrap();
    compress(&mut source, &options, &Job::new()).unwrap()
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn what_is_known_of_a_volume_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let volume = volume();
    for level in [CompressionLevel::Fast, CompressionLevel::Default, CompressionLevel::Small] {
        // This also saves over an older file.
        volume.save(&path, level, &Job::new()).unwrap();
        let back = CompressedVolume::open(&path, &Job::new()).unwrap();
        assert_eq!(back.info(), volume.info());
        assert_eq!(back.labels(), volume.labels());
        assert_eq!(back.note(2).and_then(|n| n.name.as_deref()), Some("\"näme\"\n"));
        assert_eq!(
            back.labels().type_of(3).map(|t| back.labels().type_names()[usize::from(t)].as_str()),
            Some("axon")
        );
    }
    assert_eq!(files(folder.path()), ["a.pumice"]);
}

#[test]
fn a_volume_of_no_voxels_is_a_volume() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    let info = VolumeInfo::new([0, 7, 9], LabelType::U8);
    compress_labels(info, LabelBuffer::U8(Vec::new()))
        .unwrap()
        .save(&path, CompressionLevel::Default, &Job::new())
        .unwrap();
    let back = CompressedVolume::open(&path, &Job::new()).unwrap();
    assert!(back.labels().is_empty() && back.boxes().is_empty());
    assert_eq!(back.label_at([0; 3]).unwrap(), None);
}

#[test]
fn a_file_that_cannot_be_written_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let volume = volume();
    let missing = folder.path().join("not there/a.pumice");
    let error = volume.save(&missing, CompressionLevel::Default, &Job::new()).unwrap_err();
    assert!(matches!(&error, Error::Io { path, .. } if path == &missing), "{error}");

    std::fs::create_dir(folder.path().join("folder.pumice")).unwrap();
    assert!(volume.save(&folder.path().join("folder.pumice"), CompressionLevel::Fast, &Job::new()).is_err());

    let job = Job::new();
    job.cancel();
    let error = volume.save(&folder.path().join("b.pumice"), CompressionLevel::Default, &job).unwrap_err();
    assert!(matches!(error, Error::Cancelled));
    assert_eq!(files(folder.path()), ["folder.pumice"]);
}

#[test]
fn other_files_are_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    for (bytes, what) in [
        (&b""[..], "expected at least 64, got 0"),
        (&[b'x'; 100][..], "signature"),
        (&[0x89, b'P', b'U', b'M', b'I', b'C', b'E', b'\n', 9, 0, 0, 0].repeat(9)[..], "file version"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let text = CompressedVolume::open(&path, &Job::new()).unwrap_err().to_string();
        assert!(text.contains(what) && text.contains("a.pumice") && text.lines().count() == 1, "{text}");
    }
    let text = CompressedVolume::open(&folder.path().join("none"), &Job::new()).unwrap_err().to_string();
    assert!(text.contains("none"), "{text}");
}
