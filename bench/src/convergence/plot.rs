//! Plots relMSE over CPU seconds, both on logarithmic scales.

use super::Convergence;
use pumice_session::plot::{Axes, Curve, log_log_svg};

pub(super) fn svg(scene: &Convergence) -> Result<String, String> {
    let curves: Vec<Curve<'_>> = scene
        .programs
        .iter()
        .map(|program| Curve {
            name: &program.name,
            points: program
                .points
                .iter()
                .filter(|p| p.rel_mse > 0.0)
                .map(|p| (p.cpu_seconds.max(1e-3), p.rel_mse))
                .collect(),
        })
        .collect();
    let title = format!("{}, {} bounces", scene.volume, scene.bounces);
    log_log_svg(
        &title,
        &Axes { x: "CPU seconds", y: "relMSE", y_digits: 5, slope: Some((-1.0, "1/time")) },
        &curves,
    )
}
