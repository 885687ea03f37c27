//! Renders the time steps of a series: a picture for each, with one renderer that keeps what does not change from one to the next.

use std::path::{Path, PathBuf};

use pumice_core::Job;
use pumice_formats::OpenOptions;
use pumice_scene::Scene;
use pumice_transport::LoadedScene;

use super::open_scene::{is_scene_file, set_time_step, state_at, time_steps_of};
use super::request::{RenderRequest, Subject};
use super::turntable::{NumberedPicture, numbered};
use super::{Ready, in_pool};
use crate::annotations::lay_out;
use crate::error::{Result, SessionError};
use crate::open::{Residence, open_chosen};
use crate::persistent_renderer::{PersistentRenderer, Watching};
use crate::progressive::{CurvePoint, Stop};
use crate::reading::options_for;

/// Renders a picture of each time step that `request.time_steps` chooses. Volumes that have several time steps show it; everything else stays
/// as it is at the first of them, also the camera that is found for a volume, and the labels that are chosen. `OUT.png` stands for the files
/// `OUT_0001.png`, `OUT_0002.png` and so on. After every slice it calls `watch` with the number of the picture, counted from 0, the limits in force
/// and the progress.
///
/// # Errors
/// As [`render_file`](super::render_file); [`SessionError::Caller`] where no volume has several time steps. Pictures that are finished stay.
pub fn render_time_steps(
    request: &RenderRequest,
    job: &Job,
    watch: &mut (dyn FnMut(u32, &Stop, &CurvePoint) + Send),
) -> Result<Vec<NumberedPicture>> {
    let (Subject::File(path), Some(steps)) = (&request.subject, request.time_steps) else {
        return Err(SessionError::Caller("--time-steps: expected a volume or a scene".into()));
    };
    let steps = steps.of(path, count_of(path, &request.reading)?)?;
    let files: Vec<PathBuf> = (0..steps.len() as u32).map(|number| numbered(&request.out, number)).collect();
    let mut first = request.clone();
    first.overrides.time_step = Some(steps.start);
    let Ready { format, passes, scene: first, stop, backend, annotations, denoise, opening_seconds, .. } =
        Ready::new(&first, &files, job)?;
    in_pool(request.threads, || {
        let renderer = PersistentRenderer::new(&backend)?;
        let watching = Watching { denoise, ..Watching::default() };
        let mut pictures = Vec::new();
        let mut shown = first;
        for ((number, step), picture) in (0..).zip(steps.clone()).zip(files) {
            if step > steps.start {
                shown = at_step(&shown, step, &request.reading, job)?;
            }
            let laid_out = lay_out(&shown, &annotations)?;
            let mut rendered = renderer.render(&shown, &stop, job, watching, &mut |point| {
                watch(number, &stop, point);
            })?;
            if number == 0 {
                rendered.figures.opening_seconds = Some(opening_seconds);
            }
            laid_out.apply(&mut rendered);
            format.write(&picture, &rendered.picture, &passes, request.paths)?;
            pictures.push(NumberedPicture { picture, figures: rendered.figures });
        }
        Ok(pictures)
    })
}

/// Number of time steps of a file, or of the volumes of a scene, which have the same number or one.
fn count_of(path: &Path, reading: &OpenOptions) -> Result<u64> {
    let refuse =
        |what: String| Err(SessionError::Caller(format!("{}: --time-steps: {what}", path.display())));
    let mut counts: Vec<(PathBuf, u64)> = Vec::new();
    if state_at(path)?.is_some() {
        return refuse(
            "a state of Neuroglancer shows one time step; --save-scene makes a scene of it".into(),
        );
    }
    if is_scene_file(path) {
        let scene = Scene::load(path).map_err(|source| SessionError::Scene { path: path.into(), source })?;
        for instance in &scene.instances {
            let count = time_steps_of(&instance.source, &options_for(&instance.reading, reading))?;
            counts.push((instance.source.clone(), count));
        }
    } else {
        counts.push((path.to_owned(), time_steps_of(path, reading)?));
    }
    counts.retain(|(_, count)| *count > 1);
    let Some((file, count)) = counts.first() else {
        return refuse("expected a volume with several time steps, got none".into());
    };
    match counts.iter().find(|(_, other)| other != count) {
        Some((other, n)) => {
            let (file, other) = (file.display(), other.display());
            refuse(format!("{file} has {count} time steps, {other} has {n}: expected the same number"))
        }
        None => Ok(*count),
    }
}

/// A scene at another time step. Volumes without time stay open, and keep what was built of them.
fn at_step(shown: &LoadedScene, step: u32, caller: &OpenOptions, job: &Job) -> Result<LoadedScene> {
    let mut scene = shown.scene().clone();
    set_time_step(&mut scene, step)?;
    let mut volumes = Vec::new();
    for (i, (instance, before)) in scene.instances.iter().zip(&shown.scene().instances).enumerate() {
        // A file that several instances show alike is opened once.
        let alike = scene.instances[..i].iter().position(|other| {
            other.source == instance.source
                && other.reading == instance.reading
                && other.style == instance.style
        });
        volumes.push(match alike {
            Some(earlier) => std::sync::Arc::clone(&volumes[earlier]),
            None if instance.reading == before.reading => std::sync::Arc::clone(&shown.volumes()[i]),
            None => {
                let options = options_for(&instance.reading, &OpenOptions { time: None, ..caller.clone() });
                open_chosen(&instance.source, &[&instance.style.show], &options, Residence::Mapped, job)?
            }
        });
    }
    Ok(LoadedScene::new(scene, volumes, shown.meshes().to_vec())?)
}
