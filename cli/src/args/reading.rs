//! Flags that say how to read a label volume, shared by every subcommand that reads one.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use pumice_session::values::label_type;
use pumice_session::{ArrayAxes, Roi, Scale};

use super::values::{by_name, dims, spacing};

/// How to read a label volume where the file alone does not decide it
#[derive(Debug, Default, Args)]
pub(crate) struct Reading {
    /// Layer to read from a file with overlapping segments, counted from 0
    #[arg(long, value_name = "N")]
    pub(crate) layer: Option<u32>,
    /// Time step to read from a file with several, counted from 0
    ///
    /// A .pumice file of a time series has them too.
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
    /// Axes of an array in the order of its indices, or what the pages of a TIFF file are: xyz, zyx, tzyx, zcyx, …
    ///
    /// NumPy arrays do not say which axis is which. nibabel and pynrrd use `xyz`, which is the default with a warning; tifffile,
    /// scikit-image and napari use `zyx`. The wrong order mirrors the volume. For TIFF the letters before `yx` are what the pages are, slowest
    /// first, in place of what the file says: z, t (time steps) and c (channels). Other formats say their order and refuse the option.
    #[arg(long, value_name = "ORDER", value_parser = by_name(&ArrayAxes::ALL, ArrayAxes::name))]
    pub(crate) axes: Option<ArrayAxes>,
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
    /// Level of a volume that is stored at several: its number, 0 the finest, or the voxel size x,y,z to which it is nearest
    ///
    /// OME-Zarr, Neuroglancer and N5 folders hold levels. Without the option the finest is read.
    #[arg(long, value_name = "LEVEL|X,Y,Z")]
    pub(crate) scale: Option<Scale>,
    /// Read only these voxels, such as 0:512,100:200,: (the first, and the one after the last)
    ///
    /// An end that is left out is the volume's. The voxels keep their place in the world. Of a store of chunks only those that the region meets
    /// are read.
    #[arg(long, value_name = "X0:X1,Y0:Y1,Z0:Z1", allow_hyphen_values = true)]
    pub(crate) roi: Option<Roi>,
    /// Label image of an OME-Zarr picture that has several
    #[arg(long, value_name = "NAME")]
    pub(crate) label: Option<String>,
    /// Data set of an HDF5 file, or of a Zarr or N5 folder, that has several
    #[arg(long, value_name = "PATH")]
    pub(crate) dataset: Option<String>,
    /// What a chunk means that a store lacks; default fill
    #[arg(long, value_name = "MEANING", value_enum)]
    pub(crate) missing_chunks: Option<Missing>,
    /// Join ids while the volume is read: a CSV or TSV table of pairs supervoxel,segment, or an .npy array of shape (n, 2)
    ///
    /// Ids that the table lacks stay as they are. Takes 16 bytes of memory a pair.
    #[arg(long, value_name = "TABLE")]
    pub(crate) relabel: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Missing {
    /// The fill value of the store; a warning counts them
    Fill,
    /// The store is refused
    Error,
}
