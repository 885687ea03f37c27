//! What many instances cost, as the example `instance_speed` measures it: asked in turn, and found by a hierarchy over them.

use std::ffi::OsStr;
use std::path::PathBuf;

use crate::Result;
use crate::programs::{Programs, figure, name_of};
use crate::table::Table;

/// Of the picture: where thousands are asked in turn, a larger one takes minutes.
const SIZE: &str = "160x90";

const COUNTS: [&str; 11] = ["1", "2", "3", "4", "6", "8", "16", "64", "256", "1024", "4096"];

pub(crate) fn measure(programs: &Programs, volumes: &[PathBuf]) -> Result<Table> {
    let mut table = Table::default();
    for volume in volumes {
        let text = programs.example(
            "instance_speed",
            &[volume.as_os_str(), OsStr::new(SIZE), OsStr::new(&COUNTS.join(","))],
        )?;
        for count in COUNTS {
            let of = |what: &str, unit: &str| figure(&text, &format!("{count}: {what}"), unit);
            table.push(vec![
                ("what", name_of(volume)),
                ("instances", count.to_owned()),
                ("in turn, CPU s a sample", of("in turn", "CPU-s,")?),
                ("by a hierarchy, CPU s a sample", of("in turn", "CPU-s")?),
                ("building it, CPU s", of("tree", "CPU-s")?),
                ("its bytes", of("tree of", "bytes")?),
                ("all hierarchies, bytes", of("hierarchies of", "bytes")?),
            ]);
        }
    }
    Ok(table)
}
