//! `pumice devices`

use serde::Serialize;

use crate::Answer;
use crate::args::Devices;
use crate::failure::{Failure, say};

#[derive(Serialize)]
struct Report {
    devices: Vec<pumice_session::Device>,
}

pub(crate) fn run(args: &Devices) -> Result<Answer, Failure> {
    let devices = pumice_session::devices();
    if args.json {
        say(serde_json::to_string_pretty(&Report { devices })?)?;
    } else {
        for d in devices {
            let mark = if d.chosen { "*" } else { " " };
            say(format_args!("{mark} {:15} {}\n  {:15} {}", d.backend, d.device, "", d.reason))?;
        }
    }
    Ok(Answer::Yes)
}
