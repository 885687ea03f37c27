//! Traces the same rays through every form: those of a camera, and diffuse rays from their hits.

use std::sync::Arc;

use glam::DVec3;
use pumice_core::{CompressedVolume, Job};
use pumice_cpu::traverse::{SceneTracer, TracedInstance, VolumeTracer};
use pumice_encodings::{Encoding, EncodingTracer};
use pumice_session::error::Result;
use pumice_session::measure::Stopwatch;
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Tracer};
use serde::Serialize;

use super::PaperOptions;
use crate::ray_sets::{camera_rays, diffuse_rays, some_labels, voxel_side};

/// Height above the face it leaves at which a diffuse ray starts, in units of the voxel's shortest side. Without it a ray through the
/// paper's forms hits that face again.
const LIFT: f64 = 1e-3;
/// Shares of labels that are shown when hiding is measured, in per cent.
const SHOWN: [u32; 5] = [100, 50, 25, 10, 3];

/// Rates and counts of camera rays and of diffuse rays, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Rates {
    /// Millions of rays per CPU second.
    pub rays: [f64; 2],
    /// Number of rays that hit.
    pub hits: [usize; 2],
    /// Mean number of nodes that a ray reads; 0 if nodes were not counted.
    pub nodes: [f64; 2],
}

/// Rates with some labels shown, in two ways of hiding the others. Pairs are the paper's form, then Pumice's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Hiding {
    /// Share of the labels that are shown, in per cent.
    pub shown: u32,
    /// CPU milliseconds of rebuilding the hierarchy for the shown labels.
    pub rebuild_ms: [f64; 2],
    /// Millions of camera rays per CPU second with the rebuilt hierarchy.
    pub rebuilt: [f64; 2],
    /// Millions of camera rays per CPU second with one hierarchy for all labels, skipping boxes of hidden ones.
    pub discarding: [f64; 2],
}

/// The camera rays and diffuse rays, and the labels that they meet.
pub(super) struct Rays {
    sets: [Vec<RayInWorld>; 2],
    pub(super) visible: Vec<bool>,
    rounds: u32,
}

/// Traces a ray, adds the nodes read to the counter, and returns whether it hits.
type FirstHit<'a> = &'a dyn Fn(&RayInWorld, &mut u64) -> bool;

impl Rays {
    pub(super) fn new(volume: &Arc<CompressedVolume>, options: &PaperOptions) -> Result<Self> {
        let visible = some_labels(volume.labels().len(), options.show);
        let place = volume.info().world_from_index;
        let camera = camera_rays(&place, volume.info().dims, u64::from(options.side.next_multiple_of(8)));
        let scene = SceneTracer::new(&[traced(volume, &visible, LodChoice::Voxels)])?;
        let first = |r: &RayInWorld| Some((*r, scene.first_hit(r, PathOrigin::Free, f64::INFINITY)?));
        let hits: Vec<(RayInWorld, Hit)> = camera.iter().filter_map(first).collect();
        let lift = LIFT * voxel_side(&place);
        let lifted = |(ray, (_, hit)): (RayInWorld, &(RayInWorld, Hit))| {
            let above: DVec3 = lift * hit.normal_in_world.normalize();
            RayInWorld { origin: ray.origin + above, ..ray }
        };
        let diffuse = diffuse_rays(&hits).into_iter().zip(&hits).map(lifted).collect();
        Ok(Self { sets: [camera, diffuse], visible, rounds: options.rounds })
    }

    pub(super) fn counts(&self) -> [usize; 2] {
        [self.sets[0].len(), self.sets[1].len()]
    }

    /// Rates of each tracer for the given sets of rays (0: camera, 1: diffuse). The tracers take turns.
    fn measure(&self, tracers: &[FirstHit<'_>], sets: &[usize], job: &Job) -> Result<Vec<Rates>> {
        let mut all = vec![Rates::default(); tracers.len()];
        for &set in sets {
            let mut best = vec![f64::INFINITY; tracers.len()];
            for _ in 0..self.rounds {
                for (tracer, (rates, best)) in tracers.iter().zip(all.iter_mut().zip(&mut best)) {
                    job.check()?;
                    let mut nodes = 0;
                    let clock = Stopwatch::start();
                    let hits = self.sets[set].iter().filter(|r| tracer(r, &mut nodes)).count();
                    *best = best.min(clock.cpu_seconds());
                    rates.hits[set] = hits;
                    rates.nodes[set] = nodes as f64 / self.sets[set].len().max(1) as f64;
                }
            }
            for (rates, best) in all.iter_mut().zip(best) {
                rates.rays[set] = self.sets[set].len() as f64 / best.max(1e-9) / 1e6;
            }
        }
        Ok(all)
    }

    pub(super) fn rates(&self, tracers: &[EncodingTracer<'_>], job: &Job) -> Result<Vec<Rates>> {
        let ways: Vec<_> = tracers.iter().map(by).collect();
        let ways: Vec<FirstHit<'_>> = ways.iter().map(|w| w as FirstHit<'_>).collect();
        self.measure(&ways, &[0, 1], job)
    }

    /// Rates of Pumice's own form, through voxels and through boxes drawn solid. It is traced without bricks, as the paper's forms are,
    /// since bricks would take additional bytes.
    pub(super) fn ours(&self, volume: &Arc<CompressedVolume>, job: &Job) -> Result<[Rates; 2]> {
        let mut rates = [Rates::default(); 2];
        for (rates, lod) in rates.iter_mut().zip([LodChoice::Voxels, LodChoice::Boxes]) {
            let scene = SceneTracer::without_bricks(&[traced(volume, &self.visible, lod)])?;
            let way =
                |r: &RayInWorld, _: &mut u64| scene.first_hit(r, PathOrigin::Free, f64::INFINITY).is_some();
            *rates = self.measure(&[&way], &[0, 1], job)?[0];
        }
        Ok(rates)
    }

    /// Rates with labels hidden in two ways, by the paper's form and by Pumice's.
    pub(super) fn hiding(
        &self,
        encoding: &Encoding,
        volume: &Arc<CompressedVolume>,
        job: &Job,
    ) -> Result<Vec<Hiding>> {
        let place = volume.info().world_from_index;
        let mut all = Vec::new();
        for shown in SHOWN {
            let visible = some_labels(volume.labels().len(), shown);
            let instance = traced(volume, &visible, LodChoice::Voxels);
            let mut rebuild_ms = [f64::INFINITY; 2];
            for _ in 0..self.rounds {
                let clock = Stopwatch::start();
                EncodingTracer::new(encoding, place, &visible)?;
                rebuild_ms[0] = rebuild_ms[0].min(1e3 * clock.cpu_seconds());
                let clock = Stopwatch::start();
                VolumeTracer::new(0, &instance)?;
                rebuild_ms[1] = rebuild_ms[1].min(1e3 * clock.cpu_seconds());
            }
            let scene = |tracer| SceneTracer::of(vec![Arc::new(tracer)]);
            let theirs = [
                EncodingTracer::new(encoding, place, &visible)?,
                EncodingTracer::discarding(encoding, place, &visible)?,
            ];
            let ours = [
                scene(VolumeTracer::new(0, &instance)?),
                scene(VolumeTracer::with_hidden_labels(0, &instance)?),
            ];
            let ours = ours.each_ref().map(|scene| {
                |r: &RayInWorld, _: &mut u64| scene.first_hit(r, PathOrigin::Free, f64::INFINITY).is_some()
            });
            let theirs = theirs.each_ref().map(by);
            let ways: [FirstHit<'_>; 4] = [&theirs[0], &ours[0], &theirs[1], &ours[1]];
            let rates: Vec<f64> = self.measure(&ways, &[0], job)?.iter().map(|r| r.rays[0]).collect();
            all.push(Hiding {
                shown,
                rebuild_ms,
                rebuilt: [rates[0], rates[1]],
                discarding: [rates[2], rates[3]],
            });
        }
        Ok(all)
    }
}

fn by<'a>(tracer: &'a EncodingTracer<'a>) -> impl Fn(&RayInWorld, &mut u64) -> bool + 'a {
    |ray, nodes| tracer.first_hit(ray, nodes).is_some()
}

fn traced(volume: &Arc<CompressedVolume>, visible: &[bool], lod: LodChoice) -> TracedInstance {
    TracedInstance {
        volume: Arc::clone(volume),
        world_from_index: volume.info().world_from_index,
        visible: visible.to_vec(),
        lod,
    }
}
