//! Runs the program that traces with Embree. It is compiled from `bench/embree/rays.c`, reads and writes files, and takes commands as lines
//! of text; the C file documents both.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use glam::{DAffine3, DVec3};
use pumice_export::QuadMesh;
use pumice_session::error::{Result, SessionError, io};

use super::Ray;

const SOURCE: &str = include_str!("../../embree/rays.c");

/// Error text if compiling against Embree fails.
const INSTALL: &str = "this bench needs Embree 3: install it (Debian 12: apt install libembree-dev), or pass a folder that holds its \
include and lib as --embree (for unpacked packages: …/usr)";

/// Compiles the program into `folder` and returns its path. `prefix` holds Embree if the compiler does not find it by itself.
pub(super) fn build_driver(folder: &Path, prefix: Option<&Path>) -> Result<PathBuf> {
    let (source, driver) = (folder.join("rays.c"), folder.join("rays"));
    std::fs::write(&source, SOURCE).map_err(io(&source))?;
    let mut compiler = Command::new("cc");
    compiler.args(["-O3", "-march=native", "-std=gnu11", "-o"]).arg(&driver).arg(source);
    if let Some(prefix) = prefix {
        compiler.arg("-I").arg(prefix.join("include"));
        for lib in ["lib", "lib/x86_64-linux-gnu", "lib/aarch64-linux-gnu"] {
            if let Ok(lib) = prefix.join(lib).canonicalize() {
                compiler.arg("-L").arg(&lib).arg(format!("-Wl,-rpath,{}", lib.display()));
            }
        }
        // The libraries that Embree links are in its own folder.
        compiler.args(["-Wl,--disable-new-dtags", "-Wl,--allow-shlib-undefined"]);
    }
    let said = compiler.args(["-lembree3", "-lm"]).output().map_err(io("cc"))?;
    if said.status.success() {
        return Ok(driver);
    }
    let text = String::from_utf8_lossy(&said.stderr);
    let first = text.lines().next().unwrap_or_default();
    Err(SessionError::Caller(format!("{INSTALL}; cc: {}: {first}", said.status)))
}

/// The running program, which has built its mesh and waits for rays.
pub(super) struct Driver {
    child: Child,
    ask: ChildStdin,
    answer: BufReader<ChildStdout>,
    /// CPU seconds of building Embree's hierarchy.
    pub(super) build_cpu_seconds: f64,
    /// Bytes that Embree holds, with the arrays of the quads.
    pub(super) bytes: u64,
}

impl Driver {
    /// Starts the program, and waits until it has built its hierarchy.
    pub(super) fn start(program: &Path, mesh: &Path) -> Result<Self> {
        let mut child = Command::new(program)
            .arg(mesh)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(io(program))?;
        let (Some(ask), Some(answer)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(SessionError::Caller(
                "the program with Embree has no standard input or output".into(),
            ));
        };
        let mut driver =
            Self { child, ask, answer: BufReader::new(answer), build_cpu_seconds: 0.0, bytes: 0 };
        match driver.numbers_after("built")?[..] {
            [seconds, bytes] => (driver.build_cpu_seconds, driver.bytes) = (seconds, bytes as u64),
            ref other => return Err(unexpected("built SECONDS BYTES", &format!("{other:?}"))),
        }
        Ok(driver)
    }

    /// The numbers in the program's next line of output, which must begin with `word`.
    fn numbers_after(&mut self, word: &str) -> Result<Vec<f64>> {
        let mut line = String::new();
        self.answer.read_line(&mut line).map_err(io("Embree's program"))?;
        let numbers =
            line.trim().strip_prefix(word).map(|rest| rest.split_whitespace().map(str::parse).collect());
        match numbers {
            Some(Ok(numbers)) => Ok(numbers),
            _ => Err(unexpected(&format!("a line of {word} and numbers"), line.trim())),
        }
    }

    /// Traces the rays of a file and writes their hits to another; returns the CPU seconds of the tracing only.
    pub(super) fn trace(&mut self, rays: &Path, hits: &Path) -> Result<f64> {
        writeln!(self.ask, "trace {} {}", rays.display(), hits.display()).map_err(io("Embree's program"))?;
        match self.numbers_after("traced")?[..] {
            [seconds] => Ok(seconds),
            ref other => Err(unexpected("traced SECONDS", &format!("{other:?}"))),
        }
    }

    /// Closes the program's input and waits for its end.
    pub(super) fn end(self) -> Result<()> {
        let Self { mut child, ask, .. } = self;
        drop(ask);
        let status = child.wait().map_err(io("Embree's program"))?;
        match status.success() {
            true => Ok(()),
            false => Err(SessionError::Caller(format!("the program with Embree ended with {status}"))),
        }
    }
}

fn unexpected(expected: &str, got: &str) -> SessionError {
    SessionError::Caller(format!("the program with Embree: expected {expected}, got {got:?}"))
}

/// Writes a mesh as `rays.c` reads it, with `middle` moved to the origin.
pub(super) fn write_mesh(path: &Path, mesh: &QuadMesh, world: &DAffine3, middle: DVec3) -> Result<()> {
    let mut bytes = Vec::with_capacity(16 + 12 * mesh.vertices.len() + 16 * mesh.quads.len());
    bytes.extend((mesh.vertices.len() as u64).to_le_bytes());
    bytes.extend((mesh.quads.len() as u64).to_le_bytes());
    for v in &mesh.vertices {
        let place = world.transform_point3(DVec3::from(v.map(f64::from))) - middle;
        bytes.extend(place.to_array().iter().flat_map(|&x| (x as f32).to_le_bytes()));
    }
    bytes.extend(mesh.quads.iter().flatten().flat_map(|v| v.to_le_bytes()));
    std::fs::write(path, bytes).map_err(io(path))
}

/// Writes rays as `rays.c` reads them; each starts at Pumice's origin plus the lift.
pub(super) fn write_rays(path: &Path, rays: &[Ray]) -> Result<()> {
    let mut bytes = (rays.len() as u64).to_le_bytes().to_vec();
    for ray in rays {
        let (o, d) = (ray.ray.origin + ray.lift, ray.ray.direction);
        for v in [o.x, o.y, o.z, 0.0, d.x, d.y, d.z, 0.0] {
            bytes.extend((v as f32).to_le_bytes());
        }
    }
    std::fs::write(path, bytes).map_err(io(path))
}

/// Reads the distance of each ray's hit, infinite for a miss.
pub(super) fn read_hits(path: &Path, expected: usize) -> Result<Vec<f64>> {
    let bytes = std::fs::read(path).map_err(io(path))?;
    if bytes.len() != 8 * expected {
        return Err(unexpected(&format!("{expected} hits of 8 bytes"), &format!("{} bytes", bytes.len())));
    }
    let hit = |b: &[u8; 8]| match u32::from_le_bytes([b[4], b[5], b[6], b[7]]) {
        u32::MAX => f64::INFINITY,
        _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
    };
    Ok(bytes.as_chunks::<8>().0.iter().map(hit).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hits_are_read_by_distance_and_number_and_what_is_too_short_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hits");
        let mut bytes = 2.5f32.to_le_bytes().to_vec();
        bytes.extend(7u32.to_le_bytes());
        bytes.extend(9.0f32.to_le_bytes());
        bytes.extend(u32::MAX.to_le_bytes());
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(read_hits(&path, 2).unwrap(), [2.5, f64::INFINITY]);
        assert!(read_hits(&path, 3).unwrap_err().to_string().contains("16 bytes"));
    }
}
