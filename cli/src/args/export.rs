//! `pumice export`

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Reading;

/// Write a volume or a scene for other programs, as USD
///
/// The file holds the volumes with their materials, names and ids of labels. A scene's camera, lights, world and meshes are not written
/// yet; the command says what it left out.
#[derive(Debug, Args)]
pub(crate) struct Export {
    /// A .pumice file, any label volume, or a scene (.json)
    #[arg(value_name = "FILE|SCENE.json")]
    pub(crate) input: PathBuf,
    /// Output file; its extension chooses the format: .usda (text), .usdc (binary)
    #[arg(short, long, value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Forms of the volumes, separated by commas; each is a variant of the stage, and the first is shown
    #[arg(long, value_enum, value_name = "A,B", default_value = "voxels", value_delimiter = ',')]
    pub(crate) form: Vec<FormArg>,
    /// Write a square for each face, instead of merging neighbouring faces of a label into rectangles
    #[arg(long)]
    pub(crate) plain: bool,
    /// Write only these labels, by id, separated by commas
    #[arg(long, value_name = "ID,ID", value_delimiter = ',')]
    pub(crate) labels: Option<Vec<u64>>,
    /// Refuse to write more faces and boxes than this, of all forms together; each takes 24 bytes of memory, about 50 of a .usdc and 125 of a .usda
    #[arg(long, value_name = "N", default_value = "20000000")]
    pub(crate) most_faces: u64,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// Write a report as JSON to this file, or to standard output with -
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormArg {
    /// Every box as a scaled cube, also where boxes coincide: the least to write, for proxies
    Instances,
    /// The surface that is drawn at level of detail 16
    Boxes,
    /// The surface that is drawn at level of detail 4
    Cells4,
    /// The exact surface
    Voxels,
}
