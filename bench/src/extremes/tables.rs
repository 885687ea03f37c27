//! Writes the measurements as CSV, one row per volume, and as a Markdown page.

use std::path::Path;

use pumice_session::error::Result;

use super::{ExtremeCase, ExtremeFigures};
use crate::files::write_results;

/// Writes `extremes.csv` and `extremes.md` into `folder`; `machine` describes the machine.
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write_extremes(folder: &Path, machine: &str, cases: &[ExtremeCase]) -> Result<()> {
    write_results(
        folder,
        [("extremes.csv".into(), csv(cases)), ("extremes.md".into(), markdown(machine, cases))],
    )
}

fn csv(cases: &[ExtremeCase]) -> String {
    let mut text = "case,x,y,z,labels,boxes,bytes_resident,bytes_bound,bytes_fast,bytes_default,compress_cpu_s,file_cpu_s,\
                    hierarchy_cpu_s,verify_cpu_s,generator_cpu_s,peak_rss_bytes,exponent\n"
        .to_owned();
    for (case, f) in cases.iter().flat_map(|c| c.figures.iter().map(move |f| (c, f))) {
        text += &format!(
            "{},{},{},{},{},{},{},{},{},{},{:.3},{:.3},{:.3},{:.3},{:.3},{},{}\n",
            case.name,
            f.dims[0],
            f.dims[1],
            f.dims[2],
            f.labels,
            f.boxes,
            f.bytes_resident,
            f.bytes_bound,
            f.bytes_disk[0],
            f.bytes_disk[1],
            f.compress_cpu_seconds,
            f.file_cpu_seconds,
            f.hierarchy_cpu_seconds,
            f.verify_cpu_seconds,
            f.generator_cpu_seconds,
            f.peak_rss_bytes.map_or(String::new(), |b| b.to_string()),
            case.exponent.map_or(String::new(), |e| format!("{e:.3}"))
        );
    }
    text
}

fn markdown(machine: &str, cases: &[ExtremeCase]) -> String {
    let mut text = format!(
        "# extremes\n\n{machine}\n\nGenerated volumes, each compared with its generator voxel by voxel, in memory and from files of both \
         levels. *In memory* includes the hierarchy over the boxes; *bound* is the most that the form can take for such a volume. CPU \
         seconds are those of all threads without the generator's. *Grows as* is the power of the number of voxels n with which CPU time \
         grew from an eighth of the volume to all of it; a dash where the eighth took too little time.\n\n\
         | case | voxels | labels | boxes | in memory, MB | bytes a voxel | bound | files: fast, default, MB | compress, CPU s | files, CPU s | \
         hierarchy, CPU s | verify, CPU s | peak memory, MB | grows as |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
    );
    let mb = |bytes: u64| format!("{:.2}", bytes as f64 / 1e6);
    for case in cases {
        let f: &ExtremeFigures = &case.figures[1];
        let a_voxel = |bytes: u64| format!("{:.4}", bytes as f64 / f.voxels());
        text += &format!(
            "| {} | {:.0} | {} | {} | {} | {} | {} | {}, {} | {:.2} | {:.2} | {:.2} | {:.2} | {} | {} |\n",
            case.what,
            f.voxels(),
            f.labels,
            f.boxes,
            mb(f.bytes_resident),
            a_voxel(f.bytes_resident),
            a_voxel(f.bytes_bound),
            mb(f.bytes_disk[0]),
            mb(f.bytes_disk[1]),
            f.compress_cpu_seconds,
            f.file_cpu_seconds,
            f.hierarchy_cpu_seconds,
            f.verify_cpu_seconds,
            f.peak_rss_bytes.map_or("–".into(), |b| format!("{:.0}", b as f64 / 1e6)),
            case.exponent.map_or("–".into(), |e| format!("n^{e:.2}"))
        );
    }
    text
}
