//! NRRD files built by hand: every variant of the header and every kind of error.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;
use pumice_core::{LabelType, Unit, WorldFrame};
use pumice_formats::{OpenOptions, open, probe};
use tempfile::TempDir;

/// Reads the voxels, x fastest; returns the error's one line.
fn read(path: &Path, options: &OpenOptions) -> Result<Vec<u64>, String> {
    let mut source = open(path, options).map_err(|e| e.to_string())?;
    let dims = source.info().dims.map(|d| d as usize);
    let mut voxels = vec![u64::MAX; dims.iter().product()];
    while let Some(block) = source.next_block().map_err(|e| e.to_string())? {
        for z in 0..block.dims[2] {
            for y in 0..block.dims[1] {
                for x in 0..block.dims[0] {
                    let at = [0, 1, 2].map(|a| (block.origin[a] + [x, y, z][a]) as usize);
                    voxels[at[0] + dims[0] * (at[1] + dims[1] * at[2])] = block.get([x, y, z]);
                }
            }
        }
    }
    Ok(voxels)
}

fn file(folder: &TempDir, name: &str, parts: &[&[u8]]) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, parts.concat()).unwrap();
    path
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

const SIX: [u8; 6] = [1, 2, 3, 4, 5, 6];
const HEAD: &str = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 3 2 1\n";

/// A u8 volume of 3 × 2 × 1 voxels with additional header lines.
fn small(lines: &str) -> Vec<u8> {
    [HEAD.as_bytes(), lines.as_bytes(), b"\n", &SIX].concat()
}

fn refused(lines: &str) -> String {
    let folder = TempDir::new().unwrap();
    let path = file(&folder, "a.nrrd", &[&small(lines)]);
    let error = read(&path, &OpenOptions::default()).expect_err(lines);
    assert_eq!(error.lines().count(), 1, "{error}");
    error
}

#[test]
fn every_spelling_of_a_type_is_read() {
    let folder = TempDir::new().unwrap();
    for (names, label_type, voxel) in [
        ("signed char|int8|int8_t", LabelType::I8, &[7][..]),
        ("uchar|unsigned char|uint8|uint8_t", LabelType::U8, &[7]),
        ("short|short int|signed short|signed short int|int16|int16_t", LabelType::I16, &[7, 0]),
        ("ushort|unsigned short|unsigned short int|uint16|uint16_t", LabelType::U16, &[7, 0]),
        ("int|signed int|int32|int32_t", LabelType::I32, &[7, 0, 0, 0]),
        ("uint|unsigned int|uint32|uint32_t", LabelType::U32, &[7, 0, 0, 0]),
        ("longlong|long long|signed long long int|int64|int64_t", LabelType::I64, &[7, 0, 0, 0, 0, 0, 0, 0]),
        ("ulonglong|unsigned long long int|uint64|uint64_t", LabelType::U64, &[7, 0, 0, 0, 0, 0, 0, 0]),
        ("float", LabelType::F32, &7f32.to_le_bytes()),
        ("double", LabelType::F64, &7f64.to_le_bytes()),
    ] {
        for name in names.split('|') {
            let header =
                format!("NRRD0001\ntype: {name}\ndimension: 1\nsizes: 1\nendian: little\nencoding: raw\n\n");
            let path = file(&folder, "a.nrrd", &[header.as_bytes(), voxel]);
            assert_eq!(read(&path, &OpenOptions::default()).as_deref(), Ok(&[7][..]), "{name}");
            assert_eq!(probe(&path, &OpenOptions::default()).unwrap().info.label_type, label_type, "{name}");
        }
    }
}

#[test]
fn space_and_units_are_read() {
    let folder = TempDir::new().unwrap();
    for (space, frame) in [
        ("right-anterior-superior", WorldFrame::Ras),
        ("RAS", WorldFrame::Ras),
        ("left-posterior-superior", WorldFrame::Lps),
        ("LPS", WorldFrame::Lps),
        ("left-anterior-superior", WorldFrame::Las),
        ("LAS", WorldFrame::Las),
        ("scanner-xyz", WorldFrame::Unknown),
    ] {
        let lines = format!(
            "encoding: raw\nspace: {space}\nspace directions: (0,2,0) (-3, 0, 0) (0,0,4)\nspace origin: (10,20,30)\n\
             space units: \"um\" \"microns\" \"µm\"\nmeasurement frame: (1,0,0) (0,1,0) (0,0,1)\n"
        );
        let path = file(&folder, "a.nrrd", &[&small(&lines)]);
        let info = probe(&path, &OpenOptions::default()).unwrap().info;
        assert_eq!((info.frame, info.unit), (frame, Unit::Micrometre), "{space}");
        let centre = info.world_from_centre();
        let world = |x, y, z| centre.transform_point3(glam::DVec3::new(x, y, z)).to_array();
        assert_eq!(world(0.0, 0.0, 0.0), [10.0, 20.0, 30.0]);
        assert_eq!(world(1.0, 0.0, 0.0), [10.0, 22.0, 30.0]);
        assert_eq!(world(0.0, 1.0, 0.0), [7.0, 20.0, 30.0]);
        assert_eq!(world(0.0, 0.0, 1.0), [10.0, 20.0, 34.0]);
    }
}

#[test]
fn missing_spacing_is_a_warning_and_can_be_given() {
    let folder = TempDir::new().unwrap();
    let path = file(&folder, "a.nrrd", &[&small("encoding: raw\n")]);
    let found = probe(&path, &OpenOptions::default()).unwrap();
    assert!(found.warnings[0].contains("no spacing"), "{:?}", found.warnings);
    let options = OpenOptions { spacing: Some([1.0, 2.0, 3.0]), ..OpenOptions::default() };
    let found = probe(&path, &options).unwrap();
    assert_eq!(found.info.spacing(), [1.0, 2.0, 3.0]);
    assert!(found.warnings.is_empty());
}

#[test]
fn ascii_and_comments_are_read() {
    let folder = TempDir::new().unwrap();
    let path = file(
        &folder,
        "a.nrrd",
        &[
            HEAD.as_bytes(),
            b"# a comment: with colon\nkey:=value: with colon\nencoding: ascii\n\n1 2\n3, 4\t5\r\n6\n",
        ],
    );
    assert_eq!(read(&path, &OpenOptions::default()).as_deref(), Ok(&[1, 2, 3, 4, 5, 6][..]));
    let path = file(&folder, "b.nrrd", &[HEAD.as_bytes(), b"encoding: ascii\n\n1 2 3 256 5 6\n"]);
    assert!(read(&path, &OpenOptions::default()).unwrap_err().contains("\"256\""));
    let path = file(&folder, "c.nrrd", &[HEAD.as_bytes(), b"encoding: ascii\n\n1 2 3\n"]);
    assert!(read(&path, &OpenOptions::default()).unwrap_err().contains("expected 6 bytes"));
}

#[test]
fn detached_voxels_are_found() {
    let folder = TempDir::new().unwrap();
    let options = OpenOptions::default();
    let expected = Ok(&[1, 2, 3, 4, 5, 6][..]);
    file(&folder, "v.raw", &[b"skip\nme\nxx", &SIX]);
    file(&folder, "v.raw.gz", &[&gzip(&[b"xx".as_slice(), &SIX].concat())]);
    file(&folder, "p01.raw", &[&SIX[..3]]);
    file(&folder, "p03.raw", &[&SIX[3..]]);
    for lines in [
        "encoding: raw\nline skip: 2\nbyte skip: 2\ndata file: v.raw\n",
        "encoding: raw\nbyte skip: -1\ndatafile: v.raw\n",
        "encoding: gzip\nbyte skip: 2\ndata file: v.raw.gz\n",
        "encoding: raw\ndata file: p%02d.raw 1 3 2\n",
        "encoding: raw\ndata file: LIST\np01.raw\np03.raw\n",
        "encoding: raw\ndata file: LIST 2\np01.raw\np03.raw",
    ] {
        let path = file(&folder, "a.nhdr", &[HEAD.as_bytes(), lines.as_bytes()]);
        assert_eq!(read(&path, &options).as_deref(), expected, "{lines}");
    }
    // A control: with another skip, other voxels come out.
    let path =
        file(&folder, "a.nhdr", &[HEAD.as_bytes(), b"encoding: raw\nbyte skip: 9\ndata file: v.raw\n"]);
    assert_ne!(read(&path, &options).as_deref(), expected);

    let path = file(&folder, "a.nhdr", &[HEAD.as_bytes(), b"encoding: raw\ndata file: none.raw\n"]);
    let error = read(&path, &options).unwrap_err();
    assert!(error.contains("a.nhdr") && error.contains("none.raw"), "{error}");
    let path =
        file(&folder, "a.nhdr", &[HEAD.as_bytes(), b"encoding: raw\nbyte skip: 11\ndata file: v.raw\n"]);
    assert!(read(&path, &options).unwrap_err().contains("expected 6 bytes"));
}

#[test]
fn layers_are_chosen_never_merged() {
    let folder = TempDir::new().unwrap();
    let header = "NRRD0005\ntype: uchar\ndimension: 4\nsizes: 2 3 1 1\nkinds: list domain domain domain\nspace dimension: 3\n\
                  space directions: none (1,0,0) (0,1,0) (0,0,1)\nencoding: raw\nSegment0_Name:=liver\\nleft\nSegment0_Layer:=0\n\
                  Segment0_LabelValue:=1\nSegment1_Name:=tumour\nSegment1_Layer:=1\nSegment1_LabelValue:=3\n\
                  Segment1_Color:=1 0.5 2\n\n";
    let path = file(&folder, "a.seg.nrrd", &[header.as_bytes(), &SIX]);
    let error = read(&path, &OpenOptions::default()).unwrap_err();
    assert!(error.contains("--layer") && error.contains("1: tumour"), "{error}");
    for (layer, expected) in [(0, [1, 3, 5]), (1, [2, 4, 6])] {
        let options = OpenOptions { layer: Some(layer), ..OpenOptions::default() };
        assert_eq!(read(&path, &options).as_deref(), Ok(&expected[..]));
    }
    let options = OpenOptions { layer: Some(1), ..OpenOptions::default() };
    let notes = probe(&path, &options).unwrap().info.notes;
    assert_eq!(notes.len(), 1);
    assert_eq!((notes[0].id, notes[0].name.as_deref()), (3, Some("tumour")));
    assert_eq!(notes[0].color_srgb, Some([1.0, 0.5, 1.0]));
    assert_eq!(probe(&path, &OpenOptions::default()).unwrap().layers.len(), 2);
    let options = OpenOptions { layer: Some(2), ..OpenOptions::default() };
    let error = read(&path, &options).unwrap_err();
    assert!(error.contains("number of layers is 2: 0: liver left; 1: tumour"), "{error}");
}

#[test]
fn gzip_members_checksum_and_trailing_bytes() {
    let folder = TempDir::new().unwrap();
    let header = [HEAD.as_bytes(), b"encoding: gzip\nspacings: 1 1 1\n\n"].concat();
    let (first, second) = (gzip(&SIX[..2]), gzip(&SIX[2..]));
    let expected = Ok(&[1, 2, 3, 4, 5, 6][..]);
    let options = OpenOptions::default();
    let path = file(&folder, "a.nrrd", &[&header, &first, &second]);
    assert_eq!(read(&path, &options).as_deref(), expected);
    assert!(options.warnings.list().is_empty());

    for extra in [&b"junk"[..], &gzip(b"more")] {
        let options = OpenOptions::default();
        let path = file(&folder, "a.nrrd", &[&header, &gzip(&SIX), extra]);
        assert_eq!(read(&path, &options).as_deref(), expected);
        assert_eq!(options.warnings.list().len(), 1, "{:?}", options.warnings.list());
    }

    let whole = gzip(&SIX);
    let mut wrong = whole.clone();
    let crc_at = wrong.len() - 8;
    wrong[crc_at] ^= 1;
    let path = file(&folder, "a.nrrd", &[&header, &wrong]);
    assert!(read(&path, &options).unwrap_err().contains("byte"), "the checksum is wrong");
    for cut in 0..whole.len() {
        let path = file(&folder, "a.nrrd", &[&header, &whole[..cut]]);
        assert!(read(&path, &options).is_err(), "cut at {cut}");
    }
}

#[test]
fn too_few_and_too_many_voxels() {
    let folder = TempDir::new().unwrap();
    let options = OpenOptions::default();
    let header = [HEAD.as_bytes(), b"encoding: raw\nspacings: 1 1 1\n\n"].concat();
    let path = file(&folder, "a.nrrd", &[&header, &SIX[..5]]);
    let error = read(&path, &options).unwrap_err();
    assert!(error.contains("expected 6 bytes") && error.contains("after 5"), "{error}");
    let path = file(&folder, "a.nrrd", &[&header, &SIX, b"more"]);
    assert!(read(&path, &options).is_ok());
    assert!(
        options.warnings.list()[0].contains("4 bytes after the last voxel"),
        "{:?}",
        options.warnings.list()
    );
}

#[test]
fn values_that_are_no_labels_name_their_voxel() {
    let folder = TempDir::new().unwrap();
    let header = "NRRD0004\ntype: int16\ndimension: 3\nsizes: 3 2 1\nendian: big\nencoding: raw\n\n";
    let bytes: Vec<u8> = [0i16, 1, 2, 3, -4, 5].iter().flat_map(|v| v.to_be_bytes()).collect();
    let path = file(&folder, "a.nrrd", &[header.as_bytes(), &bytes]);
    let error = read(&path, &OpenOptions::default()).unwrap_err();
    assert!(error.contains("voxel (1, 1, 0) is -4"), "{error}");
    let header = "NRRD0004\ntype: float\ndimension: 3\nsizes: 3 2 1\nendian: big\nencoding: raw\n\n";
    let bytes: Vec<u8> = [0f32, 1.0, 2.0, 3.0, 4.0, 5.5].iter().flat_map(|v| v.to_be_bytes()).collect();
    let path = file(&folder, "a.nrrd", &[header.as_bytes(), &bytes]);
    let error = read(&path, &OpenOptions::default()).unwrap_err();
    assert!(error.contains("voxel (2, 1, 0) is 5.5"), "{error}");
}

#[test]
fn wrong_headers_are_told_in_one_line() {
    for (lines, expected) in [
        ("", "\"encoding\" is missing"),
        ("encoding: bzip2\n", "\"bzip2\" is not read"),
        ("encoding: what\n", "\"what\""),
        ("encoding: raw\nspacings: 1 nan 1\n", "spacing along y is NaN"),
        ("encoding: raw\nspacings: 1 0 1\n", "spacing along y is 0"),
        ("encoding: raw\nspacings: 1 -1 1\n", "spacing along y is -1"),
        ("encoding: raw\nspacings: inf 1 1\n", "spacing along x is inf"),
        ("encoding: raw\nspacings: 1 1\n", "2 entries, expected 3"),
        ("encoding: raw\nspace directions: (1,0,0) (1,0,0) (0,0,1)\n", "one plane"),
        ("encoding: raw\nspace directions: (1,0,0) none (0,0,1)\n", "along y is NaN"),
        ("encoding: raw\nspace directions: (1,0,0) (0,1,0 (0,0,1)\n", "expected vectors"),
        ("encoding: raw\nkinds: RGB-color domain domain\n", "rgb-color"),
        ("encoding: raw\nencoding: gzip\n", "twice"),
        ("encoding: raw\nno field\n", "field: value"),
    ] {
        let error = refused(lines);
        assert!(error.contains(expected), "{lines:?}: {error}");
    }
    // Control: the same header without a fault is read.
    let folder = TempDir::new().unwrap();
    let path = file(&folder, "a.nrrd", &[&small("encoding: raw\nspacings: 1 2 1\n")]);
    assert!(read(&path, &OpenOptions::default()).is_ok());
}

#[test]
fn absurd_sizes_are_refused_before_anything_is_read() {
    let folder = TempDir::new().unwrap();
    for (sizes, expected) in [
        ("0 1 1", "no voxels"),
        ("4294967296 1 1", "limit is 8388608"),
        ("8388609 1 1", "limit is 8388608"),
        ("18446744073709551616 1 1", "whole numbers"),
        ("-1 1 1", "whole numbers"),
        ("8388608 8388608 8388608", "2^64"),
        ("8388608 8388608 1", "expected 70368744177664 bytes"),
    ] {
        let header = format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: {sizes}\nencoding: raw\n\n");
        let path = file(&folder, "a.nrrd", &[header.as_bytes(), &SIX]);
        let error = read_only_open(&path).unwrap_err();
        assert!(error.contains(expected), "{sizes}: {error}");
    }
}

/// Opens and reads a file without the array of all voxels that [`read`] makes.
fn read_only_open(path: &Path) -> Result<(), String> {
    let mut source = open(path, &OpenOptions::default()).map_err(|e| e.to_string())?;
    while source.next_block().map_err(|e| e.to_string())?.is_some() {}
    Ok(())
}

#[test]
fn what_is_no_volume_is_told() {
    let folder = TempDir::new().unwrap();
    let options = OpenOptions::default();
    for (content, expected) in [
        (&b""[..], "empty"),
        (b"\x89HDF\r\n\x1a\n", "HDF5"),
        (b"hello", "68 65 6c"),
        (b"NRRD0009\n\n", "NRRD0005"),
    ] {
        let path = file(&folder, "a.nrrd", &[content]);
        let error = read(&path, &options).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
    let error = read(&folder.path().join("missing.nrrd"), &options).unwrap_err();
    assert!(error.contains("missing.nrrd"), "{error}");
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    assert!(read(&empty, &options).unwrap_err().contains("no TIFF slices"));
}

#[test]
fn layers_without_segments_have_numbers() {
    let folder = TempDir::new().unwrap();
    let header = "NRRD0005\ntype: uchar\ndimension: 4\nsizes: 2 3 1 1\nkinds: list domain domain domain\n\
                  space dimension: 3\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nencoding: raw\n";
    let path = file(&folder, "a.nrrd", &[header.as_bytes(), b"\n", &SIX]);
    let found = probe(&path, &OpenOptions::default()).unwrap();
    assert_eq!((found.format, found.layers.len(), found.choices[0].listed.as_str()), ("NRRD", 0, "0 to 1"));
    assert_eq!(found.choices[0].values.len(), 2);
    let error = read(&path, &OpenOptions::default()).unwrap_err();
    assert!(error.contains("--layer (0 to 1)"), "{error}");
    // Control: with a segment.
    let path = file(&folder, "b.nrrd", &[header.as_bytes(), b"Segment0_Name:=liver\n\n", &SIX]);
    let found = probe(&path, &OpenOptions::default()).unwrap();
    assert_eq!((found.format, found.layers.len()), ("NRRD (3D Slicer segmentation)", 2));
}

#[test]
fn four_axes_without_kinds_are_told_the_line_to_add() {
    let folder = TempDir::new().unwrap();
    let header = |sizes: &str, kinds: &str| {
        format!("NRRD0005\ntype: uchar\ndimension: 4\nsizes: {sizes}\n{kinds}encoding: raw\n\n")
    };
    let refused = |sizes: &str| {
        let path = file(&folder, "a.nrrd", &[header(sizes, "").as_bytes(), &[1; 120]]);
        read(&path, &OpenOptions::default()).unwrap_err()
    };
    let (last, first) = (refused("5 4 3 2"), refused("2 3 4 5"));
    for (line, kinds) in [
        (
            &last,
            "\"kinds: domain domain domain list\" for layers or \"kinds: domain domain domain time\" for time steps",
        ),
        (
            &first,
            "\"kinds: list domain domain domain\" for layers or \"kinds: time domain domain domain\" for time steps",
        ),
    ] {
        assert!(line.contains(kinds) && line.lines().count() == 1, "{line}");
    }
    // What the line asks for is read.
    let path = file(
        &folder,
        "a.nrrd",
        &[header("5 4 3 2", "kinds: domain domain domain time\n").as_bytes(), &[1; 120]],
    );
    let options = OpenOptions { time: Some(1), ..OpenOptions::default() };
    assert_eq!(read(&path, &options).unwrap().len(), 60);
}
