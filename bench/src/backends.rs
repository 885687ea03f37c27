//! How fast each backend is, as the example `backend_speed` measures it: rays, frames of 1920 × 1080 at 1 and 32 bounces for each
//! level of detail (the paper's table 4), bytes on the device.

use std::ffi::OsStr;
use std::path::PathBuf;

use crate::Result;
use crate::programs::{Programs, figure, name_of};
use crate::table::Table;

pub(crate) fn measure(
    programs: &Programs,
    volumes: &[PathBuf],
    backends: &[String],
    size: &str,
) -> Result<Table> {
    let mut table = Table::default();
    for volume in volumes {
        let list = backends.join(",");
        let args = [volume.as_os_str(), OsStr::new(size), OsStr::new(&list)];
        let text = programs.example("backend_speed", &args)?;
        for backend in backends {
            let of = |what: &str, unit: &str| figure(&text, &format!("{backend}: {what}"), unit);
            let device = text.lines().find_map(|l| l.strip_prefix(&format!("{backend}: on ")));
            let bytes = |part: &str| of(&format!("{part} "), "bytes").unwrap_or_else(|_| "–".into());
            // Where a processor imitates a graphics processor beside other work, its own seconds are what counts.
            let frame = |what: &str| -> Result<String> {
                let seconds = |bounces, unit| of(&format!("frame {what}, {bounces} bounces"), unit);
                Ok(format!(
                    "{} / {} ({} / {})",
                    seconds(1, "s,")?,
                    seconds(32, "s,")?,
                    seconds(1, "CPU-s")?,
                    seconds(32, "CPU-s")?
                ))
            };
            table.push(vec![
                ("volume", name_of(volume)),
                ("backend", backend.clone()),
                ("device", device.unwrap_or("?").to_owned()),
                ("primary, M rays/s", of("primary", "M/s,")?),
                ("primary, M rays per CPU s", of("primary", "M/CPU-s")?),
                ("diffuse, M rays/s", of("bounce", "M/s,")?),
                ("diffuse, M rays per CPU s", of("bounce", "M/CPU-s")?),
                ("frame", size.to_owned()),
                ("finest, s (CPU s) a frame at 1 / 32 bounces", frame("finest")?),
                ("by distance", frame("by distance")?),
                ("coarsest", frame("coarsest")?),
                ("hierarchy, bytes", bytes("acceleration")),
                ("boxes", bytes("boxes")),
                ("nodes", bytes("nodes")),
                ("leaves", bytes("leaves")),
                ("labels of boxes", bytes("labels")),
            ]);
        }
    }
    Ok(table)
}

/// The backends that can render here, best first.
pub(crate) fn usable(programs: &Programs) -> Result<Vec<String>> {
    let report = programs.report(&["devices", "--json"])?;
    let devices = report["devices"].as_array().ok_or("pumice devices --json lists none")?;
    let names = devices.iter().filter(|d| d["usable"] == true).filter_map(|d| d["backend"].as_str());
    let mut usable: Vec<String> = Vec::new();
    for name in names {
        if !usable.iter().any(|u| u == name) {
            usable.push(name.to_owned());
        }
    }
    Ok(usable)
}
