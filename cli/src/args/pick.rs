//! `pumice pick`

use std::path::PathBuf;

use clap::Args;

use super::values::pixel;

/// Tell which labels lie under pixels of a picture: instance, id, name, type, position, voxel
///
/// The ids come from the picture's own passes, exactly, whatever became of the volume. The voxel needs the volume that the picture was
/// rendered from; where that is gone or has changed, a line says so and the rest is told.
#[derive(Debug, Args)]
pub(crate) struct Pick {
    /// The picture: an .exr that was rendered with --passes all (the default), or with label and position
    #[arg(value_name = "PICTURE.exr")]
    pub(crate) picture: PathBuf,
    /// Pixels from the left and from the top, both from 0
    #[arg(value_name = "X,Y", value_parser = pixel, required = true)]
    pub(crate) pixels: Vec<[u32; 2]>,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub(crate) json: bool,
}
