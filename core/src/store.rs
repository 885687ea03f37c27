//! Stores parts until the volume is finished: in memory or, beyond a limit, in a spill file.
//!
//! ```text
//! add(part):  merges small or ragged parts in groups of eight    (a block that cuts cells leaves each cell in several parts)
//!             above the limit, all records move to the spill file, one part after another
//! finish:     gather(label) fetches the label's records from every part, in memory or on disk, then sorts and ORs them
//! ```
//! The spill file has no name (it is unlinked as soon as it is open), so nothing remains however the process ends. Only records are
//! spilled, 16 bytes each; a part's ids and offsets stay in memory, because merging reads them in order.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use crate::cell::{Cell, sort_and_or};
use crate::reserve::make_room;
use crate::sorted_cells::{Run, SortedCells, runs_by_id};
use crate::{Error, NoMemory, Result};

/// Number of parts of one merge level that are merged into one part of the next.
const MERGE_PARTS: usize = 8;

/// Parts with at least this many records are not merged: that would cost more than it saves.
const SMALL_CELLS: usize = 1 << 16;

/// A part whose records are in memory or in the spill file.
struct StoredPart {
    ids: Vec<u64>,
    offsets: Vec<usize>,
    place: StoredCells,
}

enum StoredCells {
    Memory(Vec<Cell>),
    /// Index of the first record in the spill file.
    Disk(u64),
}

/// The file that takes the records that exceed the limit.
struct Spill {
    file: File,
    folder: PathBuf,
    cells: u64,
}

#[derive(Default)]
struct State {
    /// Parts that wait to be merged with others; level k holds results of k merges.
    waiting: Vec<Vec<SortedCells>>,
    done: Vec<StoredPart>,
    /// Bytes on the heap of the records in memory.
    bytes: u64,
    spill: Option<Spill>,
}

/// Collects parts from several threads; see the module documentation.
pub(crate) struct PartStore {
    state: Mutex<State>,
    limit_bytes: Option<u64>,
    folder: PathBuf,
}

impl PartStore {
    /// A store that keeps at most `limit_bytes` of records in memory and writes the rest to a file in `folder`.
    pub(crate) fn new(limit_bytes: Option<u64>, folder: PathBuf) -> Self {
        Self { state: Mutex::default(), limit_bytes, folder }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        // Every critical section leaves the state consistent before anything in it can fail.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a part. `ragged` means that its block cuts through cells, so merging it with its neighbours makes it smaller.
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
            state.bytes += cell_bytes(&part);
            state.waiting[level].push(part);
            if state.waiting[level].len() < MERGE_PARTS {
                return self.relieve(&mut state);
            }
            let group = std::mem::take(&mut state.waiting[level]);
            state.bytes -= group.iter().map(cell_bytes).sum::<u64>();
            drop(state);
            part = SortedCells::merge(&group)?;
            level += 1;
        }
    }

    fn keep(&self, state: &mut State, part: SortedCells) -> Result<()> {
        state.bytes += cell_bytes(&part);
        state.done.push(StoredPart {
            ids: part.ids,
            offsets: part.offsets,
            place: StoredCells::Memory(part.cells),
        });
        self.relieve(state)
    }

    /// Spills all records if they exceed the limit.
    fn relieve(&self, state: &mut State) -> Result<()> {
        if self.limit_bytes.is_none_or(|limit| state.bytes <= limit) {
            return Ok(());
        }
        let io = |source| Error::Io { path: self.folder.clone(), source };
        let State { waiting, done, bytes, spill } = state;
        done.extend(waiting.iter_mut().flat_map(std::mem::take).map(|part| StoredPart {
            ids: part.ids,
            offsets: part.offsets,
            place: StoredCells::Memory(part.cells),
        }));
        let spill = match spill {
            Some(spill) => spill,
            None => {
                let file = tempfile::tempfile_in(&self.folder).map_err(io)?;
                spill.insert(Spill { file, folder: self.folder.clone(), cells: 0 })
            }
        };
        for part in done.iter_mut() {
            if let StoredCells::Memory(cells) = &part.place {
                spill.file.seek(SeekFrom::Start(spill.cells * size_of::<Cell>() as u64)).map_err(io)?;
                spill.file.write_all(bytemuck::cast_slice(cells)).map_err(io)?;
                let first = spill.cells;
                spill.cells += cells.len() as u64;
                part.place = StoredCells::Disk(first);
            }
        }
        *bytes = 0;
        Ok(())
    }

    /// Ends adding and returns all parts, ready to gather from.
    pub(crate) fn into_parts(self) -> StoredParts {
        let State { waiting, mut done, spill, .. } =
            self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        done.extend(waiting.into_iter().flatten().map(|part| StoredPart {
            ids: part.ids,
            offsets: part.offsets,
            place: StoredCells::Memory(part.cells),
        }));
        StoredParts { parts: done, spill }
    }
}

fn cell_bytes(part: &SortedCells) -> u64 {
    (part.cells.capacity() * size_of::<Cell>()) as u64
}

/// All parts of a volume, after the last was added.
pub(crate) struct StoredParts {
    parts: Vec<StoredPart>,
    spill: Option<Spill>,
}

impl StoredParts {
    /// The runs of all labels in all parts, by rising id.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(crate) fn runs(&self) -> std::result::Result<Vec<Run>, NoMemory> {
        runs_by_id(self.parts.iter().map(|p| (p.ids.as_slice(), p.offsets.as_slice())))
    }

    /// Bytes on the heap of ids and offsets, which cannot be spilled.
    pub(crate) fn index_bytes(&self) -> u64 {
        self.parts.iter().map(|p| 8 * (p.ids.capacity() + p.offsets.capacity()) as u64).sum()
    }

    /// Replaces `cells` by one label's records from all its runs, sorted and ORed.
    pub(crate) fn gather(&self, runs: &[Run], cells: &mut Vec<Cell>) -> Result<()> {
        cells.clear();
        make_room(cells, runs.iter().map(|run| run.end - run.start).sum(), "the cells of a label")?;
        for run in runs {
            let part = &self.parts[run.part as usize];
            match (&part.place, &self.spill) {
                (StoredCells::Memory(all), _) => cells.extend_from_slice(&all[run.start..run.end]),
                (StoredCells::Disk(first), Some(spill)) => {
                    let start = cells.len();
                    cells.resize(start + (run.end - run.start), Cell { key: 0, mask: 0 });
                    let at = (first + run.start as u64) * size_of::<Cell>() as u64;
                    read_exact_at(&spill.file, bytemuck::cast_slice_mut(&mut cells[start..]), at)
                        .map_err(|source| Error::Io { path: spill.folder.clone(), source })?;
                }
                // This cannot occur: a part is on disk only after the spill file was created.
                (StoredCells::Disk(_), None) => {}
            }
        }
        if runs.len() > 1 {
            sort_and_or(cells)?;
        }
        Ok(())
    }
}

/// Reads at an offset without moving the cursor, which other threads share.
#[cfg(unix)]
fn read_exact_at(file: &File, bytes: &mut [u8], at: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, at)
}

/// Reads at an offset; each Windows call both sets the cursor and reads, so threads do not interfere.
#[cfg(windows)]
fn read_exact_at(file: &File, bytes: &mut [u8], at: u64) -> std::io::Result<()> {
    use std::os::windows::fs::FileExt;
    let mut done = 0;
    while done < bytes.len() {
        match file.seek_read(&mut bytes[done..], at + done as u64)? {
            0 => return Err(std::io::ErrorKind::UnexpectedEof.into()),
            n => done += n,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabelBlock, LabelBuffer};

    fn parts() -> Vec<SortedCells> {
        (0..40u32)
            .map(|z| {
                let labels = (0..256u32).map(|i| ((i + z) % 7) as u8).collect();
                let block = LabelBlock::x_fastest([0, 0, z], [16, 16, 1], LabelBuffer::U8(labels));
                SortedCells::from_block(&block, [16, 16, 40]).unwrap()
            })
            .collect()
    }

    fn gathered(store: PartStore) -> (bool, Vec<(u64, Vec<Cell>)>) {
        let stored = store.into_parts();
        let runs = stored.runs().unwrap();
        let mut all = Vec::new();
        for same in runs.chunk_by(|a, b| a.id == b.id) {
            let mut cells = Vec::new();
            stored.gather(same, &mut cells).unwrap();
            all.push((same[0].id, cells));
        }
        (stored.spill.is_some(), all)
    }

    #[test]
    fn spilled_parts_gather_like_those_in_memory() {
        let whole = SortedCells::merge(&parts()).unwrap();
        let expected: Vec<_> =
            whole.ids().iter().enumerate().map(|(i, &id)| (id, whole.cells_of(i).to_vec())).collect();
        for (limit, spills) in [(None, false), (Some(0), true), (Some(6000), true), (Some(1 << 30), false)] {
            let store = PartStore::new(limit, std::env::temp_dir());
            for part in parts() {
                store.add(part, true).unwrap();
            }
            assert_eq!(gathered(store), (spills, expected.clone()), "{limit:?}");
        }
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let store = PartStore::new(Some(0), "/nowhere/at/all".into());
        let error = store.add(parts().remove(0), false).unwrap_err();
        assert!(error.to_string().contains("/nowhere/at/all"), "{error}");
    }
}
