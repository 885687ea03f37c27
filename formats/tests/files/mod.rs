//! Helpers that write volumes byte by byte and read them whole, shared by the tests of several formats.

#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests"
)]

use std::io::Write as _;
use std::path::{Path, PathBuf};

use pumice_core::VolumeInfo;
use pumice_formats::{OpenOptions, open};

/// Sizes that all differ, so that swapped axes show.
pub const DIMS: [usize; 3] = [3, 4, 5];

/// The label of a voxel; it differs from all others and fits in a byte.
pub fn label(x: usize, y: usize, z: usize) -> u64 {
    (1 + x + 5 * y + 25 * z) as u64
}

/// All labels, x fastest.
pub fn labels() -> Vec<u64> {
    let [nx, ny, nz] = DIMS;
    (0..nx * ny * nz).map(|i| label(i % nx, i / nx % ny, i / (nx * ny))).collect()
}

/// The lowest `bytes` bytes of each number, in the given byte order.
pub fn integers(values: &[u64], bytes: usize, big_endian: bool) -> Vec<u8> {
    let mut out = Vec::new();
    for value in values {
        let little = value.to_le_bytes();
        let part = &little[..bytes];
        if big_endian { out.extend(part.iter().rev()) } else { out.extend(part) }
    }
    out
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Reads the whole volume, x fastest; returns the error as text, which must be one line.
pub fn read(path: &Path, options: &OpenOptions) -> Result<(VolumeInfo, Vec<u64>), String> {
    let one_line = |error: String| {
        assert!(!error.contains('\n') && error.len() < 2000, "{error:?}");
        error
    };
    let mut source = open(path, options).map_err(|e| one_line(e.to_string()))?;
    let info = source.info().clone();
    let dims = info.dims.map(|d| d as usize);
    // Voxels are kept only where there are few, because damaged headers may claim billions.
    let count = dims.iter().product::<usize>();
    let mut voxels = vec![u64::MAX; if count < 1 << 20 { count } else { 0 }];
    while let Some(block) = source.next_block().map_err(|e| one_line(e.to_string()))? {
        if voxels.is_empty() {
            continue;
        }
        for z in 0..block.dims[2] {
            for y in 0..block.dims[1] {
                for x in 0..block.dims[0] {
                    let at = [0, 1, 2].map(|a| (block.origin[a] + [x, y, z][a]) as usize);
                    voxels[at[0] + dims[0] * (at[1] + dims[1] * at[2])] = block.get([x, y, z]);
                }
            }
        }
    }
    Ok((info, voxels))
}

/// Asserts that reading fails with a text that contains every one of `words`.
pub fn refuse(path: &Path, options: &OpenOptions, words: &[&str]) {
    let error = read(path, options).map(|(info, _)| info.dims).unwrap_err();
    assert!(!error.contains('\n'), "{error:?}");
    for word in words {
        assert!(error.contains(word), "expected {word:?} in {error:?}");
    }
}

/// A NIfTI header, version 1 or 2, with an identity sform; tests change its fields.
#[derive(Clone)]
pub struct Nifti {
    pub bytes: Vec<u8>,
    pub version: u8,
    pub big_endian: bool,
}

impl Nifti {
    /// The header of a single file with `datatype` and the voxels of [`labels`].
    pub fn new(version: u8, big_endian: bool, datatype: i64) -> Self {
        let mut header = Self { bytes: vec![0; if version == 1 { 352 } else { 544 }], version, big_endian };
        header.put(0, 4, if version == 1 { 348 } else { 540 });
        if version == 1 {
            header.bytes[344..348].copy_from_slice(b"n+1\0");
        } else {
            header.bytes[4..12].copy_from_slice(b"n+2\0\r\n\x1A\n");
        }
        header.dims(&[3, 4, 5]);
        header.put(if version == 1 { 70 } else { 12 }, 2, datatype);
        (0..4).for_each(|i| header.pixdim(i, 1.0));
        header.float(108, 352.0, true);
        if version == 2 {
            header.put(168, 8, 544);
        }
        header.sform_code(1);
        for row in 0..3 {
            header.srow(row, row, 1.0);
        }
        header
    }

    pub fn put(&mut self, at: usize, bytes: usize, value: i64) {
        let field = integers(&[value as u64], bytes, self.big_endian);
        self.bytes[at..at + bytes].copy_from_slice(&field);
    }

    fn float(&mut self, at: usize, value: f64, narrow_only: bool) {
        if self.version == 1 {
            self.put(at, 4, f32::to_bits(value as f32).into());
        } else if !narrow_only {
            self.put(at, 8, value.to_bits() as i64);
        }
    }

    pub fn dims(&mut self, sizes: &[i64]) {
        let (at, width) = if self.version == 1 { (40, 2) } else { (16, 8) };
        self.put(at, width, sizes.len() as i64);
        for (i, &size) in sizes.iter().enumerate() {
            self.put(at + (i + 1) * width, width, size);
        }
    }

    pub fn pixdim(&mut self, i: usize, value: f64) {
        self.float(if self.version == 1 { 76 + 4 * i } else { 104 + 8 * i }, value, false);
    }

    pub fn vox_offset(&mut self, value: f64) {
        if self.version == 1 { self.float(108, value, true) } else { self.put(168, 8, value as i64) }
    }

    pub fn scale(&mut self, slope: f64, intercept: f64) {
        let (a, b) = if self.version == 1 { (112, 116) } else { (176, 184) };
        self.float(a, slope, false);
        self.float(b, intercept, false);
    }

    pub fn sform_code(&mut self, code: i64) {
        if self.version == 1 { self.put(254, 2, code) } else { self.put(348, 4, code) }
    }

    pub fn srow(&mut self, row: usize, column: usize, value: f64) {
        let i = row * 4 + column;
        self.float(if self.version == 1 { 280 + 4 * i } else { 400 + 8 * i }, value, false);
    }

    /// Uses the qform instead of the sform.
    pub fn qform(&mut self, quaternion: [f64; 3], offset: [f64; 3]) {
        self.sform_code(0);
        if self.version == 1 {
            self.put(252, 2, 1)
        } else {
            self.put(344, 4, 1)
        }
        for i in 0..3 {
            let (q, o) =
                if self.version == 1 { (256 + 4 * i, 268 + 4 * i) } else { (352 + 8 * i, 376 + 8 * i) };
            self.float(q, quaternion[i], false);
            self.float(o, offset[i], false);
        }
    }

    /// The header followed by voxels.
    pub fn file(&self, voxels: &[u8]) -> Vec<u8> {
        [self.bytes.as_slice(), voxels].concat()
    }
}

/// The bytes of a `.npy` file.
pub fn npy(version: u8, header: &str, voxels: &[u8]) -> Vec<u8> {
    let mut out = b"\x93NUMPY".to_vec();
    out.extend([version, 0]);
    let length = header.len() as u32;
    out.extend(&length.to_le_bytes()[..if version == 1 { 2 } else { 4 }]);
    out.extend(header.as_bytes());
    out.extend(voxels);
    out
}

/// A ZIP archive of (name, content), deflated or stored (APPNOTE §4.3).
pub fn zip(members: &[(&str, Vec<u8>)], deflate: bool) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in members {
        let stored = if deflate {
            let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::fast());
            encoder.write_all(content).unwrap();
            encoder.finish().unwrap()
        } else {
            content.clone()
        };
        // Version, flags, method, time, date, CRC, sizes, name length, extra length.
        let mut common = Vec::new();
        for half in [20u16, 0, if deflate { 8 } else { 0 }, 0, 33] {
            common.extend(half.to_le_bytes());
        }
        for word in [crc32fast::hash(content), stored.len() as u32, content.len() as u32] {
            common.extend(word.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend((out.len() as u32).to_le_bytes());
        directory.extend(name.as_bytes());
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.as_bytes());
        out.extend(&stored);
    }
    let start = out.len() as u32;
    out.extend(&directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    let count = (members.len() as u16).to_le_bytes();
    out.extend([count, count].concat());
    out.extend((directory.len() as u32).to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0, 0]);
    out
}

/// A MetaImage header with the lines `extra` and, as its last field, `ElementDataFile`.
pub fn meta(element: &str, extra: &str, data_file: &str) -> String {
    format!(
        "ObjectType = Image\nNDims = 3\nDimSize = 3 4 5\nElementType = {element}\n{extra}ElementDataFile = {data_file}\n"
    )
}
