//! Renders a turntable: pictures from around the vertical axis, with one renderer that keeps its hierarchies from one to the next.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use pumice_core::Job;
use pumice_transport::LoadedScene;
use serde::Serialize;

use super::render_scene::RenderFigures;
use super::request::RenderRequest;
use super::{Ready, in_pool};
use crate::annotations::lay_out;
use crate::error::{Result, SessionError};
use crate::figure::turned;
use crate::persistent_renderer::{PersistentRenderer, Watching};
use crate::progressive::{CurvePoint, Stop};

/// A picture of a turntable or of an animation.
#[derive(Clone, Debug, Serialize)]
pub struct NumberedPicture {
    /// Its file.
    pub picture: PathBuf,
    /// Its cost and error.
    #[serde(flatten)]
    pub figures: RenderFigures,
}

/// Renders the pictures that `request.overrides.figure.turntable` asks for. Picture k of N shows the scene from k − 1 Nths of a turn around the
/// vertical axis, counter-clockwise from above; only the camera moves. `OUT.png` stands for the files `OUT_0001.png`, `OUT_0002.png` and so
/// on. After every slice it calls `watch` with the number of the picture, counted from 0, the limits in force and the progress.
///
/// # Errors
/// As [`render_file`](super::render_file). Pictures that are finished stay.
pub fn render_turntable(
    request: &RenderRequest,
    job: &Job,
    watch: &mut (dyn FnMut(u32, &Stop, &CurvePoint) + Send),
) -> Result<Vec<NumberedPicture>> {
    let count =
        request.overrides.figure.turntable.ok_or_else(|| {
            SessionError::Caller("--turntable: expected a number of pictures, got none".into())
        })?;
    let files: Vec<PathBuf> = (0..count).map(|number| numbered(&request.out, number)).collect();
    let Ready { format, passes, scene: first, stop, backend, annotations, denoise, opening_seconds, .. } =
        Ready::new(request, &files, job)?;
    in_pool(request.threads, || {
        let renderer = PersistentRenderer::new(&backend)?;
        let watching = Watching { denoise, ..Watching::default() };
        let mut pictures = Vec::new();
        for (number, picture) in (0..count).zip(files) {
            let angle_rad = TAU * f64::from(number) / f64::from(count);
            let scene = LoadedScene::new(
                turned(first.scene(), angle_rad),
                first.volumes().to_vec(),
                first.meshes().to_vec(),
            )?;
            let laid_out = lay_out(&scene, &annotations)?;
            let mut rendered = renderer.render(&scene, &stop, job, watching, &mut |point| {
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

/// `OUT_0001.png` for the first picture of `OUT.png`.
pub(super) fn numbered(out: &Path, number: u32) -> PathBuf {
    let mut name = out.file_stem().unwrap_or_default().to_owned();
    name.push(format!("_{:04}", number + 1));
    if let Some(extension) = out.extension() {
        name.push(".");
        name.push(extension);
    }
    out.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_numbered_from_one() {
        assert_eq!(numbered(Path::new("a/b.c.png"), 0), Path::new("a/b.c_0001.png"));
        assert_eq!(numbered(Path::new("turn.exr"), 12_344), Path::new("turn_12345.exr"));
    }
}
