//! MetaImage files written byte by byte: where the voxels are, how they are stored, placement, and what is refused.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod files;

use std::io::Write as _;

use files::*;
use pumice_core::{Unit, WorldFrame};
use pumice_formats::OpenOptions;

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn reads_attached_voxels() {
    let folder = tempfile::tempdir().unwrap();
    let little = integers(&labels(), 2, false);
    let packed = zlib(&little);
    let size = format!("CompressedData = True\nCompressedDataSize = {}\n", packed.len());
    let text = labels().iter().map(u64::to_string).collect::<Vec<_>>().join(" ");
    let cases: [(&str, Vec<u8>); 7] = [
        ("", little.clone()),
        ("BinaryDataByteOrderMSB = True\n", integers(&labels(), 2, true)),
        ("ElementByteOrderMSB = True\n", integers(&labels(), 2, true)),
        (&size, packed.clone()),
        ("CompressedData = True\n", gzip(&little)),
        ("BinaryData = False\nBinaryDataByteOrderMSB = True\n", text.into_bytes()),
        ("HeaderSize = -1\n", [vec![9; 7], little].concat()),
    ];
    for (extra, voxels) in cases {
        let file = [meta("MET_USHORT", extra, "LOCAL").as_bytes(), &voxels].concat();
        // The file is recognised by its name and by its content alone.
        for name in ["a.mha", "a.dat"] {
            let (info, got) = read(&write(folder.path(), name, &file), &OpenOptions::default()).unwrap();
            assert_eq!(got, labels(), "{extra}");
            assert_eq!((info.dims, info.frame, info.unit), ([3, 4, 5], WorldFrame::Lps, Unit::Millimetre));
        }
    }
}

#[test]
fn reads_detached_voxels() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = integers(&labels(), 1, false);
    write(folder.path(), "all voxels.raw", &bytes);
    write(folder.path(), "behind.raw", &[&[7; 11], bytes.as_slice()].concat());
    for (i, slice) in bytes.chunks(12).enumerate() {
        write(folder.path(), &format!("s{:02}.raw", 10 + 2 * i), slice);
    }
    for (extra, data) in [
        ("", "all voxels.raw"),
        ("HeaderSize = 11\n", "behind.raw"),
        ("HeaderSize = -1\n", "behind.raw"),
        ("", "s%02d.raw 10 18 2"),
        ("", "LIST\ns10.raw\ns12.raw\ns14.raw\ns16.raw\ns18.raw"),
        ("", "LIST 2\ns10.raw\ns12.raw\ns14.raw\ns16.raw\ns18.raw"),
    ] {
        let path = write(folder.path(), "a.mhd", meta("MET_UCHAR", extra, data).as_bytes());
        assert_eq!(read(&path, &OpenOptions::default()).unwrap().1, labels(), "{extra} {data}");
    }
    let refused = |extra: &str, data: &str, words: &[&str]| {
        let path = write(folder.path(), "r.mhd", meta("MET_UCHAR", extra, data).as_bytes());
        refuse(&path, &OpenOptions::default(), words);
    };
    refused("", "gone.raw", &["r.mhd", "gone.raw"]);
    refused("", "s%02d.raw 10 20 2", &["6 files", "5 slices"]);
    refused("", "s%02d.raw 10 18 0", &["pattern"]);
    refused("", "s%x.raw 10 18 2", &["pattern"]);
    refused("", "LIST", &["list of data files is empty"]);
    refused("", "LIST\ns10.raw\ns12.raw", &["s10.raw", "expected 30 bytes", "after 12"]);
    refused("HeaderSize = 1\n", "all voxels.raw", &["expected 60 bytes", "after 59"]);
}

#[test]
fn places_each_axis_by_its_run_of_the_matrix() {
    let folder = tempfile::tempdir().unwrap();
    let extra =
        "ElementSpacing = 1 2 3\nTransformMatrix = 0 1 0 0 0 1 1 0 0\nOffset = 4 5 6\nDistanceUnits = um\n";
    let file = [meta("MET_UCHAR", extra, "LOCAL").as_bytes(), &integers(&labels(), 1, false)].concat();
    let (info, _) = read(&write(folder.path(), "a.mha", &file), &OpenOptions::default()).unwrap();
    let m = info.world_from_centre();
    // x of the volume runs along the world's y, y along z, z along x.
    assert_eq!(m.matrix3.to_cols_array(), [0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 3.0, 0.0, 0.0]);
    assert_eq!((m.translation.to_array(), info.unit), ([4.0, 5.0, 6.0], Unit::Micrometre));
}

#[test]
fn refuses_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |header: &str, words: &[&str]| {
        let file = [header.as_bytes(), &integers(&labels(), 1, false)].concat();
        refuse(&write(folder.path(), "r.mha", &file), &OpenOptions::default(), words);
    };
    let good = meta("MET_UCHAR", "ElementSpacing = 1 1 1\n", "LOCAL");
    for (from, to, words) in [
        ("NDims = 3", "NDims = 5", ["NDims", "2 to 4"].as_slice()),
        ("DimSize = 3 4 5", "DimSize = 3 4", &["DimSize", "3 whole numbers"]),
        ("DimSize = 3 4 5", "DimSize = 3 -4 5", &["DimSize"]),
        ("DimSize = 3 4 5", "DimSize = 3 0 5", &["size is 0"]),
        ("DimSize = 3 4 5", "DimSize = 9000000 4 5", &["along x"]),
        ("DimSize = 3 4 5", "DimSize = 8000000 8000000 8000000", &["2^64"]),
        ("DimSize = 3 4 5", "DimSize = 3 4 6", &["expected 72 bytes", "after 60"]),
        ("DimSize = 3 4 5", "", &["DimSize", "missing"]),
        ("MET_UCHAR", "MET_UCHAR_ARRAY", &["MET_UCHAR_ARRAY"]),
        ("MET_UCHAR", "float", &["float"]),
        ("= Image", "= Tube", &["Tube"]),
        ("Spacing = 1 1 1", "Spacing = 1 0 1", &["spacing along y is 0"]),
        ("Spacing = 1 1 1", "Spacing = 1 1 -2", &["spacing along z is -2"]),
        ("Spacing = 1 1 1", "Spacing = nan 1 1", &["spacing along x"]),
        ("Spacing = 1 1 1", "Spacing = 1 1 inf", &["spacing along z"]),
        ("Spacing = 1 1 1", "Spacing = 1 1", &["3 numbers"]),
        ("ElementSpacing", "ElementNumberOfChannels = 3\nElementSpacing", &["channels"]),
        ("ElementSpacing", "TransformMatrix = 1 0 0 1 0 0 0 0 1\nElementSpacing", &["plane"]),
        ("ElementSpacing", "BinaryData = Maybe\nElementSpacing", &["True or False"]),
        ("ElementSpacing", "CompressedData = True\nElementSpacing", &["compressed data are damaged"]),
        (
            "ElementSpacing",
            "CompressedData = True\nCompressedDataSize = 61\nElementSpacing",
            &["expected 61", "got 60"],
        ),
        ("ElementSpacing", "NDims = 3\nElementSpacing", &["twice"]),
        ("ElementSpacing", "HeaderSize = 3\nElementSpacing", &["HeaderSize is 3"]),
    ] {
        refused(&good.replace(from, to), words);
    }
    let later = OpenOptions { channel: Some(1), ..OpenOptions::default() };
    let path = write(folder.path(), "c.mha", &[good.as_bytes(), &[1; 60]].concat());
    refuse(&path, &later, &["--channel 1", "number of channels is 1"]);
    assert!(
        read(&write(folder.path(), "g.mha", &[good.as_bytes(), &[1; 60]].concat()), &OpenOptions::default())
            .is_ok()
    );
}
