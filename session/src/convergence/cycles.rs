//! The other program: the scene's voxel faces as files, a job that names them, a Python that has Blender, and what came back.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use pumice_core::{CompressedVolume, Job};
use pumice_cpu::looks::Looks;
use pumice_export::{Corners, Interfaces, QuadMesh};
use pumice_render::Image;
use pumice_scene::Scene;
use serde::Deserialize;
use serde_json::json;

use super::Preparation;
use crate::error::{Result, SessionError, io};

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
    run(python, &path("scene_in_cycles.py"), &path("job.json"), &path("said.txt"), job)?;

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

/// Runs the script to its end; what it says goes into a file, whose last line is the error's.
fn run(python: &Path, script: &Path, asked: &Path, said: &Path, job: &Job) -> Result<()> {
    let log = std::fs::File::create(said).map_err(io(said))?;
    let errors = log.try_clone().map_err(io(said))?;
    let mut child = Command::new(python)
        .arg(script)
        .arg(asked)
        .stdin(Stdio::null())
        .stdout(log)
        .stderr(errors)
        .spawn()
        .map_err(io(python))?;
    let status = loop {
        if let Some(status) = child.try_wait().map_err(io(python))? {
            break status;
        }
        if let Err(cancelled) = job.check() {
            child.kill().and_then(|()| child.wait()).map_err(io(python))?;
            return Err(cancelled.into());
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    if status.success() {
        return Ok(());
    }
    let text = std::fs::read(said).map_err(io(said))?;
    let text = String::from_utf8_lossy(&text);
    let last = text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it said nothing");
    Err(SessionError::Caller(format!(
        "Cycles in {} ended with {status}: {}",
        python.display(),
        pumice_core::error::one_line(last)
    )))
}

/// Writes a C-ordered array as .npy, version 1.0 (numpy's `numpy.lib.format`).
fn write_npy(path: &PathBuf, kind: &str, shape: &[usize], bytes: &[u8]) -> Result<()> {
    let sizes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({sizes}), }}");
    // Magic, version and length take 10 bytes; the whole is a multiple of 64 and ends with a line break.
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut file = std::fs::File::create(path).map_err(io(path))?;
    let mut write = |part: &[u8]| file.write_all(part).map_err(io(path));
    write(b"\x93NUMPY\x01\x00")?;
    write(&(header.len() as u16).to_le_bytes())?;
    write(header.as_bytes())?;
    write(bytes)
}

/// The values of a .npy of 32-bit floats that has as many as expected.
fn read_npy_f32(path: &PathBuf, expected: usize) -> Result<Vec<f32>> {
    let bytes = std::fs::read(path).map_err(io(path))?;
    let header = match bytes.get(8..10) {
        Some(&[low, high]) if bytes.starts_with(b"\x93NUMPY\x01") => {
            usize::from(u16::from_le_bytes([low, high]))
        }
        _ => return Err(SessionError::Caller(format!("{}: expected .npy, version 1", path.display()))),
    };
    let values = bytes.get(10 + header..).unwrap_or(&[]);
    if values.len() != 4 * expected || !bytes[..10 + header].windows(3).any(|w| w == b"<f4") {
        return Err(SessionError::Caller(format!(
            "{}: expected {expected} floats of 32 bits, got {} bytes",
            path.display(),
            values.len()
        )));
    }
    Ok(values.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        let values = [1.5f32, -2.0, 3.25, 0.0, 7.0, 8.0];
        write_npy(&path, "<f4", &[2, 3], bytemuck::cast_slice(&values)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        // numpy asks for data at a multiple of 64 bytes.
        assert_eq!((bytes.len() - 24) % 64, 0);
        assert!(bytes[10..].starts_with(b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, ), }"));
        assert_eq!(read_npy_f32(&path, 6).unwrap(), values);
        assert!(read_npy_f32(&path, 5).is_err());
        std::fs::write(&path, b"no array").unwrap();
        assert!(read_npy_f32(&path, 6).unwrap_err().to_string().contains("a.npy"));
    }

    #[test]
    fn a_program_that_fails_is_quoted_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("s"), "echo first; echo 'No module named bpy' >&2; exit 3").unwrap();
        let failed = |program: &str| {
            run(Path::new(program), &path("s"), &path("job"), &path("said"), &Job::new())
                .unwrap_err()
                .to_string()
        };
        assert_eq!(failed("sh"), "Cycles in sh ended with exit status: 3: No module named bpy");
        assert!(failed("/no/such/python").starts_with("/no/such/python: "));
        let job = Job::new();
        job.cancel();
        std::fs::write(path("s"), "exec sleep 100").unwrap();
        let ended = run(Path::new("sh"), &path("s"), &path("job"), &path("said"), &job).unwrap_err();
        assert_eq!(ended.to_string(), "cancelled");
    }
}
