//! `pumice devices`

use clap::Args;

/// List the devices that can render on this machine, which one `--backend auto` takes, and why
#[derive(Debug, Args)]
pub(crate) struct Devices {
    /// Print one JSON object instead of text
    #[arg(long)]
    pub(crate) json: bool,
}
