//! Renders a scene of Pumice with Blender's path tracer Cycles, for comparison. The scene goes out as JSON with its voxel faces as
//! `.npy`, to a Python that has Blender as the module `bpy`; the pictures come back as `.npy`.
//!
//! ```text
//! scene, volumes ─► job.json, vertices.npy, quads.npy, materials.npy ─► python scene_in_cycles.py job.json ─► pictures.npy, report.json
//! ```
//! `cycles/scene_in_cycles.py` is the only translation of a scene into Blender's; the Cycles ladder (`tests/cycles_ladder`) runs it too,
//! on meshes that it makes itself.

use std::path::Path;
use std::sync::Arc;

use pumice_core::{CompressedVolume, Job};
use pumice_export::{Corners, Interfaces, QuadMesh};
use pumice_picture::Image;
use pumice_scene::{Instance, Scene};
use pumice_transport::material_table::MaterialTable;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::error::{Result, SessionError, io};
use crate::npy::{read_npy_f32, write_npy};
use crate::script::run_script;

/// The script that translates the scene and renders it, inside Blender.
const SCRIPT: &str = include_str!("cycles/scene_in_cycles.py");

/// Wall and CPU seconds of one step in Blender.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
pub struct Seconds {
    /// Wall seconds.
    pub seconds: f64,
    /// CPU seconds, all threads.
    pub cpu_seconds: f64,
}

/// One picture by Cycles.
#[derive(Clone, Debug)]
pub struct CyclesPicture {
    /// Samples per pixel.
    pub spp: u32,
    /// Seconds of the render call.
    pub took: Seconds,
    /// Scene-linear colours.
    pub picture: Image,
}

/// The results of one run of Blender.
#[derive(Clone, Debug)]
pub struct CyclesRun {
    /// Version of Blender.
    pub blender: String,
    /// Number of voxel faces of all instances, as quads.
    pub faces: usize,
    /// Seconds that the translation of the scene took.
    pub built: Seconds,
    /// Pictures in the order of the requests.
    pub pictures: Vec<CyclesPicture>,
    /// Resident set of the process before the scene was built, in bytes.
    pub bytes_before: u64,
    /// Largest resident set of the process, in bytes.
    pub peak_bytes: u64,
}

#[derive(Deserialize)]
struct Report {
    blender: String,
    built: Seconds,
    renders: Vec<Seconds>,
    bytes_before: u64,
    peak_bytes: u64,
}

/// Renders a scene with Cycles, once for each pair of seed and samples per pixel, in one process of `python`. `volumes` has one volume
/// for each instance.
///
/// # Errors
/// When the scene has triangle meshes or cuts, which are not translated; errors of the interpreter, the script or the system;
/// [`pumice_core::Error::Cancelled`] when `job` is cancelled, which ends the process.
pub fn render_with_cycles(
    python: &Path,
    scene: &Scene,
    volumes: &[Arc<CompressedVolume>],
    renders: &[(u64, u32)],
    job: &Job,
) -> Result<CyclesRun> {
    for (what, is_there) in [("meshes", !scene.meshes.is_empty()), ("cuts", !scene.cuts.is_empty())] {
        if is_there {
            return Err(SessionError::Caller(format!("{what}: Cycles gets only volumes without cuts here")));
        }
    }
    let folder = tempfile::tempdir().map_err(io(std::env::temp_dir()))?;
    let path = |name: &str| folder.path().join(name);

    // Write the voxel faces of each instance.
    let mut faces = 0;
    let mut instances = Vec::new();
    for (number, (instance, volume)) in scene.instances.iter().zip(volumes).enumerate() {
        let (count, fields) = write_faces(folder.path(), number, instance, volume, job)?;
        faces += count;
        instances.push(fields);
    }

    // Write the job: scene, meshes and requested pictures.
    let asked = json!({
        "scene": scene,
        "instances": instances,
        "renders": renders.iter().map(|&(seed, spp)| json!({ "seed": cycles_seed(seed), "spp": spp })).collect::<Vec<_>>(),
        "pictures": path("pictures.npy"),
        "report": path("report.json"),
    });
    std::fs::write(path("job.json"), asked.to_string()).map_err(io(path("job.json")))?;
    std::fs::write(path("scene_in_cycles.py"), SCRIPT).map_err(io(path("scene_in_cycles.py")))?;
    run_script("Cycles", python, &path("scene_in_cycles.py"), &path("job.json"), &path("said.txt"), job)?;

    // Read the report and the pictures.
    let report = std::fs::read(path("report.json")).map_err(io(path("report.json")))?;
    let report: Report = serde_json::from_slice(&report)
        .map_err(|e| SessionError::Caller(format!("the report of Cycles: {e}")))?;
    if report.renders.len() != renders.len() {
        return Err(SessionError::Caller(format!(
            "expected {} pictures of Cycles, got {}",
            renders.len(),
            report.renders.len()
        )));
    }
    let [width, height] = [scene.film.width, scene.film.height].map(|n| n as usize);
    let values = read_npy_f32(&path("pictures.npy"), renders.len() * width * height * 3)?;
    let images = values
        .chunks_exact(width * height * 3)
        .map(|v| Image::new(width, height, v.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()));
    let pictures = renders
        .iter()
        .zip(&report.renders)
        .zip(images)
        .map(|((&(_, spp), &took), picture)| CyclesPicture { spp, took, picture });
    Ok(CyclesRun {
        blender: report.blender,
        faces,
        built: report.built,
        pictures: pictures.collect(),
        bytes_before: report.bytes_before,
        peak_bytes: report.peak_bytes,
    })
}

/// Writes the faces of the labels that an instance shows; returns their number and the instance's entry in the job.
fn write_faces(
    folder: &Path,
    number: usize,
    instance: &Instance,
    volume: &CompressedVolume,
    job: &Job,
) -> Result<(usize, Value)> {
    let path = |name: &str| folder.join(format!("{name}-{number}.npy"));
    let (style, table) = (&instance.style, volume.labels());
    let field = |source| SessionError::Scene { path: instance.source.clone(), source };
    let visible =
        style.show.resolve(&format!("instances[{number}].style.show"), table.ids()).map_err(field)?;
    let mesh = QuadMesh::new(volume, &visible, Interfaces::Outside, Corners::Own, job)?;
    let material_table = MaterialTable::new(style, table.ids(), table.contacts().iter(), &visible);
    let of_label = material_table.of_label();
    let material = |&label: &u32| of_label.get(label as usize).map_or(0, |&m| m as i32);
    let materials: Vec<i32> = mesh.labels.iter().map(material).collect();
    let faces = mesh.quads.len();
    write_npy(&path("vertices"), "<i4", &[mesh.vertices.len(), 3], bytemuck::cast_slice(&mesh.vertices))?;
    write_npy(&path("quads"), "<u4", &[faces, 4], bytemuck::cast_slice(&mesh.quads))?;
    write_npy(&path("materials"), "<i4", &[faces], bytemuck::cast_slice(&materials))?;
    let fields = json!({
        "vertices": path("vertices"),
        "quads": path("quads"),
        "material_of_quad": path("materials"),
        "materials": material_table.materials(),
    });
    Ok((faces, fields))
}

/// Maps a seed to Cycles' 31 bits. Neighbouring seeds of Cycles are not independent, so a multiplication by an odd number spreads them.
fn cycles_seed(seed: u64) -> u64 {
    (seed * 2_654_435_761) % 2_147_483_647
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;
    use std::path::PathBuf;

    use pumice_oracle::volumes::blobs;
    use pumice_scene::{Cut, CutShape};

    use super::*;
    use crate::figure::{FigureOptions, compose};

    /// A script in place of Blender: it keeps the job and answers with a report of `pictures` pictures.
    fn stand_in(folder: &Path, pictures: usize) -> PathBuf {
        let values: Vec<f32> = (0..pictures * 2 * 3).map(|v| v as f32).collect();
        write_npy(&folder.join("p.npy"), "<f4", &[pictures, 1, 2, 3], bytemuck::cast_slice(&values)).unwrap();
        let renders: Vec<Value> =
            (0..pictures).map(|i| json!({ "seconds": 0.5, "cpu_seconds": i as f64 + 1.0 })).collect();
        let built = json!({ "seconds": 0.25, "cpu_seconds": 0.75 });
        let report = json!({
            "blender": "4.2.0", "built": built, "renders": renders, "bytes_before": 10, "peak_bytes": 30,
        });
        std::fs::write(folder.join("r.json"), report.to_string()).unwrap();
        let program = folder.join("python");
        let here = folder.display();
        let script = format!(
            "#!/bin/sh\nout=$(dirname \"$2\")\ncp \"$2\" {here}/asked.json\ncp {here}/p.npy $out/pictures.npy\ncp {here}/r.json $out/report.json\n"
        );
        std::fs::write(&program, script).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        program
    }

    #[test]
    fn each_picture_that_is_asked_for_comes_back_with_its_time() {
        let folder = tempfile::tempdir().unwrap();
        let (_, bodies) = blobs([24, 24, 24], 9, 4, 11);
        let options = FigureOptions { size: [2, 1], labels: None, view_deg: FigureOptions::DEFAULT_VIEW_DEG };
        let mut scene = compose(&bodies, "memory".into(), &options);
        let draw = |scene: &Scene, python: &Path| {
            render_with_cycles(python, scene, &[Arc::clone(&bodies)], &[(1, 4), (2, 16)], &Job::new())
        };
        let run = draw(&scene, &stand_in(folder.path(), 2)).unwrap();
        assert_eq!((run.blender.as_str(), run.bytes_before, run.peak_bytes), ("4.2.0", 10, 30));
        assert_eq!(
            run.pictures.iter().map(|p| (p.spp, p.took.cpu_seconds)).collect::<Vec<_>>(),
            [(4, 1.0), (16, 2.0)]
        );
        assert_eq!(run.pictures[1].picture.pixels, [[6.0, 7.0, 8.0], [9.0, 10.0, 11.0]]);
        assert!(run.faces > 100, "{}", run.faces);
        let asked = std::fs::read_to_string(folder.path().join("asked.json")).unwrap();
        let asked: Value = serde_json::from_str(&asked).unwrap();
        assert_eq!(asked["renders"][1]["spp"], 16);
        assert_ne!(asked["renders"][0]["seed"], asked["renders"][1]["seed"]);
        assert_eq!(asked["instances"].as_array().unwrap().len(), 1);

        // One picture too few, and scenes that cannot be translated, are refused.
        let few = draw(&scene, &stand_in(folder.path(), 1)).unwrap_err().to_string();
        assert_eq!(few, "expected 2 pictures of Cycles, got 1");
        scene.cuts = vec![Cut {
            shape: CutShape::Plane { point: [0.0; 3], normal: [1.0, 0.0, 0.0] },
            instances: None,
        }];
        let cut = draw(&scene, &stand_in(folder.path(), 2)).unwrap_err().to_string();
        assert!(cut.starts_with("cuts: "), "{cut}");
    }
}
