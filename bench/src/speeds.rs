//! CPU time of compressing from memory, and of rays, as the examples `build_speed` and `ray_rate` measure it on one thread.

use std::path::{Path, PathBuf};

use crate::Result;
use crate::programs::{Programs, figure, name_of, number, scratch};
use crate::table::Table;

pub(crate) fn measure(programs: &Programs, volumes: &[PathBuf]) -> Result<Table> {
    let folder = scratch()?;
    let at = |name: &str| folder.path().join(name);
    let mut table = Table::default();
    for volume in volumes {
        // The examples take labels without header and a gzipped NRRD: both come from the file as Pumice read it.
        let file = at("volume.pumice");
        let report = programs.report(&[
            "compress".as_ref(),
            volume.as_os_str(),
            "-o".as_ref(),
            file.as_os_str(),
            "--json".as_ref(),
            "-".as_ref(),
        ])?;
        for out in ["volume.npy", "volume.nrrd"] {
            programs.pumice(&[
                "decompress".as_ref(),
                file.as_os_str(),
                "-o".as_ref(),
                at(out).as_os_str(),
            ])?;
        }
        write_u32_labels(&at("volume.npy"), &at("volume.raw"))?;
        let dims: Vec<String> = (0..3).map(|a| report["dims"][a].to_string()).collect();
        let raw = at("volume.raw").display().to_string();
        let build = programs.example("build_speed", &[&raw, &dims[0], &dims[1], &dims[2]])?;
        let rays = programs.example("ray_rate", &[at("volume.nrrd")])?;
        let compression_figure = |line, unit| figure(&build, line, unit);
        let ray_figure = |line| figure(&rays, line, "M/s");
        table.push(vec![
            ("volume", name_of(volume)),
            ("whole compression from the file, CPU s", format!("{:.2}", number(&report, "cpu_seconds")?)),
            ("parts, MVoxel per CPU s", compression_figure("parts", "MVoxel/CPU-s")?),
            ("finish, CPU s", compression_figure("finish", "CPU-s")?),
            ("contacts, CPU s", compression_figure("contacts", "CPU-s,")?),
            ("verify, CPU s", compression_figure("verify", "CPU-s:")?),
            ("primary rays, M per CPU s", ray_figure("primary")?),
            ("diffuse rays, M per CPU s", ray_figure("diffuse")?),
            ("occlusion rays, M per CPU s", ray_figure("occluded")?),
        ]);
    }
    Ok(table)
}

/// The array behind an NPY header (bytes 8 and 9 give its length), which must be of u32.
fn write_u32_labels(npy: &Path, raw: &Path) -> Result<()> {
    let bytes = std::fs::read(npy).map_err(|e| format!("{}: {e}", npy.display()))?;
    let header_bytes = match bytes.get(8..10) {
        Some(&[low, high]) => usize::from(u16::from_le_bytes([low, high])) + 10,
        _ => return Err(format!("{}: no NPY header", npy.display())),
    };
    let header = String::from_utf8_lossy(bytes.get(..header_bytes).unwrap_or_default());
    if !header.contains("<u4") || !header.contains("'fortran_order': True") {
        return Err(format!(
            "speeds are measured on u32 labels, x fastest: this volume came out as {header}"
        ));
    }
    std::fs::write(raw, &bytes[header_bytes..]).map_err(|e| format!("{}: {e}", raw.display()))
}
