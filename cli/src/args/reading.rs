//! Flags that say how to read a label volume, shared by every subcommand that reads one.

use clap::{Args, ValueEnum};
use pumice_session::values::label_type;

use super::values::{dims, spacing};

/// How to read a label volume where the file alone does not decide it
#[derive(Debug, Default, Args)]
pub(crate) struct Reading {
    /// Layer to read from a file with overlapping segments, counted from 0
    #[arg(long, value_name = "N")]
    pub(crate) layer: Option<u32>,
    /// Time step to read from a file with several, counted from 0
    #[arg(long = "time-step", value_name = "N")]
    pub(crate) time_step: Option<u32>,
    /// Channel to read from a file with several, counted from 0
    #[arg(long, value_name = "N")]
    pub(crate) channel: Option<u32>,
    /// Array to read from an .npz archive with several
    #[arg(long, value_name = "NAME")]
    pub(crate) array: Option<String>,
    /// Voxel size x,y,z in the file's unit, in place of the size that the file states
    #[arg(long, value_name = "X,Y,Z", value_parser = spacing)]
    pub(crate) spacing: Option<[f64; 3]>,
    /// Axes of an .npy or .npz array, in the order of its indices
    ///
    /// NumPy arrays do not say which axis is which. nibabel and pynrrd use `xyz`, which is the default with a warning; tifffile,
    /// scikit-image and napari use `zyx`. The wrong order mirrors the volume. Other formats say their order and refuse the option.
    #[arg(long, value_name = "ORDER", value_enum)]
    pub(crate) axes: Option<Axes>,
    /// Read a file without a header, with these dims, e.g. 512,512,128 (needs --raw-type)
    #[arg(long, value_name = "X,Y,Z", value_parser = dims, requires = "raw_type")]
    pub(crate) raw_dims: Option<[u64; 3]>,
    /// Label type of a file without a header: u8 u16 u32 u64 i8 i16 i32 i64 f32 f64
    #[arg(long, value_name = "TYPE", value_parser = label_type, requires = "raw_dims")]
    pub(crate) raw_type: Option<pumice_session::LabelType>,
    /// Read a file without a header as big-endian
    #[arg(long, requires = "raw_dims")]
    pub(crate) raw_big_endian: bool,
    /// Bytes to skip at the start of a file without a header
    #[arg(long, value_name = "BYTES", default_value_t = 0, requires = "raw_dims")]
    pub(crate) raw_offset: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Axes {
    Xyz,
    Zyx,
}
