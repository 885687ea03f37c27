//! The distinct fields of a chunk's nodes with the number of their uses: in memory, or on disk in parts that fit there.
//!
//! ```text
//! uses ─► part by the field's pattern ─► sorted, counted ─► (pattern, field, uses) …      all fields of one pattern are in one part
//! ```
//! A part is counted in pieces: in noise most fields are single voxels, whose few patterns have most uses of all.

use rayon::prelude::*;

use crate::Result;
use crate::leaves::least_image;
use crate::reserve::{make_room, zeroed};
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
    /// Uses that are counted at once.
    piece_uses: u64,
}

/// Distinct fields by part, each sorted by pattern.
pub(crate) struct CountedParts<'a>(Vec<Spool<'a>>);

impl<'a> CountedFields<'a> {
    /// For at most `fields` uses; their parts take at most some `most_bytes` each while they are counted.
    pub(crate) fn new(scratch: &'a Scratch, fields: u64, most_bytes: u64) -> Self {
        // While a part is counted, a use takes 8 bytes, and a distinct field 24 more.
        let parts = (32 * fields).div_ceil(most_bytes.max(1 << 20)).clamp(1, MOST_PARTS);
        let part_bytes = if parts == 1 { u64::MAX } else { most_bytes / parts };
        let piece_uses = (most_bytes.max(1 << 20) / 32).max(1);
        let parts = (0..parts).map(|_| Spool::new(scratch, part_bytes)).collect();
        Self { parts, scratch, part_bytes, piece_uses }
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
            let mut counted: Vec<Counted> = Vec::new();
            let (mut reader, mut left, mut distinct) = (part.reader(), part.len() / 8, 0);
            while left > 0 {
                let mut uses: Vec<u64> = zeroed(left.min(self.piece_uses) as usize, FIELDS)?;
                reader.read(bytemuck::cast_slice_mut(&mut uses))?;
                left -= uses.len() as u64;
                uses.par_sort_unstable();
                let same = || uses.chunk_by(|a, b| a == b);
                make_room(&mut counted, same().count(), FIELDS)?;
                let count = |same: &[u64]| Counted { pattern: 0, field: same[0], uses: same.len() as u64 };
                counted.extend(same().map(count));
                // Of several pieces, once what they have in common may be half of it.
                if counted.len() > uses.len().max(2 * distinct) || left == 0 {
                    add_up(&mut counted);
                    distinct = counted.len();
                }
            }
            part.clear();
            counted.par_iter_mut().for_each(|c| c.pattern = least_image(c.field));
            counted.par_sort_unstable();
            let mut spool = Spool::new(self.scratch, self.part_bytes);
            spool.write(bytemuck::cast_slice(&counted))?;
            parts.push(spool);
        }
        Ok(CountedParts(parts))
    }
}

/// Adds up the uses of each field.
fn add_up(counted: &mut Vec<Counted>) {
    counted.par_sort_unstable_by_key(|c| c.field);
    counted.dedup_by(|later, first| {
        let is_same = later.field == first.field;
        first.uses += if is_same { later.uses } else { 0 };
        is_same
    });
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

#[cfg(test)]
mod tests {
    use super::*;

    /// In several parts and pieces the counts are those of all uses together.
    #[test]
    fn counts_are_those_of_a_plain_count() {
        let scratch = Scratch::new(&std::env::temp_dir());
        let mut state = 9u64;
        let uses: Vec<u64> = (0..300_000)
            .map(|_| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                // Most are single voxels.
                if state >> 61 == 0 { 1 + (state >> 40 & 0xFFF) } else { 1 << (state >> 58) }
            })
            .collect();
        let mut expected = std::collections::BTreeMap::new();
        uses.iter().for_each(|&field| *expected.entry(field).or_insert(0u64) += 1);
        for most in [0, u64::MAX] {
            let mut fields = CountedFields::new(&scratch, uses.len() as u64, most);
            uses.chunks(64).for_each(|some| fields.add(some).unwrap());
            let mut got = std::collections::BTreeMap::new();
            let counted = fields.counted().unwrap();
            assert_eq!(counted.0.len() > 1, most == 0);
            let add = |part: &[Counted]| {
                assert!(part.is_sorted());
                for c in part {
                    assert_eq!(c.pattern, least_image(c.field));
                    assert_eq!(got.insert(c.field, c.uses), None);
                }
                Ok(())
            };
            counted.for_each(add).unwrap();
            assert!(got == expected, "{most}");
        }
    }
}
