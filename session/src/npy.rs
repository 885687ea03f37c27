//! Reads and writes arrays as .npy files (numpy's `numpy.lib.format`, version 1.0), to exchange data with scripts.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;

use pumice_core::open_input;
use pumice_core::reserve::reserved;

use crate::error::{Result, SessionError, io};

/// Writes a C-ordered array; `kind` is numpy's name of its element type.
pub fn write_npy(path: &Path, kind: &str, shape: &[usize], bytes: &[u8]) -> Result<()> {
    write_npy_with(path, kind, shape, |out| out.write_all(bytes))
}

/// As [`write_npy`], of an array whose bytes `write` produces.
pub fn write_npy_with(
    path: &Path,
    kind: &str,
    shape: &[usize],
    write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<()> {
    let sizes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({sizes}), }}");
    // Magic, version and length take 10 bytes; the whole header is padded to a multiple of 64 bytes and ends with a line break.
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let written = || {
        let mut out = BufWriter::new(File::create(path)?);
        out.write_all(b"\x93NUMPY\x01\x00")?;
        out.write_all(&(header.len() as u16).to_le_bytes())?;
        out.write_all(header.as_bytes())?;
        write(&mut out)?;
        out.flush()
    };
    written().map_err(io(path))
}

/// Reads a .npy file of 32-bit floats and checks that it has `expected` values. Nothing is allocated for a file of another length.
///
/// # Errors
/// One line: the file cannot be read, is no such array, or has other than `expected` values; memory is short.
pub fn read_npy_f32(path: &Path, expected: usize) -> Result<Vec<f32>> {
    let failed = |e: std::io::Error| io(path)(e);
    let file = open_input(path).map_err(failed)?;
    let length = file.metadata().map_err(failed)?.len();
    let mut file = BufReader::new(file);
    let refuse = |what: &str| SessionError::Caller(format!("{}: {what}", path.display()));

    // Magic and version, the length of the header, the header.
    let mut start = [0; 10];
    if length < start.len() as u64 {
        return Err(refuse("expected .npy, version 1"));
    }
    file.read_exact(&mut start).map_err(failed)?;
    if !start.starts_with(b"\x93NUMPY\x01") {
        return Err(refuse("expected .npy, version 1"));
    }
    let header_bytes = u64::from(u16::from_le_bytes([start[8], start[9]]));
    let mut header = Vec::new();
    (&mut file).take(header_bytes).read_to_end(&mut header).map_err(failed)?;
    let got = length.saturating_sub(start.len() as u64 + header_bytes);
    let is_float = header.len() as u64 == header_bytes && header.windows(3).any(|w| w == b"<f4");
    if got != 4 * expected as u64 || !is_float {
        return Err(refuse(&format!("expected {expected} floats of 32 bits, got {got} bytes")));
    }

    // The values, a piece at a time.
    let what = format!("{}: {expected} floats", path.display());
    let mut values = reserved(expected, &what).map_err(pumice_core::Error::from)?;
    let mut piece = [0; 1 << 14];
    while values.len() < expected {
        let some = &mut piece[..4 * (expected - values.len()).min(1 << 12)];
        file.read_exact(some).map_err(failed)?;
        values.extend(some.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        let values = [1.5f32, -2.0, 3.25, 0.0, 7.0, 8.0];
        write_npy(&path, "<f4", &[2, 3], bytemuck::cast_slice(&values)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        // numpy requires that the data begins at a multiple of 64 bytes.
        assert_eq!((bytes.len() - 24) % 64, 0);
        assert!(bytes[10..].starts_with(b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, ), }"));
        assert_eq!(read_npy_f32(&path, 6).unwrap(), values);
        assert!(read_npy_f32(&path, 5).is_err());
        // More values than a piece, and than the file has: 2⁵⁹ of them are refused by the file's length, before any memory is asked for.
        let many: Vec<f32> = (0..10_000u16).map(f32::from).collect();
        write_npy(&path, "<f4", &[10_000], bytemuck::cast_slice(&many)).unwrap();
        assert_eq!(read_npy_f32(&path, 10_000).unwrap(), many);
        let text = read_npy_f32(&path, 1 << 59).unwrap_err().to_string();
        assert!(text.ends_with("expected 576460752303423488 floats of 32 bits, got 40000 bytes"), "{text}");
        // A file that ends within its header, or has another type.
        std::fs::write(&path, &bytes[..60]).unwrap();
        assert!(read_npy_f32(&path, 0).unwrap_err().to_string().contains("expected 0 floats"));
        std::fs::write(&path, bytes.iter().map(|&b| if b == b'f' { b'i' } else { b }).collect::<Vec<_>>())
            .unwrap();
        assert!(read_npy_f32(&path, 6).unwrap_err().to_string().contains("got 24 bytes"));
        std::fs::write(&path, b"\x93NUMPY\x01").unwrap();
        assert!(read_npy_f32(&path, 6).unwrap_err().to_string().contains("expected .npy, version 1"));
        assert!(read_npy_f32(folder.path(), 6).unwrap_err().to_string().contains("folder"));
        std::fs::write(&path, b"no array").unwrap();
        assert!(read_npy_f32(&path, 6).unwrap_err().to_string().contains("a.npy"));
    }
}
