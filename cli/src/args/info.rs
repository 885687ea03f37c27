//! `pumice info`

use std::path::PathBuf;

use clap::Args;

use super::Reading;

/// Show what a .pumice file or a label volume holds
///
/// For a .pumice file: dims, spacing, labels, boxes, and bytes on disk and in memory by part. For other formats, only the header is read.
///
/// With --query alone: also the bytes that a process holds which reads and traces only the labels that match. Needs a .pumice file.
///
/// With --labels: a line for each label, with id, name, type, number of voxels, lowest and highest voxel, the middle of these bounds in the
/// volume's world, and colour. Other formats than .pumice are then read whole.
#[derive(Debug, Args)]
pub(crate) struct Info {
    /// A .pumice file or any label volume
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) list: LabelList,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

/// Flags of the list of labels.
#[derive(Debug, Args)]
pub(crate) struct LabelList {
    /// List the labels instead; as JSON: `pumice table`
    #[arg(long, conflicts_with = "json")]
    pub(crate) labels: bool,
    /// List them as CSV, with all columns
    #[arg(long, requires = "labels")]
    pub(crate) csv: bool,
    /// Only the labels for which this holds, e.g. 'glia voxels>1000'
    ///
    /// With --labels it chooses what is listed, else what is shown, of which the bytes in memory are told.
    ///
    /// Conditions are separated by spaces, and all of them must hold. A word: the name contains it, in any letters. 17 42 100-199: ids and
    /// ranges of ids, of which one must be the label's. type:axon, name:"two words": the type or name contains the text; type=axon: it is the
    /// text. voxels>1000: a number compared by < <= > >= = or !=; the numbers are those of the columns of --csv. - or ! in front of a condition:
    /// it must not hold. What is in quotes is a text, whatever it looks like. Nothing, or *: all labels.
    #[arg(long, value_name = "QUERY", allow_hyphen_values = true)]
    pub(crate) query: Option<String>,
    /// Order of the labels: numbers from the largest down, id, name and type upwards
    #[arg(long, value_name = "COLUMN", requires = "labels", default_value = "voxels")]
    pub(crate) sort: String,
}
