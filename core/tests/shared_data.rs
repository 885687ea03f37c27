//! The 512³ connectome of the shared data is compressed without loss, and to the promised size.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "helpers of tests")]

use std::io::Read;
use std::path::PathBuf;

use pumice_core::*;

fn shared_data() -> PathBuf {
    let folder = std::env::var_os("PUMICE_SHARED_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")),
        PathBuf::from,
    );
    assert!(
        folder.is_dir(),
        "{}: expected a folder with the shared data, got none; set PUMICE_SHARED_DATA",
        folder.display()
    );
    folder
}

/// Reads the voxels with just enough code for this one file: a text header, an empty line, one gzip stream of u32.
fn connectome() -> ArraySource {
    let bytes = std::fs::read(shared_data().join("connectomics_16x16x40nm.nrrd")).unwrap();
    let start = bytes.windows(2).position(|w| w == b"\n\n").unwrap() + 2;
    let header = std::str::from_utf8(&bytes[..start]).unwrap();
    for line in ["sizes: 512 512 512", "encoding: gzip"] {
        assert!(header.contains(line), "{header}");
    }
    let mut raw = Vec::new();
    flate2::read::MultiGzDecoder::new(&bytes[start..]).read_to_end(&mut raw).unwrap();
    let labels = raw.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b)).collect();
    ArraySource::new(VolumeInfo::new([512; 3], LabelType::U32), LabelBuffer::U32(labels)).unwrap()
}

#[test]
fn connectome_is_lossless_and_small() {
    let mut source = connectome();
    let job = Job::new();
    let volume = compress(&mut source, &CompressOptions::default(), &job).unwrap();
    let raw = 4 * 512u64.pow(3);

    // A prototype of the same rule made 131,881 boxes; more boxes would mean that the boxes are not tightened after the splits.
    assert!(volume.boxes().len() <= 131_881, "{} boxes", volume.boxes().len());
    assert_eq!(volume.labels().len(), 2523);
    let resident: u64 = volume.resident_parts().iter().map(|p| p.1).sum();
    assert!(resident * 1000 <= raw * 22, "{resident} bytes resident of {raw} raw: more than 2.2 %");

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("connectome.pumice");
    volume.save(&path, CompressionLevel::Default, &job).unwrap();
    let disk = std::fs::metadata(&path).unwrap().len();
    assert!(disk * 1000 <= raw * 14, "{disk} bytes on disk of {raw} raw: more than 1.4 %");

    let opened = CompressedVolume::open(&path, &job).unwrap();
    assert_eq!(opened.content_hash(), volume.content_hash());
    let found = verify(&opened, &mut source.rewound(), &job).unwrap();
    assert_eq!(found, Verification::Same { voxels: 512u64.pow(3) });
}
