//! `pumice verify-render`

use std::path::PathBuf;

use clap::Args;
use pumice_session::values::{bytes, size};

use super::Reading;
use super::values::positive;

/// Compare our picture of a scene with that of Blender's Cycles, and say whether they agree
///
/// Both programs draw the same scene with many seeds, until every tile of 8 × 8 pixels is known to lie within 1 % and the picture's mean
/// within 0.2 %, or one of them beyond. Exit code 0: agrees, 1: differs, 2: cannot tell.
#[derive(Debug, Args)]
pub(crate) struct VerifyRender {
    /// A scene (.json), a .pumice file or any label volume
    #[arg(value_name = "SCENE.json|FILE")]
    pub(crate) input: PathBuf,
    /// A Python that has Blender as the module bpy, or the program Blender
    #[arg(long, value_name = "PATH")]
    pub(crate) with_blender: PathBuf,
    /// Give Cycles this scene instead, to see that the comparison notices the difference between the two
    #[arg(long, value_name = "SCENE.json")]
    pub(crate) control: Option<PathBuf>,
    /// Write a page with the verdict, pictures, maps and figures: .html, one file that needs nothing else
    #[arg(short, long, value_name = "PAGE.html")]
    pub(crate) out: Option<PathBuf>,
    /// Write a report as JSON to this file, or to standard output with -
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
    /// Backend that renders our pictures (see render)
    #[arg(long, value_name = "NAME[:DEVICE]", default_value = "auto")]
    pub(crate) backend: String,
    /// Samples per pixel of each picture, 256 or more; with fewer than 1024 the patterns of Cycles' own sampling tables show
    #[arg(long, value_name = "N", default_value = "1024", value_parser = clap::value_parser!(u32).range(256..))]
    pub(crate) spp: u32,
    /// Begin no further picture after this many seconds; without a limit, 256 pictures of each
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) time: Option<f64>,
    /// Size of the pictures; default: the scene's proportions with at most 40,000 pixels
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(crate) size: Option<[u32; 2]>,
    /// Level of detail that both draw: 1, 4 or 16; default: the finest that memory allows
    #[arg(long, value_name = "1|4|16", value_parser = ["1", "4", "16"])]
    pub(crate) lod: Option<String>,
    /// Bytes that Blender may take; default: three quarters of what is free
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// Show only these labels, by id, separated by commas
    #[arg(long, value_name = "ID,ID", value_delimiter = ',', conflicts_with = "pick")]
    pub(crate) labels: Option<Vec<u64>>,
    /// Show this many labels, chosen for a figure; for volumes
    #[arg(long, value_name = "N")]
    pub(crate) pick: Option<usize>,
    /// Maximum number of light bounces; default 32, or the scene's
    #[arg(long, value_name = "N")]
    pub(crate) bounces: Option<u32>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}
