//! `pumice bench stability`: extreme cases, each with its error against an exact oracle or a closed form, and a limit of the error (the
//! bar) with its reason.
//!
//! ```text
//! group       cases                                                                      error
//! rays        first hits and bounces of the traversal against whole-number arithmetic    longest chord that was skipped
//! placements  a white furnace and a dark room, far away, tiny, huge, squeezed, mirrored  largest error of a pixel
//! light       suns, skies, materials, path depths with closed forms                      largest error of a pixel, or error of the mean
//! lamps       no size, no angle, as wide as the world; floors mirrored and sheared       the same
//! emission    a hundred thousand emissive labels; small, distant and long voxels         the same
//! refusals    scenes that must be refused                                                0 refused, 1 drawn
//! ```
//! Rays are always traced by the CPU backend, and the table says so. Pictures are rendered by the selected backend; if that is not the CPU,
//! each is also compared with the CPU's picture ([`Beside`]). Pixels that are not finite numbers ≥ 0 are counted, and there must be none.

pub(crate) mod command;
mod emission;
mod lamps;
mod light;
mod pictures;
mod placements;
mod rays;
mod refusals;

use std::cell::Cell;

use pumice_core::Job;
use pumice_session::error::{Result, SessionError};
use pumice_session::{FallbackRenderer, make_renderer};
use serde::Serialize;

use pictures::Studio;

pub use pumice_session::savings::Beside;

/// Result of one case.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    /// Group of the case: a row of the table in the module documentation.
    pub group: &'static str,
    /// What is extreme about the case.
    pub name: String,
    /// The measured error; not finite if the answer was plainly wrong.
    pub error: f64,
    /// Quantity and unit of `error` and `bar`.
    pub unit: &'static str,
    /// Largest `error` that passes.
    pub bar: f64,
    /// Why the bar has this value.
    pub reason: &'static str,
    /// Description of a fault, if there was one.
    pub note: Option<String>,
    /// Why the case tests the CPU backend regardless of the selected one; `None` if it tests the selected one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub processor_only: Option<&'static str>,
    /// Difference between another backend's pictures and the CPU's of the same samples; `None` if there are not both.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beside: Option<Beside>,
}

impl Case {
    /// A case without note. [`measure_stability`] sets `beside`.
    fn new(
        group: &'static str,
        name: impl Into<String>,
        error: f64,
        unit: &'static str,
        bar: f64,
        reason: &'static str,
    ) -> Self {
        Self {
            group,
            name: name.into(),
            error,
            unit,
            bar,
            reason,
            note: None,
            processor_only: None,
            beside: None,
        }
    }

    /// Text about the difference from the CPU's picture, or why there is no such comparison.
    pub fn beside_text(&self) -> String {
        match (&self.beside, self.processor_only) {
            (Some(b), _) => {
                format!("at most {:.1e} off, {:.1} % of values more than rounding", b.worst, 100.0 * b.apart)
            }
            (None, Some(why)) => format!("processor only: {why}"),
            (None, None) => "–".into(),
        }
    }

    /// Whether the error is within the bar, and the picture agrees with the CPU's if both were rendered.
    pub fn holds(&self) -> bool {
        self.error <= self.bar && self.beside.is_none_or(|b| b.holds())
    }
}

/// Results of all cases.
#[derive(Clone, Debug, Serialize)]
pub struct Stability {
    /// Backend that rendered the pictures.
    pub backend: String,
    /// Device that the backend ran on.
    pub device: String,
    /// Cases, group after group.
    pub cases: Vec<Case>,
    /// Number of rays that the oracle checked.
    pub rays: u64,
    /// Number of pixels that were checked.
    pub pixels: u64,
    /// Number of pixels that were NaN, infinite, or negative.
    pub bad_pixels: u64,
}

impl Stability {
    /// Whether all cases pass and no pixel is bad.
    pub fn holds(&self) -> bool {
        self.bad_pixels == 0 && self.cases.iter().all(Case::holds)
    }

    /// The cases as a Markdown page with a table.
    pub fn markdown(&self) -> String {
        let mut text = format!(
            "# stability\n\nPictures by {} on {}; {} rays checked, {} pixels checked, {} of them not finite or negative.\n\n\
             | kind | case | error | bar | of what | why that bar | beside the processor's picture | holds |\n\
             | --- | --- | --- | --- | --- | --- | --- | --- |\n",
            self.backend, self.device, self.rays, self.pixels, self.bad_pixels
        );
        for c in &self.cases {
            let holds = if c.holds() { "yes" } else { "NO" };
            text += &format!(
                "| {} | {} | {:.1e} | {:.1e} | {} | {} | {} | {holds} |\n",
                c.group,
                c.name,
                c.error,
                c.bar,
                c.unit,
                c.reason,
                c.beside_text()
            );
        }
        text
    }
}

/// Measures all cases and calls `watch` with each; `reduced` traces fewer rays, has crowds of fewer lamps, and takes seconds.
///
/// # Errors
/// When the backend is unavailable or fails, or the job is cancelled.
pub fn measure_stability(
    backend: &str,
    reduced: bool,
    job: &Job,
    watch: &mut dyn FnMut(&Case),
) -> Result<Stability> {
    let renderer: FallbackRenderer = make_renderer(backend)?;
    let beside = Cell::new(None);
    let mut studio = Studio::new(renderer, &beside, job);
    let mut all = Stability {
        backend: String::new(),
        device: String::new(),
        cases: Vec::new(),
        rays: 0,
        pixels: 0,
        bad_pixels: 0,
    };
    let mut tell = |mut case: Case| {
        case.beside = beside.take();
        watch(&case);
        all.cases.push(case);
        job.check().map_err(SessionError::from)
    };
    all.rays = rays::measure(if reduced { 1_500 } else { 60_000 }, &mut tell)?;
    placements::measure(&mut studio, &mut tell)?;
    light::measure(&mut studio, &mut tell)?;
    lamps::measure(&mut studio, reduced, &mut tell)?;
    emission::measure(&mut studio, &mut tell)?;
    refusals::measure(&mut studio, &mut tell)?;
    (all.backend, all.device) = studio.drawn_by();
    (all.pixels, all.bad_pixels) = studio.looked_at();
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bar_is_kept_on_the_cpu() {
        let all = measure_stability("cpu", true, &Job::new(), &mut |_| {}).unwrap();
        assert!(all.holds(), "{}", all.markdown());
        assert!(
            all.cases.iter().all(|c| c.beside.is_none() && c.processor_only.is_some() == (c.group == "rays"))
        );
        assert!(all.cases.len() > 80 && all.rays > 10_000 && all.pixels > 5_000, "{}", all.markdown());
    }

    /// Control: an error above the bar, infinite or NaN fails, and so does a picture that differs too much from the CPU's.
    #[test]
    fn wrong_answers_miss_their_bars() {
        let case = |error| Case::new("rays", "", error, "voxels", 1e-3, "");
        assert!(case(1e-4).holds());
        let beside = |apart| Case { beside: Some(Beside { worst: apart, apart }), ..case(1e-4) };
        assert!(beside(0.01).holds() && !beside(0.5).holds() && !beside(f64::NAN).holds());
        assert!(!case(2e-3).holds() && !case(f64::INFINITY).holds() && !case(f64::NAN).holds());
    }
}
