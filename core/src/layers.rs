//! The cells of one chunk, layer by layer along z, with the voxels that each label has in them: what the search for labels that touch, and the
//! coding of voxels, need of a chunk.
//!
//! ```text
//! layer z:   entries in any order: position x + 256·y, label, mask        in memory or in a scratch file
//!            └─ of more bytes than may be loaded at once: divided into strips of 4 rows when it is first asked for
//! loaded:    starts by position ─► (label, mask) …                        a counting sort; two layers, or strips, are held at once
//! ```
//! An entry takes 8 bytes, and 8 more where the label does not fill the cell. A layer of noise has 64 entries a cell, 64 MiB.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::cell::{Cell, SOLID};
use crate::reserve::{collected, make_room, zeroed};
use crate::spool::{Scratch, Spool};
use crate::volume::CHUNK_CELLS;
use crate::{CHUNK_VOXELS, NoMemory, Result, morton};

/// Cells along a chunk's side.
pub(crate) const SIDE: usize = (CHUNK_VOXELS / 4) as usize;

/// Set in an entry that has a mask behind it.
const MIXED: u64 = 1 << 48;

/// What memory is for, in errors.
const WHAT: &str = "the cells of a layer of the volume";

/// Rows of a strip, and strips of a layer.
const STRIP_ROWS: usize = 4;
const STRIPS: usize = SIDE / STRIP_ROWS;

/// Bytes of a strip that wait in memory while a layer is divided.
const STRIP_BYTES: u64 = 1 << 12;

/// Entries that are read at once while a layer is divided.
const READ_ENTRIES: u64 = 1 << 12;

/// Least bytes of a layer that is loaded as a whole.
const LEAST_WHOLE_BYTES: u64 = 1 << 20;

/// The entries of a layer.
enum Stored<'a> {
    Whole(Spool<'a>),
    Strips(Vec<Spool<'a>>),
}

/// The cells of a chunk by layer.
pub(crate) struct Layers<'a> {
    layers: Vec<Mutex<Stored<'a>>>,
    scratch: &'a Scratch,
    /// Most bytes of entries that are loaded at once.
    most_bytes: u64,
}

/// Entries that are added together, so that the layers are seldom locked.
pub(crate) struct LayerBatch {
    layers: Vec<Vec<u64>>,
}

impl Default for LayerBatch {
    fn default() -> Self {
        Self { layers: vec![Vec::new(); SIDE] }
    }
}

impl LayerBatch {
    /// Adds a label's cells.
    pub(crate) fn add(&mut self, label: u32, cells: &[Cell]) -> std::result::Result<(), NoMemory> {
        for cell in cells {
            let [x, y, z] = morton::decode(cell.key % CHUNK_CELLS);
            let entry = u64::from(x + (SIDE as u32) * y) << 32 | u64::from(label);
            let layer = &mut self.layers[z as usize];
            make_room(layer, 2, WHAT)?;
            if cell.mask == SOLID {
                layer.push(entry);
            } else {
                layer.extend_from_slice(&[entry | MIXED, cell.mask]);
            }
        }
        Ok(())
    }
}

/// A layer's labels and masks by position, of all rows or of some.
#[derive(Default)]
pub(crate) struct Layer {
    /// The first position.
    first: usize,
    /// Where the entries of each position from there on begin; empty where the layer has none.
    starts: Vec<u32>,
    entries: Vec<(u32, u64)>,
}

impl Layer {
    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Labels and masks of the cell at x + 256·y, whose row was loaded.
    #[inline]
    pub(crate) fn at(&self, position: usize) -> &[(u32, u64)] {
        let position = position.wrapping_sub(self.first);
        match self.starts.get(position..position.wrapping_add(2)) {
            Some(&[start, end]) => &self.entries[start as usize..end as usize],
            _ => &[],
        }
    }
}

impl<'a> Layers<'a> {
    /// No cells yet; at most `limit_bytes` of entries are kept in memory.
    pub(crate) fn new(scratch: &'a Scratch, limit_bytes: u64) -> Self {
        let spool = || Spool::new(scratch, (limit_bytes / SIDE as u64).max(512));
        Self {
            layers: (0..SIDE).map(|_| Mutex::new(Stored::Whole(spool()))).collect(),
            scratch,
            // A thread has two layers loaded, in twice these bytes at most, while it reads a third.
            most_bytes: (limit_bytes / 8).max(LEAST_WHOLE_BYTES),
        }
    }

    /// Adds the entries of a batch, which is empty afterwards.
    pub(crate) fn add(&self, batch: &mut LayerBatch) -> Result<()> {
        for (entries, layer) in batch.layers.iter_mut().zip(&self.layers) {
            if !entries.is_empty() {
                let entries = std::mem::take(entries);
                match &mut *lock(layer) {
                    Stored::Whole(spool) => spool.write(bytemuck::cast_slice(&entries))?,
                    Stored::Strips(strips) => add_to_strips(strips, &entries)?,
                }
            }
        }
        Ok(())
    }

    /// Number of rows of the layer `z` that are loaded together: all of them, or so many that their entries may be in memory.
    pub(crate) fn rows_at_once(&self, z: usize) -> Result<usize> {
        let Some(stored) = self.layers.get(z) else { return Ok(SIDE) };
        let mut stored = lock(stored);
        let strips = match &*stored {
            Stored::Strips(_) => return Ok(STRIP_ROWS),
            Stored::Whole(spool) if spool.len() <= self.most_bytes => return Ok(SIDE),
            Stored::Whole(spool) => self.divided(spool)?,
        };
        *stored = Stored::Strips(strips);
        Ok(STRIP_ROWS)
    }

    /// The entries of a layer by strip.
    fn divided(&self, spool: &Spool<'_>) -> Result<Vec<Spool<'a>>> {
        let mut strips: Vec<Spool<'a>> = (0..STRIPS).map(|_| Spool::new(self.scratch, STRIP_BYTES)).collect();
        let (mut reader, mut entries) = (spool.reader(), Vec::new());
        let mut left = spool.len() / 8;
        while left > 0 {
            entries.clear();
            let n = left.min(READ_ENTRIES);
            reader.values(n as usize, &mut entries)?;
            left -= n;
            // The mask of the last entry may be the next word.
            if follows_mask(&entries) && left > 0 {
                reader.values(1, &mut entries)?;
                left -= 1;
            }
            add_to_strips(&mut strips, &entries)?;
        }
        strips.iter_mut().try_for_each(Spool::release)?;
        Ok(strips)
    }

    /// Rows of the layer `z`; none past the last layer.
    pub(crate) fn load_rows(&self, z: usize, rows: Range<usize>) -> Result<Layer> {
        let Some(stored) = self.layers.get(z) else { return Ok(Layer::default()) };
        let mut words: Vec<u64> = Vec::new();
        let mut read = |spool: &Spool<'_>| spool.reader().values((spool.len() / 8) as usize, &mut words);
        match &*lock(stored) {
            Stored::Whole(spool) => read(spool)?,
            Stored::Strips(strips) => {
                let strips = &strips[rows.start / STRIP_ROWS..rows.end.div_ceil(STRIP_ROWS).min(STRIPS)];
                strips.iter().try_for_each(read)?;
            }
        }
        if words.is_empty() {
            return Ok(Layer::default());
        }
        let (first, count) = (rows.start * SIDE, (rows.end.min(SIDE) - rows.start) * SIDE);
        let each = |visit: &mut dyn FnMut(usize, u32, u64)| {
            for_each_entry(&words, |entry, mask| {
                let position = (position_of(entry)).wrapping_sub(first);
                if position < count {
                    visit(position, entry as u32, mask);
                }
            });
        };
        let mut starts: Vec<u32> = zeroed(count + 1, WHAT)?;
        let mut number = 0;
        each(&mut |position, _, _| {
            starts[position] += 1;
            number += 1;
        });
        let mut at = 0;
        for start in &mut starts {
            at += std::mem::replace(start, at);
        }
        let mut entries = Vec::new();
        make_room(&mut entries, number, WHAT)?;
        entries.resize(number, (0, 0));
        let mut next = collected(starts.len(), starts.iter().copied(), WHAT)?;
        each(&mut |position, label, mask| {
            entries[next[position] as usize] = (label, mask);
            next[position] += 1;
        });
        Ok(Layer { first, starts, entries })
    }
}

fn lock<'l, 'a>(layer: &'l Mutex<Stored<'a>>) -> MutexGuard<'l, Stored<'a>> {
    layer.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The position of an entry in its layer.
#[inline]
fn position_of(entry: u64) -> usize {
    (entry >> 32) as usize % (SIDE * SIDE)
}

/// Calls `visit` with each entry and its mask.
#[inline]
fn for_each_entry(words: &[u64], mut visit: impl FnMut(u64, u64)) {
    let mut words = words.iter();
    while let Some(&entry) = words.next() {
        visit(entry, if entry & MIXED == 0 { SOLID } else { words.next().copied().unwrap_or(0) });
    }
}

/// Whether the last entry is one that has a mask, which is missing.
fn follows_mask(words: &[u64]) -> bool {
    let mut words = words.iter();
    while let Some(&entry) = words.next() {
        if entry & MIXED != 0 && words.next().is_none() {
            return true;
        }
    }
    false
}

/// Adds entries to the strips of a layer.
fn add_to_strips(strips: &mut [Spool<'_>], entries: &[u64]) -> Result<()> {
    let mut result = Ok(());
    for_each_entry(entries, |entry, mask| {
        if result.is_ok() {
            let words = [entry, mask];
            let words = &words[..if entry & MIXED == 0 { 1 } else { 2 }];
            result = strips[position_of(entry) / (SIDE * STRIP_ROWS)].write(bytemuck::cast_slice(words));
        }
    });
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Labels of a layer of many entries: the rows of it are those of the layer as a whole.
    #[test]
    fn rows_of_a_divided_layer_are_those_of_the_whole() {
        let scratch = Scratch::new(&std::env::temp_dir());
        let (small, large) = (Layers::new(&scratch, 0), Layers::new(&scratch, u64::MAX));
        let mut state = 3u64;
        for label in 0..40 {
            let mut cells = Vec::new();
            for x in 0..64u32 {
                for y in (label % 3..256).step_by(3) {
                    state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    let mask = if state >> 62 == 0 { SOLID } else { state | 1 };
                    cells.push(Cell { key: morton::encode([x, y, 7]), mask });
                }
            }
            for layers in [&small, &large] {
                let mut batch = LayerBatch::default();
                batch.add(label, &cells).unwrap();
                layers.add(&mut batch).unwrap();
            }
        }
        assert_eq!([&small, &large].map(|layers| layers.rows_at_once(7).unwrap()), [STRIP_ROWS, SIDE]);
        assert_eq!([6, SIDE].map(|z| small.rows_at_once(z).unwrap()), [SIDE; 2]);
        let whole = large.load_rows(7, 0..SIDE).unwrap();
        assert!(!whole.is_empty());
        let sorted = |layer: &Layer, position| {
            let mut entries = layer.at(position).to_vec();
            entries.sort_unstable();
            entries
        };
        for rows in [0..4, 0..5, 3..9, 200..204, 252..256, 252..257, 0..SIDE] {
            for layers in [&small, &large] {
                let some = layers.load_rows(7, rows.clone()).unwrap();
                for position in rows.start * SIDE..rows.end.min(SIDE) * SIDE {
                    assert_eq!(sorted(&some, position), sorted(&whole, position), "{rows:?} {position}");
                }
            }
        }
        assert!(small.load_rows(SIDE, 0..4).unwrap().is_empty());
    }
}
