//! Asks Intel's Open Image Denoise, through a Python that has the module `pyoidn`; `oidn.py` says how the two talk.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use pumice_picture::{Image, Picture};
use pumice_session::error::Result;

use super::wrong;

const SCRIPT: &str = include_str!("oidn.py");
/// Bytes of the seconds before the picture.
const SECONDS: usize = 8;

/// A Python that has it.
pub(super) struct Oidn {
    python: PathBuf,
    /// Version of the module.
    pub(super) version: String,
}

impl Oidn {
    /// Asks the Python for the version of its module.
    ///
    /// # Errors
    /// One line when it cannot be started or lacks the module.
    pub(super) fn check(python: &Path) -> Result<Self> {
        let said = asked(python, &[])?;
        let version = String::from_utf8_lossy(&said).trim().to_owned();
        Ok(Self { python: python.to_owned(), version })
    }

    /// The denoised picture and the CPU seconds that it took.
    ///
    /// # Errors
    /// One line when the program fails or answers with another picture.
    pub(super) fn denoise(&self, picture: &Picture) -> Result<(Image, f64)> {
        let color = &picture.color;
        let (Some(albedo), Some(normal)) = (&picture.albedo, &picture.normal) else {
            return Err(wrong(
                &self.python,
                "expected a picture with base colour and normal, got one without",
            ));
        };
        let mut sent: Vec<u8> = [color.width, color.height].map(|n| (n as i32).to_ne_bytes()).concat();
        for image in [color, albedo, normal] {
            sent.extend_from_slice(bytemuck::cast_slice(&image.pixels));
        }
        let said = asked(&self.python, &sent)?;
        let expected = SECONDS + 12 * color.pixels.len();
        let (Some((seconds, pixels)), true) = (said.split_first_chunk::<SECONDS>(), said.len() == expected)
        else {
            return Err(wrong(&self.python, format_args!("expected {expected} bytes, got {}", said.len())));
        };
        let floats: Vec<f32> = pixels.as_chunks::<4>().0.iter().map(|b| f32::from_ne_bytes(*b)).collect();
        let image = Image::new(color.width, color.height, floats.as_chunks::<3>().0.to_vec());
        Ok((image, f64::from_ne_bytes(*seconds)))
    }
}

/// What the script answers to some input.
fn asked(python: &Path, input: &[u8]) -> Result<Vec<u8>> {
    let mut child = Command::new(python)
        .args(["-c", SCRIPT])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| wrong(python, e))?;
    if let Some(mut to) = child.stdin.take() {
        // If the script has ended, its exit status and last line say why.
        let _ = to.write_all(input);
    }
    let output = child.wait_with_output().map_err(|e| wrong(python, e))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().last().unwrap_or("no message").trim().to_owned();
        return Err(wrong(
            python,
            format_args!("expected a Python with the module pyoidn, got {}: {last}", output.status),
        ));
    }
    Ok(output.stdout)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_such_module_is_refused_in_a_line() {
        for (python, said) in
            [("/nonexistent/python", "No such file"), ("false", "expected a Python with the module pyoidn")]
        {
            let error = Oidn::check(Path::new(python)).err().unwrap().to_string();
            assert!(error.starts_with(&format!("--oidn {python}: ")) && error.contains(said), "{error}");
            assert!(!error.contains('\n'));
        }
    }
}
