//! Reads the sections of a file: finds them by header and table, compares their checksums, decodes them.

use std::collections::HashMap;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::ops::Range;

use bytemuck::Pod;
use serde::Deserialize;

use super::codec;
use super::format_error::{FormatError, Stop};
use super::layout::{Contents, ENTRY_BYTES, Entry, HEADER_BYTES, Layout, section_checksum};
use super::size_limits;
use crate::elements::{Elements, MappedFile};
use crate::error::one_line;
use crate::reserve::reserved;
use crate::{CompressedVolume, Contacts, Error, Job, NumericColumn, VolumeInfo};

/// The section `INFO`, as JSON.
#[derive(Deserialize)]
struct Info {
    volume: VolumeInfo,
    types: Vec<String>,
    /// Names of the columns of `LCOL`; files without that section have none.
    #[serde(default)]
    columns: Vec<String>,
}

/// What the section `INFO` says beside the volume's info: names of label types, and of the columns of numbers.
pub(super) struct TableNames {
    pub(super) types: Vec<String>,
    pub(super) columns: Vec<String>,
}

/// Name of a section, and the chunk that it belongs to; `None` where it belongs to the volume.
type Key = ([u8; 4], Option<u32>);

/// Sections that were read and decoded, by name and chunk.
pub(super) struct Sections {
    decoded: HashMap<Key, Vec<u8>>,
    info: Option<Info>,
    offsets: HashMap<Key, u64>,
    /// The mapped file, if it is mapped, and the byte ranges of sections that were not read because they need no decoding.
    map: Option<MappedFile>,
    mapped: HashMap<[u8; 4], Range<usize>>,
}

impl Sections {
    /// A fault in a section of the volume, or in the first chunk's section with this name.
    pub(super) fn fault(&self, section: [u8; 4], what: impl Into<String>) -> Stop {
        let at = self.offsets.get(&(section, None)).or_else(|| self.offsets.get(&(section, Some(0))));
        Stop::Fault(FormatError { section, at: at.copied().unwrap_or(0), what: what.into() })
    }

    /// A fault in a section of a chunk.
    pub(super) fn fault_in(&self, section: [u8; 4], chunk: u32, what: &str) -> Stop {
        let what = format!("chunk {chunk}: {what}");
        Stop::Fault(FormatError { section, at: self.offset(section, Some(chunk)), what })
    }

    /// Byte offset of a section in the file; 0 if it was not read.
    fn offset(&self, name: [u8; 4], chunk: Option<u32>) -> u64 {
        self.offsets.get(&(name, chunk)).copied().unwrap_or(0)
    }

    /// Whether a section of the volume was read and has not been taken yet.
    pub(super) fn has(&self, name: &[u8; 4]) -> bool {
        self.decoded.contains_key(&(*name, None)) || self.mapped.contains_key(name)
    }

    /// Removes and returns the bytes of a section of the volume.
    pub(super) fn take(&mut self, name: &[u8; 4]) -> std::result::Result<Vec<u8>, Stop> {
        self.take_of(name, None)
    }

    /// Removes and returns the bytes of a section of a chunk, or of the volume.
    pub(super) fn take_of(
        &mut self,
        name: &[u8; 4],
        chunk: Option<u32>,
    ) -> std::result::Result<Vec<u8>, Stop> {
        let what = "expected the section, got none";
        self.decoded.remove(&(*name, chunk)).ok_or_else(|| match chunk {
            Some(chunk) => self.fault_in(*name, chunk, what),
            None => self.fault(*name, what),
        })
    }

    /// Returns an error if a section is left that was not taken.
    pub(super) fn expect_none_left(&self) -> std::result::Result<(), Stop> {
        match self.decoded.keys().min() {
            None => Ok(()),
            Some(&(name, chunk)) => {
                let place = chunk.map_or("the volume".to_owned(), |chunk| format!("chunk {chunk}"));
                let what = format!("expected no such section of {place}, got one");
                Err(Stop::Fault(FormatError { section: name, at: self.offset(name, chunk), what }))
            }
        }
    }

    /// Removes a section of the volume and converts it to elements of `N` bytes each.
    pub(super) fn elements<const N: usize, T>(
        &mut self,
        name: &[u8; 4],
        element: impl Fn([u8; N]) -> T,
    ) -> std::result::Result<Vec<T>, Stop> {
        self.elements_of(name, None, element)
    }

    /// Removes a section of a chunk, or of the volume, and converts it to elements of `N` bytes each.
    pub(super) fn elements_of<const N: usize, T>(
        &mut self,
        name: &[u8; 4],
        chunk: Option<u32>,
        element: impl Fn([u8; N]) -> T,
    ) -> std::result::Result<Vec<T>, Stop> {
        let bytes = self.take_of(name, chunk)?;
        let (whole, rest) = bytes.as_chunks::<N>();
        if !rest.is_empty() {
            let (at, what) =
                (self.offset(*name, chunk), format!("size: expected a multiple of {N}, got {}", bytes.len()));
            return Err(Stop::Fault(FormatError { section: *name, at, what }));
        }
        let mut elements = reserved(whole.len(), "a section of the file").map_err(Error::from)?;
        elements.extend(whole.iter().map(|&b| element(b)));
        Ok(elements)
    }

    /// Removes a section and returns it as an array that may stay in the mapped file.
    pub(super) fn array<const N: usize, T: Pod>(
        &mut self,
        name: &[u8; 4],
        element: impl Fn([u8; N]) -> T,
    ) -> std::result::Result<Elements<T>, Stop> {
        match (&self.map, self.mapped.remove(name)) {
            (Some(map), Some(range)) => {
                let length = range.len();
                map.elements(range).ok_or_else(|| {
                    self.fault(*name, format!("size: expected a multiple of {N}, got {length}"))
                })
            }
            _ => Ok(self.elements(name, element)?.into()),
        }
    }

    /// Removes the section `LCOL` and divides it into the columns with these names; without names, there is no such section.
    pub(super) fn columns(
        &mut self,
        names: Vec<String>,
        labels: usize,
    ) -> std::result::Result<Vec<NumericColumn>, Stop> {
        if names.is_empty() {
            return Ok(Vec::new());
        }
        let values = self.elements(b"LCOL", f64::from_le_bytes)?;
        let expected = names.len().saturating_mul(labels);
        if values.len() != expected {
            let what = format!("numbers: expected {} columns of {labels}, got {}", names.len(), values.len());
            return Err(self.fault(*b"LCOL", what));
        }
        // Columns of a volume without labels are empty, and `chunks_exact` takes no size of 0.
        let mut parts = values.chunks_exact(labels.max(1));
        let column =
            |name| NumericColumn { name, values: parts.next().map_or_else(Vec::new, <[f64]>::to_vec) };
        Ok(names.into_iter().map(column).collect())
    }

    /// Checks and takes over the pairs of touching labels; the volume's number of labels must have been checked.
    pub(super) fn unpack_contacts(&self, volume: &mut CompressedVolume) -> std::result::Result<(), Stop> {
        let packed = std::mem::take(&mut volume.labels.contacts.bytes);
        volume.labels.contacts =
            Contacts::from_packed(packed, volume.labels.len() as u32).map_err(|(at, what)| {
                self.fault(*b"LCON", format!("{what} (byte {at} of the decoded section)"))
            })?;
        Ok(())
    }
}

/// Reads and checks the header and the section table of a volume.
pub(super) fn read_layout(
    file: &mut (impl Read + Seek),
    file_bytes: u64,
) -> std::result::Result<Layout, Stop> {
    let layout = read_any_layout(file, file_bytes)?;
    if layout.contents == Contents::Part {
        let what =
            "contents: expected a volume, got a part of one (pumice merge makes the volume of all its parts)";
        return Err(FormatError::in_header(12, what.into()).into());
    }
    Ok(layout)
}

/// Reads and checks the header and the section table of a volume, or of a part of one.
pub(super) fn read_any_layout(
    file: &mut (impl Read + Seek),
    file_bytes: u64,
) -> std::result::Result<Layout, Stop> {
    let head = |at: u64, what: String| Stop::Fault(FormatError::in_header(at, what));
    if file_bytes < HEADER_BYTES as u64 {
        return Err(head(
            0,
            format!("length of the file: expected at least {HEADER_BYTES}, got {file_bytes}"),
        ));
    }
    let bytes = read_at(file, 0, HEADER_BYTES as u64, *b"HEAD")?;
    let Ok(header) = <&[u8; HEADER_BYTES]>::try_from(bytes.as_slice()) else {
        return Err(head(0, "the file became shorter while it was read; open it again".into()));
    };
    let count = Layout::sections(header, file_bytes)?;
    let length = HEADER_BYTES as u64 + u64::from(count) * ENTRY_BYTES as u64;
    if length > file_bytes {
        return Err(head(
            32,
            format!("end of the section table: expected at most {file_bytes}, got {length}"),
        ));
    }
    let bytes = read_at(file, 0, length, *b"HEAD")?;
    Layout::parse(&bytes, file_bytes)
}

/// Reads a range that lies within the length of the file.
pub(super) fn read_at(
    file: &mut (impl Read + Seek),
    offset: u64,
    length: u64,
    section: [u8; 4],
) -> std::result::Result<Vec<u8>, Stop> {
    file.seek(SeekFrom::Start(offset)).map_err(Stop::Io)?;
    let mut bytes = reserved(length as usize, "a section of the file").map_err(Error::from)?;
    match file.take(length).read_to_end(&mut bytes) {
        Ok(n) if n as u64 == length => Ok(bytes),
        Err(error) if error.kind() != ErrorKind::UnexpectedEof => Err(Stop::Io(error)),
        _ => Err(Stop::Fault(FormatError {
            section,
            at: offset + bytes.len() as u64,
            what: "the file became shorter while it was read; open it again".into(),
        })),
    }
}

/// Byte range of a section in a mapped file, if it needs no decoding.
fn place_in(map: Option<&MappedFile>, entry: &Entry) -> Option<Range<usize>> {
    let is_array = [b"BOXS", b"NODE"].contains(&&entry.name);
    if !is_array
        || entry.chunk.is_some()
        || entry.encoding.zstd
        || entry.encoding.delta
        || entry.encoding.planes
    {
        return None;
    }
    let range = usize::try_from(entry.offset).ok()?..usize::try_from(entry.offset + entry.stored).ok()?;
    // The file may have become shorter since its length was read; then the section is read instead, which reports it.
    (cfg!(target_endian = "little") && range.end <= map?.bytes().len()).then_some(range)
}

/// Reads those of the named sections that the file has, of the volume and of all chunks.
pub(super) fn read_sections(
    file: &mut (impl Read + Seek),
    map: Option<MappedFile>,
    layout: &Layout,
    names: &[&[u8; 4]],
    job: &Job,
) -> std::result::Result<Sections, Stop> {
    read_sections_if(file, map, layout, |entry| names.contains(&&entry.name), job)
}

/// Reads the sections for which `wanted` is true.
pub(super) fn read_sections_if(
    file: &mut (impl Read + Seek),
    map: Option<MappedFile>,
    layout: &Layout,
    wanted: impl Fn(&Entry) -> bool,
    job: &Job,
) -> std::result::Result<Sections, Stop> {
    let mut sections = Sections {
        decoded: HashMap::new(),
        info: None,
        offsets: HashMap::new(),
        map,
        mapped: HashMap::new(),
    };
    // `INFO` comes first, because it says how large the others may be.
    let mut entries: Vec<&Entry> = layout.entries.iter().filter(|e| wanted(e)).collect();
    entries.sort_by_key(|entry| entry.name != *b"INFO");
    if let Some(info) = entries.first().filter(|entry| entry.name == *b"INFO") {
        size_limits::check_info(info)?;
    }
    for (i, &entry) in entries.iter().enumerate() {
        job.check()?;
        let fault = |what| Stop::Fault(FormatError { section: entry.name, at: entry.offset, what });
        let is_right = |stored: &[u8]| match section_checksum(stored) {
            got if got == entry.checksum => Ok(()),
            got => Err(fault(format!("checksum: expected {:016x}, got {got:016x}", entry.checksum))),
        };
        sections.offsets.insert((entry.name, entry.chunk), entry.offset);
        if let (Some(map), Some(place)) = (&sections.map, place_in(sections.map.as_ref(), entry)) {
            is_right(&map.bytes()[place.clone()])?;
            sections.mapped.insert(entry.name, place);
        } else {
            let stored = read_at(file, entry.offset, entry.stored, entry.name)?;
            is_right(&stored)?;
            let bytes = codec::decode(stored, entry.encoding, entry.decoded, job)?.map_err(fault)?;
            if entry.name == *b"INFO" && entry.chunk.is_none() {
                // The error quotes the file.
                let info: Info = serde_json::from_slice(&bytes)
                    .map_err(|e| sections.fault(*b"INFO", one_line(&format!("JSON: {e}"))))?;
                size_limits::check_sections(layout, &info.volume, info.columns.len())?;
                sections.info = Some(info);
                let is_decoded = |entry: &&Entry| place_in(sections.map.as_ref(), entry).is_none();
                size_limits::check_memory(entries[i + 1..].iter().copied().filter(is_decoded))?;
            } else {
                sections.decoded.insert((entry.name, entry.chunk), bytes);
            }
        }
        job.advance(entry.stored);
    }
    Ok(sections)
}

/// Reads one section that is not `INFO`, compares its checksum and decodes it. Its declared size was checked when `INFO` was read.
pub(super) fn read_section(
    file: &mut (impl Read + Seek),
    entry: &Entry,
    job: &Job,
) -> std::result::Result<Vec<u8>, Stop> {
    job.check()?;
    let fault = |what| Stop::Fault(FormatError { section: entry.name, at: entry.offset, what });
    let stored = read_at(file, entry.offset, entry.stored, entry.name)?;
    match section_checksum(&stored) {
        got if got == entry.checksum => {}
        got => return Err(fault(format!("checksum: expected {:016x}, got {got:016x}", entry.checksum))),
    }
    codec::decode(stored, entry.encoding, entry.decoded, job)?.map_err(fault)
}

/// Removes and returns what the section `INFO` says: the volume's info, and the names that the table of labels uses.
pub(super) fn info_of(sections: &mut Sections) -> std::result::Result<(VolumeInfo, TableNames), Stop> {
    let info = sections.info.take();
    let Info { volume, types, columns } =
        info.ok_or_else(|| sections.fault(*b"INFO", "expected the section, got none"))?;
    Ok((volume, TableNames { types, columns }))
}
