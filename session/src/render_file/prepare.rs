//! Turns the subject of a request into a scene with its volumes and meshes open.

use pumice_core::Job;
use pumice_picture::Annotations;

use super::again::prepare_again;
use super::open_scene::{OpenedScene, open_scene};
use super::request::{RenderOverrides, RenderRequest, Subject};
use crate::denoise::Filter;
use crate::error::Result;
use crate::figure::FigureFlags;
use crate::open::Residence;
use crate::progressive::Stop;

/// A scene with its volumes and meshes open, ready to render.
pub(super) struct Prepared {
    pub(super) opened: OpenedScene,
    pub(super) stop: Stop,
    pub(super) backend: String,
    pub(super) annotations: Annotations,
    pub(super) denoise: Option<Filter>,
    /// What a user may not expect of the picture, one line each.
    pub(super) notices: Vec<String>,
}

/// Opens the subject of a request as a scene with its volumes and meshes. The filter of an earlier picture takes the place of `denoise`.
pub(super) fn prepare(request: &RenderRequest, denoise: Option<Filter>, job: &Job) -> Result<Prepared> {
    match &request.subject {
        Subject::Again(picture) => prepare_again(request, picture, job),
        Subject::File(path) => {
            let residence = Residence::within(request.memory_limit_bytes);
            let opened = open_scene(path, &beside_legend(request), &request.reading, residence, job)?;
            Ok(Prepared {
                notices: Vec::new(),
                opened,
                stop: request.stop,
                backend: request.backend.clone(),
                annotations: request.annotations.clone(),
                denoise,
            })
        }
    }
}

/// The overrides of a request, with a figure that is framed beside the legend that the picture gets.
fn beside_legend(request: &RenderRequest) -> RenderOverrides {
    let (wishes, annotations) = (&request.overrides, &request.annotations);
    let figure = FigureFlags { legend: annotations.legend, dpi: annotations.dpi, ..wishes.figure.clone() };
    RenderOverrides { figure, ..wishes.clone() }
}
