//! `pumice devices`

use clap::Args;

/// List the devices that can render here, which one auto takes, and why
#[derive(Debug, Args)]
pub(crate) struct Devices {
    /// One JSON object instead of text
    #[arg(long)]
    pub(crate) json: bool,
}
