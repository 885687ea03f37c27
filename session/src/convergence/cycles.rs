//! The other program: the scene's voxel faces as files, a job that names them, a Python that has Blender, and what came back.

use std::path::Path;

use pumice_core::{CompressedVolume, Job};
use pumice_export::{Corners, Interfaces, QuadMesh};
use pumice_picture::Image;
use pumice_scene::Scene;
use pumice_transport::looks::Looks;
use serde::Deserialize;
use serde_json::json;

use super::Preparation;
use crate::error::{Result, SessionError, io};
use crate::npy::{read_npy_f32, write_npy};
use crate::script::run_script;

/// Translates the scene, inside Blender.
const SCRIPT: &str = include_str!("scene_in_cycles.py");

/// Pictures of a program in the order in which they were asked for: samples, wall seconds, CPU seconds, picture.
pub(super) struct Run {
    pub(super) name: String,
    pub(super) preparation: Preparation,
    pub(super) pictures: Vec<(u32, f64, f64, Image)>,
}

#[derive(Deserialize)]
struct Report {
    blender: String,
    built: Seconds,
    renders: Vec<Seconds>,
    bytes_before: u64,
    peak_bytes: u64,
}

#[derive(Deserialize)]
struct Seconds {
    seconds: f64,
    cpu_seconds: f64,
}

/// Draws the scene with Cycles for each (seed, samples); gives also the number of faces.
pub(super) fn drawn_by_cycles(
    python: &Path,
    scene: &Scene,
    volume: &CompressedVolume,
    renders: &[(u64, u32)],
    job: &Job,
) -> Result<(usize, Run)> {
    let folder = tempfile::tempdir().map_err(io(std::env::temp_dir()))?;
    let path = |name: &str| folder.path().join(name);

    // The faces of the labels that are shown, and what they look like.
    let style = &scene.instances[0].style;
    let table = volume.labels();
    let field = |source| SessionError::Scene { path: scene.instances[0].source.clone(), source };
    let visible = style.show.resolve("instances[0].style.show", table.ids()).map_err(field)?;
    let mesh = QuadMesh::new(volume, &visible, Interfaces::Outside, Corners::Own, job)?;
    let looks = Looks::new(style, table.ids(), table.contacts().iter(), &visible);
    let of_label = looks.of_label();
    let material = |&label: &u32| of_label.get(label as usize).map_or(0, |&m| m as i32);
    let materials: Vec<i32> = mesh.labels.iter().map(material).collect();
    let faces = mesh.quads.len();
    write_npy(&path("vertices.npy"), "<i4", &[mesh.vertices.len(), 3], bytemuck::cast_slice(&mesh.vertices))?;
    write_npy(&path("quads.npy"), "<u4", &[faces, 4], bytemuck::cast_slice(&mesh.quads))?;
    write_npy(&path("materials.npy"), "<i4", &[faces], bytemuck::cast_slice(&materials))?;
    drop(mesh);

    // Twice one sample first: what the first took longer than the second was preparation.
    let renders: Vec<_> = [(9_999_991, 1), (9_999_992, 1)]
        .iter()
        .chain(renders)
        .map(|&(seed, spp)| json!({ "seed": cycles_seed(seed), "spp": spp }))
        .collect();
    let asked = json!({
        "scene": scene,
        "instances": [{
            "vertices": path("vertices.npy"),
            "quads": path("quads.npy"),
            "material_of_quad": path("materials.npy"),
            "materials": looks.materials(),
        }],
        "renders": renders,
        "pictures": path("pictures.npy"),
        "report": path("report.json"),
    });
    std::fs::write(path("job.json"), asked.to_string()).map_err(io(path("job.json")))?;
    std::fs::write(path("scene_in_cycles.py"), SCRIPT).map_err(io(path("scene_in_cycles.py")))?;
    run_script("Cycles", python, &path("scene_in_cycles.py"), &path("job.json"), &path("said.txt"), job)?;

    let report = std::fs::read(path("report.json")).map_err(io(path("report.json")))?;
    let report: Report = serde_json::from_slice(&report)
        .map_err(|e| SessionError::Caller(format!("what Cycles reported: {e}")))?;
    let [width, height] = [scene.film.width, scene.film.height].map(|n| n as usize);
    let values = read_npy_f32(&path("pictures.npy"), report.renders.len() * width * height * 3)?;
    let [first, second, measured @ ..] = &report.renders[..] else {
        return Err(SessionError::Caller("Cycles drew fewer pictures than were asked for".into()));
    };
    let images = values
        .chunks_exact(width * height * 3)
        .skip(2)
        .map(|v| Image::new(width, height, v.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()));
    let pictures = renders[2..].iter().zip(measured).zip(images).map(|((asked, took), image)| {
        let spp = asked["spp"].as_u64().unwrap_or(0) as u32;
        (spp, took.seconds, took.cpu_seconds, image)
    });
    Ok((
        faces,
        Run {
            name: format!("Cycles in Blender {}", report.blender),
            preparation: Preparation {
                seconds: report.built.seconds + first.seconds - second.seconds,
                cpu_seconds: report.built.cpu_seconds + first.cpu_seconds - second.cpu_seconds,
                peak_bytes: Some(report.peak_bytes),
                base_bytes: Some(report.bytes_before),
            },
            pictures: pictures.collect(),
        },
    ))
}

/// Cycles' seeds are 31 bits and not independent where they are near each other: a multiplication by an odd number spreads them.
fn cycles_seed(seed: u64) -> u64 {
    (seed * 2_654_435_761) % 2_147_483_647
}
