//! The directories of a TIFF file: one per page, each a list of tags. Classic TIFF and BigTIFF, both byte orders.
//!
//! ```text
//! classic  II 42 . first-IFD(4)         IFD: count(2)  { tag(2) type(2) count(4) value-or-offset(4) }…  next(4)
//! Big      II 43 8 0 first-IFD(8)       IFD: count(8)  { tag(2) type(2) count(8) value-or-offset(8) }…  next(8)
//! ```
//! After TIFF Revision 6.0 (Adobe 1992) §2 and the BigTIFF design (AWare Systems). Pumice has its own reader because the voxels must come
//! out as stored (a library that inverts `WhiteIsZero` would change labels) and row by row (ImageJ stores a whole plane as one strip), and
//! because ImageJ's stacks above 4 GiB have only one directory.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::error::{FormatError, Result};
use crate::stream::open_file;

/// Largest number of entries of a directory; TIFF has some hundred tags altogether.
const MAX_ENTRIES: u64 = 4096;

/// Largest number of pages of a file: the slices that a volume may have, times channels and time steps.
const MAX_PAGES: usize = 1 << 24;

/// Longest text of a tag that is read, in bytes.
const MAX_TEXT_BYTES: u64 = 64 << 20;

/// Tags, with their names in the specification.
pub(crate) mod tag {
    pub(crate) const NEW_SUBFILE_TYPE: u16 = 254;
    pub(crate) const IMAGE_WIDTH: u16 = 256;
    pub(crate) const IMAGE_LENGTH: u16 = 257;
    pub(crate) const BITS_PER_SAMPLE: u16 = 258;
    pub(crate) const COMPRESSION: u16 = 259;
    pub(crate) const PHOTOMETRIC: u16 = 262;
    pub(crate) const FILL_ORDER: u16 = 266;
    pub(crate) const IMAGE_DESCRIPTION: u16 = 270;
    pub(crate) const STRIP_OFFSETS: u16 = 273;
    pub(crate) const SAMPLES_PER_PIXEL: u16 = 277;
    pub(crate) const ROWS_PER_STRIP: u16 = 278;
    pub(crate) const STRIP_BYTE_COUNTS: u16 = 279;
    pub(crate) const X_RESOLUTION: u16 = 282;
    pub(crate) const Y_RESOLUTION: u16 = 283;
    pub(crate) const RESOLUTION_UNIT: u16 = 296;
    pub(crate) const PREDICTOR: u16 = 317;
    pub(crate) const TILE_WIDTH: u16 = 322;
    pub(crate) const TILE_LENGTH: u16 = 323;
    pub(crate) const TILE_OFFSETS: u16 = 324;
    pub(crate) const TILE_BYTE_COUNTS: u16 = 325;
    pub(crate) const SAMPLE_FORMAT: u16 = 339;
    /// Of SGI: slices of a page that holds a whole volume.
    pub(crate) const IMAGE_DEPTH: u16 = 32997;
}

/// One tag: its type, its number of values, and their offset in the file.
#[derive(Clone, Copy, Debug)]
struct Entry {
    kind: u16,
    count: u64,
    at: u64,
}

/// The tags of one page.
pub(crate) struct Directory {
    entries: HashMap<u16, Entry>,
    next: u64,
}

/// An open TIFF file.
pub(crate) struct TiffFile {
    path: PathBuf,
    file: BufReader<File>,
    /// Where in the file the next byte is read: asking the system for each number would take most of the time of opening.
    position: u64,
    pub(crate) big_endian: bool,
    big_tiff: bool,
    pub(crate) file_bytes: u64,
    first: u64,
}

impl TiffFile {
    /// Reads the file header.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let file = open_file(path)?;
        let file_bytes = file.metadata().map_err(FormatError::io(path))?.len();
        let mut tiff = Self {
            path: path.to_owned(),
            file: BufReader::new(file),
            position: 0,
            big_endian: false,
            big_tiff: false,
            file_bytes,
            first: 0,
        };
        let order = tiff.bytes::<2>(0)?;
        tiff.big_endian = match &order {
            b"II" => false,
            b"MM" => true,
            _ => return Err(tiff.damaged("expected II or MM at the start of a TIFF file", 0)),
        };
        tiff.first = match tiff.u16(2)? {
            42 => tiff.u32(4)?.into(),
            43 if tiff.u16(4)? == 8 => {
                tiff.big_tiff = true;
                tiff.u64(8)?
            }
            version => return Err(tiff.damaged(&format!("expected TIFF version 42 or 43, got {version}"), 2)),
        };
        Ok(tiff)
    }

    /// Offsets of the directories of all pages, without reduced-resolution copies.
    pub(crate) fn pages(&mut self) -> Result<Vec<u64>> {
        let mut pages = Vec::new();
        let mut seen = std::collections::HashSet::new();
        let mut at = self.first;
        while at != 0 {
            if !seen.insert(at) {
                return Err(self.damaged("the list of pages runs in a circle", at));
            }
            if seen.len() > MAX_PAGES {
                return Err(FormatError::Limit {
                    path: self.path.clone(),
                    what: "the number of pages".into(),
                    got: "more".into(),
                    limit: MAX_PAGES as u64,
                });
            }
            let directory = self.directory(at)?;
            // Bit 0 marks a smaller copy of another page (TIFF 6.0 §8), as in image pyramids.
            if self.number(&directory, tag::NEW_SUBFILE_TYPE)?.unwrap_or(0) & 1 == 0 {
                pages.push(at);
            }
            at = directory.next;
        }
        if pages.is_empty() {
            return Err(self.damaged("the file has no page", 4));
        }
        Ok(pages)
    }

    /// Reads the directory at byte `at`.
    pub(crate) fn directory(&mut self, at: u64) -> Result<Directory> {
        let (count_bytes, entry_bytes, inline) = if self.big_tiff { (8, 20, 12) } else { (2, 12, 8) };
        let count = if self.big_tiff { self.u64(at)? } else { self.u16(at)?.into() };
        if count > MAX_ENTRIES {
            return Err(self.damaged(&format!("a page has {count} tags, expected at most {MAX_ENTRIES}"), at));
        }
        let mut entries = HashMap::new();
        let end = at.saturating_add(count_bytes + count * entry_bytes);
        for i in 0..count {
            let entry_at = at + count_bytes + i * entry_bytes;
            let (id, kind) = (self.u16(entry_at)?, self.u16(entry_at + 2)?);
            let count = if self.big_tiff { self.u64(entry_at + 4)? } else { self.u32(entry_at + 4)?.into() };
            // Values that fit are stored in the entry itself.
            let fits = if self.big_tiff { 8 } else { 4 };
            let value_at = if count.saturating_mul(kind_bytes(kind)) <= fits {
                entry_at + inline
            } else if self.big_tiff {
                self.u64(entry_at + inline)?
            } else {
                self.u32(entry_at + inline)?.into()
            };
            entries.insert(id, Entry { kind, count, at: value_at });
        }
        let next = if self.big_tiff { self.u64(end)? } else { self.u32(end)?.into() };
        Ok(Directory { entries, next })
    }

    /// The first value of a tag.
    pub(crate) fn number(&mut self, directory: &Directory, id: u16) -> Result<Option<u64>> {
        match directory.entries.get(&id) {
            Some(&entry) if entry.count > 0 => self.value(entry, 0).map(Some),
            _ => Ok(None),
        }
    }

    /// Number of values of a tag.
    pub(crate) fn count(&self, directory: &Directory, id: u16) -> u64 {
        directory.entries.get(&id).map_or(0, |e| e.count)
    }

    /// Value `index` of a tag with several values.
    pub(crate) fn nth(&mut self, directory: &Directory, id: u16, index: u64) -> Result<u64> {
        match directory.entries.get(&id) {
            Some(&entry) if index < entry.count => self.value(entry, index),
            _ => {
                let path = self.path.clone();
                Err(FormatError::damaged(&path, format!("tag {id} has no value number {index}")))
            }
        }
    }

    /// The text of a tag.
    pub(crate) fn text(&mut self, directory: &Directory, id: u16) -> Result<Option<String>> {
        let Some(&entry) = directory.entries.get(&id) else { return Ok(None) };
        if entry.kind != 2 && entry.kind != 1 {
            return Ok(None);
        }
        if entry.count > MAX_TEXT_BYTES || entry.count > self.file_bytes.saturating_sub(entry.at) {
            return Err(self.damaged(
                &format!(
                    "tag {id} has a text of {} bytes, expected at most 64 MiB and within the file",
                    entry.count
                ),
                entry.at,
            ));
        }
        let mut bytes = vec![0; entry.count as usize];
        self.read_at(entry.at, &mut bytes)?;
        let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
        let bytes = &bytes[..end];
        // OME writes UTF-8, ImageJ writes Latin-1.
        Ok(Some(match std::str::from_utf8(bytes) {
            Ok(text) => text.to_owned(),
            Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
        }))
    }

    /// The fraction of a tag (TIFF type RATIONAL).
    pub(crate) fn rational(&mut self, directory: &Directory, id: u16) -> Result<Option<f64>> {
        match directory.entries.get(&id) {
            Some(&Entry { kind: 5, count: 1.., at }) => {
                let (numerator, denominator) = (self.u32(at)?, self.u32(at + 4)?);
                Ok(Some(f64::from(numerator) / f64::from(denominator)))
            }
            _ => Ok(None),
        }
    }

    fn value(&mut self, entry: Entry, index: u64) -> Result<u64> {
        let at = entry.at.saturating_add(index.saturating_mul(kind_bytes(entry.kind)));
        match entry.kind {
            1 | 2 | 7 => Ok(self.bytes::<1>(at)?[0].into()),
            3 => Ok(self.u16(at)?.into()),
            4 | 13 => Ok(self.u32(at)?.into()),
            16 | 18 => self.u64(at),
            kind => Err(self.damaged(&format!("expected a whole number, got tag type {kind}"), at)),
        }
    }

    fn u16(&mut self, at: u64) -> Result<u16> {
        let bytes = self.bytes(at)?;
        Ok(if self.big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    fn u32(&mut self, at: u64) -> Result<u32> {
        let bytes = self.bytes(at)?;
        Ok(if self.big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    fn u64(&mut self, at: u64) -> Result<u64> {
        let bytes = self.bytes(at)?;
        Ok(if self.big_endian { u64::from_be_bytes(bytes) } else { u64::from_le_bytes(bytes) })
    }

    fn bytes<const N: usize>(&mut self, at: u64) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        self.read_at(at, &mut bytes)?;
        Ok(bytes)
    }

    fn read_at(&mut self, at: u64, bytes: &mut [u8]) -> Result<()> {
        if at.checked_add(bytes.len() as u64).is_none_or(|end| end > self.file_bytes) {
            return Err(self.damaged(
                &format!(
                    "the file has {} bytes, but refers to byte {at}: it is cut off or damaged",
                    self.file_bytes
                ),
                self.file_bytes,
            ));
        }
        // Relative seeks keep the buffer, because entries of one directory lie side by side.
        let step = i64::try_from(i128::from(at) - i128::from(self.position));
        match step {
            Ok(step) => self.file.seek_relative(step),
            Err(_) => self.file.seek(SeekFrom::Start(at)).map(|_| ()),
        }
        .and_then(|()| self.file.read_exact(bytes))
        .map_err(FormatError::io(&self.path))?;
        self.position = at + bytes.len() as u64;
        Ok(())
    }

    fn damaged(&self, what: &str, at: u64) -> FormatError {
        FormatError::Damaged { path: self.path.clone(), what: what.to_owned(), at: Some(at) }
    }
}

/// Bytes of one value of a TIFF type (TIFF 6.0 §2; 13 and 16 to 18: BigTIFF); unknown types count as 1.
fn kind_bytes(kind: u16) -> u64 {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16 | 17 | 18 => 8,
        _ => 1,
    }
}
