//! Extreme cases, each with its error against an exact oracle or a closed form, and a bar with its reason: what `pumice bench
//! stability` prints.
//!
//! ```text
//! rays        first hits and bounces of the traversal against whole-number arithmetic   longest chord that was skipped
//! placements  a white furnace and a dark room, far away, tiny, huge, squeezed, mirrored  largest error of a pixel
//! light       suns, skies, materials, depths with closed forms                           largest error, or of the mean
//! lamps       no size, no angle, as wide as the world; floors mirrored and sheared       the same
//! emission    a hundred thousand labels that shine, small, far and long voxels           the same
//! refusals    what must not be drawn at all                                              0 refused, 1 drawn
//! ```
//! Rays are the processor's, and the table says so; pictures are drawn by the backend that is asked for, and where that is another
//! than the processor, each is held beside the processor's ([`Beside`]). No pixel of any picture may be anything but a number from 0
//! on: they are counted.

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

/// One case.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    /// Kind of the case: a row of the module's table.
    pub group: &'static str,
    /// What is extreme about it.
    pub name: String,
    /// What was measured; not finite where the answer was plainly wrong.
    pub error: f64,
    /// Quantity and unit of `error` and `bar`.
    pub unit: &'static str,
    /// Largest `error` that passes.
    pub bar: f64,
    /// Where the bar comes from.
    pub reason: &'static str,
    /// What was wrong, where something was.
    pub note: Option<String>,
    /// Why the processor was judged whatever backend was asked for; `None` where that backend drew.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub processor_only: Option<&'static str>,
    /// Another backend's pictures beside the processor's of the same samples; `None` where there are no two of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beside: Option<Beside>,
}

impl Case {
    /// A case of which there is no more to say; [`measure_stability`] sets how it stands beside the processor.
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

    /// How a backend's picture stands beside the processor's, or why there are no two.
    pub fn beside_text(&self) -> String {
        match (&self.beside, self.processor_only) {
            (Some(b), _) => {
                format!("at most {:.1e} off, {:.1} % of values more than rounding", b.worst, 100.0 * b.apart)
            }
            (None, Some(why)) => format!("processor only: {why}"),
            (None, None) => "–".into(),
        }
    }

    /// Whether the bar is kept, and the processor's picture where there is one.
    pub fn holds(&self) -> bool {
        self.error <= self.bar && self.beside.is_none_or(|b| b.holds())
    }
}

/// All cases.
#[derive(Clone, Debug, Serialize)]
pub struct Stability {
    /// Backend that drew the pictures.
    pub backend: String,
    /// What it ran on.
    pub device: String,
    /// Cases, kind after kind.
    pub cases: Vec<Case>,
    /// Rays that the oracle has judged.
    pub rays: u64,
    /// Pixels that were looked at.
    pub pixels: u64,
    /// Pixels that were not a number, infinite, or negative.
    pub bad_pixels: u64,
}

impl Stability {
    /// Whether all bars are kept and no pixel was bad.
    pub fn holds(&self) -> bool {
        self.bad_pixels == 0 && self.cases.iter().all(Case::holds)
    }

    /// The cases as a page with a table.
    pub fn markdown(&self) -> String {
        let mut text = format!(
            "# stability\n\nPictures by {} on {}; {} rays judged, {} pixels looked at, {} of them not a number from 0 on.\n\n\
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

/// Measures all cases; `reduced` ones take seconds. `watch` hears of each.
///
/// # Errors
/// When the backend is not there or fails, or the job is cancelled.
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
    lamps::measure(&mut studio, &mut tell)?;
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

    /// The bars can be missed: an error that is no number misses each.
    #[test]
    fn wrong_answers_miss_their_bars() {
        let case = |error| Case::new("rays", "", error, "voxels", 1e-3, "");
        assert!(case(1e-4).holds());
        let beside = |apart| Case { beside: Some(Beside { worst: apart, apart }), ..case(1e-4) };
        assert!(beside(0.01).holds() && !beside(0.5).holds() && !beside(f64::NAN).holds());
        assert!(!case(2e-3).holds() && !case(f64::INFINITY).holds() && !case(f64::NAN).holds());
    }
}
