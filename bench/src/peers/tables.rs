//! Writes the measurements as CSV, one row per program, and as a Markdown page; levels and settings in files of their own.

use std::path::Path;

use pumice_session::error::{Result, SessionError};

use super::{Level, Peer, PeersTable, levels};
use crate::files::write_results;
use crate::table::quoted;

/// Writes `peers.csv` and `peers.md` into `folder`, and where levels were measured, their table and plots; `machine` describes the machine.
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write_peers(folder: &Path, machine: &str, tables: &[PeersTable]) -> Result<()> {
    let mut files =
        vec![("peers.csv".to_owned(), csv(tables)), ("peers.md".to_owned(), markdown(machine, tables))];
    let all: Vec<Level> = tables.iter().flat_map(|t| t.levels.iter().cloned()).collect();
    if !all.is_empty() {
        files.extend(levels::files(machine, &all).map_err(SessionError::Caller)?);
    }
    write_results(folder, files)
}

fn csv(tables: &[PeersTable]) -> String {
    let mut text =
        "volume,program,version,bytes,bytes_raw,compress_cpu_s,compress_s,decompress_cpu_s,decompress_s,\
                    voxel_cpu_us,one_voxel,traversable\n"
            .to_owned();
    for (table, p) in tables.iter().flat_map(|t| t.programs.iter().map(move |p| (t, p))) {
        text += &format!(
            "{},{},{},{},{},{:.3},{:.3},{:.3},{:.3},{},{},{}\n",
            quoted(&table.volume),
            quoted(&p.name),
            p.version,
            p.bytes,
            table.bytes_raw,
            p.compress.cpu_seconds,
            p.compress.seconds,
            p.decompress.cpu_seconds,
            p.decompress.seconds,
            microseconds(p).unwrap_or_default(),
            quoted(&p.one_voxel),
            quoted(&p.traversable)
        );
    }
    text
}

/// CPU microseconds for reading one voxel; `None` if not measured.
fn microseconds(p: &Peer) -> Option<String> {
    p.voxel_cpu_seconds.is_finite().then(|| format!("{:.3}", 1e6 * p.voxel_cpu_seconds))
}

fn markdown(machine: &str, tables: &[PeersTable]) -> String {
    let mut text = format!(
        "# peers\n\n{machine}\n\nEach program gets the voxels as an array in memory and returns them as one; all returned the same voxels. \
         Percentages are of 4 bytes per voxel; seconds are CPU seconds of all threads, with wall seconds in brackets.\n"
    );
    for table in tables {
        let [x, y, z] = table.dims;
        text += &format!(
            "\n## {}, {x} × {y} × {z}\n\n\
             | program | bytes | % | compress, CPU s (wall) | decompress, CPU s (wall) | one voxel, CPU µs | how | ray traced as it is |\n\
             | --- | --- | --- | --- | --- | --- | --- | --- |\n",
            table.volume
        );
        for p in &table.programs {
            let percent = 100.0 * p.bytes as f64 / table.bytes_raw as f64;
            text += &format!(
                "| {} {} | {} | {percent:.3} | {:.2} ({:.2}) | {:.2} ({:.2}) | {} | {} | {} |\n",
                p.name,
                p.version,
                p.bytes,
                p.compress.cpu_seconds,
                p.compress.seconds,
                p.decompress.cpu_seconds,
                p.decompress.seconds,
                microseconds(p).unwrap_or_else(|| "–".into()),
                p.one_voxel,
                p.traversable
            );
        }
        if !table.left_out.is_empty() {
            text += &format!("\nLeft out: {}.\n", table.left_out.join(", "));
        }
    }
    text
}
