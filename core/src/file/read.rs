//! A volume out of a file.

use std::collections::HashMap;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use serde::Deserialize;

use super::layout::{ENTRY_BYTES, Encoding, HEADER_BYTES, Layout, section_checksum};
use super::nodes::{self, Streams};
use super::{Fault, archive, check, codec};
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
        from_path(path, |file, file_bytes| read(file, file_bytes, true, job))
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
pub(super) const HEAD_SECTIONS: [&[u8; 4]; 8] =
    [b"INFO", b"CHNK", b"RUNS", b"LIDS", b"LVOX", b"LTYP", b"LCON", b"LEAF"];

/// Boxes and nodes, in the one form or the other.
const BOX_SECTIONS: [&[u8; 4]; 9] =
    [b"BOXS", b"NODE", b"BCEL", b"BNOD", b"OCCU", b"SOLI", b"RANK", b"REFS", b"FLDS"];

/// Sections read and decoded, by name.
pub(super) struct Sections {
    decoded: HashMap<[u8; 4], Vec<u8>>,
    offsets: HashMap<[u8; 4], u64>,
}

impl Sections {
    pub(super) fn fault(&self, section: [u8; 4], what: impl Into<String>) -> Stop {
        Stop::Fault(Fault { section, at: self.offset(&section), what: what.into() })
    }

    /// Where a section lies in the file; 0 where it was not read.
    pub(super) fn offset(&self, name: &[u8; 4]) -> u64 {
        self.offsets.get(name).copied().unwrap_or(0)
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

/// Reads a volume. `check_hash` is off only where a test wants to reach what lies behind the checks.
pub(super) fn read(
    file: &mut (impl Read + Seek),
    file_bytes: u64,
    check_hash: bool,
    job: &Job,
) -> std::result::Result<CompressedVolume, Stop> {
    let layout = read_layout(file, file_bytes)?;
    if archive::is_archive(&layout) {
        let volume = archive::read_archive(file, &layout, job)?;
        return if check_hash { check_content(&layout, volume) } else { Ok(volume) };
    }
    let names: Vec<&[u8; 4]> = HEAD_SECTIONS.into_iter().chain(BOX_SECTIONS).collect();
    job.begin(layout.file_bytes);
    let mut sections = read_sections(file, &layout, &names, job)?;
    let mut volume = assemble(&mut sections)?;
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

/// Those of the named sections that are there.
pub(super) fn read_sections(
    file: &mut (impl Read + Seek),
    layout: &Layout,
    names: &[&[u8; 4]],
    job: &Job,
) -> std::result::Result<Sections, Stop> {
    let mut sections = Sections { decoded: HashMap::new(), offsets: HashMap::new() };
    for entry in layout.entries.iter().filter(|e| names.contains(&&e.name)) {
        job.check()?;
        let fault = |what| Stop::Fault(Fault { section: entry.name, at: entry.offset, what });
        let stored = read_at(file, entry.offset, entry.stored, entry.name)?;
        let got = section_checksum(&stored);
        if got != entry.checksum {
            return Err(fault(format!("checksum: expected {:016x}, got {got:016x}", entry.checksum)));
        }
        let encoding: Encoding = entry.encoding;
        let bytes = codec::decode(stored, encoding, entry.decoded, job)?.map_err(fault)?;
        sections.decoded.insert(entry.name, bytes);
        sections.offsets.insert(entry.name, entry.offset);
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
    volume.dictionary = sections.elements(b"LEAF", u64::from_le_bytes)?;
    Ok(volume)
}

/// A volume from its sections, unchecked but for what putting it together needs.
fn assemble(sections: &mut Sections) -> std::result::Result<CompressedVolume, Stop> {
    let mut volume = assemble_head(sections)?;
    if sections.decoded.contains_key(b"NODE") {
        volume.nodes = sections.elements(b"NODE", u16::from_le_bytes)?;
        volume.boxes = sections.elements(b"BOXS", |b| BoxRecord(u64::from_le_bytes(b)))?;
    } else {
        let streams = Streams {
            cells: sections.take(b"BCEL")?,
            backs: sections.take(b"BNOD")?,
            occupied: sections.take(b"OCCU")?,
            solid: sections.take(b"SOLI")?,
            ranked: sections.take(b"RANK")?,
            references: sections.take(b"REFS")?,
            fields: sections.take(b"FLDS")?,
        };
        let fault = |(section, what): ([u8; 4], String)| sections.fault(section, what);
        let (nodes, starts) = nodes::join_nodes(&streams).map_err(fault)?;
        volume.boxes = nodes::join_boxes(&streams, &volume.chunks, &nodes, &starts).map_err(fault)?;
        volume.nodes = nodes;
    }
    volume.nodes.shrink_to_fit();
    volume.boxes.shrink_to_fit();
    Ok(volume)
}
