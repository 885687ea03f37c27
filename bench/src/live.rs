//! How soon a live picture follows an edit, as the example `live_latency` measures it: wall milliseconds, because that is what a
//! person waits for.

use std::ffi::OsStr;
use std::path::PathBuf;

use crate::Result;
use crate::programs::{Programs, figure, name_of};
use crate::table::Table;

/// Of the picture.
const SIZE: &str = "1920x1080";

pub(crate) fn measure(programs: &Programs, volumes: &[PathBuf]) -> Result<Table> {
    let mut table = Table::default();
    for volume in volumes {
        for (labels, more) in [("32", None), ("all, each with its own material", Some("colours"))] {
            let mut args = vec![volume.as_os_str(), OsStr::new(SIZE)];
            args.extend(more.map(OsStr::new));
            let text = programs.example("live_latency", &args)?;
            for edit in ["camera", "colour"] {
                let median = |what: &str| figure(&text, &format!("{edit}: {what}"), "ms");
                table.push(vec![
                    ("volume", name_of(volume)),
                    ("labels shown", labels.to_owned()),
                    ("edit", edit.to_owned()),
                    ("call, ms", median("call")?),
                    ("first frame, ms", median("first frame")?),
                    ("whole frame of 1 sample, ms", median("whole frame")?),
                ]);
            }
        }
    }
    Ok(table)
}
