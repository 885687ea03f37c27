//! Plots the curves of the paper's Figure 6, on logarithmic scales.

use super::PaperTables;
use pumice_session::plot::{Axes, Curve, log_log_svg};

/// The SVG files of a volume as pairs of name and text.
pub(super) fn svgs(volume: &PaperTables) -> Result<Vec<(String, String)>, String> {
    let stem = volume.volume.split('.').next().unwrap_or_default();
    let mut files = Vec::new();
    if let Some(reuse) = volume.reuse.last().filter(|r| !r.ranked.is_empty()) {
        let curve = Curve { name: "uses", points: ranks(&reuse.ranked) };
        let axes = Axes { x: "nodes", y: "uses of the node", y_digits: 0, slope: Some((-1.0, "1/nodes")) };
        let title = format!("{}: uses of the shared graph's nodes", volume.volume);
        files.push((format!("paper_{stem}_reuse.svg"), log_log_svg(&title, &axes, &[curve])?));
    }
    let names = ["SVOs (AABB)", "SVDAGs (TYPE)", "SVDAG (SHARED)"];
    let curves: Vec<Curve<'_>> = names
        .into_iter()
        .enumerate()
        .map(|(i, name)| {
            let grown = volume.growth.iter().filter(|g| g.boxes > 0 && g.bytes[i] > 0);
            Curve { name, points: grown.map(|g| (g.boxes as f64, g.bytes[i] as f64 / 1e6)).collect() }
        })
        .collect();
    if curves.iter().all(|c| !c.points.is_empty()) {
        let axes = Axes { x: "boxes", y: "MB", y_digits: 4, slope: Some((1.0, "boxes")) };
        let title = format!("{}: growth while types are merged", volume.volume);
        files.push((format!("paper_{stem}_growth.svg"), log_log_svg(&title, &axes, &curves)?));
    }
    Ok(files)
}

/// Points (rank, uses of the node at that rank), about evenly spaced on a logarithmic scale of ranks.
pub(super) fn ranks(ranked: &[u32]) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    let mut rank = 1usize;
    while rank <= ranked.len() {
        points.push((rank as f64, f64::from(ranked[rank - 1])));
        rank = (rank + 1).max(rank * 5 / 4);
    }
    points
}
