//! The cells of one chunk, layer by layer along z, with the voxels that each label has in them: what the search for labels that touch, and the
//! coding of voxels, need of a chunk.
//!
//! ```text
//! layer z:   entries in any order: position x + 256·y, label, mask        in memory or in a scratch file
//! loaded:    starts by position ─► (label, mask) …                        a counting sort; two layers are held at once
//! ```
//! An entry takes 8 bytes, and 8 more where the label does not fill the cell.

use std::sync::{Mutex, PoisonError};

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

/// The cells of a chunk by layer.
pub(crate) struct Layers<'a> {
    layers: Vec<Mutex<Spool<'a>>>,
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

/// A layer's labels and masks by position.
#[derive(Default)]
pub(crate) struct Layer {
    /// Where the entries of each position begin; empty where the layer has none.
    starts: Vec<u32>,
    entries: Vec<(u32, u64)>,
}

impl Layer {
    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Labels and masks of the cell at x + 256·y.
    #[inline]
    pub(crate) fn at(&self, position: usize) -> &[(u32, u64)] {
        match self.starts.get(position..position + 2) {
            Some(&[start, end]) => &self.entries[start as usize..end as usize],
            _ => &[],
        }
    }
}

impl<'a> Layers<'a> {
    /// No cells yet; at most `limit_bytes` of entries are kept in memory.
    pub(crate) fn new(scratch: &'a Scratch, limit_bytes: u64) -> Self {
        let spool = || Mutex::new(Spool::new(scratch, (limit_bytes / SIDE as u64).max(512)));
        Self { layers: (0..SIDE).map(|_| spool()).collect() }
    }

    /// Adds the entries of a batch, which is empty afterwards.
    pub(crate) fn add(&self, batch: &mut LayerBatch) -> Result<()> {
        for (entries, layer) in batch.layers.iter_mut().zip(&self.layers) {
            if !entries.is_empty() {
                layer
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .write(bytemuck::cast_slice(&std::mem::take(entries)))?;
            }
        }
        Ok(())
    }

    /// The layer `z`; an empty one past the last.
    pub(crate) fn load(&self, z: usize) -> Result<Layer> {
        let Some(spool) = self.layers.get(z) else { return Ok(Layer::default()) };
        let spool = spool.lock().unwrap_or_else(PoisonError::into_inner);
        let mut words: Vec<u64> = Vec::new();
        spool.reader().values((spool.len() / 8) as usize, &mut words)?;
        drop(spool);
        if words.is_empty() {
            return Ok(Layer::default());
        }
        let each = |visit: &mut dyn FnMut(usize, u32, u64)| {
            let mut words = words.iter();
            while let Some(&entry) = words.next() {
                let mask = if entry & MIXED == 0 { SOLID } else { words.next().copied().unwrap_or(0) };
                visit((entry >> 32) as usize % (SIDE * SIDE), entry as u32, mask);
            }
        };
        let mut starts: Vec<u32> = zeroed(SIDE * SIDE + 1, WHAT)?;
        let mut count = 0;
        each(&mut |position, _, _| {
            starts[position] += 1;
            count += 1;
        });
        let mut at = 0;
        for start in &mut starts {
            at += std::mem::replace(start, at);
        }
        let mut entries = Vec::new();
        make_room(&mut entries, count, WHAT)?;
        entries.resize(count, (0, 0));
        let mut next = collected(starts.len(), starts.iter().copied(), WHAT)?;
        each(&mut |position, label, mask| {
            entries[next[position] as usize] = (label, mask);
            next[position] += 1;
        });
        Ok(Layer { starts, entries })
    }
}
