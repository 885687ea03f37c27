//! Writes the measurements as CSV, one row per point, and as a Markdown page.

use std::fmt::Write;

use super::{Convergence, Point, Preparation, Program};
use crate::table::Table;

/// Columns of a point.
const OF_POINT: [&str; 7] = ["program", "samples", "CPU s", "wall s", "relMSE", "relMSE × CPU s", "FLIP"];

/// A point of a program as cells: seconds with this many digits, the errors with one more, FLIP with two more.
fn cells(program: &Program, point: &Point, digits: usize) -> Vec<String> {
    let &Point { spp, seconds, cpu_seconds, rel_mse, flip } = point;
    let error = |value: f64| format!("{value:.*e}", digits + 1);
    vec![
        program.name.clone(),
        spp.to_string(),
        format!("{cpu_seconds:.digits$}"),
        format!("{seconds:.digits$}"),
        error(rel_mse),
        error(rel_mse * cpu_seconds),
        format!("{flip:.*}", digits + 2),
    ]
}

/// Each point of a scene with its program.
fn points(scene: &Convergence) -> impl Iterator<Item = (&Program, &Point)> {
    scene.programs.iter().flat_map(|program| program.points.iter().map(move |point| (program, point)))
}

pub(super) fn csv(scenes: &[Convergence]) -> String {
    let columns = [&["volume", "width", "height", "bounces"], &OF_POINT[..]].concat();
    let rows = scenes.iter().flat_map(|scene| {
        let [width, height] = scene.size.map(|pixels| pixels.to_string());
        let of_scene = [scene.volume.clone(), width, height, scene.bounces.to_string()];
        points(scene).map(move |(program, point)| [&of_scene[..], &cells(program, point, 3)].concat())
    });
    Table::new(&columns, rows).csv()
}

pub(super) fn markdown(machine: &str, scenes: &[Convergence]) -> String {
    let mut text = format!("# convergence\n\n{machine}\n");
    for scene in scenes {
        let [width, height] = scene.size;
        let _ = write!(
            text,
            "\n## {} bounces\n\n{} at {width} × {height}, {} voxel faces. The reference's own relMSE, {:.1e}, is subtracted.",
            scene.bounces, scene.volume, scene.faces, scene.reference_rel_mse
        );
        if let Some(errors) = scene.disagreement {
            let _ = write!(text, " The two references' means differ by {errors:.1} standard errors.");
        }
        let rows = points(scene).map(|(program, point)| cells(program, point, 2));
        text += "\n\n";
        text += &Table::new(&OF_POINT, rows).markdown();

        let preparation = |program: &Program| {
            let p: &Preparation = &program.preparation;
            let mb = |bytes: Option<u64>| bytes.map_or("–".into(), |b| format!("{:.0}", b as f64 / 1e6));
            let above = p.peak_bytes.zip(p.base_bytes).map(|(peak, base)| peak.saturating_sub(base));
            let [cpu, wall] = [p.took.cpu_seconds, p.took.seconds].map(|seconds| format!("{seconds:.2}"));
            vec![program.name.clone(), cpu, wall, mb(p.peak_bytes), mb(above)]
        };
        let columns =
            ["program", "preparation, CPU s", "wall s", "peak memory, MB", "above the empty program, MB"];
        text += "\n";
        text += &Table::new(&columns, scene.programs.iter().map(preparation)).markdown();
        if let Some(ratio) = scene.cpu_ratio_at_equal_error() {
            let _ = writeln!(
                text,
                "\nFor the error that {} has at its most samples, {} needs {:.0} % of its CPU seconds of rendering.",
                scene.programs[1].name,
                scene.programs[0].name,
                100.0 * ratio
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::timing::Took;

    #[test]
    fn every_point_has_its_row() {
        let point =
            |spp, rel_mse| Point { spp, seconds: 0.5, cpu_seconds: f64::from(spp), rel_mse, flip: 0.25 };
        let program = |name: &str, factor: f64| Program {
            name: name.into(),
            preparation: Preparation {
                took: Took { seconds: 1.0, cpu_seconds: 2.0 },
                peak_bytes: Some(5_000_000),
                base_bytes: Some(2_000_000),
            },
            points: vec![point(1, 0.1 * factor), point(4, 0.025 * factor)],
        };
        let scene = Convergence {
            volume: "v.nrrd".into(),
            size: [240, 135],
            bounces: 8,
            faces: 12,
            reference_rel_mse: 2e-5,
            disagreement: Some(1.2),
            programs: vec![program("ours", 1.0), program("theirs", 2.0)],
        };
        let csv = csv(std::slice::from_ref(&scene));
        assert_eq!(csv.lines().count(), 5);
        assert!(csv.contains("v.nrrd,240,135,8,ours,4,4.000,0.500,2.5000e-2,1.0000e-1,0.25000"));
        let page = markdown("a machine", &[scene]);
        assert!(page.contains("| theirs | 1 | 1.00 | 0.50 | 2.000e-1 | 2.000e-1 | 0.2500 |"), "{page}");
        assert!(page.contains("| ours | 2.00 | 1.00 | 5 | 3 |"), "{page}");
        assert!(
            page.contains("theirs has at its most samples, ours needs 50 % of its CPU seconds"),
            "{page}"
        );
    }
}
