//! Writes the results: a CSV row for each picture, a Markdown page, and a plot for each scene.

use std::fmt::Write;
use std::path::Path;

use pumice_session::error::{Result, SessionError};
use pumice_session::plot::{Axes, Curve, log_log_svg};

use super::{Denoised, Through};
use crate::files::write_results;

const ALL: [Through; 3] = [Through::Nothing, Through::Pumice, Through::Oidn];

/// Writes `denoise.csv`, `denoise.md` and `denoise_SCENE.svg` into `folder`, which is created if missing. `machine` is a line that describes the
/// machine, `oidn` the version of Open Image Denoise, if it was measured.
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

fn scenes(results: &[Denoised]) -> Vec<&'static str> {
    let mut names: Vec<&'static str> = results.iter().map(|r| r.scene).collect();
    names.dedup();
    names
}

fn csv(size: [u32; 2], results: &[Denoised]) -> String {
    let [width, height] = size;
    let mut text = String::from("scene,width,height,samples,denoiser,CPU s,of which denoising,relMSE,FLIP\n");
    for r in results {
        let _ = writeln!(
            text,
            "{},{width},{height},{},{},{:.3},{:.3},{:.4e},{:.4}",
            r.scene,
            r.spp,
            r.through.name(),
            r.render_cpu_seconds + r.denoise_cpu_seconds,
            r.denoise_cpu_seconds,
            r.rel_mse,
            r.flip
        );
    }
    text
}

fn markdown(machine: &str, oidn: Option<&str>, [width, height]: [u32; 2], results: &[Denoised]) -> String {
    let with = oidn.map_or(String::new(), |version| format!(" Open Image Denoise is pyoidn {version}."));
    let mut text = format!(
        "# denoise\n\n{machine}\n\nPictures of {width} × {height} pixels. relMSE is less the part of the reference's own noise.{with}\n"
    );
    for scene in scenes(results) {
        let _ = write!(
            text,
            "\n## {scene}\n\n| samples | denoiser | CPU s | of which denoising | relMSE | FLIP |\n| --- | --- | --- | --- | --- | --- |\n"
        );
        for r in results.iter().filter(|r| r.scene == scene) {
            let _ = writeln!(
                text,
                "| {} | {} | {:.2} | {:.2} | {:.3e} | {:.4} |",
                r.spp,
                r.through.name(),
                r.render_cpu_seconds + r.denoise_cpu_seconds,
                r.denoise_cpu_seconds,
                r.rel_mse,
                r.flip
            );
        }
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
    let axes = Axes { x: "CPU seconds", y: "relMSE", y_digits: 5, slope: (-1.0, "1/time") };
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
        assert_eq!(text.lines().nth(2), Some("a,4,3,1,Pumice,2.500,0.500,1.2500e-1,0.2500"));
        assert_eq!(text.lines().count(), 4);
        // What is below the reference's noise is in the tables and not in the plot.
        assert!(
            markdown("m", Some("2"), [4, 3], &results)
                .contains("| 4 | Pumice | 2.50 | 0.50 | -1.000e-9 | 0.2500 |")
        );
        assert!(svg("a", &results).unwrap().starts_with("<svg"));
    }
}
