//! Reads a volume from a file.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use super::format_error::{FormatError, Stop};
use super::layout::{Contents, Layout};
use super::nodes::{self, Streams};
use super::sections::{Sections, TableNames, info_of, read_layout, read_sections};
use super::{check, voxel_pieces};
use crate::elements::MappedFile;
use crate::{
    BoxRecord, Chunk, CompressedVolume, Contacts, Error, Job, LabelRun, LabelTable, Leaves, Result,
    open_input,
};

impl CompressedVolume {
    /// Reads a `.pumice` file and checks all of it.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::File`], which says where the file is damaged and what is wrong; [`Error::Version`]; [`Error::Cancelled`].
    pub fn open(path: &Path, job: &Job) -> Result<Self> {
        from_path(path, |file, file_bytes| read(file, file_bytes, None, true, job))
    }

    /// Like [`CompressedVolume::open`], but boxes and nodes of a file of [`crate::CompressionLevel::Fast`] stay in the file, which is mapped into
    /// memory. Their pages are shared with other processes, reclaimed when memory runs short, and loaded into this process only when they
    /// are used. The same checks are made. Files of other levels have nothing to map and are read. [`CompressedVolume::mapped_bytes`] tells
    /// how much is mapped.
    ///
    /// While the volume exists, the file must not be changed in place: if another program truncates it, the process ends with a signal.
    /// [`CompressedVolume::save`] over it is safe, because it replaces the file and leaves the old one to those who have it open.
    ///
    /// # Errors
    /// As [`CompressedVolume::open`], and [`Error::Io`] where the system cannot map the file.
    pub fn open_mapped(path: &Path, job: &Job) -> Result<Self> {
        from_path(path, |file, file_bytes| {
            // An empty file cannot be mapped; the reader refuses it because of its length.
            let map = if file_bytes > 0 { Some(MappedFile::new(file).map_err(Stop::Io)?) } else { None };
            let volume = read(file, file_bytes, map.clone(), true, job)?;
            // The checks touched every page, but a picture may need few of them.
            map.iter().for_each(MappedFile::let_go);
            Ok(volume)
        })
    }
}

/// Opens a file and calls `read` on it; adds the path to its errors.
pub(super) fn from_path<T>(
    path: &Path,
    read: impl FnOnce(&mut File, u64) -> std::result::Result<T, Stop>,
) -> Result<T> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let mut file = open_input(path).map_err(io)?;
    let file_bytes = file.metadata().map_err(io)?.len();
    read(&mut file, file_bytes).map_err(|stop| match stop {
        Stop::Fault(FormatError { section, at, what }) => {
            Error::File { path: path.to_owned(), section: section.escape_ascii().to_string(), at, what }
        }
        Stop::Version(got) => Error::Version { path: path.to_owned(), got },
        Stop::Frames(frames) => Error::Frames { path: path.to_owned(), frames },
        Stop::Io(source) => io(source),
        Stop::Core(Error::Memory(error)) => Error::Memory(error.of_file(path)),
        Stop::Core(error) => error,
    })
}

/// Sections of the volume and of its chunks, apart from boxes and nodes.
pub(super) const HEAD_SECTIONS: [&[u8; 4]; 11] =
    [b"INFO", b"CHNK", b"RUNS", b"LIDS", b"LVOX", b"LTYP", b"LCON", b"LCOL", b"LEAF", b"SLIC", b"RARE"];

/// Sections of boxes and nodes: of the volume in the plain form, of each chunk in the packed one.
const BOX_SECTIONS: [&[u8; 4]; 9] =
    [b"BOXS", b"NODE", b"BCEL", b"BNOD", b"OCCU", b"CLAS", b"REFS", b"SLCR", b"FLDS"];

/// Reads a volume. With `map`, sections that can stay in the mapped file are not read. `check_hash` is false only in tests that want to
/// reach the code behind the hash check.
pub(super) fn read(
    file: &mut (impl Read + Seek),
    file_bytes: u64,
    map: Option<MappedFile>,
    check_hash: bool,
    job: &Job,
) -> std::result::Result<CompressedVolume, Stop> {
    let layout = read_layout(file, file_bytes)?;
    if layout.frames != 1 {
        return Err(Stop::Frames(layout.frames));
    }
    if layout.contents == Contents::Voxels {
        let volume = voxel_pieces::read_voxels(file, &layout, job)?;
        return if check_hash { check_content(&layout, volume) } else { Ok(volume) };
    }
    let names: Vec<&[u8; 4]> = HEAD_SECTIONS.into_iter().chain(BOX_SECTIONS).collect();
    job.begin(layout.file_bytes);
    let mut sections = read_sections(file, map, &layout, &names, job)?;
    let mut volume = assemble(&mut sections)?;
    job.check()?;
    let wrong = |(section, what)| sections.fault(section, what);
    check::check_head(&volume).and_then(|()| check::check(&volume)).map_err(wrong)?;
    sections.unpack_contacts(&mut volume)?;
    job.check()?;
    if check_hash { check_content(&layout, volume) } else { Ok(volume) }
}

/// Returns the volume if it has the content hash that its file declares.
fn check_content(layout: &Layout, volume: CompressedVolume) -> std::result::Result<CompressedVolume, Stop> {
    let (expected, got) = (layout.content_hash, volume.content_hash());
    if expected != got {
        let what = format!("content hash: expected {expected:032x}, got {got:032x}");
        return Err(Stop::Fault(FormatError::in_header(40, what)));
    }
    Ok(volume)
}

/// Builds a volume without boxes and nodes; it is not checked yet.
pub(super) fn assemble_head(sections: &mut Sections) -> std::result::Result<CompressedVolume, Stop> {
    let (info, names) = info_of(sections)?;
    let mut volume = CompressedVolume::empty(info);
    volume.chunks = sections.elements(b"CHNK", |b| chunk_of(b).1)?;
    for (c, chunk) in (0..).zip(&volume.chunks) {
        let mut runs = runs_of(sections, c)?;
        if chunk.first_run != volume.runs.len() as u64 {
            let what =
                format!("chunk {c}: first run: expected {}, got {}", volume.runs.len(), chunk.first_run);
            return Err(sections.fault(*b"CHNK", what));
        }
        volume.runs.append(&mut runs);
        volume.leaves.push(leaves_of(sections, c)?);
    }
    volume.runs.shrink_to_fit();
    volume.leaves.shrink_to_fit();
    volume.labels = table_of(sections, names)?;
    volume.labels.contacts = Contacts { bytes: sections.take(b"LCON")?, pairs: 0 };
    Ok(volume)
}

/// An entry of `CHNK`: the frame, and the chunk.
pub(super) fn chunk_of(b: [u8; 40]) -> (u32, Chunk) {
    let u32_at = |at: usize| u32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
    let u64_at = |at: usize| u64::from(u32_at(at)) | u64::from(u32_at(at + 4)) << 32;
    let chunk = Chunk {
        origin: [u32_at(0), u32_at(4), u32_at(8)],
        first_box: u64_at(16),
        first_run: u64_at(24),
        node_base: u64_at(32),
    };
    (u32_at(12), chunk)
}

/// The runs of a chunk.
pub(super) fn runs_of(sections: &mut Sections, chunk: u32) -> std::result::Result<Vec<LabelRun>, Stop> {
    sections.elements_of(b"RUNS", Some(chunk), |b: [u8; 8]| {
        let both = u64::from_le_bytes(b);
        LabelRun { label: both as u32, first_box: (both >> 32) as u32 }
    })
}

/// The leaves of a chunk.
pub(super) fn leaves_of(sections: &mut Sections, chunk: u32) -> std::result::Result<Leaves, Stop> {
    Ok(Leaves {
        patterns: sections.elements_of(b"LEAF", Some(chunk), u64::from_le_bytes)?.into(),
        slices: sections.elements_of(b"SLIC", Some(chunk), u16::from_le_bytes)?.into(),
        rare: sections.elements_of(b"RARE", Some(chunk), u64::from_le_bytes)?.into(),
    })
}

/// The table of labels without contacts, which are checked once the number of labels is.
pub(super) fn table_of(sections: &mut Sections, names: TableNames) -> std::result::Result<LabelTable, Stop> {
    let ids = sections.elements(b"LIDS", u64::from_le_bytes)?;
    Ok(LabelTable {
        columns: sections.columns(names.columns, ids.len())?,
        ids,
        voxels: sections.elements(b"LVOX", u64::from_le_bytes)?,
        types: sections.elements(b"LTYP", u16::from_le_bytes)?,
        type_names: names.types,
        ..LabelTable::default()
    })
}

/// Builds a volume from its sections. It checks only what this needs.
fn assemble(sections: &mut Sections) -> std::result::Result<CompressedVolume, Stop> {
    let mut volume = assemble_head(sections)?;
    if sections.has(b"NODE") {
        volume.nodes = sections.array(b"NODE", u16::from_le_bytes)?;
        volume.boxes = sections.array(b"BOXS", |b| BoxRecord(u64::from_le_bytes(b)))?;
    } else {
        let (mut boxes, mut nodes) = (Vec::new(), Vec::new());
        for (c, leaves) in (0..).zip(&volume.leaves) {
            let chunk = &volume.chunks[c as usize];
            for (name, expected, got) in
                [("box", boxes.len(), chunk.first_box), ("word of its nodes", nodes.len(), chunk.node_base)]
            {
                if expected as u64 != got {
                    let what = format!("chunk {c}: first {name}: expected {expected}, got {got}");
                    return Err(sections.fault(*b"CHNK", what));
                }
            }
            let mut take = |name| sections.take_of(name, Some(c));
            let streams = Streams {
                cells: take(b"BCEL")?,
                backs: take(b"BNOD")?,
                occupied: take(b"OCCU")?,
                classes: take(b"CLAS")?,
                references: [take(b"REFS")?, take(b"SLCR")?, take(b"FLDS")?],
            };
            nodes::join(&streams, leaves, &mut boxes, &mut nodes)
                .map_err(|(section, what)| sections.fault_in(section, c, &what))?;
        }
        volume.boxes = boxes.into();
        volume.nodes = nodes.into();
    }
    sections.expect_none_left()?;
    Ok(volume)
}
