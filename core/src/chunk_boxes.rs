//! Finds the boxes of one chunk, label after label, and keeps them with their contents in their final order.
//!
//! ```text
//! records of the chunk ─► waves of labels, in parallel: sort, OR ─► layers of cells (for contacts)
//!                                                                └► Snap4 boxes, in Morton order ─► box stream, hashes of contents
//! a label that is larger than a wave: its cells are divided on disk until a region fits
//! ```
//! A box in the stream has 44 bytes and its fields, as in the content hash: lowest voxel, extent in voxels (3 × u32 each), dense label (u32),
//! occupied, solid (u64), fields (u64 each). So what a chunk holds in memory does not grow with its boxes, but for their hashes and numbers.

use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3;

use crate::boxes::{RawBox, RawBoxes, split_label};
use crate::cell::{BOX_CELLS, Cell, sort_and_or};
use crate::finish::Budget;
use crate::layers::{LayerBatch, Layers};
use crate::reserve::{make_room, reserved};
use crate::spool::{Scratch, Spool, SpoolReader};
use crate::store::ChunkRecords;
use crate::volume::CHUNK_CELLS;
use crate::{Error, Job, LabelRun, Result, morton};

/// Least number of records of a task: enough to hide the cost of a task, few enough to balance the load.
const TASK_CELLS: usize = 1 << 15;

/// Most records of a wave: enough for the threads of any machine, few enough that what is made of them stays in caches.
const WAVE_CELLS: u64 = 1 << 20;

/// Records that are copied at once while a label is divided on disk.
const COPIED_CELLS: u64 = 1 << 12;

/// What memory is for, in errors.
const BOXES: &str = "a list of the boxes of the volume";

/// Bytes of a box in the stream, before its fields.
const HEAD_BYTES: usize = 44;

/// The boxes of a chunk with their contents, sorted by label and Morton code.
pub(crate) struct ChunkBoxes<'a> {
    /// Lowest cell of the chunk in the volume.
    pub(crate) cell: [u32; 3],
    /// The frame that the boxes are of; 0 where the volume has no time.
    pub(crate) frame: u32,
    /// Runs by dense label.
    pub(crate) runs: Vec<LabelRun>,
    /// Number of voxels of each run.
    pub(crate) run_voxels: Vec<u64>,
    /// Number of boxes.
    pub(crate) count: u32,
    boxes: Spool<'a>,
    /// Hash of the contents of each box.
    pub(crate) hashes: Spool<'a>,
    /// Number of fields of all boxes.
    pub(crate) fields: u64,
}

/// One task's result: what is appended for its labels.
#[derive(Default)]
struct Boxed {
    stream: Vec<u8>,
    hashes: Vec<u128>,
    /// Dense label, number of voxels, number of boxes.
    labels: Vec<(u32, u64, u32)>,
    fields: u64,
}

impl Boxed {
    /// Appends a box of the current label.
    fn push(&mut self, b: &RawBox, fields: &[u64], seed: u64) -> Result<()> {
        let from = self.stream.len();
        make_room(&mut self.stream, HEAD_BYTES + size_of_val(fields), BOXES)?;
        let place = b.origin.map(|o| 4 * o).into_iter().chain(b.extent.map(|e| 4 * u32::from(e)));
        place.chain([b.label]).for_each(|v| self.stream.extend(v.to_le_bytes()));
        [b.occupied, b.solid].iter().chain(fields).for_each(|v| self.stream.extend(v.to_le_bytes()));
        let mut hash = Xxh3::with_seed(seed);
        hash.update(&self.stream[from + HEAD_BYTES - 16..]);
        make_room(&mut self.hashes, 1, BOXES)?;
        self.hashes.push(hash.digest128());
        self.fields += fields.len() as u64;
        Ok(())
    }

    /// Appends all boxes of one label that has `voxels` voxels.
    fn label(&mut self, label: u32, voxels: u64, mut raw: RawBoxes, seed: u64) -> Result<()> {
        raw.boxes.sort_unstable_by_key(|b| morton::encode(b.origin));
        for b in &raw.boxes {
            self.push(b, &raw.fields[b.first_field..b.first_field + b.fields()], seed)?;
        }
        make_room(&mut self.labels, 1, BOXES)?;
        self.labels.push((label, voxels, raw.boxes.len() as u32));
        Ok(())
    }
}

/// Number of voxels of some records, none of which are of the same cell.
fn voxels(cells: &[Cell]) -> u64 {
    cells.iter().map(|c| u64::from(c.mask.count_ones())).sum()
}

/// Where boxes go.
struct Output<'o, 'a, 'l> {
    boxes: ChunkBoxes<'a>,
    /// The cells of all labels by layer.
    layers: Layers<'l>,
    content: &'o mut Xxh3,
    voxels: &'o mut [u64],
}

impl Output<'_, '_, '_> {
    fn append(&mut self, boxed: &Boxed) -> Result<()> {
        self.content.update(&boxed.stream);
        self.boxes.boxes.write(&boxed.stream)?;
        self.boxes.hashes.write(bytemuck::cast_slice(&boxed.hashes))?;
        self.boxes.fields += boxed.fields;
        make_room(&mut self.boxes.runs, boxed.labels.len(), BOXES)?;
        for &(label, voxels, boxes) in &boxed.labels {
            self.voxels[label as usize] += voxels;
            self.boxes.runs.push(LabelRun { label, first_box: self.boxes.count });
            make_room(&mut self.boxes.run_voxels, 1, BOXES)?;
            self.boxes.run_voxels.push(voxels);
            self.boxes.count = self.boxes.count.checked_add(boxes).ok_or_else(|| Error::Limit {
                what: format!("boxes in the chunk at {:?}", self.boxes.cell.map(|c| 4 * c)),
                limit: u32::MAX.into(),
                got: u64::from(self.boxes.count) + u64::from(boxes),
            })?;
        }
        Ok(())
    }
}

/// Finds the boxes of a chunk at a frame, and its cells by layer. `ids` are those of all labels; `content` and `voxels` take up the chunk's
/// boxes and each label's voxels. The boxes of so many frames are held together.
#[expect(clippy::too_many_arguments, reason = "each is another thing")]
pub(crate) fn boxes_of_chunk<'a, 'l>(
    (code, frame): (u64, u32),
    mut records: ChunkRecords<'_>,
    ids: &[u64],
    (content, voxels): (&mut Xxh3, &mut [u64]),
    (scratch, of_layers): (&'a Scratch, &'l Scratch),
    frames: u64,
    budget: &Budget,
    job: &Job,
) -> Result<(ChunkBoxes<'a>, Layers<'l>)> {
    let boxes = ChunkBoxes {
        cell: morton::decode(code * CHUNK_CELLS),
        frame,
        runs: Vec::new(),
        run_voxels: Vec::new(),
        count: 0,
        boxes: Spool::new(scratch, budget.share(16) / frames),
        hashes: Spool::new(scratch, budget.share(32) / frames),
        fields: 0,
    };
    let mut output = Output { boxes, layers: Layers::new(of_layers, budget.share(8)), content, voxels };
    // What is made of a label's records takes some three times their bytes beside them.
    let most_of_label = (budget.share(16) / size_of::<Cell>() as u64).max(1 << 12);
    let most_wave = most_of_label.min(WAVE_CELLS);
    let mut wave: Vec<Task> = Vec::new();
    let mut in_wave = 0;
    let mut label = 0;
    while let Some((id, count)) = records.next_label()? {
        job.check()?;
        label += ids[label..].partition_point(|&other| other < id);
        if in_wave + count > most_wave {
            finish_wave(&mut wave, &mut output, budget, job)?;
            in_wave = 0;
        }
        if count > most_of_label {
            split_on_disk(label as u32, (id, count), most_of_label, &mut records, &mut output, budget, job)?;
            continue;
        }
        let mut cells = Vec::new();
        let parts = records.read(id, count, &mut cells)?;
        match wave.last_mut().filter(|task| task.cells < TASK_CELLS) {
            Some(task) => task.push(label as u32, cells, parts),
            None => wave.push(Task { cells: cells.len(), labels: vec![(label as u32, cells, parts > 1)] }),
        }
        in_wave += count;
    }
    finish_wave(&mut wave, &mut output, budget, job)?;
    output.boxes.runs.shrink_to_fit();
    Ok((output.boxes, output.layers))
}

/// Some labels with their records.
struct Task {
    cells: usize,
    /// Dense label, records, and whether these are of several parts.
    labels: Vec<(u32, Vec<Cell>, bool)>,
}

impl Task {
    fn push(&mut self, label: u32, cells: Vec<Cell>, parts: usize) {
        self.cells += cells.len();
        self.labels.push((label, cells, parts > 1));
    }
}

fn finish_wave(
    wave: &mut Vec<Task>,
    output: &mut Output<'_, '_, '_>,
    budget: &Budget,
    job: &Job,
) -> Result<()> {
    let layers = &output.layers;
    let finished: Vec<Result<Boxed>> = std::mem::take(wave)
        .into_par_iter()
        .map(|task| {
            job.check()?;
            let (mut boxed, mut batch) = (Boxed::default(), LayerBatch::default());
            for (label, mut cells, of_several) in task.labels {
                if of_several {
                    sort_and_or(&mut cells)?;
                }
                let count = voxels(&cells);
                batch.add(label, &cells)?;
                let mut raw = RawBoxes::default();
                split_label(label, &mut cells, &mut raw)?;
                drop(cells);
                boxed.label(label, count, raw, budget.seed)?;
            }
            layers.add(&mut batch)?;
            job.advance(task.cells as u64);
            Ok(boxed)
        })
        .collect();
    finished.into_iter().try_for_each(|boxed| output.append(&boxed?))
}

/// Divides a label's cells on disk as [`split_label`] divides them in memory, until at most `most` of a region are left, which are then
/// divided in memory.
fn split_on_disk(
    label: u32,
    (id, count): (u64, u64),
    most: u64,
    records: &mut ChunkRecords<'_>,
    output: &mut Output<'_, '_, '_>,
    budget: &Budget,
    job: &Job,
) -> Result<()> {
    let scratch = Scratch::new(&budget.folder);
    let room = budget.share(64);
    let mut all = Spool::new(&scratch, room);
    let (mut cells, mut left) = (Vec::new(), count);
    while left > 0 {
        cells.clear();
        records.read(id, COPIED_CELLS.min(left), &mut cells)?;
        left -= cells.len() as u64;
        all.write(bytemuck::cast_slice(&cells))?;
    }
    // A file of its own, so that a field's place in it is its number.
    let fields = Scratch::new(&budget.folder);
    let (mut boxes, mut fields_so_far, mut count_voxels): (Vec<RawBox>, u64, u64) = (Vec::new(), 0, 0);
    let mut regions = vec![all];
    while let Some(mut region) = regions.pop() {
        job.check()?;
        let cells_of_region = region.len() / size_of::<Cell>() as u64;
        let cut = if cells_of_region > most { cut_of(&region)? } else { None };
        let Some((axis, cut)) = cut else {
            let mut cells = Vec::new();
            let mut reader = region.reader();
            let mut left = cells_of_region;
            // A region that cannot be cut has at most 64 cells, of which there may be many records.
            while left > 0 {
                let n = left.min(most);
                reader.values(n as usize, &mut cells)?;
                sort_and_or(&mut cells)?;
                left -= n;
            }
            count_voxels += voxels(&cells);
            let mut batch = LayerBatch::default();
            batch.add(label, &cells)?;
            output.layers.add(&mut batch)?;
            let mut raw = RawBoxes::default();
            split_label(label, &mut cells, &mut raw)?;
            make_room(&mut boxes, raw.boxes.len(), BOXES)?;
            let shifted = raw
                .boxes
                .iter()
                .map(|b| RawBox { first_field: b.first_field + fields_so_far as usize, ..*b });
            boxes.extend(shifted);
            fields_so_far += raw.fields.len() as u64;
            fields.append(bytemuck::cast_slice(&raw.fields))?;
            job.advance(cells_of_region);
            continue;
        };
        let (mut lower, mut upper) = (Spool::new(&scratch, room), Spool::new(&scratch, room));
        for_each_cell(&region, |cell| {
            let half = if morton::decode(cell.key)[axis] < cut { &mut lower } else { &mut upper };
            half.write(bytemuck::bytes_of(cell))
        })?;
        region.clear();
        regions.push(lower);
        regions.push(upper);
    }
    boxes.par_sort_unstable_by_key(|b| morton::encode(b.origin));
    let mut boxed = Boxed::default();
    let mut own = [0u64; 64];
    for b in &boxes {
        let own = &mut own[..b.fields()];
        fields.read(bytemuck::cast_slice_mut(own), 8 * b.first_field as u64)?;
        boxed.push(b, own, budget.seed)?;
        if boxed.stream.len() as u64 > room {
            output.append(&boxed)?;
            boxed = Boxed::default();
        }
    }
    // The label's run begins before its boxes.
    let first = output.boxes.count;
    output.append(&boxed)?;
    let number = boxes.len() as u32;
    output.append(&Boxed { labels: vec![(label, count_voxels, number)], ..Boxed::default() })?;
    debug_assert_eq!(output.boxes.count, first + number);
    Ok(())
}

fn for_each_cell(region: &Spool<'_>, mut visit: impl FnMut(&Cell) -> Result<()>) -> Result<()> {
    let (mut reader, mut cells) = (region.reader(), Vec::new());
    let mut left = region.len() / size_of::<Cell>() as u64;
    while left > 0 {
        cells.clear();
        let n = left.min(COPIED_CELLS);
        reader.values(n as usize, &mut cells)?;
        cells.iter().try_for_each(&mut visit)?;
        left -= n;
    }
    Ok(())
}

/// Where [`split_label`] cuts these cells: the axis and the first cell of the upper half. `None` where they are one box.
fn cut_of(region: &Spool<'_>) -> Result<Option<(usize, u32)>> {
    let (mut low, mut high) = ([u32::MAX; 3], [0; 3]);
    for_each_cell(region, |cell| {
        for (axis, c) in morton::decode(cell.key).into_iter().enumerate() {
            low[axis] = low[axis].min(c);
            high[axis] = high[axis].max(c);
        }
        Ok(())
    })?;
    Ok(crate::boxes::cut(low, high))
}

impl ChunkBoxes<'_> {
    /// Bytes of the chunk's boxes with their contents.
    pub(crate) fn reader(&self) -> BoxReader<'_> {
        BoxReader { reader: self.boxes.reader(), left: self.count }
    }
}

/// Reads boxes in their order.
pub(crate) struct BoxReader<'a> {
    reader: SpoolReader<'a>,
    left: u32,
}

impl BoxReader<'_> {
    /// Up to `most` further boxes; none after the last.
    pub(crate) fn next(&mut self, most: u32) -> Result<RawBoxes> {
        let n = most.min(self.left);
        self.left -= n;
        let mut batch = RawBoxes { boxes: reserved(n as usize, BOXES)?, fields: Vec::new() };
        for _ in 0..n {
            let [x, y, z, w, h, d, label]: [u32; 7] = self.reader.value()?;
            let [occupied, solid]: [u64; 2] = self.reader.value()?;
            let b = RawBox {
                origin: [x, y, z].map(|o| o / 4),
                extent: [w, h, d].map(|e| (e / 4) as u8),
                label,
                occupied,
                solid,
                first_field: batch.fields.len(),
            };
            self.reader.values(b.fields(), &mut batch.fields)?;
            batch.boxes.push(b);
        }
        Ok(batch)
    }
}

const _: () = assert!(BOX_CELLS == 4 && cfg!(target_endian = "little"));
