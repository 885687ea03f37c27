//! Compares our picture of a scene with that of Cycles, until a verdict is reached.
//!
//! ```text
//! scene ─► subject: what both can draw, the surface that memory allows
//!             ├─► our renderer:  seed 1, seed 2, …  ─┐
//!             └─► Blender, Cycles: seed 1, seed 2, … ┴─► looks at 8, 16, 32, … pictures each ─► verdict, page
//! ```
//! Camera, lights, world and materials go to Cycles from our scene, by the one translation that the Cycles ladder uses too, and never
//! through a file that Blender's importers read.

mod charts;
mod maps;
mod page;
mod progress;
mod subject;

use std::path::PathBuf;
use std::time::Instant;

use pumice_core::Job;
use pumice_formats::OpenOptions;
use pumice_picture::Image;
pub use pumice_picture::agreement::Verdict;
use pumice_picture::agreement::{Agreement, PictureSet, judge, level_of_look};
use pumice_picture::metrics::{CompareError, Comparison, compare};
use pumice_transport::geometry::DetailLevel;
use pumice_transport::{LoadedScene, RenderError, Renderer};
use serde::Serialize;

use crate::backend::{FallbackRenderer, make_renderer};
use crate::cycles::Cycles;
use crate::error::{Result, SessionError};
use crate::measure::{Stopwatch, peak_rss_bytes};
use crate::progressive::{Stop, render_until};
use crate::render_file::RenderOverrides;
use crate::render_file::hash_text;
use charts::Curve;
pub use maps::VerifyMaps;
use page::write_page;
pub use progress::{LastLook, VerifyProgress};
use subject::Subject;

/// Pictures of each renderer at the first look: Welch's t with 14 degrees of freedom is already within twice the normal quantile.
const FIRST_LOOK: usize = 8;
/// Pictures of each renderer at the last look. More would halve the noise by another 1.4, for as much time as all so far.
const MOST_PICTURES: usize = 256;
/// Samples per pixel of each picture at least: a mean of fewer has tails that Student's t does not know, and Cycles' 256 sampling patterns
/// show in the mean over all seeds (docs/verify.md).
pub const LEAST_SPP: u32 = 256;
/// Pixels of the picture at most, where no size is asked for: a tile then shows a larger piece of the scene, and the time of a
/// comparison falls with the pixels.
const MOST_PIXELS: f64 = 40_000.0;

/// What is compared.
#[derive(Clone, Debug)]
pub struct VerifyRenderRequest {
    /// A scene (`.json`), a `.pumice` file or any label volume.
    pub input: PathBuf,
    /// A Python that has Blender as the module `bpy`, or a program of Blender.
    pub blender: PathBuf,
    /// Another scene for Cycles, to see that the comparison notices what differs between the two.
    pub control: Option<PathBuf>,
    /// Where the page goes, if anywhere: `.html`.
    pub page: Option<PathBuf>,
    /// Our backend by name.
    pub backend: String,
    /// Samples per pixel of each picture, at least [`LEAST_SPP`].
    pub spp: u32,
    /// Seconds after which no further picture is begun.
    pub seconds: Option<f64>,
    /// Level of detail that both draw; without it the finest that memory allows.
    pub level: Option<DetailLevel>,
    /// Bytes that Blender may take; without it three quarters of what is free.
    pub memory_limit: Option<u64>,
    /// Values that override those of the scene.
    pub overrides: RenderOverrides,
    /// How to read a volume.
    pub reading: OpenOptions,
    /// The command, for the page.
    pub command: String,
}

/// Cost of one renderer's pictures.
#[derive(Clone, Debug, Serialize)]
pub struct Cost {
    /// Name and version.
    pub name: String,
    /// Wall seconds of building the scene.
    pub build_seconds: f64,
    /// Wall seconds of all pictures.
    pub seconds: f64,
    /// CPU seconds of all pictures.
    pub cpu_seconds: f64,
    /// Bytes: of our renderer and its volumes; of Blender's process.
    pub bytes: u64,
    /// Estimated relative error of the mean of all pictures.
    pub error_estimate: f64,
    /// Wall seconds and estimated relative error of the mean of 2, 4, 8, … pictures.
    pub curve: Vec<(f64, f64)>,
}

/// The result of a comparison.
#[derive(Clone, Debug, Serialize)]
pub struct VerifiedRender {
    /// One sentence.
    pub sentence: String,
    /// The verdict and its statistics.
    pub agreement: Agreement,
    /// Metrics of the mean pictures, ours against theirs.
    pub comparison: Comparison,
    /// Level of detail that was drawn: `voxels` is exact.
    pub surface: &'static str,
    /// Faces that Cycles got.
    pub faces: u64,
    /// Width and height of the pictures.
    pub size: [u32; 2],
    /// Samples per pixel of each picture.
    pub spp: u32,
    /// What was changed or left out for the comparison, one line each.
    pub notes: Vec<String>,
    /// Our cost.
    pub ours: Cost,
    /// Theirs.
    pub theirs: Cost,
    /// Hashes of the volumes.
    pub volume_hashes: Vec<String>,
    /// Wall seconds of everything.
    pub total_seconds: f64,
    /// Largest resident set of this process.
    pub peak_rss_bytes: Option<u64>,
    /// The mean pictures, and maps of their difference; no part of the report as text.
    #[serde(skip)]
    pub maps: VerifyMaps,
}

/// Compares our picture of a scene with that of Cycles. `watch` hears how far it is.
///
/// # Errors
/// One line that says what is wrong with the input or the page's name, what in the scene Cycles cannot draw, or what Blender said last;
/// [`pumice_core::Error::Cancelled`].
pub fn verify_render(
    request: &VerifyRenderRequest,
    job: &Job,
    watch: &mut dyn FnMut(VerifyProgress),
) -> Result<VerifiedRender> {
    let total = Stopwatch::start();
    page::check_name(request)?;
    request.reading.outputs.check_input(&request.blender)?;
    if request.spp < LEAST_SPP {
        let spp = request.spp;
        return Err(SessionError::Caller(format!("spp: expected at least {LEAST_SPP} samples, got {spp}")));
    }

    // Both programs get the same scene, unless the comparison itself is to be tested.
    let mut subject = Subject::new(request, &request.input, job)?;
    let for_cycles = match &request.control {
        None => subject.scene.clone(),
        Some(other) => {
            subject.notes.push(format!("A control: Cycles draws another scene, {}.", other.display()));
            Subject::new(request, other, job)?.scene
        }
    };
    let size = |scene: &LoadedScene| [scene.scene().film.width, scene.scene().film.height];
    if size(&for_cycles) != size(&subject.scene) {
        return Err(SessionError::Caller("control: expected a scene whose picture has the same size".into()));
    }
    let mut us = Us::new(&subject.scene, &request.backend)?;
    let mut cycles = Cycles::start(&request.blender, &for_cycles, subject.level, job)?;

    // Draw in turn, and look at each doubling, until there is a verdict.
    let began = Instant::now();
    let (mut ours, mut theirs) = (Series::default(), Series::default());
    let (mut look, mut next_look, mut last_look) = (0, FIRST_LOOK, None);
    let (mut agreement, cycles_bytes) = loop {
        let seconds = began.elapsed().as_secs_f64();
        watch(VerifyProgress {
            pictures: ours.set.len(),
            next_look,
            seconds_left: request.seconds.map(|limit| (limit - seconds).max(0.0)),
            last_look,
        });
        let number = ours.set.len() as u64 + 1;
        let (picture, seconds) = us.picture(&subject.scene, number, request.spp, job)?;
        ours.push(picture, seconds);
        let drawn = cycles.picture(number, request.spp, job)?;
        theirs.push(drawn.picture, [drawn.took.seconds, drawn.took.cpu_seconds]);
        let is_late = request.seconds.is_some_and(|limit| began.elapsed().as_secs_f64() > limit);
        if ours.set.len() < next_look && !is_late {
            continue;
        }
        let agreement = judge(&ours.set, &theirs.set, &us.covered, level_of_look(look));
        let is_last = is_late || ours.set.len() >= MOST_PICTURES;
        // A first look that agrees is followed by a second, so that a smaller difference has a chance to be proven.
        let is_told = match agreement.verdict {
            Verdict::Differs => true,
            Verdict::Agrees => look > 0,
            Verdict::CannotTell => false,
        };
        if is_told || is_last {
            break (agreement, drawn.peak_bytes);
        }
        (look, next_look, last_look) = (look + 1, 2 * next_look, Some(LastLook::of(&agreement)));
    };

    let sentence = said(&mut agreement, cycles.without_order(), &mut subject.notes);

    // Say it.
    let means = [ours.set.mean(), theirs.set.mean()];
    let [Some(mut our_mean), Some(mut their_mean)] = means else {
        return Err(SessionError::Caller("no picture was drawn".into()));
    };
    for mean in [&mut our_mean, &mut their_mean] {
        let masked = mean.pixels.iter_mut().zip(&agreement.mask).filter(|(_, masked)| **masked);
        masked.for_each(|(pixel, _)| *pixel = [0.0; 3]);
    }
    let comparison = compare(&our_mean, &their_mean, None, &|| job.is_cancelled()).map_err(|e| match e {
        CompareError::Cancelled => pumice_core::Error::Cancelled.into(),
        e => SessionError::Caller(e.to_string()),
    })?;
    let film = &subject.scene.scene().film;
    let verified = VerifiedRender {
        sentence,
        comparison,
        surface: subject.surface(),
        faces: cycles.faces(),
        size: [film.width, film.height],
        spp: request.spp,
        notes: subject.notes.clone(),
        ours: ours.cost(us.name.clone(), us.build_seconds, us.bytes()),
        theirs: theirs.cost(
            format!("Cycles in Blender {}", cycles.blender()),
            cycles.built().seconds,
            cycles_bytes,
        ),
        volume_hashes: subject.scene.volumes().iter().map(|v| hash_text(v)).collect(),
        total_seconds: total.seconds(),
        peak_rss_bytes: peak_rss_bytes(),
        maps: VerifyMaps::new(our_mean, their_mean, &agreement),
        agreement,
    };
    if let Some(path) = &request.page {
        write_page(path, request, &verified)?;
    }
    Ok(verified)
}

/// The verdict in a sentence. Where the scene has faces `without_order`, a difference proves nothing: it then cannot be judged.
fn said(agreement: &mut Agreement, without_order: &[String], notes: &mut Vec<String>) -> String {
    let sentence = agreement.sentence();
    if without_order.is_empty() {
        return sentence;
    }
    let unordered = without_order.join(", and ");
    notes.push(format!("No program says which is passed first: {unordered}."));
    if agreement.verdict != Verdict::Differs {
        return sentence;
    }
    agreement.verdict = Verdict::CannotTell;
    format!(
        "Cannot be judged: {unordered}, of which no program says which is passed first. Otherwise it would be: {sentence}"
    )
}

/// Our renderer.
struct Us {
    renderer: FallbackRenderer,
    name: String,
    build_seconds: f64,
    volume_bytes: u64,
    /// Pixels whose centre shows a surface; empty before the first picture.
    covered: Vec<bool>,
}

impl Us {
    fn new(scene: &LoadedScene, backend: &str) -> Result<Self> {
        let clock = Stopwatch::start();
        let mut renderer = make_renderer(backend)?;
        renderer.set_scene(scene)?;
        let volumes = scene.volumes();
        let is_first = |i: usize| !volumes[..i].iter().any(|v| std::sync::Arc::ptr_eq(v, &volumes[i]));
        let bytes = |i: usize| volumes[i].resident_parts().into_iter().map(|(_, b)| b).sum::<u64>();
        let volume_bytes = (0..volumes.len()).filter(|&i| is_first(i)).map(bytes).sum();
        let name = format!("Pumice {} ({})", env!("CARGO_PKG_VERSION"), renderer.name());
        Ok(Self { renderer, name, build_seconds: clock.seconds(), volume_bytes, covered: Vec::new() })
    }

    /// A picture, laid over white where the film is transparent; with its wall and CPU seconds.
    fn picture(
        &mut self,
        scene: &LoadedScene,
        number: u64,
        spp: u32,
        job: &Job,
    ) -> Result<(Image, [f64; 2])> {
        let mut seeded = scene.scene().clone();
        // Widely spaced: neighbouring seeds would do for us, but nobody need believe that.
        seeded.settings.seed = number.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 16;
        let seeded = LoadedScene::new(seeded, scene.volumes().to_vec(), scene.meshes().to_vec())?;
        self.renderer.set_scene(&seeded)?;
        let clock = Stopwatch::start();
        let stop = Stop { spp: Some(spp), ..Stop::default() };
        let picture = loop {
            render_until(&mut self.renderer, &stop, job, &mut |_| {})?;
            match self.renderer.picture() {
                // The device failed when the finished picture was read: another one draws it again.
                Err(RenderError::Restarted) => {}
                picture => break picture?,
            }
        };
        let took = [clock.seconds(), clock.cpu_seconds()];
        if self.covered.is_empty() {
            self.covered = match &picture.depth {
                Some(depth) => depth.iter().map(|d| d.is_finite()).collect(),
                None => vec![true; picture.color.pixels.len()],
            };
        }
        Ok((page::over_white(&picture), took))
    }

    fn bytes(&self) -> u64 {
        self.volume_bytes + self.renderer.bytes().into_iter().map(|(_, bytes)| bytes).sum::<u64>()
    }
}

/// Pictures of one renderer, and when they were done.
#[derive(Default)]
struct Series {
    set: PictureSet,
    seconds: f64,
    cpu_seconds: f64,
    curve: Curve,
}

impl Series {
    fn push(&mut self, picture: Image, [seconds, cpu_seconds]: [f64; 2]) {
        self.seconds += seconds;
        self.cpu_seconds += cpu_seconds;
        self.curve.add(&picture, self.seconds);
        self.set.push(picture);
    }

    fn cost(&self, name: String, build_seconds: f64, bytes: u64) -> Cost {
        Cost {
            name,
            build_seconds,
            seconds: self.seconds,
            cpu_seconds: self.cpu_seconds,
            bytes,
            error_estimate: self.curve.error(),
            curve: self.curve.points().to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight even pictures of 8 × 8 pixels.
    fn even(value: f32) -> PictureSet {
        let mut set = PictureSet::default();
        (0..8).for_each(|_| set.push(Image::new(8, 8, vec![[value; 3]; 64])));
        set
    }

    #[test]
    fn a_difference_of_a_scene_without_an_order_is_not_judged() {
        let lines = ["faces in one place (3)".to_owned(), "planes (1)".to_owned()];
        for (theirs, lines, verdict, begins) in [
            (
                2.0,
                &lines[..],
                Verdict::CannotTell,
                "Cannot be judged: faces in one place (3), and planes (1), of",
            ),
            (2.0, &[], Verdict::Differs, "Differs: "),
            (1.0, &lines[..], Verdict::Agrees, "Agrees: "),
        ] {
            let mut agreement = judge(&even(1.0), &even(theirs), &[true; 64], level_of_look(0));
            let mut notes = Vec::new();
            let sentence = said(&mut agreement, lines, &mut notes);
            assert!(sentence.starts_with(begins) && !sentence.contains('\n'), "{sentence}");
            assert_eq!((agreement.verdict, notes.len()), (verdict, usize::from(!lines.is_empty())));
        }
    }
}
