//! Stores a volume as its voxels, piece by piece, and reads it back. This is the smallest file; it holds no boxes.
//!
//! ```text
//! write: volume ─► chunks of 1024³ voxels ─► one stream each ([`super::voxel_coder`])    PIEC  origins    VOXL  the stream of each
//! read:  streams ─► parts, as in compression ─► the same volume, because its form is canonical
//! ```
//! Opening compresses the voxels again, so its time depends on the number of voxels, not of boxes. The file stores neither voxel counts nor
//! contacts: compression yields the counts, and decoding finds the contacts when it compares neighbours.

use std::io::{Read, Seek};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use rayon::prelude::*;

use super::check;
use super::format_error::Stop;
use super::layout::Layout;
use super::sections::{Sections, info_of, read_sections};
use super::slices::SLAB;
use super::voxel_coder::{VoxelDecoder, VoxelEncoder};
use crate::compress::volume_of_parts;
use crate::finish::Known;
use crate::memory::available_bytes;
use crate::reserve::reserved;
use crate::sorted_cells::SortedCells;
use crate::store::PartStore;
use crate::volume::CHUNK_CELLS;
use crate::{
    BoxGrid, CHUNK_VOXELS, CompressOptions, CompressedVolume, Error, Job, LabelTable, Result, VolumeInfo,
    morton,
};

/// Bytes of an entry of `PIEC`.
const PIECE_BYTES: usize = 16;

/// Size in voxels of the piece at `origin`.
pub(super) fn piece_dims(volume_dims: [u32; 3], origin: [u32; 3]) -> [u32; 3] {
    [0, 1, 2].map(|a| CHUNK_VOXELS.min(volume_dims[a] - origin[a]))
}

fn morton_of(origin: [u32; 3]) -> u64 {
    morton::encode(origin.map(|o| o / 4)) / CHUNK_CELLS
}

/// Encodes the section `VOXL` of each chunk.
///
/// # Errors
/// [`Error::Cancelled`]; [`Error::Caller`] when two labels claim one voxel.
pub(super) fn encode(volume: &CompressedVolume, job: &Job) -> Result<Vec<Vec<u8>>> {
    let pieces: Vec<[u32; 3]> = volume.chunks.iter().map(|chunk| chunk.origin).collect();
    let voxels =
        |&origin: &[u32; 3]| piece_dims(volume.info.dims, origin).map(u64::from).iter().product::<u64>();
    job.begin(pieces.iter().map(voxels).sum());

    // A grid for this call only, so that saving does not enlarge the volume in memory.
    let (grid, labelled) = (volume.new_grid()?, AtomicU64::new(0));
    let streams: Vec<Vec<u8>> = pieces
        .par_iter()
        .map(|&origin| {
            let (stream, voxels) = encode_piece(volume, &grid, origin, job)?;
            labelled.fetch_add(voxels, Relaxed);
            Ok(stream)
        })
        .collect::<Result<_>>()?;
    check_disjoint(volume.labels.voxels.iter().sum::<u64>(), labelled.into_inner())?;
    Ok(streams)
}

/// Returns an error unless all voxels of the boxes were coded. Boxes of a malicious file may overlap; then the voxels would not represent all of
/// them.
pub(super) fn check_disjoint(expected: u64, got: u64) -> Result<()> {
    if expected == got {
        return Ok(());
    }
    Err(Error::Caller(format!(
        "two labels claim one voxel: expected {expected} labelled voxels, got {got}; compress the source volume again"
    )))
}

/// Encodes the voxels of the chunk at `origin`; returns the number of labelled ones too.
pub(super) fn encode_piece(
    volume: &CompressedVolume,
    grid: &BoxGrid,
    origin: [u32; 3],
    job: &Job,
) -> Result<(Vec<u8>, u64)> {
    let [w, h, d] = piece_dims(volume.info.dims, origin);
    let mut encoder = VoxelEncoder::new([w as usize, h as usize], volume.labels.len() as u32);
    let mut labelled = 0;
    for z in (0..d).step_by(SLAB) {
        job.check()?;
        let dims = [w, h, (SLAB as u32).min(d - z)];
        let slab = volume.decode_block_by(grid, [origin[0], origin[1], origin[2] + z], dims)?;
        slab.chunks_exact((w * h) as usize).for_each(|slice| encoder.slice(slice));
        labelled += slab.iter().filter(|&&v| v != 0).count() as u64;
        job.advance(slab.len() as u64);
    }
    Ok((encoder.finish(), labelled))
}

/// Reads a file of voxels; the caller compares the content hash.
pub(super) fn read_voxels(
    file: &mut (impl Read + Seek),
    layout: &Layout,
    job: &Job,
) -> std::result::Result<CompressedVolume, Stop> {
    let mut sections =
        read_sections(file, None, layout, &[b"INFO", b"LIDS", b"LTYP", b"LCOL", b"PIEC", b"VOXL"], job)?;
    let (info, names) = info_of(&mut sections)?;
    let ids = sections.elements(b"LIDS", u64::from_le_bytes)?;
    let types = sections.elements(b"LTYP", u16::from_le_bytes)?;
    let columns = sections.columns(names.columns, ids.len())?;
    let mut head = CompressedVolume::empty(info);
    head.labels = LabelTable {
        voxels: vec![0; ids.len()],
        ids,
        types,
        type_names: names.types,
        columns,
        ..LabelTable::default()
    };
    check::check_head(&head).map_err(|(section, what)| sections.fault(section, what))?;

    let table = sections.elements(b"PIEC", |b: [u8; PIECE_BYTES]| {
        let number = |at: usize| u32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
        [number(0), number(4), number(8)]
    })?;
    check_origins(&table, head.info.dims).map_err(|what| sections.fault(*b"PIEC", what))?;
    let mut pieces = reserved(table.len(), "a section of the file").map_err(Error::from)?;
    for (i, &origin) in (0..).zip(&table) {
        pieces.push((origin, sections.take_of(b"VOXL", Some(i))?));
    }
    sections.expect_none_left()?;

    let info = std::mem::replace(&mut head.info, VolumeInfo::new([0; 3], crate::LabelType::U32));
    let mut volume = decode(info, pieces, head.labels.len() as u32, &sections, job)?;
    // In the new volume, the id of each label is its dense index plus 1.
    if volume.labels.len() != head.labels.len() {
        let what = format!("labels: expected {}, got {}", head.labels.len(), volume.labels.len());
        return Err(sections.fault(*b"VOXL", what));
    }
    let made = std::mem::take(&mut volume.labels);
    volume.labels = LabelTable { voxels: made.voxels, contacts: made.contacts, ..head.labels };
    Ok(volume)
}

/// Decodes the streams of pieces, each with its origin. The labels of the volume have the voxels' numbers as ids, which are at most `number`.
pub(super) fn decode(
    info: VolumeInfo,
    streams: Vec<([u32; 3], Vec<u8>)>,
    number: u32,
    sections: &Sections,
    job: &Job,
) -> std::result::Result<CompressedVolume, Stop> {
    let fault = |what: String| sections.fault(*b"VOXL", what);
    // A stream of a few bytes can stand for any number of records, so they are kept in memory only up to a part of what is free.
    let folder = std::env::temp_dir();
    let store = PartStore::new(available_bytes().map_or(u64::MAX, |free| free / 4), None, &folder);
    let dims = info.dims;
    let piece = |(origin, stream)| Piece { origin, dims: piece_dims(dims, origin), stream };
    let pieces: Vec<Piece> = streams.into_iter().map(piece).collect();
    job.begin(pieces.iter().map(|p| p.dims.map(u64::from).iter().product::<u64>()).sum());
    let decode = |piece: &Piece| {
        let size = [piece.dims[0], piece.dims[1]].map(|n| n as usize);
        let stream = VoxelDecoder::new(size, number, &piece.stream);
        decode_piece(piece, stream, dims, number, &store, &fault, job)
    };
    let touching: Vec<Vec<u64>> = pieces.par_iter().map(decode).collect::<std::result::Result<_, Stop>>()?;
    let known = Known { labelled: None, touching: Some(touching.concat()), share: 1.0 };
    let parts = store.into_parts()?;
    let mut volume = volume_of_parts(info, parts, &known, &CompressOptions::default(), &folder, job)?;
    // Its content hash is that of a volume with these ids.
    volume.hash = OnceLock::new();
    Ok(volume)
}

/// What a chunk has of the volume, and its stream.
struct Piece {
    origin: [u32; 3],
    dims: [u32; 3],
    stream: Vec<u8>,
}

/// Returns an error unless the pieces' origins rise within a volume of `dims` voxels.
fn check_origins(table: &[[u32; 3]], dims: [u32; 3]) -> std::result::Result<(), String> {
    let mut before = None;
    for (i, &origin) in table.iter().enumerate() {
        let inside = (0..3).all(|a| origin[a].is_multiple_of(CHUNK_VOXELS) && origin[a] < dims[a]);
        // Only an origin inside the volume is sure to have a Morton code.
        let code = inside.then(|| morton_of(origin));
        if code.is_none() || code <= before {
            return Err(format!("piece {i}: expected a rising origin in {dims:?} voxels, got {origin:?}"));
        }
        before = code;
    }
    Ok(())
}

/// Decodes a piece's voxels to parts in `store`; returns the pairs of labels that touch in it.
fn decode_piece(
    piece: &Piece,
    mut stream: VoxelDecoder<'_>,
    volume_dims: [u32; 3],
    labels: u32,
    store: &PartStore,
    fault: &(impl Fn(String) -> Stop + Sync),
    job: &Job,
) -> std::result::Result<Vec<u64>, Stop> {
    let ([w, h, d], [x, y, z]) = (piece.dims, piece.origin);
    for from in (0..d).step_by(SLAB) {
        job.check()?;
        let layers = (SLAB as u32).min(d - from);
        for layer in from..from + layers {
            if !stream.slice() {
                return Err(fault(format!(
                    "piece at {:?}: expected {d} slices, got the end in slice {layer}",
                    piece.origin
                )));
            }
        }
        if stream.highest() > labels {
            let (above, place) = (stream.highest(), piece.origin);
            return Err(fault(format!("piece at {place:?}: expected labels to {labels}, got {above}")));
        }
        let place = [[x, y, z + from], [w, h, layers]];
        store.add(SortedCells::from_labels(place, stream.slab(), volume_dims)?, false)?;
        job.advance(u64::from(w) * u64::from(h) * u64::from(layers));
    }
    match stream.is_at_end() {
        true => Ok(stream.touching().map_err(Error::from)?),
        false => Err(fault(format!(
            "piece at {:?}: expected the end after its last slice, got more bytes",
            piece.origin
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The last case was found by fuzzing: the code computed a Morton code for an origin that has none.
    #[test]
    fn pieces_must_rise_within_the_volume() {
        let dims = [2000, 5, 5];
        let pieces = |origins: &[[u32; 3]]| check_origins(origins, dims);
        assert_eq!(pieces(&[[0; 3], [1024, 0, 0]]), Ok(()));
        let later = [[7, 0, 0], [0; 3], [2048, 0, 0], [1 << 30, 0, 0]];
        for wrong in later.map(|second| pieces(&[[0; 3], second])) {
            assert!(wrong.is_err_and(|what| what.contains("piece 1: expected a rising origin")));
        }
    }
}
