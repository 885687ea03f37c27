//! Sorts the header attributes of OpenEXR files by name.
//!
//! ```text
//! magic number, version   4 + 4 bytes
//! attributes              for each: name, 0, type, 0, size (4 bytes, little-endian), value; after the last: 0
//! rest of the file        its offsets count from the file's beginning, so that attributes may change places
//! ```
//! The order means nothing to readers. The crate `exr` keeps attributes that it does not know in a hash map, and so writes them in a
//! different order each time; but the same picture must give the same bytes.

use std::io::{Result, Seek, SeekFrom, Write};

/// Magic number and version.
const BEFORE_ATTRIBUTES: usize = 8;

/// A writer for a file of one part: it holds the header back until it is complete, sorts it, and passes everything on.
pub(crate) struct SortedHeader<W> {
    inner: W,
    /// The bytes written so far, until the header is complete.
    held: Option<Vec<u8>>,
}

impl<W: Write> SortedHeader<W> {
    /// A writer at the beginning of a file.
    pub(crate) fn new(inner: W) -> Self {
        Self { inner, held: Some(Vec::new()) }
    }

    /// Passes on the bytes that are held back, even if the header is incomplete.
    fn release(&mut self) -> Result<()> {
        match self.held.take() {
            Some(held) => self.inner.write_all(&held),
            None => Ok(()),
        }
    }
}

impl<W: Write> Write for SortedHeader<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let Some(held) = &mut self.held else { return self.inner.write(bytes) };
        held.extend_from_slice(bytes);
        if sort(held) {
            self.release()?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        self.release()?;
        self.inner.flush()
    }
}

impl<W: Write + Seek> Seek for SortedHeader<W> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.release()?;
        self.inner.seek(to)
    }
}

/// Sorts the attributes at a file's beginning; returns `false` if the header is incomplete.
fn sort(file: &mut [u8]) -> bool {
    let Some(attributes) = attributes(file) else { return false };
    let mut sorted: Vec<&[u8]> = attributes.iter().map(|&(start, end)| &file[start..end]).collect();
    // Compare including the final 0 byte, which sorts before all others.
    sorted.sort_unstable();
    let sorted = sorted.concat();
    file[BEFORE_ATTRIBUTES..][..sorted.len()].copy_from_slice(&sorted);
    true
}

/// The byte range of each attribute; `None` if the header is incomplete.
fn attributes(file: &[u8]) -> Option<Vec<(usize, usize)>> {
    let after_text = |at: usize| Some(at + 1 + file.get(at..)?.iter().position(|&b| b == 0)?);
    let mut found = Vec::new();
    let mut start = BEFORE_ATTRIBUTES;
    while *file.get(start)? != 0 {
        let size_at = after_text(after_text(start)?)?;
        let (size, _) = file.get(size_at..)?.split_first_chunk::<4>()?;
        let end = size_at + 4 + u32::from_le_bytes(*size) as usize;
        file.get(start..end)?;
        found.push((start, end));
        start = end;
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    #[test]
    fn attributes_are_sorted_however_they_come() {
        let attribute = |name: &str, value: &str| {
            [format!("{name}\0string\0").as_bytes(), &(value.len() as u32).to_le_bytes(), value.as_bytes()]
                .concat()
        };
        // Values may hold any bytes: here, bytes that look like the end of the header.
        let (a, ab, b) = (attribute("a", "z\0\0\0"), attribute("ab", ""), attribute("b", "\0"));
        let file = |parts: [&[u8]; 3]| [b"magicver", parts[0], parts[1], parts[2], b"\0rest\0"].concat();
        let expected = file([&a, &ab, &b]);
        for parts in [[&a, &ab, &b], [&b, &ab, &a], [&ab, &b, &a]] {
            let file = file(parts.map(Vec::as_slice));
            for step in [1, 3, 7, file.len()] {
                let mut out = Cursor::new(Vec::new());
                let mut writer = SortedHeader::new(&mut out);
                file.chunks(step).for_each(|part| writer.write_all(part).unwrap());
                writer.seek(SeekFrom::Start(0)).unwrap();
                writer.write_all(b"MAGIC").unwrap();
                writer.flush().unwrap();
                let got = out.into_inner();
                assert_eq!((&got[..5], &got[5..]), (&b"MAGIC"[..], &expected[5..]), "{step}");
            }
        }
    }
}
