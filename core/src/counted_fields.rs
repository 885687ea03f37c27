//! The distinct fields of a chunk's nodes with the number of their uses: in memory, or on disk in parts that fit there.
//!
//! ```text
//! uses ─► part by the field's pattern ─► sorted, counted ─► (pattern, field, uses) …      all fields of one pattern are in one part
//! ```

use rayon::prelude::*;

use crate::Result;
use crate::leaves::least_image;
use crate::reserve::{collected, zeroed};
use crate::spool::{Scratch, Spool};

/// What memory is for, in errors.
const FIELDS: &str = "a list of the distinct fields of a volume";

/// Most parts: each has a buffer.
const MOST_PARTS: u64 = 256;

/// A distinct field, its pattern, and how often it is used.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Counted {
    pub(crate) pattern: u64,
    pub(crate) field: u64,
    pub(crate) uses: u64,
}

/// Collects the fields that nodes use.
pub(crate) struct CountedFields<'a> {
    parts: Vec<Spool<'a>>,
    scratch: &'a Scratch,
    /// Bytes that the counted fields of each part may take in memory.
    part_bytes: u64,
}

/// Distinct fields by part, each sorted by pattern.
pub(crate) struct CountedParts<'a>(Vec<Spool<'a>>);

impl<'a> CountedFields<'a> {
    /// For at most `fields` uses; their parts take at most some `most_bytes` each while they are counted.
    pub(crate) fn new(scratch: &'a Scratch, fields: u64, most_bytes: u64) -> Self {
        // While a part is counted, a use takes 8 bytes, and a distinct field 24 more.
        let parts = (32 * fields).div_ceil(most_bytes.max(1 << 20)).clamp(1, MOST_PARTS);
        let part_bytes = if parts == 1 { u64::MAX } else { most_bytes / parts };
        Self { parts: (0..parts).map(|_| Spool::new(scratch, part_bytes)).collect(), scratch, part_bytes }
    }

    /// Adds uses.
    pub(crate) fn add(&mut self, fields: &[u64]) -> Result<()> {
        let count = self.parts.len() as u64;
        if let [only] = &mut self.parts[..] {
            return only.write(bytemuck::cast_slice(fields));
        }
        for field in fields {
            // Fibonacci hashing: the product's upper bits depend on all bits of the pattern.
            let upper = least_image(*field).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32;
            let part = (upper * count) >> 32;
            self.parts[part as usize].write(&field.to_ne_bytes())?;
        }
        Ok(())
    }

    /// Counts them.
    pub(crate) fn counted(self) -> Result<CountedParts<'a>> {
        let mut parts = Vec::new();
        for mut part in self.parts {
            let mut uses: Vec<u64> = zeroed((part.len() / 8) as usize, FIELDS)?;
            part.reader().read(bytemuck::cast_slice_mut(&mut uses))?;
            part.clear();
            uses.par_sort_unstable();
            let count = |same: &[u64]| Counted { pattern: 0, field: same[0], uses: same.len() as u64 };
            let distinct = || uses.chunk_by(|a, b| a == b);
            let mut counted: Vec<Counted> = collected(distinct().count(), distinct().map(count), FIELDS)?;
            drop(uses);
            counted.par_iter_mut().for_each(|c| c.pattern = least_image(c.field));
            counted.par_sort_unstable();
            let mut spool = Spool::new(self.scratch, self.part_bytes);
            spool.write(bytemuck::cast_slice(&counted))?;
            parts.push(spool);
        }
        Ok(CountedParts(parts))
    }
}

impl CountedParts<'_> {
    /// Calls `visit` with the fields of each part; all fields of one pattern come together.
    pub(crate) fn for_each(&self, mut visit: impl FnMut(&[Counted]) -> Result<()>) -> Result<()> {
        for part in &self.0 {
            let mut counted: Vec<Counted> = Vec::new();
            part.reader().values((part.len() / size_of::<Counted>() as u64) as usize, &mut counted)?;
            visit(&counted)?;
        }
        Ok(())
    }
}
