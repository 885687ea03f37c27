//! Measures what leaving out unneeded parts of a renderer saves, by running with and without each part in turn; nothing is computed
//! from a model.
//!
//! ```text
//! each file of which not all labels are shown    opened for these alone, whole, whole, for these alone, …
//! for each part that the scene does not need, and finally for all of them together:
//!     rounds of building       left out, put in, put in, left out, …      milliseconds of `set_scene`, each with a new renderer
//!     the last two renderers   bytes by part; the first sample, with what is compiled for it
//!     rounds of samples        left out, put in, put in, left out, …      milliseconds a sample of a small picture
//!     both pictures            must be the same
//! ```
//! Milliseconds are CPU time of the process (user and system, all threads), so that other programs disturb little. The saving is the
//! median of the differences of the rounds; where 0 lies between their quartiles, the measurement does not show a saving.

mod beside;
mod opening;

use std::collections::BTreeMap;
use std::time::Duration;

use pumice_core::Job;
use pumice_scene::{Part, PartSet};
use pumice_transport::{LoadedScene, Renderer};
use serde::Serialize;

use crate::backend::{FallbackRenderer, make_renderer};
use crate::error::Result;
use crate::measure::Stopwatch;

pub use beside::{Beside, ROUNDING};
pub use opening::{OpeningSaved, measure_opening};

/// Number of rounds and size of the pictures.
#[derive(Clone, Copy, Debug)]
pub struct SavingsOptions {
    /// Rounds, each of which runs with and without the part.
    pub rounds: u32,
    /// Most pixels along the longer side of the pictures.
    pub side: u32,
}

impl SavingsOptions {
    /// Used by `--explain`: takes seconds on a processor.
    pub const QUICK: Self = Self { rounds: 9, side: 160 };
}

/// Median and quartiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Lower quartile.
    pub low: f64,
    /// Median.
    pub median: f64,
    /// Upper quartile.
    pub high: f64,
}

impl Spread {
    /// Median and quartiles of at least one number.
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let last = values.len().saturating_sub(1) as f64;
        let at = |share: f64| {
            let place = share * last;
            let (below, above) = (place.floor() as usize, place.ceil() as usize);
            let [a, b] = [below, above].map(|i| values.get(i).copied().unwrap_or(f64::NAN));
            a + (b - a) * (place - place.floor())
        };
        Self { low: at(0.25), median: at(0.5), high: at(0.75) }
    }
}

/// Milliseconds with and without a part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Both {
    /// With the part left out.
    pub without: Spread,
    /// With the part put in.
    pub with: Spread,
    /// The saving: the differences within each round.
    pub saved: Spread,
}

impl Both {
    fn of(without: Vec<f64>, with: Vec<f64>) -> Self {
        let saved = with.iter().zip(&without).map(|(with, without)| with - without).collect();
        Self { without: Spread::of(without), with: Spread::of(with), saved: Spread::of(saved) }
    }
}

/// What leaving out one part saves, or all unneeded parts together.
#[derive(Clone, Debug, Serialize)]
pub struct Saving {
    /// The part; `None` for all together.
    pub part: Option<Part>,
    /// Bytes of the renderer by part of memory: without the part, with it.
    pub bytes: BTreeMap<&'static str, [u64; 2]>,
    /// Milliseconds of building (`set_scene`).
    pub build_ms: Both,
    /// Milliseconds of the first sample, compiling included: without the part, with it.
    pub first_ms: [f64; 2],
    /// Milliseconds of each further sample of the whole picture.
    pub sample_ms: Both,
    /// Difference of the picture with the part from the one without.
    pub beside: Beside,
}

impl Saving {
    /// Name of the part that is left out.
    pub fn name(&self) -> &'static str {
        self.part.map_or("all of it together", Part::spoken)
    }

    /// Bytes saved, all parts of the renderer together.
    pub fn bytes_saved(&self) -> i64 {
        self.bytes.values().map(|[without, with]| *with as i64 - *without as i64).sum()
    }
}

/// All measured savings of a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Savings {
    /// Backend that was measured.
    pub backend: String,
    /// Device that the backend runs on.
    pub device: String,
    /// Pixels of the pictures across and down.
    pub size: [u32; 2],
    /// Number of rounds.
    pub rounds: u32,
    /// For each file of which only the visible labels were read, what that saved.
    pub opening: Vec<OpeningSaved>,
    /// For each part that was left out, then for all together, what that saved.
    pub savings: Vec<Saving>,
    /// Parts that the scene does not need but that this backend always has, with the reason.
    pub always_there: Vec<(Part, &'static str)>,
}

impl Savings {
    /// The savings as text, one line for each part.
    pub fn lines(&self) -> Vec<String> {
        let [width, height] = self.size;
        let mut lines = vec![format!(
            "measured by {} on {}, each part left out and put in in turn, {} rounds of {width} × {height} pixels; CPU milliseconds, \
             medians and quartiles:",
            self.backend, self.device, self.rounds
        )];
        lines.extend(self.opening.iter().map(OpeningSaved::line));
        for s in &self.savings {
            let ms =
                |b: &Both| format!("{:.2} ms ({:.2} to {:.2})", b.saved.median, b.saved.low, b.saved.high);
            let [first_without, first_with] = s.first_ms;
            let mut line = format!(
                "saved by leaving out {}: {} bytes; {} of building; {:.1} ms of the first sample; {} of each further of {:.2} ms",
                s.name(),
                s.bytes_saved(),
                ms(&s.build_ms),
                first_with - first_without,
                ms(&s.sample_ms),
                s.sample_ms.with.median
            );
            if !s.beside.holds() {
                line += "; NOT COMPARABLE: the pictures differ";
            }
            lines.push(line);
        }
        let always = self.always_there.iter();
        lines.extend(
            always.map(|(part, why)| format!("saved by leaving out {}: nothing ({why})", part.spoken())),
        );
        lines
    }

    /// Whether the pictures with and without each part were the same.
    pub fn holds(&self) -> bool {
        self.savings.iter().all(|s| s.beside.holds())
    }
}

/// Measures the savings of a scene. `watch` is called with the name of each part before it is measured.
///
/// # Errors
/// Any error of the renderer; the cancellation of the job.
pub fn measure_savings(
    scene: &LoadedScene,
    backend: &str,
    options: &SavingsOptions,
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<Savings> {
    let mut film = scene.scene().film;
    let longer = film.width.max(film.height);
    if longer > options.side {
        let shorten = |n: u32| (u64::from(n) * u64::from(options.side) / u64::from(longer)).max(1) as u32;
        (film.width, film.height) = (shorten(film.width), shorten(film.height));
    }
    let scene = scene.with_film(film)?;
    let needs = scene.needs();
    let ways = Ways { scene: &scene, backend, rounds: options.rounds.max(2), job };

    // Find out which parts can be left out.
    let (asked, _) = ways.built(PartSet::NONE)?;
    let leaves_out = left_out_by(asked.name());
    let mut can = leaves_out;
    let mut always_there = Vec::new();
    let is_cpu = asked.name() == "cpu";
    if !is_cpu && needs.levels.contains(&16) && needs.unneeded().has(Part::HiddenLabels) {
        can = can.without(PartSet::NONE.with(Part::HiddenLabels));
        always_there
            .push((Part::HiddenLabels, "not measured: boxes that are drawn whole cannot be left out"));
    }
    let why = "its code is always compiled; it runs only for what a scene has";
    let missing = needs.unneeded().without(leaves_out);
    always_there.extend(missing.parts().map(|part| (part, why)));
    let spare = needs.unneeded().and(can);

    let mut savings = Vec::new();
    for part in spare.parts() {
        watch(part.spoken());
        savings.push(Saving { part: Some(part), ..ways.measure(PartSet::NONE.with(part))? });
    }
    if !spare.is_none() {
        watch("all of it together");
        savings.push(ways.measure(spare)?);
    }
    Ok(Savings {
        backend: asked.name().to_owned(),
        device: asked.device().to_owned(),
        size: [film.width, film.height],
        rounds: ways.rounds,
        opening: Vec::new(),
        savings,
        always_there,
    })
}

/// The parts that a backend leaves out where a scene does not need them.
fn left_out_by(backend: &str) -> PartSet {
    if backend == "cpu" { pumice_cpu::LEAVES_OUT } else { pumice_vulkan::pack::LEAVES_OUT }
}

/// Calls `one` without and with the part, in the order ABBA; its arguments are whether the part is put in, and the round.
fn in_turn<T>(rounds: u32, job: &Job, mut one: impl FnMut(bool, u32) -> Result<T>) -> Result<[Vec<T>; 2]> {
    let [mut without, mut with] = [Vec::new(), Vec::new()];
    for round in 0..rounds {
        job.check()?;
        let first = round % 2 == 1;
        for put_in in [first, !first] {
            let found = one(put_in, round)?;
            if put_in { with.push(found) } else { without.push(found) }
        }
    }
    Ok([without, with])
}

/// A scene that is drawn with and without parts.
struct Ways<'a> {
    scene: &'a LoadedScene,
    backend: &'a str,
    rounds: u32,
    job: &'a Job,
}

impl Ways<'_> {
    /// A renderer that shows the scene and also builds the parts `besides`, and the milliseconds that building took.
    fn built(&self, besides: PartSet) -> Result<(FallbackRenderer, f64)> {
        let mut renderer = make_renderer(self.backend)?;
        let scene = self.scene.with_parts(besides);
        let clock = Stopwatch::start();
        renderer.set_scene(&scene)?;
        Ok((renderer, 1e3 * clock.cpu_seconds()))
    }

    /// Milliseconds of one more sample.
    fn sample(&self, renderer: &mut FallbackRenderer, spp: u32) -> Result<f64> {
        let clock = Stopwatch::start();
        renderer.advance(Duration::ZERO, spp, self.job)?;
        Ok(1e3 * clock.cpu_seconds())
    }

    fn measure(&self, spare: PartSet) -> Result<Saving> {
        let mut last = [None, None];
        let built = in_turn(self.rounds, self.job, |put_in, _| {
            let (renderer, ms) = self.built(if put_in { spare } else { PartSet::NONE })?;
            last[usize::from(put_in)] = Some(renderer);
            Ok(ms)
        })?;
        let [without, with] = built;
        let build_ms = Both::of(without, with);
        let mut renderers = Vec::new();
        for (i, renderer) in last.into_iter().enumerate() {
            renderers.push(match renderer {
                Some(renderer) => renderer,
                None => self.built(if i == 1 { spare } else { PartSet::NONE })?.0,
            });
        }

        let mut first_ms = [0.0; 2];
        for (ms, renderer) in first_ms.iter_mut().zip(&mut renderers) {
            *ms = self.sample(renderer, 1)?;
        }
        let [without, with] = in_turn(self.rounds, self.job, |put_in, round| {
            self.sample(&mut renderers[usize::from(put_in)], 2 + round)
        })?;

        let mut bytes: BTreeMap<&'static str, [u64; 2]> = BTreeMap::new();
        for (way, renderer) in renderers.iter().enumerate() {
            for (part, count) in renderer.bytes() {
                bytes.entry(part).or_default()[way] += count;
            }
        }
        let mut pictures = Vec::new();
        for renderer in &mut renderers {
            pictures.push(renderer.color()?.pixels);
        }
        let beside = Beside::between(&pictures[1], &pictures[0]);
        Ok(Saving { part: None, bytes, build_ms, first_ms, sample_ms: Both::of(without, with), beside })
    }
}

#[cfg(test)]
mod tests {
    use pumice_oracle::volumes::blobs;
    use pumice_scene::{Scene, Show};

    use super::*;
    use crate::figure::{FigureOptions, compose};

    fn measured(edit: impl FnOnce(&mut Scene)) -> Savings {
        let (_, bodies) = blobs([48, 48, 48], 60, 5, 4);
        let options = FigureOptions { size: [64, 40], ..FigureOptions::default() };
        let mut scene = compose(&bodies, "memory".into(), &options);
        edit(&mut scene);
        let how = SavingsOptions { rounds: 3, side: 32 };
        measure_savings(
            &LoadedScene::new(scene, vec![bodies], vec![]).unwrap(),
            "cpu",
            &how,
            &Job::new(),
            &mut |_| {},
        )
        .unwrap()
    }

    #[test]
    fn each_spare_part_is_measured_and_what_is_needed_is_not() {
        let all = measured(|s| s.instances[0].style.show = Show::Only(vec![1, 2]));
        assert_eq!((all.backend.as_str(), all.size, all.rounds), ("cpu", [32, 20], 3));
        let parts: Vec<_> = all.savings.iter().map(|s| s.part).collect();
        let (voxels, light) = ([Part::HiddenLabels, Part::Levels], [Part::Transparent, Part::Sorting]);
        let expected = [&voxels[..], &light, &[Part::Mattes, Part::InstanceTree]].concat();
        let expected: Vec<_> = expected.into_iter().map(Some).collect();
        assert_eq!(parts, [&expected[..], &[None]].concat());
        assert!(all.holds(), "{all:?}");
        // Bytes do not depend on the clock, so they can be tested.
        assert!(all.savings[0].bytes_saved() > 0 && all.savings[3].bytes_saved() == 0, "{all:?}");
        let lines = all.lines();
        assert_eq!(lines.len(), 1 + 7 + all.always_there.len());
        assert!(
            lines[1].starts_with("saved by leaving out boxes of labels that are not shown: "),
            "{lines:?}"
        );
        assert!(
            lines.iter().any(|l| l.starts_with("saved by leaving out clear coats: nothing (")),
            "{lines:?}"
        );

        let needed = measured(|s| {
            s.instances[0].style.material.alpha = 0.5;
            s.settings.clamp_direct = 7.0;
        });
        let parts: Vec<_> = needed.savings.iter().map(|s| s.part).collect();
        assert_eq!(parts, [Some(Part::Levels), Some(Part::Mattes), Some(Part::InstanceTree), None]);
    }

    #[test]
    fn medians_and_quartiles() {
        assert_eq!(Spread::of(vec![3.0, 1.0, 2.0, 5.0, 4.0]), Spread { low: 2.0, median: 3.0, high: 4.0 });
        assert_eq!(Spread::of(vec![1.0, 2.0]), Spread { low: 1.25, median: 1.5, high: 1.75 });
        // Differences are taken within a round, so that a slow-down over time does not count as a saving.
        let both = Both::of(vec![1.0, 2.0, 3.0], vec![2.0, 3.0, 4.0]);
        assert_eq!(both.saved, Spread { low: 1.0, median: 1.0, high: 1.0 });
    }
}
