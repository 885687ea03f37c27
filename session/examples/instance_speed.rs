//! What many instances cost: CPU seconds a sample where they are asked in turn and where a hierarchy over them finds them.
//!
//! `instance_speed VOLUME|mesh WIDTHxHEIGHT COUNT[,COUNT…]` lays copies of the figure of 32 long labels, or of a ball of 2,048 triangles,
//! side by side on a square, each turned another way, and looks at all of them from above at a slant: an even sky, three bounces. Both
//! ways must draw the same film, bit for bit. Seconds are the process's own, the least of several samples, the two ways in turn.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_core::{CompressedVolume, MeshData};
use pumice_cpu::path::Surroundings;
use pumice_cpu::path_tracer::PathTracer;
use pumice_cpu::traverse::{MeshTracer, SceneTracer, TracedInstance, VolumeTracer};
use pumice_scene::{Camera, Film, Filter, Material, Projection, Settings};
use pumice_session::selection::select_labels;
use pumice_session::{Job, OpenOptions, Residence, Stopwatch, open_volume};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Lights, Looks, Sky};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, what, size, counts] = arguments.as_slice() else {
        return Err("usage: instance_speed VOLUME|mesh WIDTHxHEIGHT COUNT[,COUNT...]".into());
    };
    let (width, height) = size.split_once('x').ok_or("a size such as 160x90")?;
    let film = Film::new(width.parse()?, height.parse()?, Filter::BlackmanHarris { width: 3.0 });
    let shape = match what.as_str() {
        "mesh" => Shape::Mesh(Arc::new(ball(4)?)),
        path => Shape::Volume(open_volume(
            &PathBuf::from(path),
            &OpenOptions::default(),
            Residence::Copied,
            &Job::new(),
        )?),
    };
    for count in counts.split(',') {
        measure(&shape, count.parse()?, &film)?;
    }
    Ok(())
}

enum Shape {
    Volume(Arc<CompressedVolume>),
    Mesh(Arc<MeshData>),
}

impl Shape {
    /// Copies at these places, each about the origin of its own, 1 long at most.
    fn copies(&self, places: &[DAffine3]) -> Result<SceneTracer, Failure> {
        let numbered = || (0u32..).zip(places);
        match self {
            Self::Volume(volume) => {
                let mut visible = vec![false; volume.labels().len()];
                select_labels(volume, 32).into_iter().for_each(|label| visible[label as usize] = true);
                let dims = DVec3::from(volume.info().dims.map(f64::from));
                let unit = DAffine3::from_scale(DVec3::splat(1.0 / dims.max_element()))
                    * DAffine3::from_translation(-0.5 * dims);
                let (volume, world_from_index, lod) = (Arc::clone(volume), unit, LodChoice::Voxels);
                let traced = TracedInstance { volume, world_from_index, visible, lod };
                let first = VolumeTracer::new(0, &traced)?;
                let mut copies = Vec::new();
                for (number, place) in numbered() {
                    copies.push(Arc::new(first.again(number, *place * unit, lod)?.ok_or("the same levels")?));
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

/// A ball of size 1: an octahedron whose triangles are cut in four, `times` times.
fn ball(times: usize) -> Result<MeshData, Failure> {
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
    Ok(MeshData::new(corners, numbers, Vec::new())?)
}

fn measure(shape: &Shape, count: usize, film: &Film) -> Result<(), Failure> {
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
    let rows = DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), eye);
    let camera = Camera::new(rows, Projection::Perspective { fov_rad: 0.6 });

    let copies = shape.copies(&places)?;
    let clock = Stopwatch::start();
    let (by_tree, _) = copies.with_tree(None, 1)?;
    println!("{count}: tree {:.6} CPU-s", clock.cpu_seconds());
    println!("{count}: tree of {} bytes", by_tree.tree().map_or(0, |tree| tree.bytes()));
    println!("{count}: hierarchies of {} bytes", by_tree.bytes());

    let material = Material { base_color: [0.7; 3], specular: 0.0, roughness: 1.0, ..Material::default() };
    let looks = Arc::new(Looks::same(material));
    let around = Surroundings {
        lights: Arc::new(Lights::new(Sky::Constant(Vec3::ONE), Vec::new(), None)),
        looks: vec![looks; count].into(),
        settings: Settings { bounces: 3, ..Settings::default() },
    };
    let mut ways =
        [shape.copies(&places)?, by_tree].map(|t| PathTracer::new(t, around.clone(), &camera, film));
    let mut least = [f64::INFINITY; 2];
    // More where a sample takes long enough already, fewer where it takes minutes.
    let mut spent = 0.0;
    for sample in 1..=40 {
        for (way, least) in ways.iter_mut().zip(&mut least) {
            let clock = Stopwatch::start();
            way.add_samples(sample, &Job::new())?;
            let taken = clock.cpu_seconds();
            (*least, spent) = (least.min(taken), spent + taken);
        }
        if spent > 30.0 {
            break;
        }
    }
    let [in_turn, by_tree] = &ways;
    if in_turn.film().sums() != by_tree.film().sums() {
        return Err(format!("{count}: the two ways draw different films").into());
    }
    println!("{count}: in turn {:.5} CPU-s, by tree {:.5} CPU-s", least[0], least[1]);
    Ok(())
}
