//! `pumice compress`

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use pumice_session::values::bytes;
use pumice_session::{ChunkSet, TimeSteps};

use super::Reading;
use super::values::threads;

/// Compress a label volume, or a time series of them, losslessly into a .pumice file
///
/// Reads NRRD, NIfTI, TIFF (also a folder of slices), NPY, NPZ, MetaImage, HDF5 and raw files, and folders of Zarr, OME-Zarr, Neuroglancer and N5
/// (by their URL too, in builds with the feature http), as a stream: the whole volume is never in memory. The output file appears under its final name only when it is complete.
#[derive(Debug, Args)]
pub(crate) struct Compress {
    /// Label volume; several files, or a name with {t} in place of a number, are the time steps of one series. A .pumice file is written anew,
    /// at this --level and with this --table
    #[arg(value_name = "IN", required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// The .pumice file to write
    #[arg(short, long, value_name = "OUT.pumice")]
    pub(crate) out: PathBuf,
    /// How much time to spend on a smaller file
    ///
    /// `fast` stores the compressed form as it is in memory, `default` costs little time, `small` takes about twice as long. Without the option
    /// it is `default`.
    #[arg(long, value_enum)]
    pub(crate) level: Option<CompressionLevel>,
    /// Compress only these chunks of 1024³ voxels, such as 0,4-7, into a part that `pumice merge` joins with the others
    ///
    /// Chunks are numbered from 0 in Morton order of the volume's grid of chunks. Only what is needed of the input is read. Of a time series a
    /// part has its chunks at all time steps. Level, types and table are given to `pumice merge`.
    #[arg(long, value_name = "CHUNKS", conflicts_with_all = ["level", "types", "table", "resume", "restart"])]
    pub(crate) chunks: Option<ChunkSet>,
    /// Keep finished chunks in the folder OUT.pumice.parts until all are done, and go on with those that are there
    ///
    /// After an interrupt the same command goes on and gives the same file; the folder is removed at the end. Of compressed TIFF, whole layers of
    /// chunks are kept; of a time series, chunks at all time steps. What only reads from its beginning, such as a gzip stream, is read again up to
    /// the first chunk that is missing.
    #[arg(long)]
    pub(crate) resume: bool,
    /// Remove what an interrupted compression left in OUT.pumice.parts, then begin anew as with --resume
    #[arg(long, conflicts_with = "resume")]
    pub(crate) restart: bool,
    /// Write a report in JSON to this file (- for standard output)
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
    /// Number of threads; default: all cores. The result does not depend on it
    #[arg(long, value_name = "N", value_parser = threads())]
    pub(crate) threads: Option<u16>,
    /// Memory to work with, in bytes or with K, M, G, KiB, MiB, GiB (powers of 1024); what does not fit goes to temporary files
    ///
    /// Beyond it come what the reader of the input holds and some 30 MB of the program itself. Only a table of labels that exceeds it is
    /// refused, with the number that is needed. The folder of temporary files is that of TMPDIR. The result does not depend on the limit.
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// CSV table with the columns id,type: the type of each label
    #[arg(long, value_name = "TABLE")]
    pub(crate) types: Option<PathBuf>,
    /// Table of labels: names, types, colours and columns of numbers, by id
    ///
    /// CSV or TSV with a header line (id, name, type, color as #rrggbb or r,g,b, any columns of numbers), a label description file of
    /// ITK-SNAP, a colour table of FreeSurfer or 3D Slicer, or segment properties of Neuroglancer. Its content decides. The command says
    /// which rows have no label, and how many labels have no row.
    #[arg(long, value_name = "TABLE", conflicts_with = "types")]
    pub(crate) table: Option<PathBuf>,
    /// Compress several time steps into one file: all, or the first and the last, such as 0-19, counted from 0
    ///
    /// The time steps of a file that has several, or of a series of files, of which all are taken without the option. They share what stands
    /// still, and have one table of labels. --time-step reads one of them.
    #[arg(long, value_name = "all|A-B", conflicts_with = "time_step")]
    pub(crate) time_steps: Option<TimeSteps>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CompressionLevel {
    /// Stores the arrays as they are in memory; opens fastest, also when only a few labels are loaded
    Fast,
    /// About two thirds of the size of fast; decompressed when it is opened
    Default,
    /// Stores the voxels themselves, about a third of the size of default; writing and opening take about a CPU second each per 10⁸ voxels
    Small,
}
