//! `pumice info`

use std::path::PathBuf;

use clap::Args;

use super::Reading;

/// Show what a .pumice file or a label volume holds
///
/// For .pumice: dims, spacing, labels, boxes, bytes on disk and in memory by part. For other formats, reads the header alone.
#[derive(Debug, Args)]
pub(crate) struct Info {
    /// A .pumice file or any label volume
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// One JSON object instead of text
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) reading: Reading,
}
