//! `pumice export`

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use pumice_session::values::bytes;

use super::Reading;
use super::selectors::{Selectors, selectors};
use super::values::region;

/// Write a volume or a scene for other programs: USD, glTF, PLY, OBJ, STL
///
/// The file holds the volumes with their materials, names and ids of labels. USD and glTF also have a scene's camera, lights and meshes, USD
/// its world too; the other formats have not. The command says what it left out.
#[derive(Debug, Args)]
pub(crate) struct Export {
    /// A .pumice file, any label volume, or a scene (.json)
    #[arg(value_name = "FILE|SCENE.json")]
    pub(crate) input: PathBuf,
    /// Output file; its extension chooses the format: .usda (text), .usdc (binary), .usdz (package with the picture of the world), .gltf
    /// (with a .bin beside it), .glb, .ply, .obj (with an .mtl beside it), .stl (shape alone)
    #[arg(short, long, value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Form of the volumes; in USD several, separated by commas: each is a variant of the stage, and the first is shown
    #[arg(long, value_enum, value_name = "A,B", default_value = "voxels", value_delimiter = ',')]
    pub(crate) form: Vec<FormArg>,
    /// Write the surface that `render` draws at this level of detail, in place of --form: 16 is boxes, 4 cells4, 1 voxels
    #[arg(long, value_name = "16|4|1", conflicts_with = "form", value_parser = level)]
    pub(crate) lod: Option<FormArg>,
    /// Write a square for each face, instead of merging neighbouring faces of a label into rectangles
    #[arg(long)]
    pub(crate) plain: bool,
    /// The program that will read the file: Blender's importer departs from the specification in suns, spots and orthographic cameras
    #[arg(long = "for", value_enum, value_name = "READER", default_value = "specification")]
    pub(crate) reader: ReaderArg,
    /// Write only these labels: ids, names, queries, separated by commas, as of `pumice render`
    ///
    /// Files of different labels of a volume have the same place and scale.
    #[arg(long, value_name = "A,B,C", value_parser = selectors, allow_hyphen_values = true)]
    pub(crate) labels: Vec<Selectors>,
    /// Write only these voxels of each volume: from X0,Y0,Z0 up to, and without, X1,Y1,Z1. Surfaces are closed at its border. Cells and boxes
    /// that it overlaps are written whole
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = region)]
    pub(crate) region: Option<[[u32; 3]; 2]>,
    /// Refuse to write a file larger than this, as estimated before anything is written; memory is about half as much, with
    /// smooth twice as much
    #[arg(long, value_name = "BYTES", default_value = "4G", value_parser = bytes)]
    pub(crate) limit: u64,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// Write a report as JSON to this file, or to standard output with -
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormArg {
    /// Every box as a scaled cube, also where boxes coincide: the least to write, for proxies. In USD and glTF alone; few programs read
    /// those of glTF
    Instances,
    /// The surface that is drawn at level of detail 16
    Boxes,
    /// The surface that is drawn at level of detail 4
    Cells4,
    /// The exact surface
    Voxels,
    /// A smoothed surface, which is not exact: corners of voxels move by up to 0.4 of a voxel. Each label's surface is closed, and labels that
    /// touch have their border in common
    Smooth,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ReaderArg {
    /// Any program that keeps to USD's specification
    Specification,
    /// Blender 4.2 to 5.0: suns, spots and orthographic cameras arrive as they are in the scene. Have a world before the import, and choose
    /// the camera after it: the importer does neither
    Blender,
}

/// The form of a level of detail.
fn level(text: &str) -> Result<FormArg, String> {
    match text {
        "16" => Ok(FormArg::Boxes),
        "4" => Ok(FormArg::Cells4),
        "1" => Ok(FormArg::Voxels),
        _ => Err("expected 16, 4 or 1".into()),
    }
}
