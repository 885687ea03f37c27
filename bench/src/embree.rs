//! Traces the same rays through the compressed volume and through Embree, which gets a mesh of the same voxels' faces. The two take turns on
//! one thread.
//!
//! ```text
//! volume, some labels ─┬─► Pumice's bricks, and its boxes alone ────────────► first hits ─┐
//!                      └─► faces as quads ─► bench/embree/rays.c, compiled ─► first hits ─┴─► rates, hits that differ
//! ```
//! The program with Embree reads rays from files and times only the tracing.

mod driver;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use driver::{Driver, build_driver};
use glam::DVec3;
use pumice_core::{CompressedVolume, CompressionLevel, Job};
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_export::{Corners, Interfaces, QuadMesh};
use pumice_formats::OpenOptions;
use pumice_session::error::{Result, SessionError};
use pumice_session::{Residence, open_volume};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Tracer};
use serde::Serialize;

use crate::console::{BenchResult, Console, Outcome};
use crate::files::{file_name, scratch};
use crate::ray_sets::{camera_rays, diffuse_rays, some_labels, voxel_side};
use crate::table::{Row, TableFlags};
use crate::timing::clocked;

/// Rounds of each kind of ray; in each round the programs take turns.
const ROUNDS: usize = 7;
/// Height above the face it leaves at which a ray for Embree starts, in units of the voxel's shortest side. Without it the ray hits that
/// face again.
const LIFT: f64 = 1e-3;
/// Two hits are the same if they lie in one plane within this share of (distance + voxel side), which covers Embree's f32 precision.
const SAME_PLANE: f64 = 1e-4;

/// The same rays through Embree, which gets the voxels' faces as quads
///
/// Traces the rays of a camera and a diffuse ray from each hit, on one thread. Needs Embree 3 and a C compiler.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
    /// Folder with Embree's include and lib, if the system has none
    #[arg(long, value_name = "DIR")]
    embree: Option<PathBuf>,
    /// Pixels of the camera along each side, a multiple of 8
    #[arg(long, value_name = "N", default_value = "1024", value_parser = side)]
    side: u64,
    /// Shares of the labels that are shown, in per cent, one after another
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "15", value_parser = clap::value_parser!(u32).range(1..=100))]
    percent: Vec<u32>,
}

fn side(text: &str) -> std::result::Result<u64, String> {
    let side = text.parse().ok().filter(|n: &u64| (8..=8192).contains(n) && n.is_multiple_of(8));
    side.ok_or_else(|| "expected a multiple of 8 from 8 to 8192".into())
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let folder = scratch()?;
    let driver = build_driver(folder.path(), flags.embree.as_deref())?;
    let mut rows = Vec::new();
    for volume in &flags.table.volumes {
        for &percent in &flags.percent {
            rows.extend(measure_embree(volume, &driver, flags.side, percent, job)?);
        }
    }
    flags.table.show("embree", &rows, console)?;
    Ok(Outcome::Holds)
}

/// Millions of rays per CPU second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rate {
    /// Rate of the fastest round.
    pub best: f64,
    /// Rate of the median round.
    pub median: f64,
}

impl Rate {
    fn of(rays: usize, mut seconds: Vec<f64>) -> Self {
        seconds.sort_by(f64::total_cmp);
        let at = |i: usize| rays as f64 / seconds.get(i).copied().unwrap_or(f64::NAN) / 1e6;
        Self { best: at(0), median: at(seconds.len().saturating_sub(1) / 2) }
    }
}

/// Measurements of one kind of ray in both programs.
#[derive(Clone, Debug, Serialize)]
pub struct EmbreeRays {
    /// The volume's file name.
    pub volume: String,
    /// Share of the labels that are shown, in per cent.
    pub percent: u32,
    /// Boxes of the labels shown.
    pub boxes: usize,
    /// Number of faces in Embree's mesh.
    pub quads: usize,
    /// Bytes of geometry and acceleration structures: Pumice with bricks and boxes, Pumice with boxes only, Embree.
    pub bytes: [u64; 3],
    /// CPU seconds of building Pumice's structures, and Embree's.
    pub build_cpu_seconds: [f64; 2],
    /// `primary` or `bounce`.
    pub kind: &'static str,
    /// Number of rays traced.
    pub rays: usize,
    /// Number of rays that hit something, by Pumice.
    pub hits: usize,
    /// Number of rays for which Pumice and Embree report different hits.
    pub differing: usize,
    /// Rate of Pumice through bricks.
    pub ours: Rate,
    /// Rate of Pumice through boxes only.
    pub boxes_alone: Rate,
    /// Rate of Embree.
    pub embree: Rate,
}

/// Measures camera rays and diffuse rays from their hits on one volume, of which `percent` per cent of the labels are shown. `driver` is the
/// compiled program with Embree.
///
/// # Errors
/// Errors of the volume or of the program with Embree; rays whose hits differ between rounds; the job's cancellation.
pub fn measure_embree(
    path: &Path,
    driver: &Path,
    side: u64,
    percent: u32,
    job: &Job,
) -> Result<Vec<EmbreeRays>> {
    // Open only the shown labels, as a scene does. Embree gets no faces of other labels either.
    let folder = scratch()?;
    let file = |name: &str| folder.path().join(name);
    let volume = open_volume(path, &OpenOptions::default(), Residence::Copied, job)?;
    let visible = some_labels(volume.labels().len(), percent);
    volume.save(&file("volume.pumice"), CompressionLevel::Fast, job)?;
    drop(volume);
    let shown = CompressedVolume::open_labels(&file("volume.pumice"), |_| visible.clone(), job)?;
    let volume = Arc::new(shown);
    let world = volume.info().world_from_index;
    let voxel = voxel_side(&world);

    // Move the volume's middle to the origin, where Embree's f32 coordinates are most exact. Build both.
    let middle = world.transform_point3(DVec3::from(volume.info().dims.map(f64::from)) / 2.0);
    let mesh = QuadMesh::new(&volume, &visible, Interfaces::Outside, Corners::Own, job)?;
    let quads = mesh.quads.len();
    driver::write_mesh(&file("mesh"), &mesh, &world, middle)?;
    drop(mesh);
    let mut embree = Driver::start(driver, &file("mesh"))?;
    let mut moved = world;
    moved.translation -= middle;
    let instance = [TracedInstance {
        volume: Arc::clone(&volume),
        world_from_index: moved,
        visible,
        lod: LodChoice::Voxels,
    }];
    let (bricks, building) = clocked(|| Ok(SceneTracer::new(&instance)?))?;
    let boxes = SceneTracer::without_bricks(&instance)?;

    // Make the camera's rays and a diffuse ray from each hit. Those for Embree start a little above the face.
    let camera = camera_rays(&moved, volume.info().dims, side);
    let first = |r: &RayInWorld| Some((*r, bricks.first_hit(r, PathOrigin::Free, f64::INFINITY)?));
    let hits: Vec<(RayInWorld, Hit)> = camera.iter().filter_map(first).collect();
    let primary = camera.iter().map(|&ray| Ray { ray, lift: DVec3::ZERO, from: PathOrigin::Free }).collect();
    let bounces = diffuse_rays(&hits).into_iter().zip(&hits).map(|(ray, (_, hit))| Ray {
        ray,
        lift: LIFT * voxel * hit.normal_in_world.normalize(),
        from: PathOrigin::Face(hit.surface),
    });
    let kinds: [(&'static str, Vec<Ray>); 2] = [("primary", primary), ("bounce", bounces.collect())];

    let volume_bytes: u64 = volume.resident_parts().iter().map(|p| p.1).sum();
    let mut rows = Vec::new();
    for (kind, rays) in kinds {
        job.check()?;
        driver::write_rays(&file("rays"), &rays)?;
        let compared = compare(&rays, [&bricks, &boxes], &mut embree, &file("rays"), &file("hits"), job)?;
        let theirs = driver::read_hits(&file("hits"), rays.len())?;
        let [ours, boxes_alone, by_embree] = compared.seconds.map(|s| Rate::of(rays.len(), s));
        rows.push(EmbreeRays {
            volume: file_name(path),
            percent,
            boxes: bricks.instance(0).map_or(0, |i| i.boxes()),
            quads,
            bytes: [volume_bytes + bricks.bytes(), volume_bytes + boxes.bytes(), embree.bytes],
            build_cpu_seconds: [building.cpu_seconds, embree.build_cpu_seconds],
            kind,
            rays: rays.len(),
            hits: compared.hits.iter().flatten().count(),
            differing: differing(&rays, &compared.hits, &theirs, voxel),
            ours,
            boxes_alone,
            embree: by_embree,
        });
    }
    embree.end()?;
    Ok(rows)
}

/// A ray for Pumice, and the offset from its origin at which the ray for Embree starts.
pub(crate) struct Ray {
    ray: RayInWorld,
    lift: DVec3,
    from: PathOrigin,
}

/// Pumice's hits, and the CPU seconds of each round through bricks, through boxes only, and by Embree.
struct Compared {
    hits: Vec<Option<Hit>>,
    seconds: [Vec<f64>; 3],
}

fn compare(
    rays: &[Ray],
    [bricks, boxes]: [&SceneTracer; 2],
    embree: &mut Driver,
    rays_file: &Path,
    hits_file: &Path,
    job: &Job,
) -> Result<Compared> {
    let first_hit = |scene: &SceneTracer, r: &Ray| scene.first_hit(&r.ray, r.from, f64::INFINITY);
    let hits: Vec<Option<Hit>> = rays.iter().map(|r| first_hit(bricks, r)).collect();
    let mut seconds = [Vec::new(), Vec::new(), Vec::new()];
    // Keeps of each ray what the program with Embree keeps: distance and what was hit, in memory that is allocated before.
    let mut kept = vec![(f32::INFINITY, u32::MAX); rays.len()];
    for _ in 0..ROUNDS {
        job.check()?;
        for (scene, of) in [(boxes, 1), (bricks, 0)] {
            let ((), took) = clocked(|| {
                for (ray, kept) in rays.iter().zip(&mut kept) {
                    let hit = first_hit(scene, ray);
                    *kept = hit.map_or((f32::INFINITY, u32::MAX), |h| (h.t as f32, h.surface.label));
                }
                Ok(())
            })?;
            seconds[of].push(took.cpu_seconds);
        }
        seconds[2].push(embree.trace(rays_file, hits_file)?);
    }
    let label = |hit: &Option<Hit>| hit.as_ref().map_or(u32::MAX, |h| h.surface.label);
    match hits.iter().zip(&kept).position(|(hit, kept)| label(hit) != kept.1) {
        None => Ok(Compared { hits, seconds }),
        Some(ray) => Err(SessionError::Caller(format!(
            "ray {ray} hits another label in the last round than in the first"
        ))),
    }
}

/// Counts rays for which the two programs differ: only one hits, or their hits do not lie in one plane. Comparing distances would not
/// suffice: a ray that starts above the face it leaves meets a parallel face earlier, all the more at grazing angles.
fn differing(rays: &[Ray], ours: &[Option<Hit>], theirs: &[f64], voxel: f64) -> usize {
    let apart = |ray: &Ray, ours: &Option<Hit>, theirs: f64| match (ours, theirs.is_finite()) {
        (Some(hit), true) => {
            let from_ours_to_theirs = ray.lift + (theirs - hit.t) * ray.ray.direction;
            let off = from_ours_to_theirs.dot(hit.normal_in_world.normalize()).abs();
            off > SAME_PLANE * (hit.t + voxel)
        }
        (ours, theirs) => ours.is_some() != theirs,
    };
    rays.iter().zip(ours).zip(theirs).filter(|((ray, ours), theirs)| apart(ray, ours, **theirs)).count()
}

impl Row for EmbreeRays {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let rate = |r: Rate| format!("{:.3} ({:.3})", r.best, r.median);
        let [ours, boxes_alone, theirs] = self.bytes;
        vec![
            ("volume", self.volume.clone()),
            ("labels shown", format!("{} %", self.percent)),
            ("boxes shown", self.boxes.to_string()),
            ("quads", self.quads.to_string()),
            (
                "bytes: ours, Embree's",
                format!("{ours}, {theirs} ({:.2} %)", 100.0 * ours as f64 / theirs as f64),
            ),
            ("bytes: boxes alone", boxes_alone.to_string()),
            (
                "building: ours, Embree's, CPU s",
                format!("{:.2}, {:.2}", self.build_cpu_seconds[0], self.build_cpu_seconds[1]),
            ),
            ("rays", self.kind.into()),
            ("traced", self.rays.to_string()),
            ("differing hits", self.differing.to_string()),
            ("ours, M/s, best (median)", rate(self.ours)),
            ("boxes alone, M/s, best (median)", rate(self.boxes_alone)),
            ("Embree, M/s, best (median)", rate(self.embree)),
            (
                "ratio, best (median)",
                rate(Rate {
                    best: self.ours.best / self.embree.best,
                    median: self.ours.median / self.embree.median,
                }),
            ),
        ]
    }
}
