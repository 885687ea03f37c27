//! The voxel masks of the cells of bricks, in a quarter of the bytes where they repeat.
//!
//! ```text
//! codes   3    0    3    65535    1     u16, one for each cell that is neither empty nor full
//! table   [mask 0, mask 1, mask 2, mask 3 …]    at most 65,535 masks, rising
//! rare    (3, mask)                             those that are not in the table, by their place among the codes
//! ```
//! In a cortex of 512³ voxels, 275,219 cells have 66,214 masks: 2.2 MB become 1.1. Reading one takes a second access to memory, within a
//! table of half a megabyte. Where masks hardly repeat, as in noise, they are stored as they are.

use std::ops::Range;
use std::sync::Arc;

use pumice_core::NoMemory;
use pumice_core::stored::{put, take};

/// Code of a mask that is not in the table.
const RARE: u16 = u16::MAX;

/// Masks by their place (see the module).
#[derive(Debug)]
pub(in crate::geometry) enum Fields {
    /// As they are.
    Plain(Vec<u64>),
    /// As codes.
    Coded(Coded),
}

#[derive(Debug)]
pub(in crate::geometry) struct Coded {
    codes: Vec<u16>,
    /// Shared by bricks that were made of others.
    table: Arc<[u64]>,
    rare: Vec<(u32, u64)>,
}

impl Default for Fields {
    fn default() -> Self {
        Self::Plain(Vec::new())
    }
}

impl Fields {
    /// None yet, to be appended in the form of `like`.
    pub(super) fn empty_like(like: &Self) -> Self {
        match like {
            Self::Plain(_) => Self::default(),
            Self::Coded(coded) => {
                Self::Coded(Coded { codes: Vec::new(), table: Arc::clone(&coded.table), rare: Vec::new() })
            }
        }
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Self::Plain(fields) => fields.len(),
            Self::Coded(coded) => coded.codes.len(),
        }
    }

    #[inline(always)]
    pub(super) fn at(&self, place: usize) -> u64 {
        match self {
            Self::Plain(fields) => fields[place],
            Self::Coded(coded) => match coded.codes[place] {
                RARE => coded.rare_at(place),
                code => coded.table[usize::from(code)],
            },
        }
    }

    pub(super) fn push(&mut self, field: u64) {
        match self {
            Self::Plain(fields) => fields.push(field),
            Self::Coded(coded) => coded.push(field),
        }
    }

    /// Appends masks of others, from one place up to another.
    pub(super) fn extend_from(&mut self, other: &Self, places: Range<usize>) {
        match (&mut *self, other) {
            (Self::Coded(coded), Self::Coded(other)) if Arc::ptr_eq(&coded.table, &other.table) => {
                for place in places {
                    match other.codes[place] {
                        RARE => coded.push(other.rare_at(place)),
                        code => coded.codes.push(code),
                    }
                }
            }
            _ => places.for_each(|place| self.push(other.at(place))),
        }
    }

    /// Makes codes of plain masks where these take less. To be called when all are there.
    pub(super) fn pack(&mut self) {
        if let Self::Plain(fields) = self {
            let coded = Coded::new(fields);
            if coded.bytes() < size_of_val(fields.as_slice()) as u64 {
                *self = Self::Coded(coded);
            }
        }
    }

    /// Frees memory that is not in use.
    pub(super) fn shrink_to_fit(&mut self) {
        match self {
            Self::Plain(fields) => fields.shrink_to_fit(),
            Self::Coded(coded) => {
                coded.codes.shrink_to_fit();
                coded.rare.shrink_to_fit();
            }
        }
    }

    /// Appends the masks to bytes of a temporary file.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(super) fn put(&self, out: &mut Vec<u8>) -> Result<(), NoMemory> {
        let Self::Coded(Coded { codes, table, rare }) = self else {
            let Self::Plain(fields) = self else { return Ok(()) };
            put::<u64>(out, fields)?;
            return put::<u16>(out, &[]);
        };
        put::<u64>(out, table)?;
        put::<u16>(out, codes)?;
        put::<u32>(out, &rare.iter().map(|of| of.0).collect::<Vec<_>>())?;
        put::<u64>(out, &rare.iter().map(|of| of.1).collect::<Vec<_>>())
    }

    /// Takes masks from bytes that [`Fields::put`] appended to.
    pub(super) fn take(bytes: &mut &[u8]) -> Option<Self> {
        let (masks, codes) = (take::<u64>(bytes)?, take::<u16>(bytes)?);
        if codes.is_empty() {
            return Some(Self::Plain(masks));
        }
        let (places, fields) = (take::<u32>(bytes)?, take::<u64>(bytes)?);
        let rare = places.into_iter().zip(fields).collect();
        Some(Self::Coded(Coded { codes, table: masks.into(), rare }))
    }

    /// Size on the heap in bytes.
    pub(super) fn bytes(&self) -> u64 {
        match self {
            Self::Plain(fields) => (fields.capacity() * size_of::<u64>()) as u64,
            Self::Coded(coded) => coded.bytes(),
        }
    }
}

impl Coded {
    /// The table holds the masks with the most uses; of those with equally many, the lowest.
    fn new(fields: &[u64]) -> Self {
        let mut sorted = fields.to_vec();
        sorted.sort_unstable();
        let mut uses: Vec<(usize, u64)> =
            sorted.chunk_by(|a, b| a == b).map(|same| (same.len(), same[0])).collect();
        uses.sort_unstable_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
        uses.truncate(usize::from(RARE));
        let mut table: Vec<u64> = uses.iter().map(|of| of.1).collect();
        table.sort_unstable();
        let mut coded =
            Self { codes: Vec::with_capacity(fields.len()), table: table.into(), rare: Vec::new() };
        fields.iter().for_each(|&field| coded.push(field));
        coded
    }

    fn push(&mut self, field: u64) {
        self.codes.push(match self.table.binary_search(&field) {
            Ok(code) => code as u16,
            Err(_) => {
                // (Bricks have fewer than 2³² masks.)
                self.rare.push((self.codes.len() as u32, field));
                RARE
            }
        });
    }

    #[cold]
    fn rare_at(&self, place: usize) -> u64 {
        self.rare[self.rare.partition_point(|&(at, _)| (at as usize) < place)].1
    }

    fn bytes(&self) -> u64 {
        let bytes = self.codes.capacity() * size_of::<u16>()
            + size_of_val(&*self.table)
            + self.rare.capacity() * size_of::<(u32, u64)>();
        bytes as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(all: &[u64]) -> Fields {
        let mut fields = Fields::default();
        all.iter().for_each(|&field| fields.push(field));
        fields.pack();
        fields.shrink_to_fit();
        fields
    }

    fn mixed(i: u64) -> u64 {
        i.wrapping_mul(0x9E37_79B9_7F4A_7C15)
    }

    /// Few masks that repeat, more than a table can hold, and such that never repeat: each is read back, in fewer bytes than plain ones or
    /// in as many.
    #[test]
    fn masks_are_read_back_and_take_no_more_bytes_than_plain_ones() {
        for (count, kinds, is_coded) in
            [(0u64, 1, false), (1000, 30, true), (300_000, 70_000, true), (100_000, 100_000, false)]
        {
            let all: Vec<u64> = (0..count).map(|i| mixed(i % kinds)).collect();
            let fields = packed(&all);
            assert_eq!(matches!(fields, Fields::Coded(_)), is_coded, "{count} of {kinds}");
            assert!((0..all.len()).all(|i| fields.at(i) == all[i]) && fields.len() == all.len());
            assert!(fields.bytes() <= 8 * count, "{} bytes of {count}", fields.bytes());
        }
    }

    /// What is appended in the form of others may have masks that those lack.
    #[test]
    fn masks_that_a_table_lacks_are_kept_beside_it() {
        let like = packed(&[5, 6, 7].repeat(100));
        let mut fields = Fields::empty_like(&like);
        let all = [6, 9, 5, 1, 7, 7, 9];
        all.iter().for_each(|&field| fields.push(field));
        fields.pack();
        let Fields::Coded(coded) = &fields else { panic!("expected codes") };
        assert_eq!(coded.rare, [(1, 9), (3, 1), (6, 9)]);
        assert!(all.iter().enumerate().all(|(i, &field)| fields.at(i) == field));
    }
}
