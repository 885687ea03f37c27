//! Bricks as bytes in a temporary file of this process.

use std::sync::Arc;

use pumice_core::NoMemory;
use pumice_core::stored::{put, take};

use super::{Block, Brick, Bricks, Fields, LabelOfBox, f64x4};
use crate::geometry::lod::Detail;

impl Bricks {
    /// Appends the bricks to bytes.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn put(&self, out: &mut Vec<u8>) -> Result<(), NoMemory> {
        put(out, &self.first)?;
        put(out, &self.last_block.map(|n| n as u32))?;
        put(out, &self.bounds.concat())?;
        put(out, &self.blocks.iter().map(|b| b.occupied).collect::<Vec<u64>>())?;
        put(out, &self.blocks.iter().map(|b| b.first_brick).collect::<Vec<u32>>())?;
        put::<Brick>(out, &self.bricks)?;
        self.fields.put(out)?;
        put::<u32>(out, &self.items)?;
        put::<u16>(out, &self.sections)?;
        put::<u32>(out, &self.labels.first)?;
        put::<u32>(out, &self.labels.starts)
    }

    /// Takes bricks of these levels from bytes that [`Bricks::put`] appended to; `None` where these end too early.
    pub fn take(bytes: &mut &[u8], detail: Detail) -> Option<Self> {
        let first = <[u32; 3]>::try_from(take(bytes)?).ok()?;
        let [x, y, z, _] = <[u32; 4]>::try_from(take(bytes)?).ok()?;
        let bounds = <[f64; 8]>::try_from(take(bytes)?).ok()?;
        let (occupied, first_bricks) = (take::<u64>(bytes)?, take::<u32>(bytes)?);
        let blocks = occupied.into_iter().zip(first_bricks);
        let blocks: Vec<Block> =
            blocks.map(|(occupied, first_brick)| Block { occupied, first_brick }).collect();
        let (bricks, fields) = (take(bytes)?, Fields::take(bytes)?);
        let (items, sections) = (take(bytes)?, take(bytes)?);
        let labels = LabelOfBox { first: take(bytes)?, starts: take(bytes)? };
        let [low, high] = [0, 4].map(|at| [bounds[at], bounds[at + 1], bounds[at + 2], bounds[at + 3]]);
        let along = [x, y].map(|last| last as usize + 1);
        Some(Self {
            detail,
            bounds: [low, high],
            last_block: f64x4([x, y, z]),
            strides: [1, along[0], along[0] * along[1]],
            first,
            blocks,
            bricks,
            fields,
            items,
            sections,
            labels: Arc::new(labels),
        })
    }
}
