//! Measures the traversal alone, on one thread: rays of a camera that sees the whole volume, then one diffuse ray from each hit, then a
//! shadow ray along the same path.

use std::sync::Arc;

use pumice_core::{CompressedVolume, Job};
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_session::error::Result;
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Tracer};
use serde::Serialize;

use crate::ray_sets::{camera_rays, diffuse_rays, some_labels};
use crate::timing::{Took, clocked};

/// Share of the labels that are shown, in per cent.
pub(super) const SHOWN_PERCENT: u32 = 15;
/// Pixels of the camera along each side.
pub(super) const SIDE: u64 = 1024;

/// Measurements of one kind of ray.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RaySpeed {
    /// Number of rays traced.
    pub rays: usize,
    /// Number of rays that hit something.
    pub hits: usize,
    /// Millions of rays per CPU second.
    pub millions_per_cpu_second: f64,
}

impl RaySpeed {
    fn of(rays: usize, hits: usize, took: Took) -> Self {
        Self { rays, hits, millions_per_cpu_second: rays as f64 / took.cpu_seconds / 1e6 }
    }
}

/// Measures camera rays, diffuse rays from their hits, and shadow rays along the diffuse rays, with `percent` per cent of the labels shown.
/// The camera has `side` × `side` pixels; `side` is a multiple of 8.
///
/// # Errors
/// Errors of building the hierarchy; the job's cancellation.
pub fn measure_rays(
    volume: &Arc<CompressedVolume>,
    percent: u32,
    side: u64,
    job: &Job,
) -> Result<[RaySpeed; 3]> {
    let world_from_index = volume.info().world_from_index;
    let scene = SceneTracer::new(&[TracedInstance {
        volume: Arc::clone(volume),
        world_from_index,
        visible: some_labels(volume.labels().len(), percent),
        lod: LodChoice::Voxels,
    }])?;
    let camera = camera_rays(&world_from_index, volume.info().dims, side);
    let (hits, camera_took) = clocked(|| {
        let first = |r: &RayInWorld| Some((*r, scene.first_hit(r, PathOrigin::Free, f64::INFINITY)?));
        Ok(camera.iter().filter_map(first).collect::<Vec<(RayInWorld, Hit)>>())
    })?;
    job.check()?;

    let from = hits.iter().map(|(_, hit)| PathOrigin::Face(hit.surface));
    let onward: Vec<(RayInWorld, PathOrigin)> = diffuse_rays(&hits).into_iter().zip(from).collect();
    let (diffuse, diffuse_took) = clocked(|| {
        Ok(onward.iter().filter(|(r, from)| scene.first_hit(r, *from, f64::INFINITY).is_some()).count())
    })?;
    job.check()?;
    let (occluded, shadow_took) =
        clocked(|| Ok(onward.iter().filter(|(r, from)| scene.occluded(r, *from, f64::INFINITY)).count()))?;
    Ok([
        RaySpeed::of(camera.len(), hits.len(), camera_took),
        RaySpeed::of(onward.len(), diffuse, diffuse_took),
        RaySpeed::of(onward.len(), occluded, shadow_took),
    ])
}
