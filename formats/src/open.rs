//! Opens a label volume of any format for reading, or reads its header alone.

use std::path::Path;

use pumice_core::{BlockSource, VolumeInfo, VoxelRegion};

use crate::choice::OpenChoice;
use crate::chunks::ChunkSource;
use crate::element::Element;
use crate::error::FormatError;
use crate::layout::{Layout, Role};
use crate::options::OpenOptions;
use crate::orientation::orientation;
use crate::region::{self, RegionSource};
use crate::registry;
use crate::relabel::{self, JoinedSource, Joins};
use crate::slab::SlabSource;
use crate::slabs_by_chunk::SlabsByChunk;
use crate::volume_file::{Layer, OpenStream, Voxels};

/// The content of a file's header.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Common name of the format.
    pub format: &'static str,
    /// Storage of the voxels: `raw`, `gzip`, `ascii`, `deflate`, …
    pub encoding: String,
    /// Size, label type, matrix, unit and names.
    pub info: VolumeInfo,
    /// Letters of the directions in which x, y and z run, such as `RAS`; `None` where the file does not say it. See [`orientation`].
    pub orientation: Option<String>,
    /// What the file leaves open and the caller has not chosen; the volume that is described is the first of each.
    pub choices: Vec<OpenChoice>,
    /// Layers, where the file has overlapping segments; otherwise empty.
    pub layers: Vec<Layer>,
    /// Bytes of the volume's voxels in the file's own type, without compression and without other layers.
    pub bytes_uncompressed: u64,
    /// Notices for the user that are not errors.
    pub warnings: Vec<String>,
}

/// Opens a label volume for reading in blocks.
///
/// # Errors
/// One line that says what is wrong and where, for any content of the file.
pub fn open(path: &Path, options: &OpenOptions) -> std::result::Result<Box<dyn BlockSource>, FormatError> {
    open_any(path, options, None)
}

/// Opens regions of a label volume: the source describes the whole volume and delivers their voxels alone, each once. Of a store only the
/// chunks that the regions meet are read; of a file without compression only their rows; a compressed one is read from its beginning, pages from the
/// first to the last that has their voxels.
///
/// # Errors
/// As [`open`]. Regions lie within the volume and do not overlap.
pub fn open_regions(
    path: &Path,
    options: &OpenOptions,
    regions: &[VoxelRegion],
) -> std::result::Result<Box<dyn BlockSource>, FormatError> {
    open_any(path, options, Some(regions))
}

fn open_any(
    path: &Path,
    options: &OpenOptions,
    chosen: Option<&[VoxelRegion]>,
) -> std::result::Result<Box<dyn BlockSource>, FormatError> {
    let file = registry::read(path, options)?;
    if let Some(open) = file.choices.iter().find(|choice| choice.assumed.is_none()) {
        return Err(open.undecided(path));
    }
    let region = region::resolve(path, file.info.dims, options.roi.as_ref())?;
    let joins = options.relabel.as_deref().map(Joins::read).transpose()?;
    let (path, warnings) = (path.to_owned(), options.warnings.clone());
    // In voxels of the file.
    let low = region.map(|[low, _]| low);
    let regions = match chosen {
        None => vec![region],
        Some(chosen) => {
            let in_file = |r: &VoxelRegion| [0, 1, 2].map(|a| r[a].map(|voxel| low[a] + u64::from(voxel)));
            region::joined(chosen.iter().map(in_file).collect())
        }
    };
    let info = region::cut(&file.info, region);
    let is_all = options.roi.is_none() && chosen.is_none();
    let source: Box<dyn BlockSource> = match file.voxels {
        Voxels::Plain(open) => {
            let (info_of_file, options, path) = (file.info.clone(), options.silent(), path.clone());
            let mut first = Some((file.info, file.layout, file.element, open));
            let open = move |piece| {
                let (info, layout, element, open) = match first.take() {
                    Some(parts) => parts,
                    None => plain_again(&path, &options)?,
                };
                SlabSource::new(path.clone(), (info, layout, element), open()?, piece, warnings.clone())
            };
            let source = Box::new(SlabsByChunk::new(info_of_file, regions.clone(), Box::new(open)));
            if is_all { source } else { Box::new(RegionSource::new(source, (info, low), regions)) }
        }
        Voxels::Stream(open) => {
            // What lies outside all regions is skipped as far as it can be.
            let window = [0, 1, 2].map(|a| {
                let low = regions.iter().map(|r| r[a][0]).min().unwrap_or(region[a][0]);
                [low, regions.iter().map(|r| r[a][1]).max().unwrap_or(region[a][1])]
            });
            let of_file = (file.info, file.layout, file.element);
            let source = Box::new(SlabSource::new(path.clone(), of_file, open()?, window, warnings)?);
            if is_all { source } else { Box::new(RegionSource::new(source, (info, low), regions)) }
        }
        Voxels::Chunks(chunks) => {
            let how = (&file.layout, file.element);
            Box::new(ChunkSource::new(path.clone(), (info, low), how, chunks, regions, warnings)?)
        }
    };
    Ok(match joins {
        Some(joins) => Box::new(JoinedSource::new(source, joins, &path, &options.warnings)),
        None => source,
    })
}

/// The header of a file whose voxels were found to be plain, read once more.
fn plain_again(
    path: &Path,
    options: &OpenOptions,
) -> std::result::Result<(VolumeInfo, Layout, Element, OpenStream), FormatError> {
    let file = registry::read(path, options)?;
    match file.voxels {
        Voxels::Plain(open) => Ok((file.info, file.layout, file.element, open)),
        _ => Err(FormatError::damaged(path, "the file changed while it was read")),
    }
}

/// How the voxels of a source are reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// Any region by itself: a store of chunks, or voxels that are not compressed.
    Regions,
    /// One after another only, with this axis (0 to 2 for x to z) as the slowest: a compressed stream, or compressed pages.
    InOrder(usize),
}

/// How the voxels of a source are reached, from its header.
///
/// # Errors
/// As [`open`].
pub fn reach(path: &Path, options: &OpenOptions) -> std::result::Result<Reach, FormatError> {
    let file = registry::read(path, &options.silent())?;
    let slowest = file.layout.axes().iter().rev().find_map(|axis| match axis.role {
        Role::Space(space) if axis.size > 1 => Some(space),
        _ => None,
    });
    Ok(match (file.voxels, slowest) {
        (Voxels::Chunks(_) | Voxels::Plain(_), _) => Reach::Regions,
        (Voxels::Stream(_), axis) => Reach::InOrder(axis.unwrap_or(2)),
    })
}

/// Reads the header only.
///
/// # Errors
/// As [`open`], but nothing need be chosen: [`Probe::choices`] has what is open.
pub fn probe(path: &Path, options: &OpenOptions) -> std::result::Result<Probe, FormatError> {
    let file = registry::read(path, options)?;
    let region = region::resolve(path, file.info.dims, options.roi.as_ref())?;
    let mut info = region::cut(&file.info, region);
    if let Some(table) = &options.relabel {
        info = relabel::joined(&info, &Joins::read(table)?);
    }
    let voxels = info.voxels();
    Ok(Probe {
        format: file.format,
        encoding: file.encoding,
        orientation: orientation(&info),
        choices: file.choices,
        info,
        layers: file.layers,
        bytes_uncompressed: voxels.saturating_mul(file.element.bytes() as u64),
        warnings: options.warnings.list(),
    })
}
