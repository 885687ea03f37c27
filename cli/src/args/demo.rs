//! `pumice demo`

use std::path::PathBuf;

use clap::Args;
use pumice_session::values::size;

use super::values::{positive, relative};

/// Compress a real volume of mouse cortex and path trace thirty-two of its neurites
///
/// Writes picture.png, picture.exr, report.md and error.svg. Rendering stops when the picture's estimated relative error is at most
/// 3 %, or after 60 seconds.
#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Label volume to use instead of the shipped one
    #[arg(long, value_name = "FILE")]
    pub(crate) volume: Option<PathBuf>,
    /// Folder for the results, created if absent
    #[arg(long, value_name = "DIR", default_value = "pumice-demo")]
    pub(crate) out: PathBuf,
    /// Stop rendering after this many seconds
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = positive)]
    pub(crate) time: f64,
    /// Stop rendering when the estimated relative error is at most this: 0.03 or 3%
    #[arg(long, value_name = "RELATIVE", default_value = "0.03", value_parser = relative)]
    pub(crate) error: f64,
    /// Picture size in pixels
    #[arg(long, value_name = "WxH", default_value = "960x540", value_parser = size)]
    pub(crate) size: [u32; 2],
}
