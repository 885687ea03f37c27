//! Opens a label volume of any format for reading, or reads its header alone.

use std::path::Path;

use pumice_core::{BlockSource, VolumeInfo};

use crate::choice::OpenChoice;
use crate::chunks::ChunkSource;
use crate::error::FormatError;
use crate::options::OpenOptions;
use crate::orientation::orientation;
use crate::region::{self, RegionSource};
use crate::registry;
use crate::relabel::{self, JoinedSource, Joins};
use crate::slab::SlabSource;
use crate::volume_file::{Layer, Voxels};

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
    let file = registry::read(path, options)?;
    if let Some(open) = file.choices.iter().find(|choice| choice.assumed.is_none()) {
        return Err(open.undecided(path));
    }
    let region = region::resolve(path, file.info.dims, options.roi.as_ref())?;
    let joins = options.relabel.as_deref().map(Joins::read).transpose()?;
    let (path, warnings) = (path.to_owned(), options.warnings.clone());
    let source: Box<dyn BlockSource> = match file.voxels {
        Voxels::Stream(open) => {
            let source =
                SlabSource::new(path.clone(), file.info, file.layout, file.element, open()?, warnings)?;
            if options.roi.is_some() {
                Box::new(RegionSource::new(Box::new(source), region))
            } else {
                Box::new(source)
            }
        }
        Voxels::Chunks(chunks) => {
            let info = region::cut(&file.info, region);
            let how = (&file.layout, file.element);
            Box::new(ChunkSource::new(path.clone(), info, how, chunks, region, warnings)?)
        }
    };
    Ok(match joins {
        Some(joins) => Box::new(JoinedSource::new(source, joins, &path, &options.warnings)),
        None => source,
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
