//! Opens an earlier picture to render it again: the scene that it carries, from the files that it was made of.
//!
//! A picture may come from anybody, so nothing in it is trusted: its scene is validated, and its film's size compared with the free memory,
//! before a file is opened; the hashes of its volumes, meshes and sky are complete and agree with the files before a sample is drawn.

use std::path::{Path, PathBuf};

use pumice_core::Job;
use pumice_core::memory::available_bytes;
use pumice_core::reserve::size_text;
use pumice_picture::{Denoiser, Provenance, film_memory, read_provenance};
use pumice_scene::{Scene, Show};
use pumice_transport::scene_plan::sums_of;

use super::open_scene::{OpenedScene, check_files};
use super::overrides::apply;
use super::prepare::Prepared;
use super::provenance::{check_hashes, check_sky, other_labels};
use super::request::RenderRequest;
use crate::backend::make_renderer;
use crate::denoise::{Filter, Oidn};
use crate::error::{Result, SessionError};
use crate::open::{Residence, open_meshes, open_shown};
use crate::progressive::Stop;
use crate::reading::record;

/// Opens the scene that a picture carries.
///
/// # Errors
/// One line that names the picture, and what in it or beside it does not allow the same pixels.
pub(super) fn prepare_again(request: &RenderRequest, picture: &Path, job: &Job) -> Result<Prepared> {
    let at = picture.display();
    request.reading.outputs.check_input(picture)?;
    let mut made = read_provenance(picture)?.ok_or_else(|| {
        SessionError::Caller(format!("{at}: this picture carries no scene, so it cannot be rendered again"))
    })?;
    place_sources(picture, &mut made.scene, &request.sources)?;
    check_files(&made.scene, &request.reading)?;
    check_made(picture, &made, available_bytes())?;

    let (denoise, mut notices) = same_filter(made.denoised)?;

    // Open what it was made from, and nothing else.
    check_sky(picture, &made)?;
    let instead = request.overrides.labels.clone().map(Show::Only);
    let residence = Residence::within(request.memory_limit_bytes);
    let volumes = open_shown(&made.scene, instead.as_ref(), &request.reading, residence, job)?;
    let meshes = open_meshes(&made.scene)?;
    check_hashes(picture, &made, &volumes, &meshes)?;
    if instead.is_none() {
        notices.extend(other_labels(&made, &volumes));
    }

    let backend = match request.backend.as_str() {
        "auto" => {
            make_renderer(&made.backend).map_err(|e| {
                SessionError::Caller(format!(
                    "{at}: it was drawn by a backend that is not available here: {e}; name another one for a similar picture"
                ))
            })?;
            made.backend
        }
        named => named.to_owned(),
    };
    let annotations = made.annotations;
    let mut scene = made.scene;
    record(&mut scene, &request.reading);
    apply(&request.overrides, &mut scene, &volumes)?;
    scene.validate().map_err(|source| SessionError::Scene { path: picture.to_owned(), source })?;
    let stop = Stop { spp: Some(made.spp), seconds: request.stop.seconds, ..Stop::default() };
    let opened = OpenedScene { scene, volumes, meshes };
    Ok(Prepared { opened, stop, backend, annotations, denoise, notices })
}

/// The filter that a picture went through, from this machine and never from a path in the picture, and a line if it has another version.
fn same_filter(denoised: Option<Denoiser>) -> Result<(Option<Filter>, Vec<String>)> {
    let Some(denoiser) = denoised else { return Ok((None, Vec::new())) };
    let Denoiser::OpenImageDenoise(_) = denoiser else {
        return Ok((Some(Filter::Statistical), Vec::new()));
    };
    let oidn = Oidn::find(None)?;
    let here = oidn.denoiser();
    let notices = (here != denoiser).then(|| {
        format!(
            "denoised by {}, and the earlier picture by {}: it is not the same picture",
            here.name(),
            denoiser.name()
        )
    });
    Ok((Some(Filter::Oidn(oidn)), notices.into_iter().collect()))
}

/// Gives the scene the caller's `sources` in place of the paths that the picture holds, if there are any.
fn place_sources(picture: &Path, scene: &mut Scene, sources: &[PathBuf]) -> Result<()> {
    let fields: Vec<String> = scene.paths().into_iter().map(|(field, _)| field).collect();
    let refuse = |what: String| {
        let (at, n, fields) = (picture.display(), fields.len(), fields.join(", "));
        Err(SessionError::Caller(format!("{at}: {what}; name {n} by --source, in this order: {fields}")))
    };
    if sources.is_empty() {
        let is_unnamed = scene.paths().iter().any(|(_, path)| path.as_os_str().is_empty());
        return if is_unnamed { refuse("it does not say where its files are".into()) } else { Ok(()) };
    }
    if sources.len() != fields.len() {
        return refuse(format!("expected {} files, got {}", fields.len(), sources.len()));
    }
    for (path, source) in scene.paths_mut().zip(sources) {
        *path = std::path::absolute(source).map_err(crate::error::io(source))?;
    }
    Ok(())
}

/// Checks what a picture says of itself. `free_bytes` is the memory that the film may take, where the system tells it.
fn check_made(picture: &Path, made: &Provenance, free_bytes: Option<u64>) -> Result<()> {
    made.scene.validate().map_err(|source| SessionError::Scene { path: picture.to_owned(), source })?;
    let refuse = |what: String| Err(SessionError::Caller(format!("{}: {what}", picture.display())));
    let counts = [
        ("volume", made.scene.instances.len(), made.volume_hashes.len()),
        ("mesh", made.scene.meshes.len(), made.mesh_hashes.len()),
    ];
    for (what, expected, got) in counts {
        if expected != got {
            return refuse(format!("expected a hash of each {what}, {expected} in all, got {got}"));
        }
    }
    if made.spp == 0 {
        return refuse("expected at least 1 sample a pixel (spp), got 0".into());
    }
    let film = &made.scene.film;
    let scene = &made.scene;
    let bytes = film_memory::bytes_of(film, sums_of(scene), scene.settings.adaptive);
    match free_bytes {
        Some(free) if bytes > free => refuse(format!(
            "film: a picture of {} × {} pixels needs {} of memory, {} are free",
            film.width,
            film.height,
            size_text(bytes),
            size_text(free)
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::fakes::scene;

    fn made() -> Provenance {
        let scene = scene([4, 2]);
        Provenance {
            version: "0".into(),
            backend: "cpu".into(),
            volume_hashes: vec![String::new(); scene.scene().instances.len()],
            label_hashes: Vec::new(),
            mesh_hashes: vec![String::new(); scene.scene().meshes.len()],
            scene: scene.scene().clone(),
            sky_hash: None,
            annotations: Default::default(),
            spp: 1,
            error_estimate: None,
            denoised: None,
        }
    }

    fn line(change: impl FnOnce(&mut Provenance)) -> String {
        let mut made = made();
        change(&mut made);
        check_made(Path::new("a.exr"), &made, Some(10_000)).unwrap_err().to_string()
    }

    #[test]
    fn a_picture_that_leaves_out_what_is_checked_is_refused() {
        assert!(check_made(Path::new("a.exr"), &made(), Some(10_000)).is_ok());
        assert_eq!(
            line(|made| made.volume_hashes.push(String::new())),
            "a.exr: expected a hash of each volume, 1 in all, got 2"
        );
        assert!(line(|made| made.volume_hashes.clear()).ends_with("1 in all, got 0"));
        assert!(line(|made| made.mesh_hashes.push(String::new())).contains("hash of each mesh"));
        assert!(line(|made| made.spp = 0).ends_with("(spp), got 0"));
        assert!(line(|made| made.scene.film.width = 0).contains("film.width"));
        let large = line(|made| made.scene.film.height = 400);
        assert!(large.starts_with("a.exr: film: a picture of 4 × 400 pixels needs "), "{large}");
        assert!(large.ends_with(" kB of memory, 10.0 kB are free"), "{large}");
    }
}
