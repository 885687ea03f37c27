//! TIFF files built by hand, tag by tag: compressions and predictors that the Python packages of the cross-read tests cannot write without
//! further packages.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::Path;

use pumice_formats::{OpenOptions, open};
use tempfile::TempDir;

const WIDTH: usize = 7;
const HEIGHT: usize = 5;

/// Pixels with runs and with large differences.
fn pixels() -> Vec<u64> {
    (0..(WIDTH * HEIGHT) as u64).map(|i| if i % 5 < 3 { 200 } else { i * 0x0123_4567_89AB_CDEF }).collect()
}

fn read(path: &Path) -> Result<Vec<u64>, String> {
    let mut source = open(path, &OpenOptions::default()).map_err(|e| e.to_string())?;
    let mut voxels = Vec::new();
    while let Some(block) = source.next_block().map_err(|e| e.to_string())? {
        voxels.extend((0..block.labels.len()).map(|i| block.labels.get(i)));
    }
    Ok(voxels)
}

/// A file with one page and one strip: classic TIFF or BigTIFF, in either byte order.
fn tiff(big_endian: bool, big: bool, bits: u16, tags: &[(u16, u64)], strip: &[u8]) -> Vec<u8> {
    let n = |value: u64, bytes: usize| {
        let all = value.to_le_bytes();
        let mut out = all[..bytes].to_vec();
        if big_endian {
            out.reverse();
        }
        out
    };
    let mut all: Vec<(u16, u64)> = vec![
        (256, WIDTH as u64),
        (257, HEIGHT as u64),
        (258, bits.into()),
        (262, 1),
        (277, 1),
        (278, HEIGHT as u64),
        (279, strip.len() as u64),
    ];
    all.extend(tags);
    let word = if big { 8 } else { 4 };
    let head = if big { 16 } else { 8 };
    let strip_at = head + if big { 8 } else { 2 } + (all.len() + 1) * (4 + 2 * word) + word;
    all.push((273, strip_at as u64));
    all.sort();
    let mut file = if big_endian { b"MM".to_vec() } else { b"II".to_vec() };
    if big {
        file.extend([n(43, 2), n(8, 2), n(0, 2), n(16, 8), n(all.len() as u64, 8)].concat());
    } else {
        file.extend([n(42, 2), n(8, 4), n(all.len() as u64, 2)].concat());
    }
    for (tag, value) in all {
        // All values are LONG: one value, left-aligned in its word.
        let mut field = n(value, 4);
        field.resize(word, 0);
        file.extend([n(tag.into(), 2), n(4, 2), n(1, word), field].concat());
    }
    file.extend(n(0, word));
    file.extend(strip);
    file
}

fn bytes_of(values: &[u64], bytes: usize, big_endian: bool) -> Vec<u8> {
    values
        .iter()
        .flat_map(|v| {
            let mut b = v.to_le_bytes()[..bytes].to_vec();
            if big_endian {
                b.reverse();
            }
            b
        })
        .collect()
}

fn truncated(bytes: usize) -> Vec<u64> {
    let mask = if bytes == 8 { u64::MAX } else { (1 << (8 * bytes)) - 1 };
    pixels().iter().map(|v| v & mask).collect()
}

/// PackBits straight from its definition; literal runs have one byte.
fn pack_bits(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut i = 0;
    while i < bytes.len() {
        let run = bytes[i..].iter().take(128).take_while(|&&b| b == bytes[i]).count();
        if run > 1 {
            out.extend([(257 - run) as u8, bytes[i]]);
        } else {
            out.extend([0, bytes[i], 128]);
        }
        i += run;
    }
    out
}

fn compress(how: u64, bytes: &[u8]) -> Vec<u8> {
    match how {
        5 => weezl::encode::Encoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8).encode(bytes).unwrap(),
        8 => {
            let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
            std::io::Write::write_all(&mut encoder, bytes).unwrap();
            encoder.finish().unwrap()
        }
        32773 => pack_bits(bytes),
        _ => bytes.to_vec(),
    }
}

#[test]
fn every_compression_type_and_byte_order() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.tif");
    for compression in [1, 5, 8, 32773] {
        for bytes in [1, 2, 4, 8] {
            for (big_endian, big) in [(false, false), (false, true), (true, false), (true, true)] {
                let values = truncated(bytes);
                let strip = compress(compression, &bytes_of(&values, bytes, big_endian));
                let tags = [(259, compression)];
                fs::write(&path, tiff(big_endian, big, 8 * bytes as u16, &tags, &strip)).unwrap();
                assert_eq!(
                    read(&path),
                    Ok(values),
                    "compression {compression}, {bytes} bytes, big-endian {big_endian}, BigTIFF {big}"
                );
            }
        }
    }
}

#[test]
fn horizontal_predictor_is_undone() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.tif");
    for bytes in [1, 2, 4, 8] {
        for big_endian in [false, true] {
            let values = truncated(bytes);
            // TIFF 6.0 §14: each pixel minus its left neighbour, row by row, modulo 2^bits.
            let differences: Vec<u64> = (0..values.len())
                .map(|i| if i % WIDTH == 0 { values[i] } else { values[i].wrapping_sub(values[i - 1]) })
                .collect();
            for compression in [5, 8] {
                let strip = compress(compression, &bytes_of(&differences, bytes, big_endian));
                let tags = [(259, compression), (317, 2)];
                fs::write(&path, tiff(big_endian, false, 8 * bytes as u16, &tags, &strip)).unwrap();
                assert_eq!(read(&path), Ok(values.clone()), "{bytes} bytes, big-endian {big_endian}");
                // A control: without the predictor tag, other voxels come out.
                fs::write(&path, tiff(big_endian, false, 8 * bytes as u16, &tags[..1], &strip)).unwrap();
                assert_ne!(read(&path), Ok(values.clone()));
            }
        }
    }
}

#[test]
fn float_predictor_is_undone() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.tif");
    let labels: Vec<u64> = (0..(WIDTH * HEIGHT) as u64).map(|i| i * 1000 % 77_777).collect();
    let mut strip = Vec::new();
    for row in labels.chunks(WIDTH) {
        // TIFF Technical Note 3: all most significant bytes of the row, then all next ones, …; then differences of bytes.
        let big: Vec<[u8; 4]> = row.iter().map(|&v| (v as f32).to_be_bytes()).collect();
        let planes: Vec<u8> = (0..4).flat_map(|b| big.iter().map(move |v| v[b])).collect();
        strip.push(planes[0]);
        strip.extend(planes.windows(2).map(|w| w[1].wrapping_sub(w[0])));
    }
    for big_endian in [false, true] {
        let tags = [(259, 8), (317, 3), (339, 3)];
        fs::write(&path, tiff(big_endian, false, 32, &tags, &compress(8, &strip))).unwrap();
        assert_eq!(read(&path), Ok(labels.clone()), "big-endian {big_endian}");
    }
}

#[test]
fn what_is_no_label_map_is_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.tif");
    let strip = bytes_of(&truncated(1), 1, false);
    for (bits, tags, expected) in [
        (8, &[(262, 3)][..], "palette"),
        (8, &[(262, 2), (277, 3)], "colour"),
        (8, &[(259, 7)], "JPEG"),
        (8, &[(259, 50000)], "Zstandard"),
        (12, &[], "12 bits"),
        (16, &[(339, 3)], "sample format 3"),
        (8, &[(256, 0)], "no voxels"),
        (8, &[(256, 4_000_000_000)], "limit is 8388608"),
        (8, &[(257, 8_000_000)], "1600000 strips"),
        (8, &[(278, 0)], "strips"),
        (8, &[(273, 4_000_000_000)], "cut off"),
    ] {
        // A later tag of the same number replaces the earlier one, as in the reader's table.
        let mut file = tiff(false, false, bits, &[], &strip);
        for &(tag, value) in tags {
            file = with_tag(file, tag, value);
        }
        fs::write(&path, file).unwrap();
        let error = read(&path).expect_err(expected);
        assert!(error.contains(expected) && error.lines().count() == 1, "{tags:?}: {error}");
    }
}

/// Replaces a tag's value, or turns another tag (rows per strip) into it.
fn with_tag(mut file: Vec<u8>, tag: u16, value: u64) -> Vec<u8> {
    let count = usize::from(u16::from_le_bytes([file[8], file[9]]));
    let find = |file: &[u8], tag: u16| {
        (0..count).map(|i| 10 + 12 * i).find(|&at| u16::from_le_bytes([file[at], file[at + 1]]) == tag)
    };
    let at = find(&file, tag).or_else(|| find(&file, 278)).unwrap();
    file[at..at + 2].copy_from_slice(&tag.to_le_bytes());
    file[at + 8..at + 12].copy_from_slice(&(value as u32).to_le_bytes());
    file
}

#[test]
fn pages_in_a_circle_are_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.tif");
    let strip = bytes_of(&truncated(1), 1, false);
    let mut file = tiff(false, false, 8, &[], &strip);
    let next = 10 + 12 * usize::from(u16::from_le_bytes([file[8], file[9]]));
    file[next..next + 4].copy_from_slice(&8u32.to_le_bytes());
    fs::write(&path, file).unwrap();
    assert!(read(&path).unwrap_err().contains("circle"));
}

/// The planes of a volume of two slices in a row, of bytes, with their values.
fn two_slices() -> (Vec<u8>, Vec<u64>) {
    let second: Vec<u64> = truncated(1).iter().map(|v| v ^ 1).collect();
    let values = [truncated(1), second].concat();
    (bytes_of(&values, 1, false), values)
}

#[test]
fn a_page_that_holds_a_volume_is_read_whole_or_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.tif");
    let (strip, values) = two_slices();
    fs::write(&path, tiff(false, false, 8, &[(32997, 2)], &strip)).unwrap();
    assert_eq!(read(&path), Ok(values));
    // Control: without the tag it is one slice.
    fs::write(&path, tiff(false, false, 8, &[], &strip)).unwrap();
    assert_eq!(read(&path), Ok(truncated(1)));
    for (tags, strip, expected) in [
        (&[(32997, 2), (259, 8)][..], compress(8, &strip), "a page holds a volume of 2 slices"),
        (&[(32997, 3)], strip.clone(), "expected 105 bytes"),
        (&[(32997, 2), (322, 16), (323, 16), (324, 8)], strip.clone(), "a page holds a volume of 2 slices"),
    ] {
        fs::write(&path, tiff(false, false, 8, tags, &strip)).unwrap();
        let error = read(&path).unwrap_err();
        assert!(error.contains(expected) && error.lines().count() == 1, "{error}");
    }
    // A folder of such pages.
    let slices = folder.path().join("slices");
    fs::create_dir(&slices).unwrap();
    fs::write(slices.join("s1.tif"), tiff(false, false, 8, &[(32997, 2)], &strip)).unwrap();
    assert!(read(&slices).unwrap_err().contains("this page holds 2"));
}

/// A file with a description, and the planes behind it.
fn described(description: &str, planes: &[u8]) -> Vec<u8> {
    // Rows per strip gives its place to the description; one strip is the default.
    let at = tiff(false, false, 8, &[], &[]).len();
    let text = [description.as_bytes(), b"\0"].concat();
    let mut file = with_tag(tiff(false, false, 8, &[], &[&text[..], planes].concat()), 270, at as u64);
    let count = usize::from(u16::from_le_bytes([file[8], file[9]]));
    for entry in (0..count).map(|i| 10 + 12 * i) {
        match u16::from_le_bytes([file[entry], file[entry + 1]]) {
            270 => {
                file[entry + 2] = 2;
                file[entry + 4..entry + 8].copy_from_slice(&(text.len() as u32).to_le_bytes());
            }
            273 => file[entry + 8..entry + 12].copy_from_slice(&((at + text.len()) as u32).to_le_bytes()),
            _ => {}
        }
    }
    file
}

#[test]
fn a_page_of_tifffile_that_stands_for_all_planes_is_read() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.tif");
    let (planes, values) = two_slices();
    let warnings = |description: &str, planes: &[u8]| {
        fs::write(&path, described(description, planes)).unwrap();
        let options = OpenOptions::default();
        let found = pumice_formats::probe(&path, &options).unwrap();
        (found.info.dims, options.warnings.list().join("\n"))
    };
    let (dims, said) = warnings(r#"{"shape": [2, 5, 7], "axes": "ZYX", "truncated": true}"#, &planes);
    assert!(dims == [7, 5, 2] && !said.contains("planes"), "{said}");
    assert_eq!(read(&path), Ok(values));
    let (dims, said) = warnings(r#"{"shape": [2, 5, 7, 1]}"#, &planes);
    assert!(
        dims == [7, 5, 2] && said.contains("its 2 planes are; they are read as slices along z"),
        "{said}"
    );
    // Time steps are chosen.
    let (dims, _) = warnings(r#"{"shape": [2, 5, 7], "axes": "TYX"}"#, &planes);
    assert_eq!(dims, [7, 5, 1]);
    assert!(read(&path).unwrap_err().contains("--time-step"));
    // Control: a description of one plane. One of other pages is named, and one of more planes than there are is refused.
    assert_eq!(warnings(r#"{"shape": [5, 7]}"#, &planes).0, [7, 5, 1]);
    let (dims, said) = warnings(r#"{"shape": [2, 9, 7]}"#, &planes);
    assert!(
        dims == [7, 5, 1] && said.contains("the shape 2 × 9 × 7, but the file has 1 pages of 7 × 5"),
        "{said}"
    );
    fs::write(&path, described(r#"{"shape": [3, 5, 7]}"#, &planes)).unwrap();
    let error = read(&path).unwrap_err();
    assert!(error.contains("the description promises 3 planes") && error.lines().count() == 1, "{error}");
}
