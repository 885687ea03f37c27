//! A volume out of a file.

use std::collections::HashMap;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use bytemuck::Pod;
use serde::Deserialize;

use super::layout::{ENTRY_BYTES, Entry, HEADER_BYTES, Layout, section_checksum};
use super::nodes::{self, Streams};
use super::{Fault, check, codec, legacy, voxel_pieces};
use crate::elements::{Elements, MappedFile};
use crate::error::one_line;
use crate::{
    BoxRecord, Chunk, CompressedVolume, Contacts, Error, Job, LabelRun, LabelTable, Result, VolumeInfo,
};

/// What the section `INFO` holds.
#[derive(Deserialize)]
struct Info {
    volume: VolumeInfo,
    types: Vec<String>,
}

/// Why reading stopped.
pub(super) enum Stop {
    Fault(Fault),
    Io(std::io::Error),
    Core(Error),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Self::Core(error)
    }
}

impl CompressedVolume {
    /// Reads a `.pumice` file and checks all of it.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::File`] that says where and what when the file is damaged; [`Error::Cancelled`].
    pub fn open(path: &Path, job: &Job) -> Result<Self> {
        from_path(path, |file, file_bytes| read(file, file_bytes, None, true, job))
    }

    /// The same, but boxes and nodes of a file of [`crate::Level::Fast`] stay in the file, which is mapped into memory: they are
    /// shared with other processes, given back where memory runs short, and of this process only once they are used. Everything is
    /// checked as by [`CompressedVolume::open`];
    /// files of other levels have nothing to map and are read. [`CompressedVolume::mapped_bytes`] tells what is mapped.
    ///
    /// While the volume is there, the file must not be changed in place: where another program cuts it short, the process ends with a
    /// signal. [`CompressedVolume::save`] over it is safe, as it replaces the file and leaves the former one to who has it open.
    ///
    /// # Errors
    /// As [`CompressedVolume::open`], and [`Error::Io`] where the system cannot map the file.
    pub fn open_mapped(path: &Path, job: &Job) -> Result<Self> {
        from_path(path, |file, file_bytes| {
            // Files without a byte cannot be mapped, and are refused for that length by the reader.
            let map = if file_bytes > 0 { Some(MappedFile::new(file).map_err(Stop::Io)?) } else { None };
            let volume = read(file, file_bytes, map.clone(), true, job)?;
            // Checking went through all of it; a picture may need little.
            map.iter().for_each(MappedFile::let_go);
            Ok(volume)
        })
    }
}

/// Opens a file and has it read; what stops that gets the file's name.
pub(super) fn from_path<T>(
    path: &Path,
    read: impl FnOnce(&mut File, u64) -> std::result::Result<T, Stop>,
) -> Result<T> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let mut file = File::open(path).map_err(io)?;
    let file_bytes = file.metadata().map_err(io)?.len();
    read(&mut file, file_bytes).map_err(|stop| match stop {
        Stop::Fault(Fault { section, at, what }) => {
            Error::File { path: path.to_owned(), section: section.escape_ascii().to_string(), at, what }
        }
        Stop::Io(source) => io(source),
        Stop::Core(error) => error,
    })
}

/// What is known of a volume without its boxes.
pub(super) const HEAD_SECTIONS: [&[u8; 4]; 10] =
    [b"INFO", b"CHNK", b"RUNS", b"LIDS", b"LVOX", b"LTYP", b"LCON", b"LEAF", b"SLIC", b"RARE"];

/// Boxes and nodes, in the one form or the other.
const BOX_SECTIONS: [&[u8; 4]; 9] =
    [b"BOXS", b"NODE", b"BCEL", b"BNOD", b"OCCU", b"CLAS", b"REFS", b"SLCR", b"FLDS"];

/// Sections read and decoded, by name.
pub(super) struct Sections {
    decoded: HashMap<[u8; 4], Vec<u8>>,
    offsets: HashMap<[u8; 4], u64>,
    /// The file, where it is mapped, and where in it those sections are that need no decoding and were not read therefore.
    map: Option<MappedFile>,
    mapped: HashMap<[u8; 4], Range<usize>>,
}

impl Sections {
    pub(super) fn fault(&self, section: [u8; 4], what: impl Into<String>) -> Stop {
        Stop::Fault(Fault { section, at: self.offset(&section), what: what.into() })
    }

    /// Where a section lies in the file; 0 where it was not read.
    pub(super) fn offset(&self, name: &[u8; 4]) -> u64 {
        self.offsets.get(name).copied().unwrap_or(0)
    }

    /// Whether a section was read and is there still.
    pub(super) fn has(&self, name: &[u8; 4]) -> bool {
        self.decoded.contains_key(name) || self.mapped.contains_key(name)
    }

    /// Takes a section's bytes.
    pub(super) fn take(&mut self, name: &[u8; 4]) -> std::result::Result<Vec<u8>, Stop> {
        self.decoded.remove(name).ok_or_else(|| self.fault(*name, "expected the section, got none"))
    }

    /// Takes a section as elements of `N` bytes.
    pub(super) fn elements<const N: usize, T>(
        &mut self,
        name: &[u8; 4],
        element: impl Fn([u8; N]) -> T,
    ) -> std::result::Result<Vec<T>, Stop> {
        let bytes = self.take(name)?;
        let (whole, rest) = bytes.as_chunks::<N>();
        if !rest.is_empty() {
            return Err(self.fault(*name, format!("size: expected a multiple of {N}, got {}", bytes.len())));
        }
        Ok(whole.iter().map(|&b| element(b)).collect())
    }

    /// Takes a section as an array whose elements lie in the file as they do in memory.
    fn array<const N: usize, T: Pod>(
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

    /// Checks the touching pairs, of a volume whose number of labels is checked.
    pub(super) fn unpack_contacts(&self, volume: &mut CompressedVolume) -> std::result::Result<(), Stop> {
        let packed = std::mem::take(&mut volume.labels.contacts.bytes);
        volume.labels.contacts =
            Contacts::from_packed(packed, volume.labels.len() as u32).map_err(|(at, what)| {
                self.fault(*b"LCON", format!("{what} (byte {at} of the decoded section)"))
            })?;
        Ok(())
    }
}

/// Reads a volume; what is mapped of its file need not be read. `check_hash` is off only where a test wants to reach what lies behind
/// the checks.
pub(super) fn read(
    file: &mut (impl Read + Seek),
    file_bytes: u64,
    map: Option<MappedFile>,
    check_hash: bool,
    job: &Job,
) -> std::result::Result<CompressedVolume, Stop> {
    let layout = read_layout(file, file_bytes)?;
    if voxel_pieces::is_archive(&layout) {
        let volume = voxel_pieces::read_archive(file, &layout, job)?;
        return if check_hash { check_content(&layout, volume) } else { Ok(volume) };
    }
    let is_legacy = legacy::is_legacy(&layout);
    let former = if is_legacy { &legacy::SECTIONS[..] } else { &[] };
    let names: Vec<&[u8; 4]> =
        HEAD_SECTIONS.into_iter().chain(BOX_SECTIONS).chain(former.iter().copied()).collect();
    job.begin(layout.file_bytes);
    let map = map.filter(|_| !is_legacy);
    let mut sections = read_sections(file, map, &layout, &names, job)?;
    let mut volume = assemble(&mut sections, is_legacy)?;
    job.check()?;
    let wrong = |(section, what)| sections.fault(section, what);
    check::check_head(&volume).and_then(|()| check::check(&volume)).map_err(wrong)?;
    sections.unpack_contacts(&mut volume)?;
    job.check()?;
    if check_hash { check_content(&layout, volume) } else { Ok(volume) }
}

/// A volume that has the hash that its file names.
fn check_content(layout: &Layout, volume: CompressedVolume) -> std::result::Result<CompressedVolume, Stop> {
    let (expected, got) = (layout.content_hash, volume.content_hash());
    if expected != got {
        let what = format!("content hash: expected {expected:032x}, got {got:032x}");
        return Err(Stop::Fault(Fault { section: *b"HEAD", at: 40, what }));
    }
    Ok(volume)
}

pub(super) fn read_layout(
    file: &mut (impl Read + Seek),
    file_bytes: u64,
) -> std::result::Result<Layout, Stop> {
    let head = |at: u64, what: String| Stop::Fault(Fault { section: *b"HEAD", at, what });
    if file_bytes < HEADER_BYTES as u64 {
        return Err(head(
            0,
            format!("length of the file: expected at least {HEADER_BYTES}, got {file_bytes}"),
        ));
    }
    let bytes = read_at(file, 0, HEADER_BYTES as u64, *b"HEAD")?;
    let Ok(header) = <&[u8; HEADER_BYTES]>::try_from(bytes.as_slice()) else {
        return Err(head(0, "the file became shorter while it was read".into()));
    };
    let count = Layout::sections(header, file_bytes).map_err(Stop::Fault)?;
    let length = HEADER_BYTES as u64 + u64::from(count) * ENTRY_BYTES as u64;
    if length > file_bytes {
        return Err(head(
            32,
            format!("end of the section table: expected at most {file_bytes}, got {length}"),
        ));
    }
    let bytes = read_at(file, 0, length, *b"HEAD")?;
    Layout::parse(&bytes, file_bytes).map_err(Stop::Fault)
}

/// Reads a range that lies within the file's length.
pub(super) fn read_at(
    file: &mut (impl Read + Seek),
    offset: u64,
    length: u64,
    section: [u8; 4],
) -> std::result::Result<Vec<u8>, Stop> {
    file.seek(SeekFrom::Start(offset)).map_err(Stop::Io)?;
    let mut bytes = Vec::with_capacity(length as usize);
    match file.take(length).read_to_end(&mut bytes) {
        Ok(n) if n as u64 == length => Ok(bytes),
        Err(error) if error.kind() != ErrorKind::UnexpectedEof => Err(Stop::Io(error)),
        _ => Err(Stop::Fault(Fault {
            section,
            at: offset + bytes.len() as u64,
            what: "the file became shorter while it was read".into(),
        })),
    }
}

/// Where a section lies in a mapped file, if it need not be decoded.
fn place_in(map: Option<&MappedFile>, entry: &Entry) -> Option<Range<usize>> {
    let is_array = [b"BOXS", b"NODE"].contains(&&entry.name);
    if !is_array || entry.encoding.zstd || entry.encoding.delta || entry.encoding.planes {
        return None;
    }
    let range = usize::try_from(entry.offset).ok()?..usize::try_from(entry.offset + entry.stored).ok()?;
    // It may have become shorter since its length was asked for: then reading says so.
    (cfg!(target_endian = "little") && range.end <= map?.bytes().len()).then_some(range)
}

/// Those of the named sections that are there.
pub(super) fn read_sections(
    file: &mut (impl Read + Seek),
    map: Option<MappedFile>,
    layout: &Layout,
    names: &[&[u8; 4]],
    job: &Job,
) -> std::result::Result<Sections, Stop> {
    let mut sections =
        Sections { decoded: HashMap::new(), offsets: HashMap::new(), map, mapped: HashMap::new() };
    for entry in layout.entries.iter().filter(|e| names.contains(&&e.name)) {
        job.check()?;
        let fault = |what| Stop::Fault(Fault { section: entry.name, at: entry.offset, what });
        let is_right = |stored: &[u8]| match section_checksum(stored) {
            got if got == entry.checksum => Ok(()),
            got => Err(fault(format!("checksum: expected {:016x}, got {got:016x}", entry.checksum))),
        };
        sections.offsets.insert(entry.name, entry.offset);
        if let (Some(map), Some(place)) = (&sections.map, place_in(sections.map.as_ref(), entry)) {
            is_right(&map.bytes()[place.clone()])?;
            sections.mapped.insert(entry.name, place);
        } else {
            let stored = read_at(file, entry.offset, entry.stored, entry.name)?;
            is_right(&stored)?;
            let bytes = codec::decode(stored, entry.encoding, entry.decoded, job)?.map_err(fault)?;
            sections.decoded.insert(entry.name, bytes);
        }
        job.advance(entry.stored);
    }
    Ok(sections)
}

/// What the section `INFO` holds: the volume's own, and names of types.
pub(super) fn info_of(sections: &mut Sections) -> std::result::Result<(VolumeInfo, Vec<String>), Stop> {
    let info = sections.take(b"INFO")?;
    let Info { volume, types } = serde_json::from_slice(&info).map_err(|e| {
        // It quotes the file.
        sections.fault(*b"INFO", one_line(&format!("JSON: {e}")))
    })?;
    Ok((volume, types))
}

/// A volume without boxes, unchecked.
pub(super) fn assemble_head(sections: &mut Sections) -> std::result::Result<CompressedVolume, Stop> {
    let (info, type_names) = info_of(sections)?;
    let mut volume = CompressedVolume::empty(info);
    volume.chunks = sections.elements(b"CHNK", |b: [u8; 40]| {
        let u32_at = |at: usize| u32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
        let u64_at = |at: usize| u64::from(u32_at(at)) | u64::from(u32_at(at + 4)) << 32;
        Chunk {
            origin: [u32_at(0), u32_at(4), u32_at(8)],
            first_box: u64_at(16),
            first_run: u64_at(24),
            node_base: u64_at(32),
        }
    })?;
    volume.runs = sections.elements(b"RUNS", |b: [u8; 8]| {
        let both = u64::from_le_bytes(b);
        LabelRun { label: both as u32, first_box: (both >> 32) as u32 }
    })?;
    volume.labels = LabelTable {
        ids: sections.elements(b"LIDS", u64::from_le_bytes)?,
        voxels: sections.elements(b"LVOX", u64::from_le_bytes)?,
        types: sections.elements(b"LTYP", u16::from_le_bytes)?,
        type_names,
        // Still packed: they are checked once the number of labels is.
        contacts: Contacts { bytes: sections.take(b"LCON")?, pairs: 0 },
    };
    volume.leaves.patterns = sections.elements(b"LEAF", u64::from_le_bytes)?;
    if sections.has(b"SLIC") {
        volume.leaves.slices = sections.elements(b"SLIC", u16::from_le_bytes)?;
        volume.leaves.rare = sections.elements(b"RARE", u64::from_le_bytes)?;
    }
    Ok(volume)
}

/// A volume from its sections, unchecked but for what putting it together needs.
fn assemble(sections: &mut Sections, is_legacy: bool) -> std::result::Result<CompressedVolume, Stop> {
    let mut volume = assemble_head(sections)?;
    if is_legacy {
        legacy::read_boxes(&mut volume, sections)?;
    } else if sections.has(b"NODE") {
        volume.nodes = sections.array(b"NODE", u16::from_le_bytes)?;
        volume.boxes = sections.array(b"BOXS", |b| BoxRecord(u64::from_le_bytes(b)))?;
    } else {
        let streams = Streams {
            cells: sections.take(b"BCEL")?,
            backs: sections.take(b"BNOD")?,
            occupied: sections.take(b"OCCU")?,
            classes: sections.take(b"CLAS")?,
            references: [sections.take(b"REFS")?, sections.take(b"SLCR")?, sections.take(b"FLDS")?],
        };
        let fault = |(section, what): ([u8; 4], String)| sections.fault(section, what);
        let (nodes, starts) = nodes::join_nodes(&streams, &volume.leaves).map_err(fault)?;
        volume.boxes = nodes::join_boxes(&streams, &volume.chunks, &nodes, &starts).map_err(fault)?.into();
        volume.nodes = nodes.into();
    }
    Ok(volume)
}
