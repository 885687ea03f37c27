//! Makes the nodes of one chunk from its boxes, of all frames: which boxes share a node, the leaves, and then boxes and nodes in their order.

use rayon::prelude::*;

use crate::boxes::{RawBox, RawBoxes};
use crate::chunk_boxes::ChunkBoxes;
use crate::counted_fields::CountedFields;
use crate::finish::Budget;
use crate::leaves::{LeafIndex, Leaves};
use crate::node::{node_words, write_node};
use crate::reserve::{make_room, reserved};
use crate::sharing::first_with_same;
use crate::spool::Scratch;
use crate::{BoxRecord, Error, Job, Result};

/// Boxes that are read and written at once.
const BATCH_BOXES: u32 = 1 << 12;

/// What memory is for, in errors.
const NODES: &str = "the nodes of the volume";

/// Bytes a box that finishing a chunk holds whatever the limit: which box has the same contents, and the place and number of its node.
pub(crate) const BYTES_A_BOX: u64 = 12;

/// Bytes that these may take whatever the limit: less than a program takes for itself.
const ALWAYS_BYTES: u64 = 16 << 20;

/// Some boxes of a chunk, and the nodes that they are the first to use.
pub(crate) struct NodeBatch<'b> {
    /// Box records; nodes count from the chunk's first word.
    pub(crate) records: &'b [BoxRecord],
    /// For each box: 0 where its node is the next new one, k where it is the one k before that.
    pub(crate) backs: &'b [u32],
    /// Words of the new nodes.
    pub(crate) nodes: &'b [u16],
}

/// The boxes of a chunk with their leaves.
pub(crate) struct ChunkNodes<'c, 'a> {
    frames: &'c [ChunkBoxes<'a>],
    pub(crate) leaves: Leaves,
    /// For each box, the first that has the same contents.
    first: Vec<u32>,
}

impl<'c, 'a> ChunkNodes<'c, 'a> {
    /// Finds which boxes share a node, and chooses the leaves.
    pub(crate) fn new(frames: &'c [ChunkBoxes<'a>], budget: &Budget, job: &Job) -> Result<Self> {
        let count = frames.iter().map(|boxes| u64::from(boxes.count)).sum::<u64>();
        let place = || frames.first().map_or([0; 3], |boxes| boxes.cell.map(|c| 4 * c));
        if u32::try_from(count).is_err() {
            let what = format!("boxes in the chunk at {:?}", place());
            return Err(Error::Limit { what, limit: u32::MAX.into(), got: count });
        }
        let needed = count * BYTES_A_BOX;
        if let Some(limit) = budget.limit_bytes.filter(|limit| needed > (limit / 2).max(ALWAYS_BYTES)) {
            let what = format!("bytes of memory for the boxes of the chunk at {:?}", place());
            return Err(Error::Limit { what, limit, got: 2 * needed });
        }
        job.check()?;
        let hashes: Vec<_> = frames.iter().map(|boxes| &boxes.hashes).collect();
        let first = first_with_same(&hashes, budget.share(4))?;
        let scratch = Scratch::new(&budget.folder);
        let most_fields = frames.iter().map(|boxes| boxes.fields).sum();
        let mut fields = CountedFields::new(&scratch, most_fields, budget.share(4));
        let mut number = 0;
        for boxes in frames {
            let mut reader = boxes.reader();
            loop {
                job.check()?;
                let batch = reader.next(BATCH_BOXES)?;
                if batch.boxes.is_empty() {
                    break;
                }
                for b in &batch.boxes {
                    if first[number as usize] == number {
                        fields.add(fields_of(&batch, b))?;
                    }
                    number += 1;
                }
            }
        }
        let leaves = Leaves::of_counted(&fields.counted()?)?;
        Ok(Self { frames, leaves, first })
    }

    /// Makes boxes and nodes, frame after frame.
    pub(crate) fn writer(&self) -> Result<NodeWriter<'_>> {
        let cell = self.frames.first().map_or([0; 3], |boxes| boxes.cell);
        let places = reserved(self.first.len(), NODES)?;
        let index = LeafIndex::new(&self.leaves);
        Ok(NodeWriter { first: &self.first, cell, index, places, words: 0, nodes: 0 })
    }
}

/// Makes the boxes and nodes of a chunk, frame after frame.
pub(crate) struct NodeWriter<'n> {
    /// For each box, the first that has the same contents.
    first: &'n [u32],
    /// Lowest cell of the chunk.
    cell: [u32; 3],
    index: LeafIndex<'n>,
    /// By box: first word and number of its node.
    places: Vec<(u32, u32)>,
    /// Words of all nodes so far, and their number.
    pub(crate) words: u64,
    nodes: u32,
}

impl NodeWriter<'_> {
    /// Calls `visit` with the boxes of the next frame, in order, and with the nodes that they are the first to use.
    pub(crate) fn frame(
        &mut self,
        boxes: &ChunkBoxes<'_>,
        job: &Job,
        mut visit: impl FnMut(NodeBatch<'_>) -> Result<()>,
    ) -> Result<()> {
        let Self { first, cell, index, places, words, nodes: nodes_so_far } = self;
        let mut reader = boxes.reader();
        let (mut records, mut backs, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
        loop {
            job.check()?;
            let batch = reader.next(BATCH_BOXES)?;
            if batch.boxes.is_empty() {
                return Ok(());
            }
            let from = places.len();
            let is_first = |i: usize| first[from + i] as usize == from + i;
            let written: Vec<Vec<u16>> = (0..batch.boxes.len())
                .into_par_iter()
                .with_min_len(64)
                .map(|i| {
                    if !is_first(i) {
                        return Vec::new();
                    }
                    let (b, fields) = (&batch.boxes[i], fields_of(&batch, &batch.boxes[i]));
                    let mut node = vec![0; node_words(b.occupied, fields, index)];
                    write_node(b.occupied, b.solid, fields, index, &mut node);
                    node
                })
                .collect();
            records.clear();
            backs.clear();
            nodes.clear();
            for (i, (b, node)) in batch.boxes.iter().zip(&written).enumerate() {
                let (at, back) = if is_first(i) {
                    let at = u32::try_from(*words).map_err(|_| Error::Limit {
                        what: format!("bytes of nodes in the chunk at {:?}", cell.map(|c| 4 * c)),
                        limit: 2 << 32,
                        got: 2 * *words,
                    })?;
                    places.push((at, *nodes_so_far));
                    make_room(&mut nodes, node.len(), NODES)?;
                    nodes.extend_from_slice(node);
                    *words += node.len() as u64;
                    *nodes_so_far += 1;
                    (at, 0)
                } else {
                    let place = places[first[from + i] as usize];
                    places.push(place);
                    (place.0, *nodes_so_far - place.1)
                };
                let within = [0, 1, 2].map(|a| b.origin[a] - cell[a]);
                records.push(BoxRecord::new(within, b.extent.map(u32::from), at));
                backs.push(back);
            }
            visit(NodeBatch { records: &records, backs: &backs, nodes: &nodes })?;
        }
    }
}

fn fields_of<'b>(batch: &'b RawBoxes, b: &RawBox) -> &'b [u64] {
    &batch.fields[b.first_field..b.first_field + b.fields()]
}
