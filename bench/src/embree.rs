//! Rays through the compressed form beside Embree's through a mesh of the same faces, as the example `embree_rays` measures them.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::Result;
use crate::programs::{Programs, name_of, number, said, scratch};
use crate::table::Table;

/// What to do where Embree is not found.
const INSTALL: &str = "Embree 3 is needed to compare with: install it (Debian 12: apt install libembree-dev), or name a folder with its \
                       include and lib by --embree (packages that were unpacked: …/usr)";

pub(crate) fn measure(
    programs: &Programs,
    volumes: &[PathBuf],
    prefix: Option<&Path>,
    side: &str,
) -> Result<Table> {
    let folder = scratch()?;
    let driver = folder.path().join("rays");
    build(&driver, prefix)?;
    let mut table = Table::default();
    for volume in volumes {
        let args = [volume.as_os_str(), driver.as_os_str(), "15".as_ref(), side.as_ref()];
        let report: Value = serde_json::from_str(&programs.example("embree_rays", &args)?)
            .map_err(|e| format!("what embree_rays reported: {e}"))?;
        let kinds = report["kinds"].as_array().ok_or("embree_rays reported no rays")?;
        for kind in kinds {
            let both = |what: &str| -> Result<(f64, f64)> {
                Ok((number(kind, &format!("ours_{what}"))?, number(kind, &format!("embree_{what}"))?))
            };
            let (best, median) = (both("best")?, both("median")?);
            let boxes = (number(kind, "boxes_best")?, number(kind, "boxes_median")?);
            table.push(vec![
                ("volume", name_of(volume)),
                ("boxes shown", report["boxes"].to_string()),
                ("quads", report["quads"].to_string()),
                ("bytes: ours, Embree's", {
                    let (ours, theirs) = (number(&report, "ours_bytes")?, number(&report, "embree_bytes")?);
                    format!("{ours:.0}, {theirs:.0} ({:.2} %)", 100.0 * ours / theirs)
                }),
                ("bytes: boxes alone", format!("{:.0}", number(&report, "boxes_bytes")?)),
                ("building: ours, Embree's, CPU s", {
                    let build = |who: &str| number(&report, &format!("{who}_build_cpu_seconds"));
                    format!("{:.2}, {:.2}", build("ours")?, build("embree")?)
                }),
                ("rays", kind["rays"].as_str().unwrap_or_default().to_owned()),
                ("traced", kind["count"].to_string()),
                ("seen otherwise", kind["differing"].to_string()),
                ("ours, M/s, best (median)", format!("{:.3} ({:.3})", best.0, median.0)),
                ("boxes alone, M/s, best (median)", format!("{:.3} ({:.3})", boxes.0, boxes.1)),
                ("Embree, M/s, best (median)", format!("{:.3} ({:.3})", best.1, median.1)),
                ("ratio, best (median)", format!("{:.3} ({:.3})", best.0 / best.1, median.0 / median.1)),
            ]);
        }
    }
    Ok(table)
}

/// Compiles the program that traces with Embree.
fn build(driver: &Path, prefix: Option<&Path>) -> Result<()> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("embree/rays.c");
    let mut compiler = Command::new("cc");
    compiler.args(["-O3", "-march=native", "-std=gnu11", "-o"]).arg(driver).arg(source);
    if let Some(prefix) = prefix {
        compiler.arg("-I").arg(prefix.join("include"));
        for lib in ["lib", "lib/x86_64-linux-gnu", "lib/aarch64-linux-gnu"] {
            let lib = prefix.join(lib);
            if let Ok(lib) = lib.canonicalize() {
                compiler.arg("-L").arg(&lib).arg(format!("-Wl,-rpath,{}", lib.display()));
            }
        }
        // What Embree links is found where it is itself.
        compiler.args(["-Wl,--disable-new-dtags", "-Wl,--allow-shlib-undefined"]);
    }
    said(compiler.arg("-lembree3").arg("-lm")).map(drop).map_err(|e| format!("{INSTALL}; {}", one_line(&e)))
}

/// The first line of what a compiler said.
fn one_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}
