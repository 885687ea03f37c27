//! `pumice info`

use std::path::PathBuf;

use clap::Args;

use super::Reading;

/// Show what a .pumice file or a label volume holds
///
/// For a .pumice file: dims, spacing, labels, boxes, and bytes on disk and in memory by part. For other formats, only the header is read.
#[derive(Debug, Args)]
pub(crate) struct Info {
    /// A .pumice file or any label volume
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) reading: Reading,
}
