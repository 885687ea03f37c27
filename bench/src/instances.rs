//! Measures the cost of many instances: CPU seconds per sample when a ray tests one instance after another, and when a hierarchy over the
//! instances finds them; and of instances of glass, with and without the short rays that ask at each surface that a path leaves whether
//! another volume begins there (`cpu-renderer/src/crossing.rs`).
//!
//! Copies of 32 long labels of a volume, or of a ball of 2,048 triangles, lie side by side on a square, each rotated differently, and are
//! seen obliquely from above, under a constant sky with three bounces, those of glass with eight. Both ways must render the same film, bit
//! for bit: the copies stand apart, so the short rays find nothing, and what they cost is all that they change. Times are CPU
//! seconds of the process, the least of several samples; the two ways take turns.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_cpu::path::Surroundings;
use pumice_cpu::path_tracer::PathTracer;
use pumice_cpu::traverse::{MeshTracer, SceneTracer, TracedInstance, VolumeTracer};
use pumice_formats::OpenOptions;
use pumice_scene::{Camera, Film, Filter, Material, Projection, Settings};
use pumice_session::error::{Result, SessionError};
use pumice_session::selection::select_labels;
use pumice_session::{Residence, open_volume};
use pumice_transport::geometry::{Contacts, LodChoice, Placement};
use pumice_transport::{Lights, MaterialTable, Sky};
use serde::Serialize;

use crate::console::{BenchResult, Console, Outcome};
use crate::files::file_name;
use crate::table::{Row, TableFlags};
use crate::timing::clocked;

/// Width and height of the picture. A larger one would take minutes where a ray tests thousands of instances one after another.
const SIZE: [u32; 2] = [160, 90];
/// Numbers of instances that are measured.
const COUNTS: [usize; 11] = [1, 2, 3, 4, 6, 8, 16, 64, 256, 1024, 4096];
/// Largest number of samples of each way.
const MOST_SAMPLES: u32 = 40;
/// CPU seconds after which no further sample is taken.
const MOST_SECONDS: f64 = 30.0;
/// The argument that selects the ball of triangles instead of a volume.
const MESH: &str = "mesh";

/// Cost per sample of many instances, tested one after another or found by a hierarchy
///
/// The word `mesh` instead of a volume selects a ball of 2,048 triangles.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let mut rows = Vec::new();
    for what in &flags.table.volumes {
        let what = if what == Path::new(MESH) { Subject::Ball } else { Subject::Volume(what.clone()) };
        rows.extend(measure_instances(&what, job)?);
    }
    flags.table.show("instances", &rows, console)?;
    Ok(Outcome::Holds)
}

/// The object that the scene has many instances of.
#[derive(Clone, Debug)]
pub enum Subject {
    /// The longest labels of a label volume.
    Volume(PathBuf),
    /// A ball of triangles.
    Ball,
}

/// Measurements for one number of instances.
#[derive(Clone, Debug, Serialize)]
pub struct InstanceCost {
    /// The volume's file name, or `mesh`.
    pub what: String,
    /// Number of instances.
    pub count: usize,
    /// CPU seconds per sample if rays test one instance after another.
    pub in_turn_cpu_seconds: f64,
    /// CPU seconds per sample if rays find instances through a hierarchy.
    pub by_tree_cpu_seconds: f64,
    /// CPU seconds per sample of instances of glass, without and with short rays; `None` for meshes, which need none.
    pub glass_cpu_seconds: Option<[f64; 2]>,
    /// CPU seconds of building the hierarchy over the instances.
    pub tree_build_cpu_seconds: f64,
    /// Bytes of that hierarchy.
    pub tree_bytes: u64,
    /// Bytes of all hierarchies, those within instances included.
    pub hierarchy_bytes: u64,
}

/// Measures each of the numbers of instances.
///
/// # Errors
/// Errors of opening and tracing; a film that differs between the two ways; the job's cancellation.
pub fn measure_instances(what: &Subject, job: &Job) -> Result<Vec<InstanceCost>> {
    let (name, shape) = match what {
        Subject::Ball => (MESH.to_owned(), Shape::Mesh(Arc::new(ball(4)?))),
        Subject::Volume(path) => {
            let volume = open_volume(path, &OpenOptions::default(), Residence::Copied, job)?;
            (file_name(path), Shape::Volume(volume))
        }
    };
    COUNTS.iter().map(|&count| measure(&name, &shape, count, job)).collect()
}

enum Shape {
    Volume(Arc<CompressedVolume>),
    Mesh(Arc<MeshData>),
}

impl Shape {
    /// Centres a copy and scales its longest side to 1.
    fn unit(&self) -> DAffine3 {
        match self {
            Self::Volume(volume) => {
                let dims = DVec3::from(volume.info().dims.map(f64::from));
                DAffine3::from_scale(DVec3::splat(1.0 / dims.max_element()))
                    * DAffine3::from_translation(-0.5 * dims)
            }
            Self::Mesh(_) => DAffine3::IDENTITY,
        }
    }

    /// A scene with a copy at each of these places. Each copy is centred and its longest side is at most 1.
    fn copies(&self, places: &[DAffine3]) -> Result<SceneTracer> {
        let numbered = || (0u32..).zip(places);
        match self {
            Self::Volume(volume) => {
                let mut visible = vec![false; volume.labels().len()];
                select_labels(volume, 32).into_iter().for_each(|label| visible[label as usize] = true);
                let unit = self.unit();
                let (volume, world_from_index, lod) = (Arc::clone(volume), unit, LodChoice::Voxels);
                let first = VolumeTracer::new(0, &TracedInstance { volume, world_from_index, visible, lod })?;
                let mut copies = Vec::new();
                for (number, place) in numbered() {
                    let copy = first.again(number, *place * unit, lod)?;
                    let other = || {
                        SessionError::Caller(
                            "a copy of an instance has another level of detail than the first one".into(),
                        )
                    };
                    copies.push(Arc::new(copy.ok_or_else(other)?));
                }
                Ok(SceneTracer::of(copies))
            }
            Self::Mesh(mesh) => {
                let first = MeshTracer::new(0, 0, mesh, DAffine3::IDENTITY)?;
                let mut copies = Vec::new();
                for (number, place) in numbered() {
                    copies.push(Arc::new(first.again(number, number, *place)?));
                }
                Ok(SceneTracer::of(Vec::new()).with_meshes(copies))
            }
        }
    }
}

/// A ball of diameter 1: an octahedron whose triangles are split into four, `times` times, with all corners moved onto the sphere.
fn ball(times: usize) -> Result<MeshData> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut triangles: Vec<[DVec3; 3]> = (0..8)
        .map(|octant| [0, 1, 2].map(|a| if octant >> a & 1 == 0 { axes[a] } else { -axes[a] }))
        .collect();
    for _ in 0..times {
        let cut = |&[a, b, c]: &[DVec3; 3]| {
            let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.iter().flat_map(cut).collect();
    }
    let corners = triangles.iter().flatten().map(|p| (0.5 * *p).to_array()).collect();
    let numbers = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    MeshData::new(corners, numbers, Vec::new()).map_err(|e| SessionError::Caller(format!("{MESH}: {e}")))
}

fn measure(name: &str, shape: &Shape, count: usize, job: &Job) -> Result<InstanceCost> {
    // Lay the copies out on a square and look at it obliquely.
    let columns = (count as f64).sqrt().ceil() as usize;
    let reach = 1.1 * columns as f64;
    let places: Vec<DAffine3> = (0..count)
        .map(|i| {
            let at = DVec3::new((i % columns) as f64, (i / columns) as f64, 0.0) + 0.5;
            let turned = DMat3::from_rotation_z(2.4 * i as f64) * DMat3::from_rotation_x(1.1 * i as f64);
            DAffine3::from_mat3_translation(turned, 1.1 * at - 0.5 * reach)
        })
        .collect();
    let eye = DVec3::new(0.0, -1.3, 1.0) * reach.max(1.5);
    let (back, right) = (eye.normalize(), DVec3::X);
    let world_from_camera =
        DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), eye);
    let camera = Camera::new(world_from_camera, Projection::Perspective { fov_rad: 0.6 });
    let film = Film::new(SIZE[0], SIZE[1], Filter::BlackmanHarris { width: 3.0 });

    // Build the hierarchy over the copies.
    let copies = shape.copies(&places)?;
    let ((by_tree, _), building) = clocked(|| Ok(copies.with_tree(1)?))?;
    let (tree_bytes, hierarchy_bytes) = (by_tree.tree().map_or(0, |tree| tree.bytes()), by_tree.bytes());

    // Render both ways.
    let material = Material { base_color: [0.7; 3], specular: 0.0, roughness: 1.0, ..Material::default() };
    let around = |material, bounces| Surroundings {
        lights: Arc::new(Lights::new(Sky::Constant(Vec3::ONE), Vec::new(), None)),
        materials: std::iter::repeat_n(Arc::new(MaterialTable::same(material)), count)
            .collect::<Vec<_>>()
            .into(),
        settings: Settings { bounces, ..Settings::default() },
    };
    let dull = around(material, 3);
    let way = |tracer, around: &Surroundings| PathTracer::new(tracer, around.clone(), &camera, &film);
    let what = format!("{name}, {count} instances");
    let ways = [way(shape.copies(&places)?, &dull)?, way(by_tree, &dull)?];
    let [in_turn, by_tree] = in_turns(ways, &format!("{what}, with and without a hierarchy over them"), job)?;

    // The same of glass, without and with contacts.
    let mut glass_cpu_seconds = None;
    if let Shape::Volume(_) = shape {
        let glass =
            Material { base_color: [0.9; 3], transmission: 1.0, roughness: 0.0, ior: 1.3, ..material };
        let glass = around(glass, 8);
        let copies = || -> Result<SceneTracer> {
            Ok(shape.copies(&places)?.with_tree(pumice_scene::INSTANCES_OF_A_TREE)?.0)
        };
        // Each copy is a body of its own. (A copy that could not be placed would have been refused above.)
        let placements = places.iter().filter_map(|place| Placement::new(*place * shape.unit()));
        let contacts = Contacts::of(placements, (0..count as u32).collect());
        let ways = [way(copies()?, &glass)?, way(copies()?.with_contacts(Some(contacts)), &glass)?];
        let what = format!("{what} of glass, with and without contacts");
        glass_cpu_seconds = Some(in_turns(ways, &what, job)?);
    }
    Ok(InstanceCost {
        what: name.to_owned(),
        count,
        in_turn_cpu_seconds: in_turn,
        by_tree_cpu_seconds: by_tree,
        glass_cpu_seconds,
        tree_build_cpu_seconds: building.cpu_seconds,
        tree_bytes,
        hierarchy_bytes,
    })
}

/// The least CPU seconds per sample of two ways to render the same film, which take turns: fewer samples, the longer a sample takes.
fn in_turns(mut ways: [PathTracer<SceneTracer>; 2], what: &str, job: &Job) -> Result<[f64; 2]> {
    let mut least = [f64::INFINITY; 2];
    let mut spent = 0.0;
    for sample in 1..=MOST_SAMPLES {
        for (way, least) in ways.iter_mut().zip(&mut least) {
            let (_, took) = clocked(|| Ok(way.add_samples(sample, job)?))?;
            (*least, spent) = (least.min(took.cpu_seconds), spent + took.cpu_seconds);
        }
        if spent > MOST_SECONDS {
            break;
        }
    }
    let [one, other] = &ways;
    if one.film().sums() != other.film().sums() {
        return Err(SessionError::Caller(format!("{what}: the films differ")));
    }
    Ok(least)
}

impl Row for InstanceCost {
    fn cells(&self) -> Vec<(&'static str, String)> {
        vec![
            ("what", self.what.clone()),
            ("instances", self.count.to_string()),
            ("in turn, CPU s a sample", format!("{:.5}", self.in_turn_cpu_seconds)),
            ("by a hierarchy, CPU s a sample", format!("{:.5}", self.by_tree_cpu_seconds)),
            ("of glass, CPU s a sample", seconds_of(self.glass_cpu_seconds.map(|[without, _]| without))),
            ("of glass in contact, CPU s a sample", seconds_of(self.glass_cpu_seconds.map(|[_, with]| with))),
            ("building it, CPU s", format!("{:.6}", self.tree_build_cpu_seconds)),
            ("its bytes", self.tree_bytes.to_string()),
            ("all hierarchies, bytes", self.hierarchy_bytes.to_string()),
        ]
    }
}

/// Seconds as a cell, a dash where there are none.
fn seconds_of(seconds: Option<f64>) -> String {
    seconds.map_or_else(|| "–".to_owned(), |seconds| format!("{seconds:.5}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_of_triangles_is_measured_both_ways() {
        let shape = Shape::Mesh(Arc::new(ball(1).unwrap()));
        let cost = measure("mesh", &shape, 5, &Job::new()).unwrap();
        assert!(cost.count == 5 && cost.tree_bytes > 0 && cost.hierarchy_bytes > cost.tree_bytes, "{cost:?}");
        assert!(cost.in_turn_cpu_seconds > 0.0 && cost.by_tree_cpu_seconds > 0.0, "{cost:?}");
        assert_eq!((cost.glass_cpu_seconds, cost.cells()[4].1.as_str()), (None, "–"));
    }

    #[test]
    fn a_volume_of_glass_is_measured_with_and_without_contacts() {
        let (_, blobs) = pumice_oracle::volumes::blobs([12, 12, 12], 6, 4, 3);
        let cost = measure("blobs", &Shape::Volume(blobs), 3, &Job::new()).unwrap();
        assert!(cost.glass_cpu_seconds.unwrap().iter().all(|&seconds| seconds > 0.0), "{cost:?}");
    }
}
