//! Writes the results in real light: a CSV row for each point and each part, a Markdown page, and a plot for each scene.

use std::fmt::Write;
use std::path::Path;

use pumice_session::error::{Result, SessionError};
use pumice_session::plot::{Axes, Curve, log_log_svg};

use super::{LightPoint, LightProgram, LightResult, MeasuredPart, Ratio};
use crate::files::write_results;
use crate::table::Table;

/// Writes `convergence_real_light.csv`, `.md`, a plot for each scene, and `convergence_real_light_parts.csv` if parts were measured, into
/// `folder`, which is created if missing. `machine` is a line that describes the machine.
///
/// # Errors
/// When the folder cannot be written or there is nothing to plot.
pub(crate) fn write_real_light(folder: &Path, machine: &str, results: &[LightResult]) -> Result<()> {
    let mut files = vec![
        ("convergence_real_light.csv".into(), csv(results)),
        ("convergence_real_light.md".into(), markdown(machine, results)),
    ];
    if results.iter().any(|r| !r.parts.is_empty()) {
        files.push(("convergence_real_light_parts.csv".into(), parts_csv(results)));
    }
    for result in results {
        let name = format!("convergence_real_light_{}.svg", result.scene);
        files.push((name, svg(result).map_err(SessionError::Caller)?));
    }
    write_results(folder, files)
}

/// The three numbers of a ratio as cells of a CSV; empty without one.
fn ratio_cells(ratio: Option<Ratio>) -> [String; 3] {
    ratio.map_or_else(Default::default, |r| [r.value, r.low, r.high].map(|v| format!("{v:.3}")))
}

/// A ratio with its interval.
fn ratio_text(ratio: Option<Ratio>) -> String {
    ratio.map_or("–".into(), |r| format!("{:.2} ({:.2} to {:.2})", r.value, r.low, r.high))
}

fn number(value: Option<f64>) -> String {
    value.map_or("–".into(), |v| format!("{v:.2}"))
}

/// Columns of a point.
const OF_POINT: [&str; 6] = ["program", "samples", "CPU s", "wall s", "noise", "noise × CPU s"];

/// A point of a program as cells: seconds with this many digits, the noise with one more.
fn cells(program: &LightProgram, point: &LightPoint, digits: usize) -> Vec<String> {
    let &LightPoint { spp, took, noise } = point;
    let [cpu, wall] = [took.cpu_seconds, took.seconds].map(|seconds| format!("{seconds:.digits$}"));
    let [own, product] = [noise, noise * took.cpu_seconds].map(|value| format!("{value:.*e}", digits + 1));
    vec![program.name.clone(), spp.to_string(), cpu, wall, own, product]
}

/// Each point of a result with its program; and of ours, which are the first, how they compare with Cycles': the ratio of the noise, and that of
/// the CPU seconds at Cycles' noise.
fn points(
    result: &LightResult,
) -> impl Iterator<Item = (&LightProgram, &LightPoint, Option<Ratio>, Option<f64>)> {
    result.programs.iter().enumerate().flat_map(move |(place, program)| {
        program.points.iter().enumerate().map(move |(level, point)| {
            let ours = place == 0;
            let ratio = result.ratios.get(level).copied().flatten().filter(|_| ours);
            let equal = result.cpu_ratio_at_equal_noise(level).filter(|_| ours);
            (program, point, ratio, equal)
        })
    })
}

fn csv(results: &[LightResult]) -> String {
    let of_result = ["scene", "volume", "width", "height", "bounces", "seeds"];
    let of_ratio = ["noise over Cycles'", "low", "high", "CPU s over Cycles' at its noise"];
    let rows = results.iter().flat_map(|result| {
        let [width, height] = result.size.map(|pixels| pixels.to_string());
        let (bounces, seeds) = (result.bounces.to_string(), result.seeds.to_string());
        let of_result = [result.scene.to_string(), result.volume.clone(), width, height, bounces, seeds];
        points(result).map(move |(program, point, ratio, equal)| {
            let equal = equal.map_or(String::new(), |e| format!("{e:.3}"));
            [&of_result[..], &cells(program, point, 3), &ratio_cells(ratio), &[equal]].concat()
        })
    });
    Table::new(&[&of_result[..], &OF_POINT, &of_ratio].concat(), rows).csv()
}

fn parts_csv(results: &[LightResult]) -> String {
    let columns = [
        "scene",
        "part",
        "share of the whole",
        "Pumice's noise",
        "Cycles' noise",
        "noise over Cycles'",
        "low",
        "high",
    ];
    let rows = results.iter().flat_map(|result| {
        result.parts.iter().map(|part| {
            let share = share(part, &result.parts).map_or(String::new(), |s| format!("{s:.3}"));
            let noise = |i: usize| part.noise.get(i).map_or(String::new(), |n| format!("{n:.4e}"));
            let own = [result.scene.to_string(), part.name.clone(), share, noise(0), noise(1)];
            [&own[..], &ratio_cells(part.ratio)].concat()
        })
    });
    Table::new(&columns, rows).csv()
}

/// Pumice's noise of a part over that of the whole; `None` where the part is another picture.
fn share(part: &MeasuredPart, parts: &[MeasuredPart]) -> Option<f64> {
    let (own, whole) = (part.noise.first()?, parts.first()?.noise.first()?);
    (part.is_share && *whole > 0.0).then(|| own / whole)
}

fn markdown(machine: &str, results: &[LightResult]) -> String {
    let mut text = format!(
        "# convergence, real light\n\n{machine}\n\n*Noise* is the variance of a pixel between pictures of other seeds over its squared mean plus \
         0.01, averaged over pixels and channels; ratios are Pumice's over Cycles', with a 95 % interval (bootstrap over blocks of 4 × 4 \
         pixels). Cycles has its light tree, and neither adaptive sampling nor a denoiser.\n"
    );
    if results.iter().any(|r| !r.ratios.is_empty()) {
        let columns = [
            "scene",
            "noise at the most samples",
            "CPU s a sample",
            "their product",
            "CPU s at Cycles' noise",
        ];
        let row = |result: &LightResult| {
            let ratio = result.ratios.last().copied().flatten();
            let cost = result.cpu_ratio_a_sample();
            let product = ratio.zip(cost).map(|(r, c)| r.value * c);
            let equal = result.cpu_ratio_at_equal_noise(result.ratios.len().saturating_sub(1));
            vec![result.scene.to_string(), ratio_text(ratio), number(cost), number(product), number(equal)]
        };
        text += "\n";
        text += &Table::new(&columns, results.iter().map(row)).markdown();
    }
    for result in results {
        scene_section(&mut text, result);
    }
    text
}

fn scene_section(text: &mut String, result: &LightResult) {
    let [width, height] = result.size;
    let _ = write!(
        text,
        "\n## {}\n\n{} at {width} × {height}, {} bounces, {} seeds.",
        result.scene, result.volume, result.bounces, result.seeds
    );
    if let Some(errors) = result.disagreement {
        let faces = result.faces;
        let _ = write!(
            text,
            " Cycles has {faces} voxel faces. The two programs' means differ by {errors:.1} standard errors."
        );
    }
    let rows = points(result).map(|(program, point, ratio, equal)| {
        [&cells(program, point, 2)[..], &[ratio_text(ratio), number(equal)]].concat()
    });
    let columns = [&OF_POINT[..], &["noise over Cycles'", "CPU s over Cycles' at its noise"]].concat();
    *text += "\n\n";
    *text += &Table::new(&columns, rows).markdown();
    if !result.parts.is_empty() {
        let columns =
            ["part", "share of Pumice's noise", "Pumice's noise", "Cycles' noise", "noise over Cycles'"];
        let row = |part: &MeasuredPart| {
            let percent = share(part, &result.parts).map_or("–".into(), |s| format!("{:.0} %", 100.0 * s));
            let noise = |i: usize| part.noise.get(i).map_or("–".into(), |n| format!("{n:.3e}"));
            vec![part.name.clone(), percent, noise(0), noise(1), ratio_text(part.ratio)]
        };
        *text += "\n";
        *text += &Table::new(&columns, result.parts.iter().map(row)).markdown();
    }
}

fn svg(result: &LightResult) -> std::result::Result<String, String> {
    let curves: Vec<Curve<'_>> = result
        .programs
        .iter()
        .map(|program| Curve {
            name: &program.name,
            points: (program.points.iter().filter(|p| p.noise > 0.0))
                .map(|p| (p.took.cpu_seconds.max(1e-3), p.noise))
                .collect(),
        })
        .collect();
    let axes = Axes { x: "CPU seconds", y: "noise", y_digits: 5, slope: Some((-1.0, "1/time")) };
    log_log_svg(&format!("{}, {} bounces", result.scene, result.bounces), &axes, &curves)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::timing::Took;

    fn program(name: &str, noise: f64) -> LightProgram {
        let point = |spp: u32| LightPoint {
            spp,
            took: Took { seconds: 0.5, cpu_seconds: f64::from(spp) },
            noise: noise / f64::from(spp),
        };
        LightProgram { name: name.into(), points: vec![point(4), point(16)] }
    }

    fn part(name: &str, noise: [f64; 2], is_share: bool) -> MeasuredPart {
        let ratio = Some(Ratio { value: noise[0] / noise[1], low: 0.5, high: 4.0 });
        MeasuredPart { name: name.into(), noise: noise.to_vec(), ratio, is_share }
    }

    fn result() -> LightResult {
        LightResult {
            scene: "sky-floor",
            volume: "v.tif".into(),
            size: [96, 64],
            bounces: 8,
            seeds: 4,
            faces: 12,
            disagreement: Some(1.25),
            programs: vec![program("ours", 0.2), program("theirs", 0.1)],
            ratios: vec![Some(Ratio { value: 2.0, low: 1.5, high: 2.5 }); 2],
            parts: vec![
                part("whole", [0.02, 0.01], true),
                part("sky alone", [0.005, 0.01], true),
                part("matte", [0.004, 0.002], false),
            ],
        }
    }

    #[test]
    fn each_point_and_each_part_has_its_row() {
        let all = [result()];
        let text = csv(&all);
        assert_eq!(text.lines().count(), 5);
        let columns = text.lines().next().unwrap().split(',').count();
        assert!(text.lines().all(|l| l.split(',').count() == columns), "{text}");
        assert!(text.contains(
            "sky-floor,v.tif,96,64,8,4,ours,16,16.000,0.500,1.2500e-2,2.0000e-1,2.000,1.500,2.500,2.000\n"
        ));
        assert!(text.contains("theirs,16,16.000,0.500,6.2500e-3,1.0000e-1,,,,\n"));
        let parts = parts_csv(&all);
        let columns = parts.lines().next().unwrap().split(',').count();
        assert!(parts.lines().all(|l| l.split(',').count() == columns), "{parts}");
        assert!(parts.contains("sky-floor,sky alone,0.250,5.0000e-3,1.0000e-2,0.500,0.500,4.000\n"));
        assert!(parts.contains("sky-floor,matte,,4.0000e-3"));
        let page = markdown("a machine", &all);
        assert!(page.contains("| sky-floor | 2.00 (1.50 to 2.50) | 1.00 | 2.00 | 2.00 |"), "{page}");
        assert!(page.contains("| theirs | 4 | 4.00 | 0.50 | 2.500e-2 | 1.000e-1 | – | – |"), "{page}");
        assert!(page.contains("| sky alone | 25 % | 5.000e-3 | 1.000e-2 | 0.50 (0.50 to 4.00) |"), "{page}");
        assert!(svg(&all[0]).unwrap().starts_with("<svg"));
    }

    #[test]
    fn one_program_has_no_comparison() {
        let both = result();
        let alone = LightResult {
            programs: both.programs[..1].to_vec(),
            ratios: Vec::new(),
            disagreement: None,
            parts: Vec::new(),
            ..both
        };
        let page = markdown("a machine", &[alone]);
        assert!(!page.contains("product") && !page.contains("Cycles has 12") && !page.contains("| part |"));
        assert!(page.contains("| ours | 4 | 4.00 | 0.50 | 5.000e-2 | 2.000e-1 | – | – |"), "{page}");
    }
}
