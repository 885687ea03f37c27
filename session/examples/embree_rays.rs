//! The same rays through the compressed form and, as a mesh of the same voxels' faces, through Embree; in turn, on one thread.
//!
//! ```text
//! cargo run --release -p pumice-session --example embree_rays -- VOLUME DRIVER [share of labels shown, in per cent: 15] [side: 1024] [rounds: 7]
//! ```
//! DRIVER is `bench/embree/rays.c`, built with Embree. Prints a line of JSON.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a measuring tool: it stops at the first fault"
)]

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;

use glam::DVec3;
use pumice_core::{CompressedVolume, Level};
use pumice_cpu::traverse::{SceneTracer, TracedInstance};
use pumice_export::{Corners, Interfaces, QuadMesh};
use pumice_session::ray_sets::{camera_rays, diffuse_rays, some_labels, voxel_side};
use pumice_session::{Job, OpenOptions, Residence, Stopwatch, open_volume};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Tracer};
use serde_json::json;

/// How far above the face that it leaves a ray of Embree's starts, in the shortest side of a voxel: it has no other way to miss it.
const LIFT: f64 = 1e-3;
/// Hits are the same where the two lie in one plane, within so much of the distance and of a voxel: Embree's f32.
const SAME_PLANE: f64 = 1e-4;

/// The other program, waiting for rays.
struct Embree {
    child: Child,
    ask: ChildStdin,
    answer: BufReader<ChildStdout>,
}

impl Embree {
    /// Its numbers of the next line, which begins with `word`.
    fn said(&mut self, word: &str) -> Vec<f64> {
        let mut line = String::new();
        self.answer.read_line(&mut line).expect("an answer");
        let mut words = line.split_whitespace();
        assert_eq!(words.next(), Some(word), "Embree's program said {line:?}");
        words.map(|w| w.parse().unwrap()).collect()
    }

    fn trace(&mut self, rays: &Path, hits: &Path) -> f64 {
        writeln!(self.ask, "trace {} {}", rays.display(), hits.display()).unwrap();
        self.said("traced")[0]
    }
}

/// Rays, each from a little beside where it begins.
fn write_rays(path: &Path, rays: &[(RayInWorld, DVec3)]) {
    let mut bytes = (rays.len() as u64).to_le_bytes().to_vec();
    for (ray, beside) in rays {
        let (o, d) = (ray.origin + *beside, ray.direction);
        for v in [o.x, o.y, o.z, 0.0, d.x, d.y, d.z, 0.0] {
            bytes.extend((v as f32).to_le_bytes());
        }
    }
    std::fs::write(path, bytes).unwrap();
}

/// Distance of each hit, infinite where there is none.
fn read_hits(path: &Path) -> Vec<f64> {
    let bytes = std::fs::read(path).unwrap();
    let hit = |b: &[u8; 8]| match u32::from_le_bytes([b[4], b[5], b[6], b[7]]) {
        u32::MAX => f64::INFINITY,
        _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
    };
    bytes.as_chunks::<8>().0.iter().map(hit).collect()
}

/// Rays that the two see differently: one hits and the other does not, or what they hit does not lie in one plane.
/// Distances alone would not do: a ray that is lifted along the face it leaves meets a face parallel to that one earlier, the more so the flatter it goes.
fn differing(rays: &[(RayInWorld, DVec3)], ours: &[Option<Hit>], theirs: &[f64], voxel: f64) -> usize {
    assert_eq!(ours.len(), theirs.len());
    let apart = |i: usize| match (&ours[i], theirs[i].is_finite()) {
        (Some(hit), true) => {
            let (ray, beside) = &rays[i];
            let from_ours_to_theirs = *beside + (theirs[i] - hit.t) * ray.direction;
            let off = from_ours_to_theirs.dot(hit.normal_in_world.normalize()).abs();
            off > SAME_PLANE * (hit.t + voxel)
        }
        (ours, theirs) => ours.is_some() != theirs,
    };
    (0..rays.len()).filter(|&i| apart(i)).count()
}

fn main() {
    let mut args = std::env::args().skip(1);
    let path = PathBuf::from(args.next().expect("VOLUME"));
    let driver = args.next().expect("DRIVER");
    let percent: u32 = args.next().map_or(15, |a| a.parse().unwrap());
    let side: u64 = args.next().map_or(1024, |a| a.parse().unwrap());
    let rounds: usize = args.next().map_or(7, |a| a.parse().unwrap());

    let job = Job::new();
    let volume = open_volume(&path, &OpenOptions::default(), Residence::Copied, &job).expect("the volume");
    let visible = some_labels(volume.labels().len(), percent);
    // As a scene that shows these labels opens it: Embree gets no faces of others either.
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    volume.save(&file("volume.pumice"), Level::Fast, &job).unwrap();
    let shown = CompressedVolume::open_labels(&file("volume.pumice"), |_| visible.clone(), &job).unwrap();
    let volume = Arc::new(shown);
    let world = volume.info().world_from_index;

    // Places around the volume's middle, so that Embree's f32 has them as exactly as it can.
    let middle = world.transform_point3(DVec3::from(volume.info().dims.map(f64::from)) / 2.0);
    let mesh = QuadMesh::new(&volume, &visible, Interfaces::Outside, Corners::Own, &job).expect("the mesh");
    let quads = mesh.quads.len();
    let mesh_bytes = 12 * mesh.vertices.len() + 16 * quads;
    let mut bytes = Vec::with_capacity(16 + mesh_bytes);
    bytes.extend((mesh.vertices.len() as u64).to_le_bytes());
    bytes.extend((quads as u64).to_le_bytes());
    for v in &mesh.vertices {
        let place = world.transform_point3(DVec3::from(v.map(f64::from))) - middle;
        bytes.extend(place.to_array().iter().flat_map(|&x| (x as f32).to_le_bytes()));
    }
    bytes.extend(mesh.quads.iter().flatten().flat_map(|v| v.to_le_bytes()));
    drop(mesh);
    std::fs::write(file("mesh"), bytes).unwrap();
    let mut child = Command::new(driver)
        .arg(file("mesh"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("Embree's program");
    let (ask, answer) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
    let mut embree = Embree { child, ask, answer };
    let built = embree.said("built");

    let clock = Stopwatch::start();
    let mut moved = world;
    moved.translation -= middle;
    let shown = [TracedInstance {
        volume: Arc::clone(&volume),
        world_from_index: moved,
        visible,
        lod: LodChoice::Voxels,
    }];
    let scene = SceneTracer::new(&shown).unwrap();
    let build_seconds = clock.cpu_seconds();
    let boxes = SceneTracer::without_bricks(&shown).unwrap();

    let rays = camera_rays(&moved, volume.info().dims, side);
    let hits: Vec<(RayInWorld, Hit)> = rays
        .iter()
        .filter_map(|r| Some((*r, scene.first_hit(r, PathOrigin::Free, f64::INFINITY)?)))
        .collect();
    let voxel = voxel_side(&world);
    let primary: Vec<(RayInWorld, DVec3)> = rays.into_iter().map(|r| (r, DVec3::ZERO)).collect();
    let lifts = hits.iter().map(|(_, h)| LIFT * voxel * h.normal_in_world.normalize());
    let bounces: Vec<(RayInWorld, DVec3)> = diffuse_rays(&hits).into_iter().zip(lifts).collect();
    let from: Vec<PathOrigin> = hits.iter().map(|(_, h)| PathOrigin::Face(h.surface)).collect();

    let mut kinds = Vec::new();
    for (name, rays, from) in [("primary", &primary, None), ("bounce", &bounces, Some(&from))] {
        write_rays(&file("rays"), rays);
        let mut seconds_of = [Vec::new(), Vec::new(), Vec::new()];
        let first_hit = |scene: &SceneTracer, i: usize| {
            let from = from.map_or(PathOrigin::Free, |f| f[i]);
            scene.first_hit(&rays[i].0, from, f64::INFINITY)
        };
        let ours: Vec<Option<Hit>> = (0..rays.len()).map(|i| first_hit(&scene, i)).collect();
        // Kept of each ray is what Embree's program keeps, in memory that is there: the distance, and what was hit.
        let mut kept = vec![(f32::INFINITY, u32::MAX); rays.len()];
        for _ in 0..rounds {
            for (scene, seconds) in [&boxes, &scene].into_iter().zip([2, 0]) {
                let clock = Stopwatch::start();
                for (i, kept) in kept.iter_mut().enumerate() {
                    let hit = first_hit(scene, i);
                    *kept = hit.map_or((f32::INFINITY, u32::MAX), |h| (h.t as f32, h.surface.label));
                }
                seconds_of[seconds].push(clock.cpu_seconds());
            }
            seconds_of[1].push(embree.trace(&file("rays"), &file("hits")));
        }
        let same = |(hit, kept): (&Option<Hit>, &(f32, u32))| {
            hit.as_ref().map(|h| h.surface.label).unwrap_or(u32::MAX) == kept.1
        };
        assert!(ours.iter().zip(&kept).all(same), "rays differ from one round to another");
        let mut theirs = Vec::new();
        theirs.extend(read_hits(&file("hits")));
        let rate = |s: &Vec<f64>, q: f64| {
            let mut sorted = s.clone();
            sorted.sort_by(f64::total_cmp);
            rays.len() as f64 / sorted[((sorted.len() - 1) as f64 * q) as usize] / 1e6
        };
        kinds.push(json!({
            "rays": name,
            "count": rays.len(),
            "hits": ours.iter().flatten().count(),
            "differing": differing(rays, &ours, &theirs, voxel),
            "ours_best": rate(&seconds_of[0], 0.0), "ours_median": rate(&seconds_of[0], 0.5),
            "boxes_best": rate(&seconds_of[2], 0.0), "boxes_median": rate(&seconds_of[2], 0.5),
            "embree_best": rate(&seconds_of[1], 0.0), "embree_median": rate(&seconds_of[1], 0.5),
        }));
    }
    drop(embree.ask);
    assert!(embree.child.wait().unwrap().success());
    let volume_bytes: u64 = volume.resident_parts().iter().map(|p| p.1).sum();
    println!(
        "{}",
        json!({
            "boxes": scene.instance(0).unwrap().boxes(),
            "quads": quads,
            "ours_bytes": volume_bytes + scene.bytes(),
            "boxes_bytes": volume_bytes + boxes.bytes(),
            "embree_bytes": built[1],
            "ours_build_cpu_seconds": build_seconds,
            "embree_build_cpu_seconds": built[0],
            "kinds": kinds,
        })
    );
}
