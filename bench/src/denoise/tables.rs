//! Writes the results: a CSV row for each picture, a Markdown page, and a plot for each scene.

use std::path::Path;

use pumice_session::error::{Result, SessionError};
use pumice_session::plot::{Axes, Curve, log_log_svg};

use super::viewport::{CORES, SECONDS, Shown, Viewport, WATCHED_CPU_SECONDS};
use super::{Denoised, Through};
use crate::files::write_results;
use crate::table::Table;

const ALL: [Through; 3] = [Through::Nothing, Through::Pumice, Through::Oidn];

/// Writes `denoise.csv`, `denoise.md` and `denoise_SCENE.svg` into `folder`, which is created if missing. `machine` is a line that describes the
/// machine, `oidn` is Open Image Denoise with its version, if it was measured.
///
/// # Errors
/// When the folder cannot be written or there is nothing to plot.
pub(super) fn write(
    folder: &Path,
    machine: &str,
    oidn: Option<&str>,
    size: [u32; 2],
    results: &[Denoised],
) -> Result<()> {
    let mut files = vec![
        ("denoise.csv".to_owned(), csv(size, results)),
        ("denoise.md".to_owned(), markdown(machine, oidn, size, results)),
    ];
    for scene in scenes(results) {
        let text = svg(scene, results).map_err(SessionError::Caller)?;
        files.push((format!("denoise_{scene}.svg"), text));
    }
    write_results(folder, files)
}

/// Writes `viewport.csv` with all frames, `viewport.md` and `viewport_SCENE.svg` into `folder`, which is created if missing.
///
/// # Errors
/// When the folder cannot be written or there is nothing to plot.
pub(super) fn write_viewport(
    folder: &Path,
    machine: &str,
    [width, height]: [u32; 2],
    reference_spp: u32,
    rows: &[Viewport],
) -> Result<()> {
    let table = Table::of(rows);
    let page = format!(
        "# viewport\n\n{machine}\n\nA live picture of {width} × {height} pixels after the camera moved, against one of {reference_spp} samples. \
         CPU seconds are those of all threads since the move; {SECONDS} s on two idle cores are {} of them. A dash: never, in {WATCHED_CPU_SECONDS} CPU seconds.\n\n{}",
        SECONDS * CORES,
        table.markdown()
    );
    let frames =
        Table::of_cells(rows.iter().flat_map(|row| row.frames.iter().map(|shown| frame_cells(row, shown))));
    let mut files = vec![("viewport.csv".to_owned(), frames.csv()), ("viewport.md".to_owned(), page)];
    for of_scene in rows.chunk_by(|a, b| a.scene == b.scene) {
        let text = viewport_svg(of_scene).map_err(SessionError::Caller)?;
        files.push((format!("viewport_{}.svg", of_scene[0].scene), text));
    }
    write_results(folder, files)
}

/// A frame of a live picture as a row of the CSV.
fn frame_cells(row: &Viewport, shown: &Shown) -> Vec<(&'static str, String)> {
    vec![
        ("scene", row.scene.into()),
        ("denoised", if row.denoised { "yes" } else { "no" }.into()),
        ("CPU s", format!("{:.3}", shown.cpu_seconds)),
        ("s", format!("{:.3}", shown.seconds)),
        ("samples", shown.samples()),
        ("FLIP", format!("{:.4}", shown.flip)),
    ]
}

/// FLIP over CPU seconds of the live pictures of one scene.
fn viewport_svg(rows: &[Viewport]) -> std::result::Result<String, String> {
    let curve = |row: &Viewport| Curve {
        name: if row.denoised { "denoised" } else { "as rendered" },
        points: (row.frames.iter())
            .filter(|shown| shown.flip > 0.0)
            .map(|shown| (shown.cpu_seconds.max(1e-3), shown.flip))
            .collect(),
    };
    let curves: Vec<Curve<'_>> = rows.iter().map(curve).collect();
    let axes = Axes { x: "CPU seconds since the camera moved", y: "FLIP", y_digits: 3, slope: None };
    log_log_svg(rows.first().map_or("", |row| row.scene), &axes, &curves)
}

fn scenes(results: &[Denoised]) -> Vec<&'static str> {
    let mut names: Vec<&'static str> = results.iter().map(|r| r.scene).collect();
    names.dedup();
    names
}

/// A picture as a row; in the CSV with its scene and size.
fn cells(r: &Denoised) -> Vec<(&'static str, String)> {
    vec![
        ("samples", r.spp.to_string()),
        ("denoiser", r.through.name().into()),
        ("CPU s", format!("{:.3}", r.render_cpu_seconds + r.denoise_cpu_seconds)),
        ("of which denoising", format!("{:.3}", r.denoise_cpu_seconds)),
        ("relMSE", format!("{:.3e}", r.rel_mse)),
        ("FLIP", format!("{:.4}", r.flip)),
    ]
}

/// The table of some pictures, each row with `more` cells before its own.
fn table<'a>(
    results: impl Iterator<Item = &'a Denoised>,
    more: impl Fn(&Denoised) -> Vec<(&'static str, String)>,
) -> Table {
    Table::of_cells(results.map(|r| more(r).into_iter().chain(cells(r)).collect()))
}

fn csv([width, height]: [u32; 2], results: &[Denoised]) -> String {
    table(results.iter(), |r| {
        vec![("scene", r.scene.into()), ("width", width.to_string()), ("height", height.to_string())]
    })
    .csv()
}

fn markdown(machine: &str, oidn: Option<&str>, [width, height]: [u32; 2], results: &[Denoised]) -> String {
    let with =
        oidn.map_or(String::new(), |version| format!(" {version}, with the device that each picture makes."));
    let mut text = format!(
        "# denoise\n\n{machine}\n\nPictures of {width} × {height} pixels. relMSE is less the part of the reference's own noise.{with}\n"
    );
    for scene in scenes(results) {
        let of = table(results.iter().filter(|r| r.scene == scene), |_| Vec::new());
        text += &format!("\n## {scene}\n\n{}", of.markdown());
    }
    text
}

fn svg(scene: &str, results: &[Denoised]) -> std::result::Result<String, String> {
    let curve = |through: Through| Curve {
        name: through.name(),
        points: (results.iter())
            .filter(|r| r.scene == scene && r.through == through && r.rel_mse > 0.0)
            .map(|r| ((r.render_cpu_seconds + r.denoise_cpu_seconds).max(1e-3), r.rel_mse))
            .collect(),
    };
    let curves: Vec<Curve<'_>> = ALL.map(curve).into_iter().filter(|c| !c.points.is_empty()).collect();
    let axes = Axes { x: "CPU seconds", y: "relMSE", y_digits: 5, slope: Some((-1.0, "1/time")) };
    log_log_svg(scene, &axes, &curves)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_picture_has_a_row_and_its_seconds_are_those_of_both() {
        let row = |spp, through, rel_mse| Denoised {
            scene: "a",
            spp,
            through,
            render_cpu_seconds: 2.0,
            denoise_cpu_seconds: 0.5,
            rel_mse,
            flip: 0.25,
        };
        let results =
            [row(1, Through::Nothing, 0.5), row(1, Through::Pumice, 0.125), row(4, Through::Pumice, -1e-9)];
        let text = csv([4, 3], &results);
        assert_eq!(text.lines().nth(2), Some("a,4,3,1,Pumice,2.500,0.500,1.250e-1,0.2500"));
        assert_eq!(text.lines().count(), 4);
        // What is below the reference's noise is in the tables and not in the plot.
        assert!(
            markdown("m", Some("2"), [4, 3], &results)
                .contains("| 4 | Pumice | 2.500 | 0.500 | -1.000e-9 | 0.2500 |")
        );
        assert!(svg("a", &results).unwrap().starts_with("<svg"));
    }
}
