//! Joins ids while a volume is read: the table of an agglomeration says to which segment each supervoxel belongs.
//!
//! ```text
//! supervoxel,segment       a header is optional; comma, tab, semicolon or spaces; `#` begins a comment
//! 17,3                     or an array of whole numbers of shape (n, 2) in an .npy file
//! 18,3
//! ```
//! Ids that the table lacks stay as they are, and a warning says so. Segment 0 makes a supervoxel background. Memory: 16 bytes a pair.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use pumice_core::reserve;
use pumice_core::{BlockSource, LabelBlock, LabelBuffer, LabelType, VolumeInfo};

use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::npy_header;
use crate::options::Warnings;
use crate::stream::{ByteStream, PlainStream, open_file};

/// Longest line of a table.
const MOST_LINE_BYTES: u64 = 4096;

/// Pairs of supervoxel and segment.
#[derive(Debug)]
pub(crate) struct Joins {
    path: PathBuf,
    /// Sorted by supervoxel, each once.
    pairs: Vec<(u64, u64)>,
    largest: u64,
}

impl Joins {
    /// Reads a table.
    ///
    /// # Errors
    /// One line with the place of what is no pair of ids; an id that has two segments.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let mut magic = [0; 6];
        let is_array = std::io::Read::read_exact(&mut open_file(path)?, &mut magic).is_ok()
            && magic == *npy_header::MAGIC;
        let mut pairs = if is_array { of_array(path)? } else { of_text(path)? };
        if pairs.is_empty() {
            return Err(FormatError::damaged(path, "the table has no pairs of ids"));
        }
        pairs.sort_unstable();
        pairs.dedup();
        if let Some(two) = pairs.windows(2).find(|two| two[0].0 == two[1].0) {
            let (id, a, b) = (two[0].0, two[0].1, two[1].1);
            return Err(FormatError::damaged(path, format!("id {id} belongs to two segments, {a} and {b}")));
        }
        if let Some(&(0, segment)) = pairs.first().filter(|pair| pair.1 != 0) {
            return Err(FormatError::damaged(
                path,
                format!("id 0 is background and cannot belong to segment {segment}"),
            ));
        }
        let largest = pairs.iter().map(|pair| pair.1).max().unwrap_or(0);
        Ok(Self { path: path.to_owned(), pairs, largest })
    }

    fn segment(&self, id: u64) -> Option<u64> {
        self.pairs.binary_search_by_key(&id, |pair| pair.0).ok().map(|at| self.pairs[at].1)
    }
}

/// The pairs of an array of shape (n, 2).
fn of_array(path: &Path) -> Result<Vec<(u64, u64)>> {
    let mut stream = PlainStream::open(path, 0)?;
    let header = npy_header::read(path, &mut stream)?;
    let label_type = crate::npy::label_type(path, &header.descr)?;
    let wrong = |what: String| {
        FormatError::damaged(path, format!("expected whole numbers of shape (n, 2), got {what}"))
    };
    let &[rows, 2] = header.shape.as_slice() else {
        return Err(wrong(format!("shape {}", header.shape_text())));
    };
    if matches!(label_type, LabelType::F32 | LabelType::F64) {
        return Err(wrong("floating-point numbers, which round ids".into()));
    }
    let element = Element::new(label_type, header.descr.starts_with('>'));
    let bytes = rows.saturating_mul(2).saturating_mul(element.bytes() as u64);
    let got = open_file(path)?.metadata().map_err(FormatError::io(path))?.len().saturating_sub(header.bytes);
    if got < bytes {
        return Err(FormatError::Short { path: path.to_owned(), expected: bytes, got, at: None });
    }
    let rows = usize::try_from(rows).map_err(|_| wrong(format!("{rows} rows")))?;
    let memory = FormatError::memory(path);
    // The file has these bytes.
    let mut stored = reserve::zeroed::<u8>(bytes as usize, "the table of joined ids").map_err(&memory)?;
    if stream.fill(&mut stored)? < stored.len() {
        return Err(FormatError::damaged(path, "the array ends early"));
    }
    let numbers = element.decode(&stored).map_err(|bad| wrong(format!("{}, {}", bad.value, bad.reason)))?;
    drop(stored);
    let place =
        |row: usize, column: usize| if header.fortran_order { row + column * rows } else { 2 * row + column };
    let pairs = (0..rows).map(|row| (numbers.get(place(row, 0)), numbers.get(place(row, 1))));
    reserve::collected(rows, pairs, "the table of joined ids").map_err(&memory)
}

/// The pairs of a text, one a line.
fn of_text(path: &Path) -> Result<Vec<(u64, u64)>> {
    let mut pairs = Vec::new();
    let mut file = BufReader::new(open_file(path)?);
    let mut is_first = true;
    for line in 1.. {
        let mut text = Vec::new();
        let read = std::io::Read::take(&mut file, MOST_LINE_BYTES)
            .read_until(b'\n', &mut text)
            .map_err(FormatError::io(path))?;
        if read == 0 {
            break;
        }
        let wrong = |column, what: String| FormatError::Cell { path: path.to_owned(), line, column, what };
        let text = std::str::from_utf8(&text).map_err(|_| wrong(1, "expected text in UTF-8".into()))?;
        let text = text.trim_start_matches('\u{feff}').split('#').next().unwrap_or_default().trim();
        if text.is_empty() {
            continue;
        }
        let is_gap = |c: char| matches!(c, ',' | ';' | '\t' | ' ');
        let cells: Vec<&str> =
            text.split(is_gap).map(|cell| cell.trim().trim_matches('"')).filter(|c| !c.is_empty()).collect();
        let is_header =
            std::mem::replace(&mut is_first, false) && cells.iter().all(|cell| cell.parse::<u64>().is_err());
        if is_header {
            continue;
        }
        let &[id, segment] = cells.as_slice() else {
            return Err(wrong(
                1,
                format!("expected two ids, supervoxel and segment, got {:?}", shorten(text)),
            ));
        };
        let number = |column, cell: &str| {
            cell.parse().map_err(|_| {
                wrong(column, format!("expected a whole number from 0 to 2^64-1, got {:?}", shorten(cell)))
            })
        };
        reserve::make_room(&mut pairs, 1, "the table of joined ids").map_err(FormatError::memory(path))?;
        pairs.push((number(1, id)?, number(2, segment)?));
    }
    Ok(pairs)
}

/// Ids that were looked up last, by their lowest bits: neighbours mostly have the same few.
const RECENT: usize = 4096;

/// Delivers the blocks of another source with joined ids.
pub(crate) struct JoinedSource {
    inner: Box<dyn BlockSource>,
    info: VolumeInfo,
    joins: Joins,
    /// Id, its segment, and whether the table has it.
    recent: Vec<Option<(u64, u64, bool)>>,
    /// Whether an id came that the table lacks.
    lacks_some: bool,
    source: PathBuf,
    warnings: Warnings,
}

impl JoinedSource {
    pub(crate) fn new(inner: Box<dyn BlockSource>, joins: Joins, source: &Path, warnings: &Warnings) -> Self {
        let info = joined(inner.info(), &joins);
        let (source, warnings) = (source.to_owned(), warnings.clone());
        Self { inner, info, joins, recent: vec![None; RECENT], lacks_some: false, source, warnings }
    }

    /// The segment of an id, which is the id itself where the table lacks it.
    fn segment(&mut self, id: u64) -> u64 {
        let slot = (id as usize) % RECENT;
        let (segment, is_known) = match self.recent[slot] {
            Some((known, segment, is_known)) if known == id => (segment, is_known),
            _ => {
                let found = self.joins.segment(id);
                let (segment, is_known) = (found.unwrap_or(id), found.is_some() || id == 0);
                self.recent[slot] = Some((id, segment, is_known));
                (segment, is_known)
            }
        };
        self.lacks_some |= !is_known;
        segment
    }

    fn each<T: Copy + Into<u64>, U>(&mut self, labels: Vec<T>, narrow: impl Fn(u64) -> U) -> Vec<U> {
        labels.into_iter().map(|label| narrow(self.segment(label.into()))).collect()
    }
}

/// The description of a volume with joined ids: the type holds the segments too, and names stay with ids that are segments or not joined.
pub(crate) fn joined(info: &VolumeInfo, joins: &Joins) -> VolumeInfo {
    let most: u64 = match info.label_type {
        LabelType::U8 => u8::MAX.into(),
        LabelType::I8 => i8::MAX as u64,
        LabelType::U16 => u16::MAX.into(),
        LabelType::I16 => i16::MAX as u64,
        LabelType::U32 => u32::MAX.into(),
        LabelType::I32 => i32::MAX as u64,
        LabelType::I64 => i64::MAX as u64,
        LabelType::U64 => u64::MAX,
        // Whole numbers that the types hold exactly.
        LabelType::F32 => 1 << 24,
        LabelType::F64 => 1 << 53,
    };
    let mut info = info.clone();
    if joins.largest > most {
        info.label_type = if u32::try_from(joins.largest).is_ok() { LabelType::U32 } else { LabelType::U64 };
    }
    info.notes.retain(|note| joins.segment(note.id).is_none_or(|segment| segment == note.id));
    info
}

impl BlockSource for JoinedSource {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> pumice_core::Result<Option<LabelBlock>> {
        let Some(mut block) = self.inner.next_block()? else {
            if self.lacks_some {
                self.warnings.push(format!(
                    "{}: voxels have ids that {} lacks: these ids stay as they are",
                    self.source.display(),
                    self.joins.path.display()
                ));
            }
            return Ok(None);
        };
        let largest = self.joins.largest;
        block.labels = match block.labels {
            LabelBuffer::U8(v) if largest <= u8::MAX.into() => LabelBuffer::U8(self.each(v, |s| s as u8)),
            LabelBuffer::U16(v) if largest <= u16::MAX.into() => LabelBuffer::U16(self.each(v, |s| s as u16)),
            LabelBuffer::U32(v) if largest <= u32::MAX.into() => LabelBuffer::U32(self.each(v, |s| s as u32)),
            LabelBuffer::U8(v) => LabelBuffer::U64(self.each(v, |s| s)),
            LabelBuffer::U16(v) => LabelBuffer::U64(self.each(v, |s| s)),
            LabelBuffer::U32(v) => LabelBuffer::U64(self.each(v, |s| s)),
            LabelBuffer::U64(v) => LabelBuffer::U64(self.each(v, |s| s)),
        };
        Ok(Some(block))
    }
}

#[cfg(test)]
mod tests {
    use pumice_core::ArraySource;

    use super::*;

    /// Ids with the same lowest bits share a place among those that were looked up last, and still have segments of their own.
    #[test]
    fn ids_with_the_same_lowest_bits_are_told_apart() {
        let ids: Vec<u64> = (0..8).map(|i| 5 + i % 3 * RECENT as u64).collect();
        let folder = tempfile::tempdir().unwrap();
        let table = folder.path().join("segments.csv");
        std::fs::write(&table, format!("5,1\n{},2\n", 5 + RECENT)).unwrap();
        let source =
            ArraySource::new(VolumeInfo::new([8, 1, 1], LabelType::U64), LabelBuffer::U64(ids)).unwrap();
        let joins = Joins::read(&table).unwrap();
        let warnings = Warnings::default();
        let mut joined = JoinedSource::new(Box::new(source), joins, Path::new("volume"), &warnings);
        let mut found = Vec::new();
        while let Some(block) = joined.next_block().unwrap() {
            let LabelBuffer::U64(labels) = block.labels else { panic!("another type") };
            found.extend(labels);
        }
        let alone = 5 + 2 * RECENT as u64;
        assert_eq!(found, [1, 2, alone, 1, 2, alone, 1, 2]);
    }
}
