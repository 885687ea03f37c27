//! Reads and writes arrays as .npy files (numpy's `numpy.lib.format`, version 1.0), to exchange data with scripts.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

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

/// Reads a .npy file of 32-bit floats and checks that it has `expected` values.
pub fn read_npy_f32(path: &Path, expected: usize) -> Result<Vec<f32>> {
    let bytes = std::fs::read(path).map_err(io(path))?;
    let header = match bytes.get(8..10) {
        Some(&[low, high]) if bytes.starts_with(b"\x93NUMPY\x01") => {
            usize::from(u16::from_le_bytes([low, high]))
        }
        _ => return Err(SessionError::Caller(format!("{}: expected .npy, version 1", path.display()))),
    };
    let values = bytes.get(10 + header..).unwrap_or(&[]);
    if values.len() != 4 * expected || !bytes[..10 + header].windows(3).any(|w| w == b"<f4") {
        return Err(SessionError::Caller(format!(
            "{}: expected {expected} floats of 32 bits, got {} bytes",
            path.display(),
            values.len()
        )));
    }
    Ok(values.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
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
        std::fs::write(&path, b"no array").unwrap();
        assert!(read_npy_f32(&path, 6).unwrap_err().to_string().contains("a.npy"));
    }
}
