//! `pumice devices`

use serde::Serialize;

use crate::Answer;
use crate::args::Devices;
use crate::failure::{Failure, print, say};

#[derive(Serialize)]
struct Report {
    devices: Vec<pumice_session::Device>,
}

pub(crate) fn run(args: &Devices) -> Result<Answer, Failure> {
    let devices = pumice_session::devices();
    if args.json {
        print(&serde_json::to_string_pretty(&Report { devices })?)?;
    } else {
        let mut number = None;
        for d in devices {
            // Each device is printed once, with its backends in the lines below it.
            if d.number.is_none() || d.number != number {
                let which = d.number.map_or_else(|| "-".to_string(), |n| n.to_string());
                let driver = d.driver.as_ref().map_or(String::new(), |driver| format!(", {driver}"));
                say(format_args!("{which} {} ({}{driver})", d.device, d.kind))?;
                number = d.number;
            }
            let mark = if d.chosen { "*" } else { " " };
            say(format_args!("  {mark} {:15} {}", d.backend, d.reason))?;
        }
    }
    Ok(Answer::Yes)
}
