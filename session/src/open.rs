//! Opening whatever holds a volume: a `.pumice` file as it is, a label volume of others by compressing it in memory.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use pumice_core::{BlockSource, CompressOptions, CompressedVolume, Job, MeshData};
use pumice_formats::OpenOptions;
use pumice_scene::Scene;

use crate::error::{Result, io};

/// Whether a file begins as `.pumice` files do.
///
/// # Errors
/// When the file cannot be read.
pub fn is_pumice_file(path: &Path) -> Result<bool> {
    if path.is_dir() {
        return Ok(false);
    }
    let mut magic = [0u8; 8];
    let mut file = std::fs::File::open(path).map_err(io(path))?;
    let mut got = 0;
    while got < magic.len() {
        match file.read(&mut magic[got..]).map_err(io(path))? {
            0 => return Ok(false),
            n => got += n,
        }
    }
    Ok(magic == pumice_core::file::MAGIC)
}

/// Opens a volume for rendering.
///
/// # Errors
/// One line that says what is wrong with the file and where; [`pumice_core::Error::Cancelled`] when `job` is cancelled.
pub fn open_volume(path: &Path, reading: &OpenOptions, job: &Job) -> Result<Arc<CompressedVolume>> {
    if is_pumice_file(path)? {
        return Ok(Arc::new(CompressedVolume::open(path, job)?));
    }
    let mut source = pumice_formats::open(path, reading)?;
    Ok(Arc::new(compress_source(source.as_mut(), &CompressOptions::default(), job)?))
}

/// A label volume as blocks; a `.pumice` file is none.
///
/// # Errors
/// As [`open_volume`].
pub fn open_source(path: &Path, reading: &OpenOptions) -> Result<Box<dyn BlockSource>> {
    Ok(pumice_formats::open(path, reading)?)
}

/// Compresses a source, with `job` counting its voxels.
pub(crate) fn compress_source(
    source: &mut dyn BlockSource,
    options: &CompressOptions,
    job: &Job,
) -> Result<CompressedVolume> {
    Ok(pumice_core::compress(source, options, job)?)
}

/// Opens the meshes of a scene, in its order.
///
/// # Errors
/// One line that says what is wrong with which file.
pub fn open_meshes(scene: &Scene) -> Result<Vec<Arc<MeshData>>> {
    scene.meshes.iter().map(|m| Ok(Arc::new(pumice_formats::open_mesh(&m.source)?))).collect()
}
