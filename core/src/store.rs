//! Stores parts by chunk until the volume is finished: in memory or, beyond a limit, in a temporary file.
//!
//! ```text
//! add(part):  merges small or ragged parts in groups of eight    (a block that cuts cells leaves each cell in several parts)
//!             divides the part by chunk
//!             above the limit, all parts move to the scratch file, each as  ids │ numbers of records │ records
//! a chunk:    ChunkRecords::next_label gives label after label, with its records of every part
//! ```
//! Parts of a time series are kept by chunk and frame: frames come one after another, and [`PartStore::next_frame`] stands between them.
//!
//! A part in the file takes some bytes of memory, and while its chunk is finished a small buffer.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use crate::cell::Cell;
use crate::kept_records::KeptRecords;
use crate::reserve::{make_room, make_room_in_map};
use crate::sorted_cells::SortedCells;
use crate::spool::Scratch;
use crate::volume::CHUNK_CELLS;
use crate::{Error, Result};

/// Number of parts of one merge level that are merged into one part of the next.
const MERGE_PARTS: usize = 8;

/// Parts with at least this many records are not merged: that would cost more than it saves.
const SMALL_CELLS: usize = 1 << 16;

/// Parts of a chunk are merged before they are written where more of them, and of fewer records on average, wait.
const MANY_PIECES: usize = 16;
const FEW_CELLS: usize = 1 << 13;

/// Bytes that an id takes in the set of all ids, and then in the label table, at most.
const BYTES_A_LABEL: u64 = 40;

/// Bytes beyond the limit that counting the labels of a refused volume may take.
const COUNTING_BYTES: u64 = 32 << 20;

/// Ids of several pieces are freed of repetition once there are so many.
const MOST_REPEATED_IDS: usize = 1 << 16;

/// What memory is for, in errors.
const LABELS: &str = "the table of labels";
const RECORDS: &str = "the cells of a label";

/// What one part has of a chunk.
enum Piece {
    Memory(SortedCells),
    /// Place in the scratch file, number of labels, number of records.
    Disk(u64, u64, u64),
}

/// A piece in a file that is kept.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct KeptPiece {
    /// Morton code of the chunk.
    pub(crate) chunk: u64,
    frame: u32,
    /// As in [`Piece::Disk`].
    place: u64,
    labels: u64,
    records: u64,
}

/// What a kept file has.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct KeptPieces {
    pub(crate) pieces: Vec<KeptPiece>,
    /// Number of labelled voxels that were delivered of each chunk, by its Morton code.
    pub(crate) delivered: Vec<(u64, u64)>,
}

impl KeptPiece {
    /// Where its bytes end; `None` where numbers of no piece overflow.
    pub(crate) fn end(&self) -> Option<u64> {
        let of_labels = self.labels.checked_mul(16)?;
        self.place.checked_add(of_labels)?.checked_add(self.records.checked_mul(size_of::<Cell>() as u64)?)
    }
}

#[derive(Default)]
struct State {
    /// Parts that wait to be merged with others; level k holds results of k merges.
    waiting: Vec<Vec<SortedCells>>,
    /// Pieces of each chunk at each frame, by the Morton code of the chunk and the frame's number.
    chunks: BTreeMap<(u64, u32), Vec<Piece>>,
    /// The frame that parts are of.
    frame: u32,
    ids: FxHashMap<u64, ()>,
    /// Number of labelled voxels that were delivered of each chunk, by its Morton code.
    delivered: BTreeMap<u64, u64>,
    /// Bytes on the heap of the parts in memory.
    bytes: u64,
}

/// Collects parts from several threads; see the module documentation.
pub(crate) struct PartStore {
    state: Mutex<State>,
    limit_bytes: u64,
    /// The limit of the whole compression, which the labels' table must not exceed.
    table_limit_bytes: Option<u64>,
    scratch: Scratch,
}

impl PartStore {
    /// A store that keeps at most `limit_bytes` of records in memory and writes the rest to a file in `folder`.
    pub(crate) fn new(limit_bytes: u64, table_limit_bytes: Option<u64>, folder: &Path) -> Self {
        Self { state: Mutex::default(), limit_bytes, table_limit_bytes, scratch: Scratch::new(folder) }
    }

    /// A store that has what was kept, and appends to it.
    ///
    /// # Errors
    /// As [`PartStore::add`].
    pub(crate) fn continuing(
        limit_bytes: u64,
        table_limit_bytes: Option<u64>,
        kept: &KeptRecords,
    ) -> Result<Self> {
        let (state, scratch) = (Mutex::default(), kept.file()?);
        let store = Self { state, limit_bytes, table_limit_bytes, scratch };
        let mut state = store.lock();
        let KeptPieces { pieces, delivered } = kept.pieces();
        for &KeptPiece { chunk, frame, place, labels, records } in pieces {
            let mut ids = Vec::new();
            store.scratch.read_ids(place, labels, &mut ids)?;
            for id in ids {
                make_room_in_map(&mut state.ids, LABELS)?;
                state.ids.insert(id, ());
            }
            state.chunks.entry((chunk, frame)).or_default().push(Piece::Disk(place, labels, records));
        }
        state.delivered = delivered.iter().copied().collect();
        state.frame = kept.frames().saturating_sub(1);
        drop(state);
        Ok(store)
    }

    /// The file of what is not in memory.
    pub(crate) fn scratch(&self) -> &Scratch {
        &self.scratch
    }

    /// Writes all parts to the file. Returns what is there.
    ///
    /// # Errors
    /// As [`PartStore::add`].
    pub(crate) fn all_in_file(&self) -> Result<KeptPieces> {
        let mut state = self.lock();
        self.spill(&mut state)?;
        let mut pieces = Vec::new();
        for (&(chunk, frame), of_chunk) in &state.chunks {
            pieces.extend(of_chunk.iter().filter_map(|piece| match *piece {
                Piece::Disk(place, labels, records) => {
                    Some(KeptPiece { chunk, frame, place, labels, records })
                }
                Piece::Memory(_) => None,
            }));
        }
        let delivered = state.delivered.iter().map(|(&chunk, &n)| (chunk, n)).collect();
        Ok(KeptPieces { pieces, delivered })
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        // Every critical section leaves the state consistent before anything in it can fail.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a part of a source's block, and counts its voxels. Otherwise as [`PartStore::add`].
    pub(crate) fn add_delivered(&self, part: SortedCells, ragged: bool) -> Result<()> {
        let mut voxels: Vec<(u64, u64)> = Vec::new();
        for cell in &part.cells {
            let (chunk, n) = (cell.key / CHUNK_CELLS, u64::from(cell.mask.count_ones()));
            match voxels.last_mut() {
                Some((last, count)) if *last == chunk => *count += n,
                _ => voxels.push((chunk, n)),
            }
        }
        let mut state = self.lock();
        for (chunk, n) in voxels {
            *state.delivered.entry(chunk).or_default() += n;
        }
        drop(state);
        self.add(part, ragged)
    }

    /// Adds a part. `ragged` means that its block cuts through cells, so merging it with its neighbours makes it smaller.
    ///
    /// # Errors
    /// [`Error::Limit`] where the table of labels would exceed the limit; [`Error::Io`], [`Error::Memory`].
    pub(crate) fn add(&self, part: SortedCells, ragged: bool) -> Result<()> {
        let (mut part, mut level) = (part, 0);
        loop {
            let mut state = self.lock();
            if part.len() >= SMALL_CELLS && !(ragged && level == 0) {
                return self.keep(&mut state, part);
            }
            if state.waiting.len() <= level {
                state.waiting.resize_with(level + 1, Vec::new);
            }
            state.bytes += part.bytes();
            state.waiting[level].push(part);
            if state.waiting[level].len() < MERGE_PARTS {
                return self.relieve(&mut state);
            }
            let group = std::mem::take(&mut state.waiting[level]);
            state.bytes -= group.iter().map(SortedCells::bytes).sum::<u64>();
            drop(state);
            part = SortedCells::merge(&group)?;
            level += 1;
        }
    }

    fn keep(&self, state: &mut State, part: SortedCells) -> Result<()> {
        self.file(state, part)?;
        self.relieve(state)
    }

    /// Puts what a part has of each chunk with the chunk.
    fn file(&self, state: &mut State, part: SortedCells) -> Result<()> {
        for &id in part.ids() {
            make_room_in_map(&mut state.ids, LABELS)?;
            state.ids.insert(id, ());
        }
        if self.table_error(state).is_some() {
            // The volume is refused. Labels are counted to the end, so that the error can say what is needed, as far as there is room.
            state.chunks.clear();
            state.bytes = 0;
            let limit = self.table_limit_bytes.unwrap_or(u64::MAX).saturating_add(COUNTING_BYTES);
            let ids_bytes = (state.ids.capacity() * size_of::<u64>() * 9 / 8) as u64;
            return if ids_bytes <= limit { Ok(()) } else { Err(self.refusal(state, " or more")) };
        }
        for (chunk, piece) in by_chunk(part)? {
            state.bytes += piece.bytes();
            state.chunks.entry((chunk, state.frame)).or_default().push(Piece::Memory(piece));
        }
        Ok(())
    }

    /// The error of a table of labels that exceeds the limit.
    fn table_error(&self, state: &State) -> Option<Error> {
        let needed = state.ids.len() as u64 * BYTES_A_LABEL;
        self.table_limit_bytes.filter(|&limit| needed > limit).map(|_| self.refusal(state, ""))
    }

    fn refusal(&self, state: &State, more: &str) -> Error {
        let labels = state.ids.len();
        Error::Limit {
            what: format!("bytes of memory{more} for the table of {labels} labels"),
            limit: self.table_limit_bytes.unwrap_or(u64::MAX),
            got: labels as u64 * BYTES_A_LABEL,
        }
    }

    /// Writes all parts to the file if they exceed the limit.
    fn relieve(&self, state: &mut State) -> Result<()> {
        if state.bytes <= self.limit_bytes { Ok(()) } else { self.spill(state) }
    }

    /// Writes all parts to the file.
    fn spill(&self, state: &mut State) -> Result<()> {
        for part in state.waiting.iter_mut().flat_map(std::mem::take).collect::<Vec<_>>() {
            self.file(state, part)?;
        }
        for pieces in state.chunks.values_mut() {
            let mut in_memory = Vec::new();
            pieces.retain_mut(|piece| match piece {
                Piece::Memory(part) => {
                    in_memory.push(std::mem::take(part));
                    false
                }
                Piece::Disk(..) => true,
            });
            let cells: usize = in_memory.iter().map(SortedCells::len).sum();
            if in_memory.len() > MANY_PIECES && cells < FEW_CELLS * in_memory.len() {
                in_memory = vec![SortedCells::merge(&in_memory)?];
            }
            for part in in_memory {
                let counts: Vec<u64> = part.offsets.windows(2).map(|w| (w[1] - w[0]) as u64).collect();
                let place = self.scratch.append(bytemuck::cast_slice(&part.ids))?;
                self.scratch.append(bytemuck::cast_slice(&counts))?;
                self.scratch.append(bytemuck::cast_slice(&part.cells))?;
                pieces.push(Piece::Disk(place, part.ids.len() as u64, part.cells.len() as u64));
            }
        }
        state.bytes = 0;
        Ok(())
    }

    /// Ends a frame: the parts that are added afterwards are of the next one.
    ///
    /// # Errors
    /// As [`PartStore::add`].
    pub(crate) fn next_frame(&self) -> Result<()> {
        let mut state = self.lock();
        for part in state.waiting.iter_mut().flat_map(std::mem::take).collect::<Vec<_>>() {
            state.bytes -= part.bytes();
            self.file(&mut state, part)?;
        }
        state.frame += 1;
        self.relieve(&mut state)
    }

    /// Ends adding.
    ///
    /// # Errors
    /// As [`PartStore::add`].
    pub(crate) fn into_parts(self) -> Result<StoredParts> {
        let mut state = std::mem::take(&mut *self.lock());
        for part in state.waiting.iter_mut().flat_map(std::mem::take).collect::<Vec<_>>() {
            self.file(&mut state, part)?;
        }
        if let Some(error) = self.table_error(&state) {
            return Err(error);
        }
        let mut ids: Vec<u64> = crate::reserve::reserved(state.ids.len(), LABELS)?;
        ids.extend(std::mem::take(&mut state.ids).into_keys());
        ids.sort_unstable();
        // Chunks without a record have no entry, since a piece has at least one.
        let (frames, scratch) = (state.frame + 1, Arc::new(self.scratch));
        Ok(StoredParts { ids, frames, chunks: state.chunks, delivered: state.delivered, scratch })
    }
}

impl Scratch {
    /// Appends the ids of a piece to a list.
    fn read_ids(&self, place: u64, labels: u64, ids: &mut Vec<u64>) -> Result<()> {
        let from = ids.len();
        make_room(ids, labels as usize, LABELS)?;
        ids.resize(from + labels as usize, 0);
        self.read(bytemuck::cast_slice_mut(&mut ids[from..]), place)
    }
}

/// What a part has of each chunk. Most parts lie in one chunk, and stay as they are.
fn by_chunk(part: SortedCells) -> Result<Vec<(u64, SortedCells)>> {
    let chunk_of = |cell: &Cell| cell.key / CHUNK_CELLS;
    let ends = (0..part.ids.len()).map(|i| part.cells_of(i)).filter_map(|c| c.first().zip(c.last()));
    let (low, high) = ends.fold((u64::MAX, 0), |(low, high), (first, last)| {
        (low.min(chunk_of(first)), high.max(chunk_of(last)))
    });
    if low > high {
        return Ok(Vec::new());
    }
    if low == high {
        return Ok(vec![(low, part)]);
    }
    let mut pieces: BTreeMap<u64, SortedCells> = BTreeMap::new();
    for (i, &id) in part.ids.iter().enumerate() {
        for in_chunk in part.cells_of(i).chunk_by(|a, b| chunk_of(a) == chunk_of(b)) {
            let piece = pieces
                .entry(chunk_of(&in_chunk[0]))
                .or_insert_with(|| SortedCells { offsets: vec![0], ..SortedCells::default() });
            make_room(&mut piece.cells, in_chunk.len(), RECORDS)?;
            piece.cells.extend_from_slice(in_chunk);
            piece.ids.push(id);
            piece.offsets.push(piece.cells.len());
        }
    }
    Ok(pieces.into_iter().collect())
}

/// All parts of a volume, after the last was added.
pub(crate) struct StoredParts {
    /// The ids of all labels, rising.
    pub(crate) ids: Vec<u64>,
    /// Number of frames.
    pub(crate) frames: u32,
    chunks: BTreeMap<(u64, u32), Vec<Piece>>,
    /// Number of labelled voxels that a source delivered of each chunk, by its Morton code.
    delivered: BTreeMap<u64, u64>,
    scratch: Arc<Scratch>,
}

impl StoredParts {
    /// Number of labelled voxels that a source delivered of these chunks.
    pub(crate) fn delivered(&self) -> u64 {
        self.delivered.values().sum()
    }

    /// Removes what there is of some chunks, which `chosen` tells by their Morton codes: their records, and the ids of their labels.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Memory`].
    pub(crate) fn take(&mut self, chosen: impl Fn(u64) -> bool) -> Result<Self> {
        let (chunks, left): (BTreeMap<_, _>, _) =
            std::mem::take(&mut self.chunks).into_iter().partition(|((code, _), _)| chosen(*code));
        let (delivered, others) =
            std::mem::take(&mut self.delivered).into_iter().partition(|(code, _)| chosen(*code));
        (self.chunks, self.delivered) = (left, others);
        let (mut ids, mut distinct) = (Vec::new(), 0);
        for piece in chunks.values().flatten() {
            match piece {
                Piece::Memory(part) => {
                    make_room(&mut ids, part.ids.len(), LABELS)?;
                    ids.extend_from_slice(&part.ids);
                }
                &Piece::Disk(place, labels, _) => self.scratch.read_ids(place, labels, &mut ids)?,
            }
            if ids.len() > MOST_REPEATED_IDS.max(2 * distinct) {
                ids.sort_unstable();
                ids.dedup();
                distinct = ids.len();
            }
        }
        ids.sort_unstable();
        ids.dedup();
        Ok(Self { ids, frames: self.frames, chunks, delivered, scratch: self.scratch.clone() })
    }

    /// Number of records of all parts.
    pub(crate) fn records(&self) -> u64 {
        let of_piece = |piece: &Piece| match piece {
            Piece::Memory(part) => part.len() as u64,
            Piece::Disk(_, _, records) => *records,
        };
        self.chunks.values().flatten().map(of_piece).sum()
    }

    /// Morton codes of the chunks that have records, rising; one of several frames comes as often.
    pub(crate) fn codes(&self) -> impl Iterator<Item = u64> + '_ {
        self.chunks.keys().map(|&(code, _)| code)
    }

    /// The Morton code of the first chunk that is left, and the number of frames at which it has records.
    pub(crate) fn next_chunk(&self) -> Option<(u64, u64)> {
        let &(code, _) = self.chunks.keys().next()?;
        Some((code, self.chunks.range((code, 0)..=(code, u32::MAX)).count() as u64))
    }

    /// Removes the records of the first chunk that is left, at its first frame; returns its Morton code and the frame too. `buffer_bytes` is
    /// for reading all of its parts.
    pub(crate) fn take_chunk(&mut self, buffer_bytes: u64) -> Option<(u64, u32, ChunkRecords<'_>)> {
        let ((code, frame), pieces) = self.chunks.pop_first()?;
        let most = (buffer_bytes as usize / pieces.len().max(1)).clamp(1 << 12, 1 << 16);
        let cursors = pieces.into_iter().map(|piece| Cursor::new(piece, most)).collect();
        Some((code, frame, ChunkRecords { cursors, scratch: &self.scratch }))
    }
}

/// The records of one chunk, label after label by rising id.
pub(crate) struct ChunkRecords<'a> {
    cursors: Vec<Cursor>,
    scratch: &'a Scratch,
}

/// Reads one part.
struct Cursor {
    piece: Piece,
    /// Labels that were begun, and the next record.
    label: u64,
    record: u64,
    /// The next label and how many of its records are left; `None` before the first and after the last.
    next: Option<(u64, u64)>,
    /// From the file: ids and numbers of records from label `known_from` on, and records from `cells_from` on.
    known: Vec<(u64, u64)>,
    known_from: u64,
    cells: Vec<Cell>,
    cells_from: u64,
    buffer_bytes: usize,
    begun: bool,
}

impl Cursor {
    fn new(piece: Piece, buffer_bytes: usize) -> Self {
        Self {
            piece,
            label: 0,
            record: 0,
            next: None,
            known: Vec::new(),
            known_from: 0,
            cells: Vec::new(),
            cells_from: 0,
            buffer_bytes,
            begun: false,
        }
    }

    /// Moves on to the next label.
    fn advance(&mut self, scratch: &Scratch) -> Result<()> {
        self.begun = true;
        self.next = match &self.piece {
            Piece::Memory(part) => {
                let i = self.label as usize;
                part.ids.get(i).map(|&id| (id, (part.offsets[i + 1] - part.offsets[i]) as u64))
            }
            &Piece::Disk(place, labels, _) if self.label < labels => {
                if self.label >= self.known_from + self.known.len() as u64 {
                    let n = (labels - self.label).min(self.buffer_bytes as u64 / 16);
                    let mut numbers = vec![0u64; 2 * n as usize];
                    let (ids, counts) = numbers.split_at_mut(n as usize);
                    scratch.read(bytemuck::cast_slice_mut(ids), place + 8 * self.label)?;
                    scratch.read(bytemuck::cast_slice_mut(counts), place + 8 * (labels + self.label))?;
                    self.known = ids.iter().copied().zip(counts.iter().copied()).collect();
                    self.known_from = self.label;
                }
                Some(self.known[(self.label - self.known_from) as usize])
            }
            Piece::Disk(..) => None,
        };
        self.label += 1;
        Ok(())
    }

    /// Appends up to `most` records of the current label; returns their number.
    fn read(&mut self, most: u64, cells: &mut Vec<Cell>, scratch: &Scratch) -> Result<u64> {
        let Some((_, left)) = &mut self.next else { return Ok(0) };
        let n = most.min(*left);
        make_room(cells, n as usize, RECORDS)?;
        match &self.piece {
            Piece::Memory(part) => {
                cells.extend_from_slice(&part.cells[self.record as usize..(self.record + n) as usize]);
            }
            &Piece::Disk(place, labels, records) => {
                let first = place + 16 * labels;
                let (mut at, end) = (self.record, self.record + n);
                while at < end {
                    let ready_end = self.cells_from + self.cells.len() as u64;
                    if at >= ready_end {
                        let room = (self.buffer_bytes / size_of::<Cell>()) as u64;
                        if end - at >= room {
                            // Into the caller's own memory.
                            let from = cells.len();
                            cells.resize(from + (end - at) as usize, Cell { key: 0, mask: 0 });
                            scratch.read(bytemuck::cast_slice_mut(&mut cells[from..]), first + 16 * at)?;
                            break;
                        }
                        self.cells.resize(room.min(records - at) as usize, Cell { key: 0, mask: 0 });
                        scratch.read(bytemuck::cast_slice_mut(&mut self.cells), first + 16 * at)?;
                        self.cells_from = at;
                        continue;
                    }
                    let to = end.min(ready_end);
                    let (a, b) = ((at - self.cells_from) as usize, (to - self.cells_from) as usize);
                    cells.extend_from_slice(&self.cells[a..b]);
                    at = to;
                }
            }
        }
        self.record += n;
        *left -= n;
        Ok(n)
    }
}

impl ChunkRecords<'_> {
    /// The next label: its id and the number of its records, of which several may be of one cell.
    pub(crate) fn next_label(&mut self) -> Result<Option<(u64, u64)>> {
        for cursor in &mut self.cursors {
            if !cursor.begun || cursor.next.is_some_and(|(_, left)| left == 0) {
                cursor.advance(self.scratch)?;
            }
        }
        let Some(id) = self.cursors.iter().filter_map(|c| c.next).map(|(id, _)| id).min() else {
            return Ok(None);
        };
        let of_id = self.cursors.iter().filter_map(|c| c.next).filter(|&(other, _)| other == id);
        Ok(Some((id, of_id.map(|(_, left)| left).sum())))
    }

    /// Appends up to `most` records of the label that [`ChunkRecords::next_label`] gave last. They come by rising key within a part; returns
    /// how many parts they are of.
    pub(crate) fn read(&mut self, id: u64, most: u64, cells: &mut Vec<Cell>) -> Result<usize> {
        let (mut left, mut parts) = (most, 0);
        for cursor in &mut self.cursors {
            if left > 0 && cursor.next.is_some_and(|(other, n)| other == id && n > 0) {
                left -= cursor.read(left, cells, self.scratch)?;
                parts += 1;
            }
        }
        Ok(parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::sort_and_or;
    use crate::{LabelBlock, LabelBuffer};

    /// Slices of a volume that lies in two chunks.
    fn parts() -> Vec<SortedCells> {
        (0..40u32)
            .map(|z| {
                let labels = (0..256u32).map(|i| ((i + z) % 7) as u8).collect();
                let block = LabelBlock::x_fastest([1016, 0, z], [16, 16, 1], LabelBuffer::U8(labels));
                SortedCells::from_block(&block, [1032, 16, 40]).unwrap()
            })
            .collect()
    }

    fn gathered(store: PartStore) -> (bool, Vec<(u64, u64, Vec<Cell>)>) {
        let mut stored = store.into_parts().unwrap();
        assert_eq!((stored.chunks.len(), &stored.ids[..]), (2, &[1, 2, 3, 4, 5, 6][..]));
        let mut all = Vec::new();
        while let Some((chunk, _, mut records)) = stored.take_chunk(1 << 13) {
            while let Some((id, count)) = records.next_label().unwrap() {
                let mut cells = Vec::new();
                while (cells.len() as u64) < count {
                    records.read(id, 37, &mut cells).unwrap();
                }
                sort_and_or(&mut cells).unwrap();
                all.push((chunk, id, cells));
            }
        }
        (stored.scratch.is_used(), all)
    }

    #[test]
    fn parts_in_the_file_gather_like_those_in_memory() {
        let whole = SortedCells::merge(&parts()).unwrap();
        let mut expected = Vec::new();
        for chunk in [0, 1] {
            for (i, &id) in whole.ids().iter().enumerate() {
                let cells = whole.cells_of(i).iter().copied().filter(|c| c.key / CHUNK_CELLS == chunk);
                expected.push((chunk, id, cells.collect::<Vec<_>>()));
            }
        }
        for (limit, spills) in [(u64::MAX, false), (250, true), (6000, true), (1 << 28, false)] {
            let store = PartStore::new(limit, None, &std::env::temp_dir());
            for part in parts() {
                store.add(part, true).unwrap();
            }
            assert_eq!(gathered(store), (spills, expected.clone()), "{limit:?}");
        }
    }

    #[test]
    fn a_table_of_labels_beyond_the_limit_is_refused_with_what_it_needs() {
        let store = PartStore::new(50, Some(200), &std::env::temp_dir());
        parts().into_iter().try_for_each(|part| store.add(part, false)).unwrap();
        let error = store.into_parts().err().unwrap().to_string();
        assert!(error.contains("table of 6 labels: 240 is more than the limit of 200"), "{error}");
    }
}
