//! Opens a label volume of any format for reading, or reads its header alone.

use std::path::Path;

use pumice_core::{BlockSource, VolumeInfo};

use crate::choice::OpenChoice;
use crate::error::FormatError;
use crate::options::OpenOptions;
use crate::orientation::orientation;
use crate::registry;
use crate::slab::SlabSource;
use crate::volume_file::Layer;

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
    let stream = (file.stream)()?;
    let warnings = options.warnings.clone();
    Ok(Box::new(SlabSource::new(path.to_owned(), file.info, file.layout, file.element, stream, warnings)?))
}

/// Reads the header only.
///
/// # Errors
/// As [`open`], but nothing need be chosen: [`Probe::choices`] has what is open.
pub fn probe(path: &Path, options: &OpenOptions) -> std::result::Result<Probe, FormatError> {
    let file = registry::read(path, options)?;
    let voxels = file.info.voxels();
    Ok(Probe {
        format: file.format,
        encoding: file.encoding,
        orientation: orientation(&file.info),
        choices: file.choices,
        info: file.info,
        layers: file.layers,
        bytes_uncompressed: voxels * file.element.bytes() as u64,
        warnings: options.warnings.list(),
    })
}
