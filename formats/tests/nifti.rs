//! NIfTI files written byte by byte: versions, byte orders, types, pairs, placement, scale, and what is refused.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod files;

use files::*;
use pumice_core::{LabelType, Unit, WorldFrame};
use pumice_formats::OpenOptions;

/// Rows of the matrix from whole-number voxel centres to the world.
fn rows(info: &pumice_core::VolumeInfo) -> [[f64; 4]; 3] {
    let m = info.world_from_centre();
    std::array::from_fn(|r| [m.matrix3.x_axis[r], m.matrix3.y_axis[r], m.matrix3.z_axis[r], m.translation[r]])
}

#[test]
fn reads_every_type_in_both_orders_and_versions() {
    let folder = tempfile::tempdir().unwrap();
    let types = [
        (2, 1, LabelType::U8),
        (256, 1, LabelType::I8),
        (512, 2, LabelType::U16),
        (4, 2, LabelType::I16),
        (768, 4, LabelType::U32),
        (8, 4, LabelType::I32),
        (1280, 8, LabelType::U64),
        (1024, 8, LabelType::I64),
    ];
    for version in [1, 2] {
        for big_endian in [false, true] {
            for (datatype, bytes, label_type) in types {
                // i8 holds labels up to 127 only.
                let values: Vec<u64> = labels().iter().map(|v| v % 128).collect();
                let file =
                    Nifti::new(version, big_endian, datatype).file(&integers(&values, bytes, big_endian));
                let plain = write(folder.path(), "a.nii", &file);
                let gzipped = write(folder.path(), "b.nii.gz", &gzip(&file));
                for path in [plain, gzipped] {
                    let (info, voxels) = read(&path, &OpenOptions::default()).unwrap();
                    assert_eq!(voxels, values, "{path:?} {version} {big_endian} {datatype}");
                    assert_eq!((info.label_type, info.frame), (label_type, WorldFrame::Ras));
                    assert_eq!(info.dims, [3, 4, 5]);
                }
            }
            for (datatype, wide) in [(16, false), (64, true)] {
                let bits: Vec<u64> = labels()
                    .iter()
                    .map(|&v| if wide { (v as f64).to_bits() } else { (v as f32).to_bits().into() })
                    .collect();
                let bytes = integers(&bits, if wide { 8 } else { 4 }, big_endian);
                let path =
                    write(folder.path(), "f.nii", &Nifti::new(version, big_endian, datatype).file(&bytes));
                assert_eq!(read(&path, &OpenOptions::default()).unwrap().1, labels());
            }
        }
    }
}

#[test]
fn finds_pairs_from_either_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut header = Nifti::new(1, false, 2);
    header.bytes[344..348].copy_from_slice(b"ni1\0");
    header.vox_offset(0.0);
    let voxels = integers(&labels(), 1, false);
    let hdr = write(folder.path(), "Brain.v2.hdr", &header.bytes[..348]);
    refuse(&hdr, &OpenOptions::default(), &["Brain.v2.hdr", "Brain.v2.img"]);
    let img = write(folder.path(), "Brain.v2.img", &voxels);
    let hdr_gz = write(folder.path(), "z.hdr.gz", &gzip(&header.bytes[..348]));
    let img_gz = write(folder.path(), "z.img.gz", &gzip(&voxels));
    for path in [&hdr, &img, &hdr_gz, &img_gz] {
        assert_eq!(read(path, &OpenOptions::default()).unwrap().1, labels(), "{path:?}");
    }
    std::fs::remove_file(&hdr).unwrap();
    refuse(&img, &OpenOptions::default(), &["Brain.v2.img", "Brain.v2.hdr"]);
}

#[test]
fn places_by_sform_then_qform_then_lengths() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = integers(&labels(), 1, false);
    for version in [1, 2] {
        let place = |header: &Nifti| {
            let path = write(folder.path(), "p.nii", &header.file(&voxels));
            rows(&read(&path, &OpenOptions::default()).unwrap().0)
        };
        let mut header = Nifti::new(version, false, 2);
        header.srow(0, 1, 0.25);
        header.srow(2, 3, -7.0);
        let sheared = [[1.0, 0.25, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -7.0]];
        assert_eq!(place(&header), sheared);

        // Half a turn about z: a = 0, d = 1. x and y run backwards; qfac −1 flips z as well.
        header.qform([0.0, 0.0, 1.0], [4.0, 5.0, 6.0]);
        (1..4).for_each(|i| header.pixdim(i, i as f64));
        let turned = [[-1.0, 0.0, 0.0, 4.0], [0.0, -2.0, 0.0, 5.0], [0.0, 0.0, 3.0, 6.0]];
        assert_eq!(place(&header), turned);
        header.pixdim(0, -1.0);
        assert_eq!(place(&header)[2], [0.0, 0.0, -3.0, 6.0]);
        // Any other qfac counts as 1.
        header.pixdim(0, 0.0);
        assert_eq!(place(&header), turned);

        // With neither form, x runs to the left and the middle voxel (1, 1.5, 2) is at 0.
        header.qform([0.0; 3], [0.0; 3]);
        if version == 1 {
            header.put(252, 2, 0)
        } else {
            header.put(344, 4, 0)
        }
        assert_eq!(place(&header), [[-1.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, -3.0], [0.0, 0.0, 3.0, -6.0]]);
    }
}

#[test]
fn bounds_the_quaternion() {
    let folder = tempfile::tempdir().unwrap();
    let voxels = integers(&labels(), 1, false);
    // The f32 after 1 gives a² = −2.4e−7, within 3 ε = 3.6e−7 of 0; ten steps further, the difference is no longer due to rounding.
    for (d, good) in [(1.0 + f64::from(f32::EPSILON), true), (1.0 + 10.0 * f64::from(f32::EPSILON), false)] {
        let mut header = Nifti::new(1, false, 2);
        header.qform([0.0, 0.0, d], [0.0; 3]);
        let path = write(folder.path(), "q.nii", &header.file(&voxels));
        assert_eq!(read(&path, &OpenOptions::default()).is_ok(), good);
    }
}

#[test]
fn scales_to_whole_labels_only() {
    let folder = tempfile::tempdir().unwrap();
    let values: Vec<u64> = labels().iter().map(|v| v * 2).collect();
    let stored = integers(&values, 2, false);
    let read_scaled = |slope: f64, intercept: f64| {
        let mut header = Nifti::new(1, false, 512);
        header.scale(slope, intercept);
        read(&write(folder.path(), "s.nii", &header.file(&stored)), &OpenOptions::default()).map(|(_, v)| v)
    };
    // No scale, in all the ways to write it.
    for (slope, intercept) in [(0.0, 0.0), (0.0, 3.0), (f64::NAN, f64::NAN), (1.0, 0.0)] {
        assert_eq!(read_scaled(slope, intercept).unwrap(), values);
    }
    let halved: Vec<u64> = labels().iter().map(|v| v + 1).collect();
    assert_eq!(read_scaled(0.5, 1.0).unwrap(), halved);
    assert!(read_scaled(0.25, 0.0).unwrap_err().contains("voxel (0, 0, 0) is 0.5"));
    // The first voxel is 2: with slope 1 and intercept −4 it is negative.
    assert!(read_scaled(1.0, -4.0).unwrap_err().contains("voxel (0, 0, 0) is -2"));
    assert!(read_scaled(2.0, f64::NAN).unwrap_err().contains("scl_inter"));
}

#[test]
fn asks_for_the_time_step() {
    let folder = tempfile::tempdir().unwrap();
    let mut header = Nifti::new(1, false, 2);
    header.dims(&[3, 4, 5, 2]);
    let second: Vec<u64> = labels().iter().map(|v| v + 100).collect();
    let file = header.file(&integers(&[labels(), second.clone()].concat(), 1, false));
    let path = write(folder.path(), "t.nii", &file);
    refuse(&path, &OpenOptions::default(), &["2 time steps", "--time-step", "0 to 1"]);
    let at = |time| OpenOptions { time: Some(time), ..OpenOptions::default() };
    assert_eq!(read(&path, &at(0)).unwrap().1, labels());
    assert_eq!(read(&path, &at(1)).unwrap().1, second);
    refuse(&path, &at(2), &["--time-step 2", "number of time steps is 2"]);
    header.dims(&[3, 4, 5, 1, 2]);
    let path = write(folder.path(), "c.nii", &[header.bytes, file[352..].to_vec()].concat());
    refuse(&path, &OpenOptions::default(), &["--channel"]);
    let channel = OpenOptions { channel: Some(1), ..OpenOptions::default() };
    assert_eq!(read(&path, &channel).unwrap().1, second);
}

#[test]
fn skips_extensions_and_reads_slices_and_units() {
    let folder = tempfile::tempdir().unwrap();
    let mut header = Nifti::new(1, false, 2);
    header.vox_offset(352.0 + 32.0);
    header.bytes[123] = 3;
    header.bytes.extend([0xEE; 32]);
    header.dims(&[3, 4]);
    let slice = &labels()[..12];
    let path = write(folder.path(), "e.nii", &header.file(&integers(slice, 1, false)));
    let (info, voxels) = read(&path, &OpenOptions::default()).unwrap();
    assert_eq!((voxels.as_slice(), info.dims, info.unit), (slice, [3, 4, 1], Unit::Micrometre));
}

#[test]
fn refuses_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |change: &dyn Fn(&mut Nifti), words: &[&str]| {
        let mut header = Nifti::new(1, false, 2);
        change(&mut header);
        let path = write(folder.path(), "r.nii", &header.file(&integers(&labels(), 1, false)));
        refuse(&path, &OpenOptions::default(), words);
    };
    for (datatype, word) in
        [(1, "bits"), (32, "complex"), (128, "colours"), (2304, "colours"), (1536, "128-bit"), (0, "unknown")]
    {
        refused(&|h| h.put(70, 2, datatype), &[word]);
    }
    refused(&|h| h.dims(&[3, 0, 5]), &["dim[2]", "0"]);
    refused(&|h| h.dims(&[3, -4, 5]), &["dim[2]", "-4"]);
    refused(&|h| h.put(40, 2, 8), &["dim[0]", "8"]);
    refused(&|h| h.dims(&[3, 4, 5, 1, 1, 2]), &["dim[6]"]);
    refused(&|h| h.dims(&[32767, 32767, 32767]), &["expected 35181150961663 bytes", "after 60"]);
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let with_qform = |h: &mut Nifti| {
            h.qform([0.0; 3], [0.0; 3]);
            h.pixdim(2, bad);
        };
        refused(&with_qform, &["spacing along y"]);
    }
    refused(&|h| (0..3).for_each(|i| h.srow(i, 0, 0.0)), &["spacing along x"]);
    refused(&|h| h.srow(0, 3, f64::NAN), &["origin"]);
    for bad in [-1.0, 100.0, 352.5, f64::NAN, 1e30] {
        refused(&|h| h.vox_offset(bad), &["vox_offset"]);
    }
    refused(&|h| h.bytes[344] = b'x', &["magic"]);
    refused(&|h| h.bytes[344..348].fill(0), &["Analyze"]);
    let mut wide = Nifti::new(2, false, 2);
    wide.dims(&[1 << 24, 4, 5]);
    refuse(&write(folder.path(), "w.nii", &wide.file(&[])), &OpenOptions::default(), &["along x", "8388608"]);
    wide.dims(&[1 << 22, 1 << 22, 1 << 22]);
    refuse(&write(folder.path(), "w.nii", &wide.file(&[])), &OpenOptions::default(), &["2^64"]);
}

#[test]
fn reads_the_brain_parcellation() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/torchio_t1_seg_gif_PIR.nii.gz");
    let mut source = pumice_formats::open(path.as_ref(), &OpenOptions::default()).unwrap();
    let info = source.info().clone();
    assert_eq!((info.dims, info.label_type, info.unit), ([256, 256, 176], LabelType::U8, Unit::Millimetre));
    // PIR: the first axis runs to the back, the second down, the third to the right.
    let m = info.world_from_centre().matrix3;
    assert!(m.x_axis.y < -0.9 && m.y_axis.z < -0.9 && m.z_axis.x > 0.9, "{m}");
    let mut seen = [false; 256];
    while let Some(block) = source.next_block().unwrap() {
        let pumice_core::LabelBuffer::U8(labels) = &block.labels else { panic!("the file's type is u8") };
        labels.iter().for_each(|&label| seen[usize::from(label)] = true);
    }
    // Counted with nibabel and numpy.unique: 158 labels and background.
    assert_eq!(seen.iter().filter(|&&s| s).count(), 159);
}
