//! Error against time: relMSE of pictures of 1, 4, 16 … samples a pixel against a reference of many more, with the time that each
//! took and the error that each estimated of itself. The reference is the CPU's whatever backend is measured: all of them draw the
//! same picture, and one that did not would show here.

use std::path::PathBuf;

use crate::Result;
use crate::programs::{Programs, name_of, number, scratch};
use crate::table::Table;

/// Samples a pixel of the pictures; the reference has [`REFERENCE_FACTOR`] times the last one that is drawn.
const SPP: [u32; 6] = [1, 4, 16, 32, 64, 128];
/// The reference's own error adds its share to what is measured: at 64 times the samples 1 or 2 % of it.
const REFERENCE_FACTOR: u32 = 64;

pub(crate) fn measure(
    programs: &Programs,
    volumes: &[PathBuf],
    backends: &[String],
    most_spp: u32,
) -> Result<Table> {
    let folder = scratch()?;
    let mut table = Table::default();
    for volume in volumes {
        // The reference has a seed of its own, so that its noise is not the pictures'.
        let render = |backend: &str, name: &str, spp: u32, seed: &str| {
            let picture = folder.path().join(name);
            let spp = spp.to_string();
            let fixed = [
                "--pick",
                "32",
                "--size",
                "160x90",
                "--backend",
                backend,
                "--json",
                "-",
                "--seed",
                seed,
                "--spp",
                &spp,
            ];
            let mut args = vec!["render".as_ref(), volume.as_os_str(), "-o".as_ref(), picture.as_os_str()];
            args.extend(fixed.iter().map(std::ffi::OsStr::new));
            programs.report(&args).map(|report| (picture.clone(), report))
        };
        let counts: Vec<u32> = SPP.into_iter().filter(|&spp| spp <= most_spp).collect();
        let last = counts.last().ok_or("error against time begins at 1 sample")?;
        let (reference, _) = render("cpu", "reference.exr", last * REFERENCE_FACTOR, "1")?;
        for backend in backends {
            for &spp in &counts {
                let (picture, report) = render(backend, "picture.exr", spp, "2")?;
                let args = [
                    "compare".as_ref(),
                    picture.as_os_str(),
                    reference.as_os_str(),
                    "--json".as_ref(),
                    "-".as_ref(),
                ];
                let comparison = programs.report(&args)?;
                let (rel_mse, cpu) = (number(&comparison, "rel_mse")?, number(&report, "cpu_seconds")?);
                table.push(vec![
                    ("volume", name_of(volume)),
                    ("backend", backend.clone()),
                    ("samples", spp.to_string()),
                    ("s", format!("{:.2}", number(&report, "seconds")?)),
                    ("CPU s", format!("{cpu:.2}")),
                    ("relMSE", format!("{rel_mse:.3e}")),
                    ("relMSE × CPU s", format!("{:.3e}", rel_mse * cpu)),
                    (
                        "estimated error",
                        report["error_estimate"].as_f64().map_or("–".into(), |e| format!("{e:.4}")),
                    ),
                    ("√relMSE", format!("{:.4}", rel_mse.sqrt())),
                    ("FLIP", format!("{:.4}", number(&comparison, "flip")?)),
                ]);
            }
        }
    }
    Ok(table)
}
