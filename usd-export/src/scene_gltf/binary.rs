//! The binary part of a file, planned before anything is written: sections one after the other, each of a known length.
//!
//! ```text
//! 0        section 0: vertices of a surface         a piece at a time, from its rectangles
//!          section 1: …
//!          last section: corners of triangles       0 1 2 0 2 3, 4 5 6 4 6 7, …  the same for all surfaces, which begin at its start
//! ```
//! Offsets and the length are known first, since the JSON part, which names them, comes first in a `.glb`. Each section has a multiple of
//! four bytes, so everything is aligned.

use std::io::{Result, Write};

/// Writes a section.
type WriteSection<'a> = Box<dyn Fn(&mut dyn Write) -> Result<()> + 'a>;

/// Sections in the order of the file.
#[derive(Default)]
pub(super) struct Binary<'a> {
    sections: Vec<WriteSection<'a>>,
    bytes: u64,
}

impl<'a> Binary<'a> {
    /// Appends a section of `bytes` bytes, a multiple of four, which `write` will write. Returns its offset in bytes.
    pub(super) fn add(&mut self, bytes: u64, write: impl Fn(&mut dyn Write) -> Result<()> + 'a) -> u64 {
        let offset = self.bytes;
        self.bytes += bytes;
        self.sections.push(Box::new(write));
        offset
    }

    /// Appends a section of values with `bytes_each` bytes, which `put` appends to a buffer, a piece of them at a time.
    pub(super) fn add_values<T>(
        &mut self,
        values: impl AsRef<[T]> + 'a,
        bytes_each: u64,
        put: impl Fn(&T, &mut Vec<u8>) + 'a,
    ) -> u64
    where
        T: 'a,
    {
        let bytes = bytes_each * values.as_ref().len() as u64;
        self.add(bytes, move |out| {
            let mut buffer = Vec::new();
            values.as_ref().chunks(PIECE).try_for_each(|piece| {
                buffer.clear();
                piece.iter().for_each(|value| put(value, &mut buffer));
                out.write_all(&buffer)
            })
        })
    }

    /// Bytes of all sections.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Writes all sections.
    ///
    /// # Errors
    /// Those of `out`.
    pub(super) fn write(&self, out: &mut dyn Write) -> Result<()> {
        self.sections.iter().try_for_each(|section| section(out))
    }
}

/// Values that are produced at a time.
const PIECE: usize = 4096;

/// Appends numbers of single precision.
pub(super) fn put_floats<const N: usize>(values: [f32; N], buffer: &mut Vec<u8>) {
    values.iter().for_each(|value| buffer.extend_from_slice(&value.to_le_bytes()));
}

/// Writes the corners of triangles that have vertices of their own, which follow each other: `elements` times a `pattern`, each with
/// `vertices_each` vertices.
pub(super) fn write_corners(
    elements: u64,
    vertices_each: u64,
    pattern: &[u64],
    out: &mut dyn Write,
) -> Result<()> {
    let mut buffer = Vec::new();
    for start in (0..elements).step_by(PIECE) {
        buffer.clear();
        for element in start..elements.min(start + PIECE as u64) {
            for corner in pattern {
                // Whoever asks has checked that a mesh has fewer than 2³² vertices.
                buffer.extend_from_slice(&((vertices_each * element + corner) as u32).to_le_bytes());
            }
        }
        out.write_all(&buffer)?;
    }
    Ok(())
}
