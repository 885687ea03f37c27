//! `pumice verify`

use std::path::PathBuf;

use clap::Args;

use super::Reading;

/// Check that a .pumice file holds a volume exactly: every voxel, every id
///
/// Exit code 0 if nothing differs; otherwise exit code 1, and the first difference is printed.
#[derive(Debug, Args)]
pub(crate) struct Verify {
    /// The .pumice file
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// The volume that it was made from; of a time series, the same files or the same name with {t}
    #[arg(value_name = "IN", required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}
