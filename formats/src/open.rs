//! Opens a label volume of any format for reading, or reads its header alone.

use std::path::Path;

use pumice_core::{BlockSource, VolumeInfo};

use crate::error::FormatError;
use crate::options::OpenOptions;
use crate::registry;
use crate::slab::SlabSource;
use crate::volume_file::Layer;

/// What the header of a file says.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Name of the format, as people call it.
    pub format: &'static str,
    /// How the voxels are stored: `raw`, `gzip`, `ascii`, `deflate`, …
    pub encoding: String,
    /// Size, type, place, names.
    pub info: VolumeInfo,
    /// Layers, where the file has overlapping segments; else empty.
    pub layers: Vec<Layer>,
    /// Bytes of the volume's voxels in the file's own type, without compression and without other layers.
    pub bytes_uncompressed: u64,
    /// What the user should know though it is no error.
    pub warnings: Vec<String>,
}

/// Opens a label volume for reading by blocks.
///
/// # Errors
/// One line that says what and where, for any content whatsoever.
pub fn open(path: &Path, options: &OpenOptions) -> std::result::Result<Box<dyn BlockSource>, FormatError> {
    let file = registry::read(path, options)?;
    if let Some(undecided) = file.undecided {
        return Err(undecided);
    }
    let stream = (file.stream)()?;
    let warnings = options.warnings.clone();
    Ok(Box::new(SlabSource::new(path.to_owned(), file.info, file.layout, file.element, stream, warnings)?))
}

/// Reads the header only.
///
/// # Errors
/// As [`open`], but a layer, time step or channel need not be chosen: then the first one is described.
pub fn probe(path: &Path, options: &OpenOptions) -> std::result::Result<Probe, FormatError> {
    let file = registry::read(path, options)?;
    let voxels = file.info.voxels();
    Ok(Probe {
        format: file.format,
        encoding: file.encoding,
        info: file.info,
        layers: file.layers,
        bytes_uncompressed: voxels * file.element.bytes() as u64,
        warnings: options.warnings.list(),
    })
}
