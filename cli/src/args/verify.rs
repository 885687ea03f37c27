//! `pumice verify`

use std::path::PathBuf;

use clap::Args;
use pumice_session::TimeSteps;

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
    /// Compare with several time steps of the volume: all, or the first and the last, such as 10-29, counted from 0
    ///
    /// For a file that was made of a part of them. Without it all time steps are compared.
    #[arg(long, value_name = "all|A-B", conflicts_with = "time_step")]
    pub(crate) time_steps: Option<TimeSteps>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}
