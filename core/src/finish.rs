//! Turns parts into the compressed volume.
//!
//! ```text
//! for each label (in parallel):  gather its records from all parts ─► Snap4 boxes, each with its fields
//! sort the boxes:                chunk (Morton), label, Morton code of the origin
//! for each chunk:
//!     share:                     boxes with equal contents refer to one node
//!     leaves:                    the most frequent fields and slices of the distinct nodes
//!     write the nodes:           in the order of first use, then box records and label runs
//! ```
//! The result of each step depends on the volume alone, so it is independent of threads, blocks and their order.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use rayon::prelude::*;
use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::Xxh3;

use crate::boxes::{BOXES, RawBox, RawBoxes, split_label};
use crate::cell::Cell;
use crate::leaves::{LeafIndex, Leaves};
use crate::node::{node_words, write_node};
use crate::reserve::{check_room, collected, collected_by_threads, make_room, make_room_in_map, reserved};
use crate::sorted_cells::Run;
use crate::store::StoredParts;
use crate::volume::CHUNK_CELLS;
use crate::{
    BoxRecord, Chunk, CompressedVolume, Error, Job, LabelRun, LabelTable, Result, VolumeInfo, morton,
};

/// Least number of records of a task: enough to hide the cost of a task, few enough to balance the load.
const TASK_CELLS: usize = 1 << 15;

/// What memory is for, in errors.
const NODES: &str = "the nodes of the volume";

/// Limits on what finishing may use.
pub(crate) struct Budget {
    /// Bytes of memory, of which finishing may take three quarters; the rest is for records of parts that have not been spilled.
    limit_bytes: Option<u64>,
    /// Number of threads, each of which gathers the records of one label at a time.
    threads: usize,
    /// Bytes beyond which the free memory is compared with what is needed the next time.
    ask_again_bytes: AtomicU64,
}

/// Bytes that finishing holds for each box at its peak: raw box 48, hash 16, entry in the map of shared contents about 64, index of its
/// contents 8. (The later search for contacts takes less: about 4 bricks a box at 20 bytes each, when these are gone.)
const BYTES_A_BOX: u64 = 140;

/// Bytes for each field: 8 raw, and 8 more while the results of tasks are joined, as an entry for the dictionary, or in its node.
const BYTES_A_FIELD: u64 = 16;

/// Bytes of a raw box and of a raw field, which are taken already when their memory is asked for.
const RAW_BYTES: [u64; 2] = [48, 8];

/// Free memory is asked for anew when so much more is needed: asking reads files of the system, and labels come by the million.
const ASK_EVERY_BYTES: u64 = 64 << 20;

/// Bytes that counting may take whatever the limit: less than a program takes for itself.
const COUNTING_BYTES: u64 = 64 << 20;

impl Budget {
    pub(crate) fn new(limit_bytes: Option<u64>, threads: usize) -> Self {
        Self { limit_bytes, threads, ask_again_bytes: AtomicU64::new(ASK_EVERY_BYTES) }
    }

    /// Returns an error if the memory does not suffice; the error gives the limit that would. Without a limit, what is free is one; the records
    /// of the largest label then count once, because not all threads have a label like it.
    fn check(&self, index_bytes: u64, boxes: u64, fields: u64, largest_label: u64) -> Result<()> {
        let Some(limit) = self.limit_bytes else {
            let records = largest_label * size_of::<Cell>() as u64;
            let [raw_box, raw_field] = RAW_BYTES;
            let further = boxes * (BYTES_A_BOX - raw_box) + fields * (BYTES_A_FIELD - raw_field) + records;
            if further >= self.ask_again_bytes.load(Relaxed) {
                check_room("the boxes of the volume", further)?;
                self.ask_again_bytes.fetch_max(further + ASK_EVERY_BYTES, Relaxed);
            }
            return Ok(());
        };
        let structures = boxes * BYTES_A_BOX + fields * BYTES_A_FIELD;
        let need = structures + self.counting_bytes(index_bytes, largest_label);
        let with_slack = |bytes: u64| bytes.saturating_mul(4).div_ceil(3);
        if with_slack(need) <= limit {
            return Ok(());
        }
        // The index depends on which blocks the threads merged, which is another choice the next time: half of it more suffices then too.
        let got = with_slack(need + index_bytes / 2);
        Err(Error::Limit { what: "bytes of memory".into(), limit, got })
    }

    /// Bytes that counting boxes takes: the index, and the records of one label a thread.
    fn counting_bytes(&self, index_bytes: u64, largest_label: u64) -> u64 {
        index_bytes + largest_label * size_of::<Cell>() as u64 * self.threads as u64
    }
}

/// Builds the boxes of all labels, and the label table without contacts.
pub(crate) fn boxes_of_parts(
    parts: &StoredParts,
    budget: &Budget,
    job: &Job,
) -> Result<(RawBoxes, LabelTable)> {
    let runs = parts.runs()?;
    let index_bytes = parts.index_bytes() + (runs.capacity() * size_of::<Run>()) as u64;
    job.begin(runs.iter().map(|r| (r.end - r.start) as u64).sum());

    // Divide the labels into tasks of similar size; a label is never divided here.
    let mut tasks: Vec<(u32, &[Run])> = Vec::new();
    let (mut start, mut first_label, mut label, mut size) = (0, 0u32, 0u32, 0);
    let (mut at, mut largest) = (0, 0);
    for same_id in runs.chunk_by(|a, b| a.id == b.id) {
        let cells = same_id.iter().map(|r| r.end - r.start).sum::<usize>();
        largest = largest.max(cells as u64);
        size += cells;
        at += same_id.len();
        label = label.checked_add(1).ok_or(Error::Limit {
            what: "labels".into(),
            limit: u32::MAX.into(),
            got: 1 << 32,
        })?;
        if size >= TASK_CELLS {
            tasks.push((first_label, &runs[start..at]));
            (start, first_label, size) = (at, label, 0);
        }
    }
    tasks.push((first_label, &runs[start..]));
    if budget.counting_bytes(index_bytes, largest) > COUNTING_BYTES {
        budget.check(index_bytes, 0, 0, largest).map_err(|error| match error {
            // What the boxes take is not known: counting them would take more than the caller allows.
            Error::Limit { what, limit, got } => Error::Limit { what: format!("{what} or more"), limit, got },
            other => other,
        })?;
    }

    // Each task yields the boxes, ids and voxel counts of its labels. Once the budget is exceeded, boxes are only counted, so that the
    // error can give the limit that would suffice.
    let (boxes_so_far, fields_so_far) = (AtomicU64::new(0), AtomicU64::new(0));
    let fits = || budget.check(index_bytes, boxes_so_far.load(Relaxed), fields_so_far.load(Relaxed), largest);
    let results: Vec<Result<(RawBoxes, LabelTable)>> = tasks
        .into_par_iter()
        .map(|(first_label, runs)| {
            let (mut boxes, mut table, mut cells) = (RawBoxes::default(), LabelTable::default(), Vec::new());
            for (i, same_id) in runs.chunk_by(|a, b| a.id == b.id).enumerate() {
                job.check()?;
                parts.gather(same_id, &mut cells)?;
                table.ids.push(same_id[0].id);
                table.voxels.push(cells.iter().map(|c| u64::from(c.mask.count_ones())).sum());
                let before = (boxes.boxes.len() as u64, boxes.fields.len() as u64);
                split_label(first_label + i as u32, &mut cells, &mut boxes)?;
                boxes_so_far.fetch_add(boxes.boxes.len() as u64 - before.0, Relaxed);
                fields_so_far.fetch_add(boxes.fields.len() as u64 - before.1, Relaxed);
                if fits().is_err() {
                    boxes = RawBoxes::default();
                }
                job.advance(same_id.iter().map(|r| (r.end - r.start) as u64).sum());
            }
            boxes.boxes.shrink_to_fit();
            boxes.fields.shrink_to_fit();
            Ok((boxes, table))
        })
        .collect();
    fits()?;

    let mut all = RawBoxes {
        boxes: reserved(boxes_so_far.load(Relaxed) as usize, BOXES)?,
        fields: reserved(fields_so_far.load(Relaxed) as usize, NODES)?,
    };
    let mut table = LabelTable::default();
    for result in results {
        let (boxes, labels) = result?;
        all.append(boxes)?;
        table.ids.extend(labels.ids);
        table.voxels.extend(labels.voxels);
    }
    table.ids.shrink_to_fit();
    table.voxels.shrink_to_fit();
    Ok((all, table))
}

/// Sort key of a box: chunk, label, Morton code of its origin within the chunk.
fn rank(b: &RawBox) -> (u64, u32, u64) {
    let code = morton::encode(b.origin);
    (code / CHUNK_CELLS, b.label, code % CHUNK_CELLS)
}

/// Builds the volume from its boxes.
pub(crate) fn finish(
    info: VolumeInfo,
    raw: RawBoxes,
    labels: LabelTable,
    job: &Job,
) -> Result<CompressedVolume> {
    let RawBoxes { mut boxes, fields } = raw;
    if boxes.len() > u32::MAX as usize {
        return Err(Error::Limit { what: "boxes".into(), limit: u32::MAX.into(), got: boxes.len() as u64 });
    }
    job.check()?;
    boxes.par_sort_unstable_by_key(rank);
    let mut volume = CompressedVolume::empty(info);
    let mut records = reserved(boxes.len(), BOXES)?;
    let mut nodes: Vec<u16> = Vec::new();
    for in_chunk in boxes.chunk_by(|a, b| rank(a).0 == rank(b).0) {
        let chunk_cell = morton::decode(rank(&in_chunk[0]).0 * CHUNK_CELLS);
        volume.chunks.push(Chunk {
            origin: chunk_cell.map(|c| 4 * c),
            first_box: records.len() as u64,
            first_run: volume.runs.len() as u64,
            node_base: nodes.len() as u64,
        });
        for (i, b) in in_chunk.iter().enumerate() {
            if i == 0 || in_chunk[i - 1].label != b.label {
                volume.runs.push(LabelRun { label: b.label, first_box: i as u32 });
            }
        }
        volume.leaves.push(finish_chunk(chunk_cell, in_chunk, &fields, &mut records, &mut nodes, job)?);
    }
    volume.runs.shrink_to_fit();
    volume.chunks.shrink_to_fit();
    volume.leaves.shrink_to_fit();
    volume.boxes = records.into();
    volume.nodes = nodes.into();
    volume.labels = labels;
    Ok(volume)
}

/// Appends the records and nodes of the boxes of a chunk, and returns the leaves of these nodes.
fn finish_chunk(
    chunk_cell: [u32; 3],
    boxes: &[RawBox],
    fields: &[u64],
    records: &mut Vec<BoxRecord>,
    nodes: &mut Vec<u16>,
    job: &Job,
) -> Result<Leaves> {
    let fields_of = |b: &RawBox| &fields[b.first_field..b.first_field + b.fields()];

    // Find the distinct contents, in order of first use, and the contents of each box.
    job.check()?;
    let hash_of = |b: &RawBox| {
        let mut hash = Xxh3::new();
        hash.update(bytemuck::bytes_of(&[b.occupied, b.solid]));
        hash.update(bytemuck::cast_slice(fields_of(b)));
        hash.digest128()
    };
    let hashes: Vec<u128> = collected_by_threads(boxes.par_iter().map(hash_of), BOXES)?;
    let mut first_with: FxHashMap<u128, u32> = FxHashMap::default();
    let mut distinct: Vec<u32> = Vec::new();
    let mut distinct_of_box: Vec<u32> = reserved(boxes.len(), BOXES)?;
    for (i, (b, hash)) in boxes.iter().zip(&hashes).enumerate() {
        make_room_in_map(&mut first_with, NODES)?;
        let d = *first_with.entry(*hash).or_insert(distinct.len() as u32);
        let same = distinct.get(d as usize).is_some_and(|&other| {
            let o = &boxes[other as usize];
            (o.occupied, o.solid) == (b.occupied, b.solid) && fields_of(o) == fields_of(b)
        });
        // The contents are new; or two contents have the same 128-bit hash, which has never been seen. Then the later one is not shared.
        distinct_of_box.push(if same { d } else { distinct.len() as u32 });
        if !same {
            make_room(&mut distinct, 1, NODES)?;
            distinct.push(i as u32);
        }
    }
    drop((first_with, hashes));

    // Choose the leaves of the distinct nodes.
    job.check()?;
    let count = distinct.iter().map(|&i| boxes[i as usize].fields()).sum();
    let uses = distinct.iter().flat_map(|&i| fields_of(&boxes[i as usize])).copied();
    let leaves = Leaves::of_fields(collected(count, uses, NODES)?)?;
    let index = LeafIndex::new(&leaves);
    let size_of_node = |&i: &u32| {
        let b = &boxes[i as usize];
        // At most MOST_NODE_WORDS.
        node_words(b.occupied, fields_of(b), &index) as u16
    };
    let sizes: Vec<u16> = collected_by_threads(distinct.par_iter().map(size_of_node), NODES)?;

    // Assign an offset to each node, and write the records.
    job.check()?;
    let mut place: Vec<u64> = reserved(distinct.len(), NODES)?;
    let mut words = 0u64;
    for &size in &sizes {
        place.push(words);
        words += u64::from(size);
    }
    for (b, &d) in boxes.iter().zip(&distinct_of_box) {
        let node = u32::try_from(place[d as usize]).map_err(|_| Error::Limit {
            what: format!("bytes of nodes in the chunk at {:?}", chunk_cell.map(|c| 4 * c)),
            limit: 2 << 32,
            got: 2 * words,
        })?;
        let cell = [0, 1, 2].map(|a| b.origin[a] - chunk_cell[a]);
        records.push(BoxRecord::new(cell, b.extent.map(u32::from), node));
    }

    // Write the nodes in parallel, each group of nodes into its own piece of the array.
    let first = nodes.len();
    make_room(nodes, words as usize, NODES)?;
    nodes.resize(first + words as usize, 0);
    let mut pieces = Vec::new();
    let mut rest = &mut nodes[first..];
    for (group, sizes) in distinct.chunks(4096).zip(sizes.chunks(4096)) {
        let length = sizes.iter().map(|&s| usize::from(s)).sum();
        let (piece, tail) = rest.split_at_mut(length);
        pieces.push((group, sizes, piece));
        rest = tail;
    }
    pieces.into_par_iter().for_each(|(group, sizes, mut piece)| {
        for (&i, &size) in group.iter().zip(sizes) {
            let b = &boxes[i as usize];
            let (node, tail) = piece.split_at_mut(usize::from(size));
            write_node(b.occupied, b.solid, fields_of(b), &index, node);
            piece = tail;
        }
    });
    Ok(leaves)
}
