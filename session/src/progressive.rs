//! Rendering until enough: by samples, by time, by estimated error.

use std::time::Duration;

use pumice_core::Job;
use pumice_transport::{RenderError, Renderer};
use serde::Serialize;

use crate::measure::Stopwatch;

/// When a picture is done: at the first of its limits, or when every pixel rests. No limit at all means never (until cancelled).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stop {
    /// Samples a pixel.
    pub spp: Option<u32>,
    /// Wall seconds.
    pub seconds: Option<f64>,
    /// Estimated relative error.
    pub error: Option<f64>,
}

/// Error against run time: one point of a render's history.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Wall seconds since the first sample was begun.
    pub seconds: f64,
    /// CPU seconds of the process in that time.
    pub cpu_seconds: f64,
    /// Samples in every pixel that does not rest.
    pub spp: u32,
    /// Mean over pixels of the samples that each has.
    pub mean_spp: f64,
    /// Estimated relative error; `null` in JSON until it can be known.
    pub error_estimate: Option<f64>,
}

/// How long one call into the renderer lasts: short enough for a smooth progress bar and a quick cancel.
const SLICE: Duration = Duration::from_millis(200);

/// Renders until `stop`, telling `watch` after each slice.
///
/// # Errors
/// What the renderer reports; [`RenderError::Cancelled`] within a slice of `job` being cancelled.
pub fn render_until(
    renderer: &mut dyn Renderer,
    stop: &Stop,
    job: &Job,
    watch: &mut dyn FnMut(&CurvePoint),
) -> Result<Vec<CurvePoint>, RenderError> {
    let clock = Stopwatch::start();
    let mut curve: Vec<CurvePoint> = Vec::new();
    loop {
        let left = stop.seconds.map_or(f64::INFINITY, |s| s - clock.seconds());
        let slice = SLICE.min(Duration::from_secs_f64(left.clamp(0.0, 1.0)));
        let progress = renderer.advance(slice, stop.spp.unwrap_or(u32::MAX), job)?;
        let point = CurvePoint {
            seconds: clock.seconds(),
            cpu_seconds: clock.cpu_seconds(),
            spp: progress.spp,
            mean_spp: progress.mean_spp,
            error_estimate: progress.error_estimate.is_finite().then_some(progress.error_estimate),
        };
        watch(&point);
        if curve.last().is_some_and(|former| former.spp > point.spp) {
            // A device failed and another began anew: the lost samples are no part of this picture's history, but their time is.
            curve.clear();
        }
        curve.push(point);
        let done = progress.all_rest
            || stop.spp.is_some_and(|n| point.spp >= n)
            || stop.seconds.is_some_and(|s| point.seconds >= s)
            || matches!((stop.error, point.error_estimate), (Some(bar), Some(e)) if e <= bar);
        if done {
            return Ok(curve);
        }
    }
}

/// At most `keep` points of a curve, evenly spread in log time, first and last included: what a table or a report shows.
pub fn thin_curve(curve: &[CurvePoint], keep: usize) -> Vec<CurvePoint> {
    if curve.len() <= keep || keep < 2 {
        return curve.to_vec();
    }
    let (first, last) = (curve[0].seconds.max(1e-6), curve[curve.len() - 1].seconds.max(2e-6));
    let mut kept: Vec<CurvePoint> = Vec::with_capacity(keep);
    let mut next = 0;
    for (i, point) in curve.iter().enumerate() {
        let wanted = first * (last / first).powf(next as f64 / (keep - 1) as f64);
        if i == curve.len() - 1 || (point.seconds >= wanted && kept.len() + 1 < keep) {
            kept.push(*point);
            while first * (last / first).powf(next as f64 / (keep - 1) as f64) <= point.seconds && next < keep
            {
                next += 1;
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64) -> CurvePoint {
        CurvePoint { seconds, cpu_seconds: seconds, spp: 1, mean_spp: 1.0, error_estimate: None }
    }

    #[test]
    fn a_thinned_curve_keeps_its_ends_and_its_order() {
        let curve: Vec<_> = (1..500).map(|i| point(f64::from(i) * 0.2)).collect();
        let thin = thin_curve(&curve, 12);
        assert!(thin.len() <= 12 && thin.len() >= 8, "{}", thin.len());
        assert_eq!((thin[0], thin[thin.len() - 1]), (curve[0], curve[curve.len() - 1]));
        assert!(thin.windows(2).all(|w| w[0].seconds < w[1].seconds));
        assert_eq!(thin_curve(&curve[..5], 12), curve[..5]);
    }
}
