//! `pumice devices`

use clap::Args;

/// List what can render here, what would be chosen, and why
#[derive(Debug, Args)]
pub(crate) struct Devices {
    /// One JSON object instead of text
    #[arg(long)]
    pub(crate) json: bool,
}
