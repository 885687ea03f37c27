//! Writes a package (`usdz`): an archive of a stage and the pictures that it refers to, which programs read without unpacking.
//!
//! ```text
//! header of stage.usdc, filled so that what follows begins at a multiple of 64 bytes
//! stage.usdc, as it is              the first file is what programs open
//! header of sky.exr, filled
//! sky.exr, as it is
//! …
//! directory of the ZIP archive
//! ```
//! Nothing is compressed or encrypted. Sizes and offsets have 32 bits: the specification knows no ZIP64, and Pixar's library reads none.
//! Source: Usdz File Format Specification 1.3.

use std::io::{Read, Seek, Write};

use pumice_core::Error;
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::{ExportError, Result};

/// Multiple of bytes at which files begin.
const ALIGNMENT: u16 = 64;
/// Largest size of a package: offsets in it have 32 bits.
const MOST_BYTES: u64 = u32::MAX as u64;
/// More than the headers of a file take: both, the name twice, and what fills up to the alignment.
const HEADER_BYTES: u64 = 1024;

/// A file of a package.
pub struct PackedFile<'a, R> {
    /// Its name in the package: letters, digits, dots.
    pub name: &'a str,
    /// Its bytes, from where the reader stands.
    pub from: R,
    /// Their number.
    pub bytes: u64,
}

/// Writes a package of these files, the stage first.
///
/// # Errors
/// [`Error::Limit`] for more than 4 GiB; [`ExportError::Write`] where `out` or a file fails.
pub fn write_usdz<R: Read>(files: Vec<PackedFile<'_, R>>, out: &mut (impl Write + Seek)) -> Result<()> {
    let whole =
        files.iter().fold(0u64, |sum, file| sum.saturating_add(file.bytes).saturating_add(HEADER_BYTES));
    if whole > MOST_BYTES {
        let what = "bytes of a usdz package (write .usdc, which has no such limit)".into();
        return Err(Error::Limit { what, limit: MOST_BYTES, got: whole }.into());
    }
    let mut zip = ZipWriter::new(out);
    let written = files.into_iter().try_for_each(|file| -> Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .with_alignment(ALIGNMENT);
        zip.start_file(file.name, options).map_err(of_zip)?;
        let copied = std::io::copy(&mut file.from.take(file.bytes), &mut zip)?;
        if copied != file.bytes {
            let name = file.name;
            let what = format!("{name}: expected {} bytes for a package, got {copied}", file.bytes);
            return Err(std::io::Error::new(std::io::ErrorKind::UnexpectedEof, what).into());
        }
        Ok(())
    });
    match written {
        Ok(()) => zip.finish().map(drop).map_err(of_zip),
        Err(error) => {
            // Dropped, it would write a directory to a file that has failed already, and complain on the standard error.
            std::mem::forget(zip);
            Err(error)
        }
    }
}

fn of_zip(error: ZipError) -> ExportError {
    match error {
        ZipError::Io(source) => ExportError::Write(source),
        other => ExportError::Write(std::io::Error::other(other)),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    #[test]
    fn more_than_offsets_can_say_is_refused_before_anything_is_written() {
        let mut out = Cursor::new(Vec::new());
        let files = |bytes| {
            let of = |name, bytes| PackedFile { name, from: std::io::empty(), bytes };
            vec![of("stage.usdc", bytes), of("sky.exr", 5000)]
        };
        let error = write_usdz(files(MOST_BYTES - 6000), &mut out).unwrap_err().to_string();
        assert!(
            error.starts_with("bytes of a usdz package (write .usdc") && out.get_ref().is_empty(),
            "{error}"
        );
        // A file that is shorter than was said.
        let error = write_usdz(files(7), &mut out).unwrap_err().to_string();
        assert!(error.contains("stage.usdc: expected 7 bytes for a package, got 0"), "{error}");
    }
}
