//! How a label volume is read: flags of every subcommand that reads one.

use clap::{Args, ValueEnum};

use super::values::{dims, label_type, spacing};

/// How to read a label volume where the file leaves something open
#[derive(Debug, Default, Args)]
pub(crate) struct Reading {
    /// Layer of a file with overlapping segments, counted from 0
    #[arg(long, value_name = "N")]
    pub(crate) layer: Option<u32>,
    /// Time step of a file with several, counted from 0
    #[arg(long = "time-step", value_name = "N")]
    pub(crate) time_step: Option<u32>,
    /// Channel of a file with several, counted from 0
    #[arg(long, value_name = "N")]
    pub(crate) channel: Option<u32>,
    /// Array of an .npz archive with several
    #[arg(long, value_name = "NAME")]
    pub(crate) array: Option<String>,
    /// Voxel size x,y,z in the file's unit, instead of the file's own
    #[arg(long, value_name = "X,Y,Z", value_parser = spacing)]
    pub(crate) spacing: Option<[f64; 3]>,
    /// Array axes of .npy and .npz in the order of indexing
    ///
    /// NumPy arrays do not say which axis is which. `xyz` (default) is what nibabel and pynrrd give, `zyx` what tifffile,
    /// scikit-image and napari use.
    #[arg(long, value_name = "ORDER", value_enum)]
    pub(crate) axes: Option<Axes>,
    /// Read a file without header: its dims, e.g. 512,512,128 (needs --raw-type)
    #[arg(long, value_name = "X,Y,Z", value_parser = dims, requires = "raw_type")]
    pub(crate) raw_dims: Option<[u64; 3]>,
    /// Label type of a file without header: u8 u16 u32 u64 i8 i16 i32 i64 f32 f64
    #[arg(long, value_name = "TYPE", value_parser = label_type, requires = "raw_dims")]
    pub(crate) raw_type: Option<pumice_session::LabelType>,
    /// A file without header is big-endian
    #[arg(long, requires = "raw_dims")]
    pub(crate) raw_big_endian: bool,
    /// Bytes to skip at the start of a file without header
    #[arg(long, value_name = "BYTES", default_value_t = 0, requires = "raw_dims")]
    pub(crate) raw_offset: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Axes {
    Xyz,
    Zyx,
}
