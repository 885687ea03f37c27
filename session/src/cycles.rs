//! Renders a scene of Pumice with Blender's path tracer Cycles, for comparison. The scene goes out as JSON with the surface that Pumice
//! draws as `.npy`, to a Python that has Blender as the module `bpy`, or to the program Blender; the pictures come back as `.npy`.
//!
//! ```text
//! LoadedScene ─► job.json, vertices.npy, quads.npy, materials.npy ─► scene_in_cycles.py: builds the scene, keeps it
//!                {seed, spp} on standard input                    ─► one picture.npy and its report, as often as asked
//! ```
//! `cycles/scene_in_cycles.py` is the only translation of a scene into Blender's; the Cycles ladder (`tests/cycles_ladder`) runs it too,
//! on meshes that it makes itself.

use std::io::Write;
use std::path::{Path, PathBuf};

use glam::DVec3;
use pumice_core::{Job, MeshData, octahedral};
use pumice_export::{CutPolygon, CutRegion, Faces, Interfaces, Merging, Rectangle, for_each_cut_block};
use pumice_picture::Image;
use pumice_scene::{Instance, Material};
use pumice_transport::geometry::{Contacts, DetailLevel};
use pumice_transport::{LoadedScene, MaterialTable};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::error::{Result, SessionError, io};
use crate::npy::{read_npy_f32, write_npy_with};
use crate::script::{Script, is_blender_program};

/// The script that translates the scene and renders it, inside Blender, and its module about faces in one place.
const SCRIPT: &str = include_str!("cycles/scene_in_cycles.py");
const COINCIDENT_FACES: &str = include_str!("cycles/coincident_faces.py");

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
    /// Scene-linear colours; on a transparent film laid over white.
    pub picture: Image,
    /// Largest resident set of the process so far, in bytes.
    pub peak_bytes: u64,
}

/// What Blender says once the scene is built.
#[derive(Clone, Debug, Deserialize)]
struct Built {
    blender: String,
    built: Seconds,
    bytes_before: u64,
    without_order: Vec<String>,
}

#[derive(Deserialize)]
struct Row {
    seconds: f64,
    cpu_seconds: f64,
    peak_bytes: u64,
}

/// A process of Blender that holds a scene.
#[derive(Debug)]
pub struct Cycles {
    script: Script,
    folder: TempDir,
    size: [usize; 2],
    channels: usize,
    faces: u64,
    drawn: usize,
    built: Built,
}

impl Cycles {
    /// Starts Blender and builds the scene in it, with the surfaces that are drawn at `level`, a quad for each face. `blender` is a Python
    /// that has `bpy`, or a program of Blender.
    ///
    /// # Errors
    /// When the scene has something that Cycles has not; errors of the interpreter, the script or the
    /// system; [`pumice_core::Error::Cancelled`] when `job` is cancelled, which ends the process.
    pub fn start(blender: &Path, loaded: &LoadedScene, level: DetailLevel, job: &Job) -> Result<Self> {
        let scene = loaded.scene();
        let folder = tempfile::tempdir().map_err(io(std::env::temp_dir()))?;
        let path = |name: &str| folder.path().join(name);

        // Write the surface of each instance, and each mesh.
        let mut faces = 0;
        let mut instances = Vec::new();
        let contacts = Contacts::new(loaded);
        for place in 0..loaded.volumes().len() {
            let (count, mut fields) = write_surface(folder.path(), loaded, place, level, job)?;
            let number = place as u32;
            fields["body"] = json!(contacts.as_ref().and_then(|c| c.body(number)).unwrap_or(number));
            faces += count;
            instances.push(fields);
        }
        let meshes: Vec<Value> = scene
            .meshes
            .iter()
            .zip(loaded.meshes())
            .enumerate()
            .map(|(place, (mesh, data))| write_mesh(folder.path(), place, data, &mesh.materials))
            .collect::<Result<_>>()?;

        // Start the script, and wait until it has built the scene.
        let asked = json!({
            "scene": scene,
            "instances": instances,
            "meshes": meshes,
            "cut_is_in_the_mesh": true,
            "report": path("built.json"),
        });
        std::fs::write(path("job.json"), asked.to_string()).map_err(io(path("job.json")))?;
        for (name, text) in [("scene_in_cycles.py", SCRIPT), ("coincident_faces.py", COINCIDENT_FACES)] {
            std::fs::write(path(name), text).map_err(io(path(name)))?;
        }
        let mut script = Script::start(
            "Cycles",
            blender,
            is_blender_program(blender)?,
            [&path("scene_in_cycles.py"), &path("job.json")],
            &path("said.txt"),
        )?;
        let built = answer(&mut script, &path("built.json"), job)?;
        let shadow = scene.film.passes.has(pumice_picture::Pass::ShadowCatcher);
        let channels = match (scene.film.transparent, shadow) {
            (_, true) => 7,
            (true, false) => 4,
            (false, false) => 3,
        };
        let size = [scene.film.width, scene.film.height].map(|n| n as usize);
        Ok(Self { script, folder, size, channels, faces, drawn: 0, built })
    }

    /// Renders a picture.
    ///
    /// # Errors
    /// As [`Cycles::start`].
    pub fn picture(&mut self, seed: u64, spp: u32, job: &Job) -> Result<CyclesPicture> {
        self.drawn += 1;
        let path = |name: &str| self.folder.path().join(format!("{name}-{}", self.drawn));
        let [picture, report] = [path("picture").with_extension("npy"), path("report")];
        let asked = json!({ "seed": cycles_seed(seed), "spp": spp, "picture": picture, "report": report });
        self.script.say(&asked.to_string())?;
        let row: Row = answer(&mut self.script, &report, job)?;
        let [width, height] = self.size;
        let values = read_npy_f32(&picture, width * height * self.channels)?;
        std::fs::remove_file(&picture).map_err(io(&picture))?;
        let pixels = values.chunks_exact(self.channels).map(laid_over_white).collect();
        Ok(CyclesPicture {
            spp,
            took: Seconds { seconds: row.seconds, cpu_seconds: row.cpu_seconds },
            picture: Image::new(width, height, pixels),
            peak_bytes: row.peak_bytes,
        })
    }

    /// Version of Blender.
    pub fn blender(&self) -> &str {
        &self.built.blender
    }

    /// Faces of all instances, as quads.
    pub fn faces(&self) -> u64 {
        self.faces
    }

    /// Seconds that the translation of the scene took.
    pub fn built(&self) -> Seconds {
        self.built.built
    }

    /// Faces of volumes in one place of which neither program says which is passed first, one line for each kind.
    pub fn without_order(&self) -> &[String] {
        &self.built.without_order
    }

    /// Resident set of the process before the scene was built, in bytes.
    pub fn bytes_before(&self) -> u64 {
        self.built.bytes_before
    }
}

/// A pixel's colour over white, under its caught shadow where that is a pass of its own.
fn laid_over_white(channels: &[f32]) -> [f32; 3] {
    let color = [channels[0], channels[1], channels[2]];
    let Some(alpha) = channels.get(3) else { return color };
    let shadow = channels.get(4..7).unwrap_or(&[1.0; 3]);
    [0, 1, 2].map(|c| color[c] + (1.0 - alpha) * shadow[c])
}

/// Waits for a report of the script.
fn answer<T: DeserializeOwned>(script: &mut Script, report: &Path, job: &Job) -> Result<T> {
    script.wait_for(report, job)?;
    let text = std::fs::read(report).map_err(io(report))?;
    serde_json::from_slice(&text).map_err(|e| SessionError::Caller(format!("the report of Cycles: {e}")))
}

/// The faces that light reaches, each as a square: also those between shown labels, where it passes through some label.
pub(crate) fn faces_of(instance: &Instance) -> Faces {
    let interfaces = if instance.style.lets_light_through() { Interfaces::All } else { Interfaces::Outside };
    Faces { interfaces, merging: Merging::Plain }
}

/// Writes the surface of what instance number `place` shows; returns the number of its faces and its entry in the job.
fn write_surface(
    folder: &Path,
    loaded: &LoadedScene,
    place: usize,
    level: DetailLevel,
    job: &Job,
) -> Result<(u64, Value)> {
    let (instance, volume) = (&loaded.scene().instances[place], &loaded.volumes()[place]);
    let (visible, table) = (loaded.visible(place), volume.labels());
    let cuts = CutRegion::of_instance(loaded.scene(), instance);
    let (mut rectangles, mut polygons): (Vec<Rectangle>, Vec<CutPolygon>) = (Vec::new(), Vec::new());
    for_each_cut_block(volume, &visible, level, faces_of(instance), &cuts, job, |whole, cut| {
        rectangles.extend_from_slice(whole);
        polygons.extend_from_slice(cut);
        Ok(())
    })?;
    let materials = MaterialTable::new(&instance.style, table.ids(), table.contacts().iter(), &visible);
    let of_label = materials.of_label();
    let path = |name: &str| folder.join(format!("{name}-{place}.npy"));
    let faces = rectangles.len();
    write_npy_with(&path("vertices"), "<i4", &[4 * faces, 3], |out| {
        rectangles.iter().try_for_each(|r| out.write_all(bytemuck::cast_slice(&r.corners())))
    })?;
    write_npy_with(&path("quads"), "<u4", &[faces, 4], |out| {
        (0..4 * faces as u32).try_for_each(|corner| out.write_all(&corner.to_le_bytes()))
    })?;
    write_npy_with(&path("materials"), "<i4", &[faces], |out| {
        let material = |r: &Rectangle| of_label.get(r.label as usize).copied().unwrap_or(0);
        rectangles.iter().try_for_each(|r| out.write_all(&material(r).to_le_bytes()))
    })?;
    write_npy_with(&path("labels"), "<u4", &[faces], |out| {
        rectangles.iter().try_for_each(|r| out.write_all(&r.label.to_le_bytes()))
    })?;
    let mut fields = json!({
        "vertices": path("vertices"),
        "quads": path("quads"),
        "material_of_quad": path("materials"),
        "label_of_quad": path("labels"),
        "materials": materials.materials(),
    });
    let mut count = faces as u64;
    if !polygons.is_empty() {
        let material = |label: u32| of_label.get(label as usize).copied().unwrap_or(0);
        fields["cut"] = write_polygons(folder, place, &polygons, material)?;
        count += polygons.len() as u64;
    }
    Ok((count, fields))
}

/// Writes polygons as fans of triangles; returns their entry in the job.
fn write_polygons(
    folder: &Path,
    place: usize,
    polygons: &[CutPolygon],
    material: impl Fn(u32) -> u32,
) -> Result<Value> {
    let path = |name: &str| folder.join(format!("cut-{name}-{place}.npy"));
    let corners: usize = polygons.iter().map(|polygon| polygon.corners.len()).sum();
    write_npy_with(&path("vertices"), "<f8", &[corners, 3], |out| {
        let mut all = polygons.iter().flat_map(|polygon| &polygon.corners);
        all.try_for_each(|corner| out.write_all(bytemuck::cast_slice(&corner.to_array())))
    })?;
    let triangles: usize = polygons.iter().map(|polygon| polygon.corners.len() - 2).sum();
    write_npy_with(&path("triangles"), "<u4", &[triangles, 3], |out| {
        let mut first = 0u32;
        for polygon in polygons {
            let corners = polygon.corners.len() as u32;
            for second in 1..corners - 1 {
                out.write_all(bytemuck::cast_slice(&[first, first + second, first + second + 1]))?;
            }
            first += corners;
        }
        Ok(())
    })?;
    write_npy_with(&path("materials"), "<i4", &[triangles], |out| {
        for polygon in polygons {
            let material = material(polygon.label).to_le_bytes();
            (2..polygon.corners.len()).try_for_each(|_| out.write_all(&material))?;
        }
        Ok(())
    })?;
    Ok(json!({
        "vertices": path("vertices"),
        "triangles": path("triangles"),
        "material_of_triangle": path("materials"),
    }))
}

/// Writes the triangles of mesh number `place`; returns its entry in the job.
fn write_mesh(folder: &Path, place: usize, data: &MeshData, materials: &[Material]) -> Result<Value> {
    let path = |name: &str| -> PathBuf { folder.join(format!("mesh-{name}-{place}.npy")) };
    let triangles = data.triangles();
    write_npy_with(&path("vertices"), "<f8", &[data.positions().len(), 3], |out| {
        out.write_all(bytemuck::cast_slice(data.positions()))
    })?;
    write_npy_with(&path("triangles"), "<u4", &[triangles.len(), 3], |out| {
        out.write_all(bytemuck::cast_slice(triangles))
    })?;
    // A triangle whose index is past the end has the last material.
    let last = materials.len().saturating_sub(1) as u32;
    write_npy_with(&path("materials"), "<i4", &[triangles.len()], |out| {
        let material = |triangle: usize| data.material(triangle).min(last);
        (0..triangles.len()).try_for_each(|t| out.write_all(&material(t).to_le_bytes()))
    })?;
    let mut fields = json!({
        "vertices": path("vertices"),
        "triangles": path("triangles"),
        "material_of_triangle": path("materials"),
        "materials": materials,
    });
    if data.is_smooth() {
        write_npy_with(&path("normals"), "<f4", &[triangles.len(), 3, 3], |out| {
            triangles.iter().zip(data.normals()).try_for_each(|(triangle, codes)| {
                let flat = flat_normal(triangle.map(|corner| data.positions()[corner as usize]));
                let normal = |code| if code == octahedral::FLAT { flat } else { octahedral::decode(code) };
                out.write_all(bytemuck::cast_slice(&codes.map(normal)))
            })
        })?;
        fields["normals"] = json!(path("normals"));
    }
    Ok(fields)
}

/// Unit normal of a triangle, on the side from which its corners run counterclockwise.
fn flat_normal(corners: [[f64; 3]; 3]) -> [f32; 3] {
    let [a, b, c] = corners.map(DVec3::from);
    (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array()
}

/// Maps a seed to Cycles' 31 bits. Neighbouring seeds of Cycles are not independent, so a multiplication by an odd number spreads them.
fn cycles_seed(seed: u64) -> u64 {
    (seed * 2_654_435_761) % 2_147_483_647
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use pumice_oracle::volumes::blobs;

    use super::*;
    use crate::figure::{FigureOptions, compose};
    use crate::npy::write_npy;

    /// A script in place of Blender: it keeps the job, and answers each line with a picture of 1 × 2 pixels; with `fails` it ends instead.
    fn stand_in(folder: &Path, fails: bool) -> PathBuf {
        let values = [0.0f32, 1.0, 2.0, 3.0, 4.0, 5.0];
        write_npy(&folder.join("p.npy"), "<f4", &[1, 2, 3], bytemuck::cast_slice(&values)).unwrap();
        let built = r#"{"blender": "4.2.0", "built": {"seconds": 0.25, "cpu_seconds": 0.75}, "bytes_before": 10, "without_order": []}"#;
        let row = r#"{"seconds": 0.5, "cpu_seconds": 1.5, "peak_bytes": 30}"#;
        let end = if fails { "echo 'out of memory' >&2; exit 3" } else { "" };
        let here = folder.display();
        let script = format!(
            "#!/bin/sh\n[ \"$1\" = --version ] && echo Python && exit\ncp \"$2\" {here}/asked.json\nout=$(dirname \"$2\")\n\
             echo '{built}' > $out/built.json\n{end}\nn=0\nwhile read line; do n=$((n+1)); echo \"$line\" >> {here}/lines\n\
             cp {here}/p.npy $out/picture-$n.npy; echo '{row}' > $out/part; mv $out/part $out/report-$n; done\n"
        );
        let program = folder.join("python");
        std::fs::write(&program, script).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        program
    }

    #[test]
    fn each_picture_that_is_asked_for_comes_back_with_its_time() {
        let folder = tempfile::tempdir().unwrap();
        let (_, bodies) = blobs([24, 24, 24], 9, 4, 11);
        let options = FigureOptions { size: [2, 1], ..FigureOptions::default() };
        let scene = compose(&bodies, "memory".into(), &options);
        let loaded = LoadedScene::new(scene, vec![bodies], vec![]).unwrap();
        let job = Job::new();
        let start = |program: &Path| Cycles::start(program, &loaded, DetailLevel::Voxels, &job);
        let mut cycles = start(&stand_in(folder.path(), false)).unwrap();
        assert_eq!(
            (cycles.blender(), cycles.bytes_before(), cycles.built().cpu_seconds),
            ("4.2.0", 10, 0.75)
        );
        assert!(cycles.faces() > 100, "{}", cycles.faces());
        for seed in 1..3 {
            let drawn = cycles.picture(seed, 16, &job).unwrap();
            assert_eq!((drawn.spp, drawn.took.cpu_seconds, drawn.peak_bytes), (16, 1.5, 30));
            assert_eq!(drawn.picture.pixels, [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]);
        }
        let lines = std::fs::read_to_string(folder.path().join("lines")).unwrap();
        let seeds: Vec<Value> =
            lines.lines().map(|l| serde_json::from_str::<Value>(l).unwrap()["seed"].clone()).collect();
        assert!(seeds.len() == 2 && seeds[0] != seeds[1], "{seeds:?}");
        let asked = std::fs::read_to_string(folder.path().join("asked.json")).unwrap();
        let asked: Value = serde_json::from_str(&asked).unwrap();
        assert_eq!(asked["instances"].as_array().unwrap().len(), 1);

        // A program that ends early is quoted.
        let mut fails = start(&stand_in(folder.path(), true)).unwrap();
        let error = fails.picture(1, 16, &job).unwrap_err().to_string();
        assert!(error.contains("ended with exit status: 3: out of memory"), "{error}");
    }

    /// Two voxels that touch have ten faces outside, and two between them where light passes through one of them.
    #[test]
    fn faces_between_labels_are_there_where_light_passes() {
        let folder = tempfile::tempdir().unwrap();
        let (_, pair) = pumice_oracle::volumes::volume([8, 8, 8], |x, y, z| match (x, y, z) {
            (3, 3, 3) => 1,
            (4, 3, 3) => 2,
            _ => 0,
        });
        let options = FigureOptions { size: [2, 1], ..FigureOptions::default() };
        let scene = compose(&pair, "memory".into(), &options);
        let faces = |material: Material| {
            let mut scene = scene.clone();
            scene.instances[0].style.materials.insert(2, material);
            let loaded = LoadedScene::new(scene, vec![pair.clone()], vec![]).unwrap();
            let program = stand_in(folder.path(), false);
            Cycles::start(&program, &loaded, DetailLevel::Voxels, &Job::new()).unwrap().faces()
        };
        let opaque = Material::default();
        assert_eq!(faces(opaque), 10);
        assert_eq!(faces(Material { alpha: 0.5, ..opaque }), 12);
        assert_eq!(faces(Material { transmission: 0.5, ..opaque }), 12);
    }

    #[test]
    fn alpha_and_caught_shadows_are_laid_over_white() {
        assert_eq!(laid_over_white(&[0.5, 0.25, 0.0]), [0.5, 0.25, 0.0]);
        assert_eq!(laid_over_white(&[0.5, 0.25, 0.0, 0.5]), [1.0, 0.75, 0.5]);
        assert_eq!(laid_over_white(&[0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 0.0]), [0.25, 0.5, 0.0]);
    }
}
