//! Bytes in memory by part, and on disk by level.

use std::path::PathBuf;

use crate::Result;
use crate::programs::{Programs, name_of, number, scratch};
use crate::table::Table;

pub(crate) fn measure(programs: &Programs, volumes: &[PathBuf]) -> Result<Table> {
    let folder = scratch()?;
    let file = folder.path().join("volume.pumice");
    let mut table = Table::default();
    for volume in volumes {
        let mut disk = Vec::new();
        for level in ["fast", "small", "default"] {
            let args = ["compress".as_ref(), volume.as_os_str(), "-o".as_ref(), file.as_os_str()];
            programs.pumice(&[&args[..], &["--level".as_ref(), level.as_ref()]].concat())?;
            disk.push(std::fs::metadata(&file).map_err(|e| e.to_string())?.len() as f64);
            programs.pumice(&["verify".as_ref(), file.as_os_str(), volume.as_os_str()])?;
        }

        let info = programs.report(&["info".as_ref(), file.as_os_str(), "--json".as_ref()])?;
        let raw = number(&info, "bytes_raw")?;
        let share = |bytes: f64| format!("{:.0} ({:.3} %)", bytes, 100.0 * bytes / raw);
        let part = |name: &str| number(&info["resident_parts"], name);
        let acceleration = part("acceleration")?;
        table.push(vec![
            ("volume", name_of(volume)),
            ("voxels", format!("{:.0}", raw / 4.0)),
            ("labels", info["labels"].to_string()),
            ("boxes", info["boxes"].to_string()),
            ("box bytes", share(part("boxes")?)),
            ("node bytes", share(part("nodes")?)),
            ("leaf bytes", share(part("leaves")?)),
            ("label bytes", share(part("labels")?)),
            ("together", share(number(&info, "bytes_resident")? - acceleration)),
            ("acceleration bytes", share(acceleration)),
            ("disk, fast", share(disk[0])),
            ("disk, default", share(disk[2])),
            ("disk, small", share(disk[1])),
        ]);
    }
    Ok(table)
}
