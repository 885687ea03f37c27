//! Renders until a limit is reached: samples, time or estimated error.

use std::time::Duration;

use pumice_core::Job;
use pumice_transport::{Progress, RenderError, Renderer};
use serde::Serialize;

use crate::measure::Stopwatch;

/// When a picture is done: at the first of these limits, or when every pixel rests. Without a limit it renders until it is cancelled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stop {
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// Wall seconds.
    pub seconds: Option<f64>,
    /// Estimated relative error.
    pub error: Option<f64>,
}

/// The next number of samples above `spp` at which the estimated error is compared with a limit: 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24 and so on,
/// in steps of an eighth to a fourth. Were it compared whenever a slice of time ends, how long a sample takes would decide about the picture.
fn next_checkpoint(spp: u32) -> u32 {
    let step = checkpoint_step(spp);
    (spp.max(FIRST_CHECKPOINT - 1) / step).saturating_add(1).saturating_mul(step)
}

fn is_checkpoint(spp: u32) -> bool {
    spp >= FIRST_CHECKPOINT && spp.is_multiple_of(checkpoint_step(spp))
}

/// Samples with which a film begins to estimate its error.
const FIRST_CHECKPOINT: u32 = 4;

/// A fourth of the largest power of two up to `spp`.
fn checkpoint_step(spp: u32) -> u32 {
    1 << (spp.max(FIRST_CHECKPOINT).ilog2() - 2)
}

impl Stop {
    /// Most samples that a picture with so many may have after the next call into its renderer.
    pub(crate) fn most_samples(&self, spp: u32) -> u32 {
        let checkpoint = if self.error.is_some() { next_checkpoint(spp) } else { u32::MAX };
        self.spp.unwrap_or(u32::MAX).min(checkpoint)
    }

    /// Whether a picture with this progress after `seconds` wall seconds is done. The error counts at a fixed sequence of numbers of samples alone,
    /// so that the same scene has the same samples however fast it is drawn.
    pub fn is_met(&self, progress: &Progress, seconds: f64) -> bool {
        let error = progress.error_estimate;
        progress.all_rest
            || progress.spp >= self.spp.unwrap_or(u32::MAX)
            || self.seconds.is_some_and(|limit| seconds >= limit)
            || self.error.is_some_and(|bar| is_checkpoint(progress.spp) && error.is_finite() && error <= bar)
    }
}

/// One point of the curve of error against run time of a render.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Wall seconds since the first sample began.
    pub seconds: f64,
    /// CPU seconds of the process in that time.
    pub cpu_seconds: f64,
    /// Samples in every pixel that does not rest.
    pub spp: u32,
    /// Mean over pixels of the samples that each has.
    pub mean_spp: f64,
    /// Estimated relative error; `null` in JSON until there is an estimate.
    pub error_estimate: Option<f64>,
}

/// Duration of one call into the renderer: short enough for a smooth progress bar and a quick cancel.
const SLICE: Duration = Duration::from_millis(200);

impl CurvePoint {
    /// The point of this progress, at the clock's time.
    pub(crate) fn of(progress: &Progress, clock: &Stopwatch) -> Self {
        Self {
            seconds: clock.seconds(),
            cpu_seconds: clock.cpu_seconds(),
            spp: progress.spp,
            mean_spp: progress.mean_spp,
            error_estimate: progress.error_estimate.is_finite().then_some(progress.error_estimate),
        }
    }
}

/// Renders until `stop` is met and calls `watch` after each slice.
///
/// # Errors
/// Any error of the renderer; [`RenderError::Cancelled`] at most one slice after `job` is cancelled.
pub fn render_until(
    renderer: &mut dyn Renderer,
    stop: &Stop,
    job: &Job,
    watch: &mut dyn FnMut(&CurvePoint),
) -> Result<Vec<CurvePoint>, RenderError> {
    render_watched(renderer, stop, job, &mut |_, point| {
        watch(point);
        Ok(())
    })
}

/// What is called after each slice, with the renderer so that it can be asked for the picture so far.
pub(crate) type Watch<'a> = dyn FnMut(&mut dyn Renderer, &CurvePoint) -> Result<(), RenderError> + 'a;

/// As [`render_until`], where `watch` may use the renderer. An error of `watch` ends the render.
pub(crate) fn render_watched(
    renderer: &mut dyn Renderer,
    stop: &Stop,
    job: &Job,
    watch: &mut Watch<'_>,
) -> Result<Vec<CurvePoint>, RenderError> {
    let clock = Stopwatch::start();
    let mut curve: Vec<CurvePoint> = Vec::new();
    loop {
        let (slice, limit) = next_slice(stop, clock.seconds(), curve.last());
        let progress = renderer.advance(slice, limit, job)?;
        let point = CurvePoint::of(&progress, &clock);
        watch(renderer, &point)?;
        if curve.last().is_some_and(|former| former.spp > point.spp) {
            // A device failed and another restarted the picture: the lost samples leave the curve, but their time still counts.
            curve.clear();
        }
        curve.push(point);
        if stop.is_met(&progress, point.seconds) {
            return Ok(curve);
        }
    }
}

/// Time of the next call into the renderer, and the most samples that pixels may have after it, `seconds` after the start.
///
/// A pass over the picture may add several samples to each pixel. So that it does not go on far beyond a time limit, it gets as many as the
/// time that is left suffices for, at the pace until `last`, but one at least. With a limit of the error it ends at the next checkpoint.
fn next_slice(stop: &Stop, seconds: f64, last: Option<&CurvePoint>) -> (Duration, u32) {
    let left = stop.seconds.map_or(f64::INFINITY, |end| (end - seconds).max(0.0));
    let limit = match last {
        Some(last) if left.is_finite() && last.seconds > 0.0 => {
            let more = (f64::from(last.spp) * left / last.seconds).max(1.0);
            last.spp.saturating_add(more as u32)
        }
        _ => u32::MAX,
    };
    let slice = SLICE.min(Duration::from_secs_f64(left.min(1.0)));
    (slice, stop.most_samples(last.map_or(0, |last| last.spp)).min(limit))
}

/// At most `keep` points of a curve, evenly spread in log time, including the first and the last, for a table or a report.
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

    /// A second left of a picture that has got 16 samples in 4 seconds is time for four more; none left, for one.
    #[test]
    fn what_is_left_of_the_time_limits_the_samples() {
        let last = CurvePoint { spp: 16, ..point(4.0) };
        let next = |end: Option<f64>, spp: Option<u32>, last: Option<&CurvePoint>| {
            next_slice(&Stop { seconds: end, spp, ..Stop::default() }, 4.0, last)
        };
        assert_eq!(next(Some(5.0), None, Some(&last)), (SLICE, 20));
        assert_eq!(next(Some(5.0), Some(18), Some(&last)), (SLICE, 18));
        for end in [4.0, 3.0] {
            assert_eq!(next(Some(end), None, Some(&last)), (Duration::ZERO, 17));
        }
        assert_eq!(next(None, None, Some(&last)), (SLICE, u32::MAX));
        assert_eq!(next(Some(4.1), None, None), (Duration::from_secs_f64(4.1 - 4.0), u32::MAX));
        assert_eq!(next(Some(1e300), None, Some(&last)), (SLICE, u32::MAX));
    }

    #[test]
    fn the_error_is_checked_in_steps_of_an_eighth_to_a_fourth() {
        let mut checkpoints = vec![next_checkpoint(0)];
        while checkpoints.last().is_some_and(|&spp| spp < 200) {
            checkpoints.extend(checkpoints.last().map(|&spp| next_checkpoint(spp)));
        }
        assert_eq!(checkpoints[..12], [4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28]);
        for spp in 0..200 {
            assert_eq!(is_checkpoint(spp), checkpoints.contains(&spp), "{spp}");
            assert_eq!(next_checkpoint(spp), checkpoints.iter().copied().find(|&next| next > spp).unwrap());
        }
        assert_eq!(next_checkpoint(u32::MAX), u32::MAX);
        let last = CurvePoint { spp: 17, ..point(4.0) };
        let stop = Stop { error: Some(0.1), ..Stop::default() };
        assert_eq!(next_slice(&stop, 4.0, Some(&last)), (SLICE, 20));
        assert_eq!(next_slice(&stop, 0.0, None), (SLICE, 4));
    }

    /// Each limit by itself, just missed and just met.
    #[test]
    fn a_picture_is_done_at_the_first_of_its_limits() {
        let so_far = Progress { spp: 7, mean_spp: 7.0, error_estimate: 0.25, all_rest: false };
        let no_limit = Stop::default();
        let cases = [
            (Stop { spp: Some(8), ..no_limit }, Stop { spp: Some(7), ..no_limit }),
            (Stop { seconds: Some(2.5), ..no_limit }, Stop { seconds: Some(2.0), ..no_limit }),
            (Stop { error: Some(0.2), ..no_limit }, Stop { error: Some(0.25), ..no_limit }),
        ];
        for (missed, met) in cases {
            assert!(!missed.is_met(&so_far, 2.0) && met.is_met(&so_far, 2.0), "{missed:?}, {met:?}");
        }
        assert!(!no_limit.is_met(&so_far, 1e9));
        assert!(no_limit.is_met(&Progress { all_rest: true, ..so_far }, 0.0));
        // Between two checkpoints the error meets no limit.
        let between = Progress { spp: 9, ..so_far };
        assert!(!Stop { error: Some(0.25), ..no_limit }.is_met(&between, 0.0));
        // An unknown error meets no limit.
        let unknown = Progress { error_estimate: f64::INFINITY, ..so_far };
        assert!(!Stop { error: Some(f64::INFINITY), ..no_limit }.is_met(&unknown, 0.0));
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
