//! `pumice merge`

use std::path::PathBuf;

use clap::Args;
use pumice_session::values::bytes;

use super::CompressionLevel;
use super::values::threads;

/// Join the parts of a volume or of a time series, made by `pumice compress --chunks`, into a .pumice file
///
/// The file has the bytes that compressing the volume at once gives, whatever the parts and their order. Parts of another source, of other
/// options or of another number of time steps, chunks that come twice and chunks that are missing are refused by name. One chunk is in memory at a
/// time. With --part some parts become one, which is merged with the others later.
#[derive(Debug, Args)]
pub(crate) struct Merge {
    /// The parts, in any order
    #[arg(value_name = "PART", required = true)]
    pub(crate) parts: Vec<PathBuf>,
    /// The .pumice file to write
    #[arg(short, long, value_name = "OUT.pumice")]
    pub(crate) out: PathBuf,
    /// Write a part again, of the chunks of these parts: the bytes that compressing them at once gives
    ///
    /// For parts that lie on several machines: each sends one file instead of many. Chunks may be missing. Merging reads every chunk, so each such
    /// step takes about a seventh of the CPU time of compressing.
    #[arg(long, conflicts_with_all = ["level", "types", "table"])]
    pub(crate) part: bool,
    /// How much time to spend on a smaller file
    ///
    /// `default` copies the chunks of the parts; `fast` decodes them; `small` codes their voxels again, about a CPU second per 10⁸ voxels.
    #[arg(long, value_enum, default_value_t = CompressionLevel::Default)]
    pub(crate) level: CompressionLevel,
    /// Write a report in JSON to this file (- for standard output)
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
    /// Number of threads; default: all cores. The result does not depend on it
    #[arg(long, value_name = "N", value_parser = threads())]
    pub(crate) threads: Option<u16>,
    /// Memory to work with, in bytes or with K, M, G, KiB, MiB, GiB (powers of 1024); what does not fit goes to temporary files
    ///
    /// Beyond it come one chunk, the table of labels and their contacts.
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub(crate) memory_limit: Option<u64>,
    /// CSV table with the columns id,type: the type of each label
    #[arg(long, value_name = "TABLE")]
    pub(crate) types: Option<PathBuf>,
    /// Table of labels: names, types, colours and columns of numbers, by id; as for `pumice compress`
    #[arg(long, value_name = "TABLE", conflicts_with = "types")]
    pub(crate) table: Option<PathBuf>,
}
