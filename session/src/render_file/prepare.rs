//! Turns the subject of a request into a scene with its volumes and meshes open.

use std::path::Path;

use pumice_core::Job;
use pumice_picture::{Annotations, read_provenance};
use pumice_scene::Show;

use super::open_scene::{OpenedScene, check_files, open_scene};
use super::overrides::apply;
use super::provenance::check_hashes;
use super::request::{RenderRequest, Subject};
use crate::backend::make_renderer;
use crate::error::{Result, SessionError};
use crate::open::{Residence, open_meshes, open_shown};
use crate::progressive::Stop;

/// A scene with its volumes and meshes open, ready to render.
pub(super) struct Prepared {
    pub(super) opened: OpenedScene,
    pub(super) stop: Stop,
    pub(super) backend: String,
    pub(super) annotations: Annotations,
}

/// Opens the subject of a request as a scene with its volumes and meshes.
pub(super) fn prepare(request: &RenderRequest, job: &Job) -> Result<Prepared> {
    match &request.subject {
        Subject::Again(picture) => prepare_again(request, picture, job),
        Subject::File(path) => Ok(Prepared {
            opened: open_scene(path, &request.overrides, &request.reading, job)?,
            stop: request.stop,
            backend: request.backend.clone(),
            annotations: request.annotations.clone(),
        }),
    }
}

/// Opens the scene that a picture carries.
fn prepare_again(request: &RenderRequest, picture: &Path, job: &Job) -> Result<Prepared> {
    request.reading.outputs.check_input(picture)?;
    let made = read_provenance(picture)?.ok_or_else(|| {
        let picture = picture.display();
        SessionError::Caller(format!(
            "{picture}: this picture carries no scene, so it cannot be rendered again"
        ))
    })?;
    check_files(&made.scene, &request.reading)?;
    let instead = request.overrides.labels.clone().map(Show::Only);
    let volumes = open_shown(&made.scene, instead.as_ref(), &request.reading, Residence::Mapped, job)?;
    let meshes = open_meshes(&made.scene)?;
    check_hashes(picture, &made, &volumes, &meshes)?;
    let backend = match request.backend.as_str() {
        "auto" => {
            make_renderer(&made.backend).map_err(|e| {
                let picture = picture.display();
                SessionError::Caller(format!(
                    "{picture}: it was drawn by a backend that is not available here: {e}; name another one for a similar picture"
                ))
            })?;
            made.backend
        }
        named => named.to_owned(),
    };
    let mut scene = made.scene;
    apply(&request.overrides, &mut scene, &volumes)?;
    scene.validate().map_err(|source| SessionError::Scene { path: picture.to_owned(), source })?;
    let stop = Stop { spp: Some(made.spp), ..Stop::default() };
    let annotations = made.annotations;
    Ok(Prepared { opened: OpenedScene { scene, volumes, meshes }, stop, backend, annotations })
}
