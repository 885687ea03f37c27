//! Every level of Pumice's files and every program at several of its settings: bytes against the CPU seconds of writing and of opening.
//!
//! *Opening* is what must be done before rays can be traced or all voxels read: Pumice reads its file into the form in memory, which rays go
//! through as it is; any other program decodes all voxels into an array.

use pumice_session::plot::{Axes, Curve, log_log_svg};
use serde::Serialize;

use super::{Peer, PeersTable};
use crate::table::{Row, Table};
use crate::timing::Took;

/// Settings beside the [usual](super::PEERS) ones: program, name of the setting, keywords of its `compress` in `peers.py`.
pub(super) const SETTINGS: [(&str, &str, &str); 15] = [
    ("crackle", "Markov model of order 5", r#"{"markov_model_order": 5}"#),
    ("crackle", "order 5, pins", r#"{"markov_model_order": 5, "allow_pins": true}"#),
    ("crackle + zstd", "zstd 3", r#"{"level": 3}"#),
    ("crackle + zstd", "order 5, pins, zstd 19", r#"{"markov_model_order": 5, "allow_pins": true}"#),
    ("compresso + gzip", "gzip 1", r#"{"level": 1}"#),
    ("compressed_segmentation + zstd", "zstd 1", r#"{"level": 1}"#),
    ("compressed_segmentation + zstd", "zstd 9", r#"{"level": 9}"#),
    ("compressed_segmentation + zstd", "zstd 19", r#"{"level": 19}"#),
    ("zstd", "zstd 1", r#"{"level": 1}"#),
    ("zstd", "zstd 9", r#"{"level": 9}"#),
    ("zstd", "zstd 19", r#"{"level": 19}"#),
    ("NIfTI + gzip", "gzip 1", r#"{"level": 1}"#),
    ("NIfTI + gzip", "gzip 9", r#"{"level": 9}"#),
    ("zarr", "zstd 9", r#"{"level": 9}"#),
    ("zarr", "zstd 19", r#"{"level": 19}"#),
];

/// One program at one setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Level {
    /// The volume's file name.
    pub volume: String,
    /// Name of the program.
    pub program: String,
    /// Its setting; for Pumice the level of the file.
    pub setting: String,
    /// Bytes of the stored volume.
    pub bytes: u64,
    /// Those bytes in per cent of 4 bytes a voxel.
    pub percent: f64,
    /// Time from the array to those bytes.
    pub writing: Took,
    /// Time from those bytes to what rays can be traced through or voxels read from.
    pub opening: Took,
}

impl Level {
    /// What was measured of a program whose name is split into program and setting.
    pub(super) fn of(table: &PeersTable, program: &str, setting: &str, peer: &Peer) -> Self {
        Self {
            volume: table.volume.clone(),
            program: program.into(),
            setting: setting.into(),
            bytes: peer.bytes,
            percent: 100.0 * peer.bytes as f64 / table.bytes_raw as f64,
            writing: peer.compress,
            opening: peer.opening,
        }
    }
}

impl Row for Level {
    fn cells(&self) -> Vec<(&'static str, String)> {
        vec![
            ("volume", self.volume.clone()),
            ("program", self.program.clone()),
            ("setting", self.setting.clone()),
            ("bytes", self.bytes.to_string()),
            ("%", format!("{:.3}", self.percent)),
            ("writing, CPU s", format!("{:.3}", self.writing.cpu_seconds)),
            ("opening, CPU s", format!("{:.3}", self.opening.cpu_seconds)),
        ]
    }
}

/// The files `peers_levels.csv`, `peers_levels.md` and two plots for each volume, as pairs of name and text.
///
/// # Errors
/// A line of text when the plot library fails.
pub(super) fn files(machine: &str, levels: &[Level]) -> Result<Vec<(String, String)>, String> {
    let table = Table::of(levels);
    let page = format!(
        "# peers: levels and settings\n\n{machine}\n\nPercentages are of 4 bytes per voxel, seconds are CPU seconds of all threads. *Writing* begins \
         with an array in memory. *Opening* ends where rays can be traced or all voxels read: Pumice opens its file, every other program \
         decodes all voxels.\n\n{}",
        table.markdown()
    );
    let mut files = vec![("peers_levels.csv".into(), table.csv()), ("peers_levels.md".into(), page)];
    let mut volumes: Vec<&str> = levels.iter().map(|l| l.volume.as_str()).collect();
    volumes.dedup();
    for volume in volumes {
        let stem = volume.split('.').next().unwrap_or_default();
        let of: Vec<&Level> = levels.iter().filter(|l| l.volume == volume).collect();
        for (what, took) in [
            ("writing", (|l| l.writing.cpu_seconds) as fn(&Level) -> f64),
            ("opening", |l| l.opening.cpu_seconds),
        ] {
            files.push((format!("peers_levels_{stem}_{what}.svg"), svg(volume, what, took, &of)?));
        }
    }
    Ok(files)
}

/// Plots bytes against the seconds of one kind of work, a curve for each program.
fn svg(volume: &str, what: &str, took: fn(&Level) -> f64, levels: &[&Level]) -> Result<String, String> {
    let mut programs: Vec<&str> = Vec::new();
    for level in levels {
        if !programs.contains(&level.program.as_str()) {
            programs.push(&level.program);
        }
    }
    let curve = |name| {
        let of = levels.iter().filter(|l| l.program == name && l.bytes > 0);
        // The clock of CPU time is that coarse.
        let mut points: Vec<(f64, f64)> = of.map(|l| (took(l).max(1e-3), l.percent)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Curve { name, points }
    };
    let curves: Vec<Curve<'_>> = programs.into_iter().map(curve).filter(|c| !c.points.is_empty()).collect();
    let x = format!("CPU seconds of {what}");
    let axes = Axes { x: &x, y: "% of 4 bytes a voxel", y_digits: 3, slope: None };
    log_log_svg(&format!("{volume}: {what}"), &axes, &curves)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peers::PEERS;

    #[test]
    fn each_setting_is_of_a_known_program_and_differs_from_its_usual_one() {
        for (program, setting, keywords) in SETTINGS {
            let usual = PEERS.iter().find(|p| p.0 == program).unwrap().1;
            assert_ne!(usual, setting);
            assert!(serde_json::from_str::<serde_json::Value>(keywords).unwrap().is_object());
        }
    }

    #[test]
    fn each_program_has_a_curve_and_each_volume_two_plots() {
        let level = |program: &str, setting: &str, bytes: u64, cpu_seconds: f64| Level {
            volume: "a.b.nrrd".into(),
            program: program.into(),
            setting: setting.into(),
            bytes,
            percent: bytes as f64 / 4.0,
            writing: Took { seconds: 9.0, cpu_seconds },
            opening: Took { seconds: 9.0, cpu_seconds: 0.0 },
        };
        let levels = [level("p", "1", 8, 2.0), level("p", "2", 4, 1.0), level("q, r", "1", 2, 3.0)];
        let files = files("m", &levels).unwrap();
        let names: Vec<&str> = files.iter().map(|f| f.0.as_str()).collect();
        let expected = [
            "peers_levels.csv",
            "peers_levels.md",
            "peers_levels_a_writing.svg",
            "peers_levels_a_opening.svg",
        ];
        assert_eq!(names, expected);
        assert_eq!(files[0].1.lines().nth(3), Some("a.b.nrrd,\"q, r\",1,2,0.500,3.000,0.000"));
        // Each program is in the legend, under the name of the volume.
        assert!(["a.b.nrrd: writing", "q, r"].iter().all(|text| files[2].1.contains(text)), "{}", files[2].1);
    }
}
