//! `pumice compare`

use std::path::PathBuf;

use clap::Args;

use super::values::positive;

/// Measure how far a picture is from a reference: relMSE, PSNR, SSIM, FLIP, and a statistical test where variances are known
#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// The picture (.exr)
    #[arg(value_name = "A.exr")]
    pub(crate) picture: PathBuf,
    /// The reference (.exr), of the same size
    #[arg(value_name = "B.exr")]
    pub(crate) reference: PathBuf,
    /// Write a report in JSON to this file (- for standard output)
    #[arg(long, value_name = "REPORT")]
    pub(crate) json: Option<PathBuf>,
    /// Exit with 1 when relMSE is above this
    #[arg(long, value_name = "VALUE", value_parser = positive)]
    pub(crate) max_rel_mse: Option<f64>,
}
