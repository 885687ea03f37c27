//! Writes the measurements as CSV, one row per point, as a Markdown page, and as one plot per table.

use std::fmt::Write;
use std::path::Path;

use pumice_session::error::{Result, SessionError};

use super::LodTable;
use crate::files::write_results;
use pumice_session::plot::{Axes, Curve, log_log_svg};

/// Writes `lod.csv`, `lod.md` and an SVG for each table into `folder`, which is created if missing. `machine` is a line that describes the
/// machine.
///
/// # Errors
/// When the folder cannot be written or there is nothing to plot.
pub fn write_lod(folder: &Path, machine: &str, tables: &[LodTable]) -> Result<()> {
    let mut files = vec![("lod.csv".into(), csv(tables)), ("lod.md".into(), markdown(machine, tables))];
    for table in tables {
        files.push((svg_name(table), svg(table).map_err(SessionError::Caller)?));
    }
    write_results(folder, files)
}

/// `lod_volume_384x216.svg`.
fn svg_name(table: &LodTable) -> String {
    let stem = table.volume.split('.').next().unwrap_or_default();
    format!("lod_{stem}_{}x{}.svg", table.size[0], table.size[1])
}

fn csv(tables: &[LodTable]) -> String {
    let mut text = "volume,width,height,labels,level,build_cpu_s,frame_cpu_s,bytes_held,bytes_touched,bytes_mapped,own_relmse,own_flip,\
                    samples,cpu_s,wall_s,relmse,flip\n"
        .to_owned();
    let some = |v: Option<String>| v.unwrap_or_default();
    for table in tables {
        for level in &table.levels {
            for p in &level.points {
                let _ = writeln!(
                    text,
                    "{},{},{},{},{},{:.5},{:.5},{},{},{},{},{},{},{:.4},{:.4},{:.4e},{:.5}",
                    table.volume,
                    table.size[0],
                    table.size[1],
                    table.labels,
                    level.name,
                    level.build_cpu_seconds,
                    level.frame_cpu_seconds,
                    level.bytes_held,
                    some(level.bytes_touched.map(|b| b.to_string())),
                    table.bytes_mapped,
                    some(level.rel_mse.map(|e| format!("{e:.4e}"))),
                    some(level.flip.map(|f| format!("{f:.5}"))),
                    p.spp,
                    p.cpu_seconds,
                    p.seconds,
                    p.rel_mse,
                    p.flip
                );
            }
        }
    }
    text
}

fn markdown(machine: &str, tables: &[LodTable]) -> String {
    let mut text = format!(
        "# lod\n\n{machine}\n\nFigures of the longest labels at each level of detail, on the CPU. *Own relMSE* and *own FLIP* are the \
         errors due to the level itself, against voxels, with the noise subtracted. *Touched* is how much of the mapped file was in \
         memory after four samples, as the system counts it (with what it reads ahead); *held* is what rays need and the \
         renderer's own tables. relMSE of pictures is against voxels with many samples, whose own error is subtracted; where the curve of \
         a level becomes flat, more samples at that level no longer help.\n"
    );
    for table in tables {
        let _ = write!(
            text,
            "\n## {}, {} × {} pixels\n\n{} voxels, {} labels shown; {:.2} MB of the file can be mapped. The reference's own relMSE is {:.1e}. \
             [Plot]({})\n\n| level | CPU ms a sample | building, CPU ms | touched, MB | held, MB | own relMSE | own FLIP |",
            table.volume,
            table.size[0],
            table.size[1],
            table.dims.map(|d| d.to_string()).join(" × "),
            table.labels,
            table.bytes_mapped as f64 / 1e6,
            table.reference_rel_mse,
            svg_name(table),
        );
        let spp: Vec<u32> =
            table.levels.first().map_or(Vec::new(), |l| l.points.iter().map(|p| p.spp).collect());
        for n in &spp {
            let _ = write!(text, " {n} spp: relMSE, FLIP |");
        }
        let _ = writeln!(text, "\n|{}", " --- |".repeat(7 + spp.len()));
        for l in &table.levels {
            let dash = || "–".to_owned();
            let _ = write!(
                text,
                "| {} | {:.1} | {:.1} | {} | {:.2} | {} | {} |",
                l.name,
                1e3 * l.frame_cpu_seconds,
                1e3 * l.build_cpu_seconds,
                l.bytes_touched.map_or_else(dash, |b| format!("{:.2}", b as f64 / 1e6)),
                l.bytes_held as f64 / 1e6,
                l.rel_mse.map_or_else(dash, |e| format!("{e:.2e}")),
                l.flip.map_or_else(dash, |f| format!("{f:.4}")),
            );
            for p in &l.points {
                let _ = write!(text, " {:.2e}, {:.4} |", p.rel_mse, p.flip);
            }
            text.push('\n');
        }
    }
    text
}

fn svg(table: &LodTable) -> std::result::Result<String, String> {
    let curves: Vec<Curve<'_>> = table
        .levels
        .iter()
        .map(|level| {
            let points = level.points.iter().filter(|p| p.rel_mse > 0.0);
            Curve { name: level.name, points: points.map(|p| (p.cpu_seconds.max(1e-4), p.rel_mse)).collect() }
        })
        .collect();
    let title = format!("{}, {} × {} pixels", table.volume, table.size[0], table.size[1]);
    let axes = Axes { x: "CPU seconds", y: "relMSE", y_digits: 5, slope: Some((-1.0, "1/time")) };
    log_log_svg(&title, &axes, &curves)
}

#[cfg(test)]
mod tests {
    use super::super::LevelFigures;
    use super::*;
    use crate::convergence::Point;

    #[test]
    fn every_level_and_point_has_its_place() {
        let point =
            |spp: u32| Point { spp, seconds: 0.5, cpu_seconds: f64::from(spp), rel_mse: 0.01, flip: 0.25 };
        let level = |name, rel_mse| LevelFigures {
            name,
            build_cpu_seconds: 0.25,
            frame_cpu_seconds: 0.125,
            bytes_held: 1_500_000,
            bytes_touched: Some(2_500_000),
            rel_mse,
            flip: rel_mse,
            points: vec![point(1), point(4)],
        };
        let table = LodTable {
            volume: "a.nrrd".into(),
            dims: [5, 6, 7],
            bytes_mapped: 9_000_000,
            size: [64, 36],
            labels: 3,
            reference_rel_mse: 1e-5,
            levels: vec![level("voxels", None), level("cells", Some(0.002))],
        };
        let csv = csv(std::slice::from_ref(&table));
        assert_eq!(csv.lines().count(), 5);
        let columns = csv.lines().next().unwrap().split(',').count();
        assert!(csv.lines().all(|l| l.split(',').count() == columns), "{csv}");
        let page = markdown("m", std::slice::from_ref(&table));
        assert!(
            page.contains("| voxels | 125.0 | 250.0 | 2.50 | 1.50 | – | – | 1.00e-2, 0.2500 |"),
            "{page}"
        );
        assert!(page.contains("| cells | 125.0 | 250.0 | 2.50 | 1.50 | 2.00e-3 | 0.0020 |"), "{page}");
        assert!(page.contains("(lod_a_64x36.svg)"), "{page}");
        assert!(svg(&table).unwrap().contains("a.nrrd"));
    }
}
