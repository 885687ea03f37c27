//! Turns the subject of a request into a scene with its volumes and meshes open.

use std::sync::Arc;

use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_picture::read_provenance;
use pumice_scene::{Scene, Show};

use super::overrides::apply;
use super::provenance::check_hashes;
use super::request::{RenderRequest, Subject};
use crate::backend::make_renderer;
use crate::error::{Result, SessionError, io};
use crate::figure::{FigureOptions, compose};
use crate::open::{Residence, open_chosen, open_meshes, open_shown};
use crate::progressive::Stop;
use crate::selection::select_labels;

/// A scene with its volumes and meshes open, ready to render.
pub(crate) struct Prepared {
    pub(crate) scene: Scene,
    pub(crate) volumes: Vec<Arc<CompressedVolume>>,
    pub(crate) meshes: Vec<Arc<MeshData>>,
    pub(super) stop: Stop,
    pub(super) backend: String,
}

/// Opens the subject of a request as a scene with its volumes and meshes.
pub(crate) fn prepare(request: &RenderRequest, job: &Job) -> Result<Prepared> {
    let instead = request.overrides.labels.clone().map(Show::Only);
    let open_all =
        |scene: &Scene| open_shown(scene, instead.as_ref(), &request.reading, Residence::Mapped, job);
    let (mut scene, volumes, meshes, stop, backend) = match &request.subject {
        Subject::Again(picture) => {
            let made = read_provenance(picture)?.ok_or_else(|| {
                let picture = picture.display();
                SessionError::Caller(format!(
                    "{picture}: this picture carries no scene, so it cannot be rendered again"
                ))
            })?;
            let volumes = open_all(&made.scene)?;
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
            (made.scene, volumes, meshes, Stop { spp: Some(made.spp), ..Stop::default() }, backend)
        }
        Subject::File(path) if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) => {
            let scene =
                Scene::load(path).map_err(|source| SessionError::Scene { path: path.clone(), source })?;
            let (volumes, meshes) = (open_all(&scene)?, open_meshes(&scene)?);
            (scene, volumes, meshes, request.stop, request.backend.clone())
        }
        Subject::File(path) => {
            // `pick` chooses by the shape of labels and compares all of them, so all are read.
            let shows = instead.as_ref().unwrap_or(&Show::All);
            let volume = open_chosen(path, &[shows], &request.reading, Residence::Mapped, job)?;
            let options = FigureOptions {
                size: request.overrides.size.unwrap_or([960, 540]),
                labels: request.overrides.pick.map(|n| select_labels(&volume, n)),
                view_deg: request.overrides.view_deg.unwrap_or(FigureOptions::DEFAULT_VIEW_DEG),
            };
            let options = match &request.overrides.labels {
                None => options,
                Some(ids) => FigureOptions { labels: Some(dense_labels(&volume, ids)?), ..options },
            };
            let absolute = path.canonicalize().map_err(io(path))?;
            let scene = compose(&volume, absolute, &options);
            (scene, vec![volume], Vec::new(), request.stop, request.backend.clone())
        }
    };
    apply(&request.overrides, &mut scene, &volumes)?;
    let path = match &request.subject {
        Subject::File(path) | Subject::Again(path) => path.clone(),
    };
    scene.validate().map_err(|source| SessionError::Scene { path, source })?;
    Ok(Prepared { scene, volumes, meshes, stop, backend })
}

fn dense_labels(volume: &CompressedVolume, ids: &[u64]) -> Result<Vec<u32>> {
    let dense = |&id: &u64| {
        let index = volume.labels().index_of(id);
        index.ok_or_else(|| SessionError::Caller(format!("--labels: the volume has no label {id}")))
    };
    ids.iter().map(dense).collect()
}
