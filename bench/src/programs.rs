//! The programs that are measured, built with the release profile.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::Result;

/// Where they are.
#[derive(Clone, Debug)]
pub(crate) struct Programs {
    pumice: PathBuf,
    examples: PathBuf,
}

impl Programs {
    /// Builds those that are asked for (package, `--bin` or `--example`, name); nothing happens where they are up to date.
    pub(crate) fn build(wanted: &[[&str; 3]]) -> Result<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for &[package, kind, name] in wanted {
            let args = ["build", "--quiet", "--release", "--package", package, kind, name];
            said(Command::new("cargo").current_dir(&root).args(args))?;
        }
        let target = std::env::var_os("CARGO_TARGET_DIR")
            .map_or_else(|| root.join("target"), PathBuf::from)
            .join("release");
        Ok(Self { pumice: target.join("pumice"), examples: target.join("examples") })
    }

    /// What `pumice ARGS…` prints.
    pub(crate) fn pumice<A: AsRef<OsStr>>(&self, args: &[A]) -> Result<String> {
        said(Command::new(&self.pumice).args(args))
    }

    /// The JSON object that `pumice ARGS…` prints.
    pub(crate) fn report<A: AsRef<OsStr>>(&self, args: &[A]) -> Result<Value> {
        let text = self.pumice(args)?;
        let begin = text.find('{').ok_or_else(|| format!("no JSON in: {text}"))?;
        serde_json::from_str(&text[begin..]).map_err(|e| format!("{e} in: {text}"))
    }

    /// What an example prints.
    pub(crate) fn example<A: AsRef<OsStr>>(&self, name: &str, args: &[A]) -> Result<String> {
        said(Command::new(self.examples.join(name)).args(args))
    }
}

/// What a command prints; an error where it fails.
pub(crate) fn said(command: &mut Command) -> Result<String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|e| format!("{name}: {e}"))?;
    if !output.status.success() {
        return Err(format!("{name}: {}: {}", output.status, String::from_utf8_lossy(&output.stderr).trim()));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// A number of a report.
pub(crate) fn number(report: &Value, key: &str) -> Result<f64> {
    report[key].as_f64().ok_or_else(|| format!("no number {key} in {report}"))
}

/// The number that stands before `unit` in the first line of a text that begins with `start`.
pub(crate) fn figure(text: &str, start: &str, unit: &str) -> Result<String> {
    let line = text.lines().find(|l| l.starts_with(start));
    let words: Vec<&str> = line.unwrap_or_default().split_whitespace().collect();
    let value = words.iter().zip(words.iter().skip(1)).find(|(_, next)| **next == unit).map(|(v, _)| *v);
    let number = value.filter(|v| v.parse::<f64>().is_ok());
    number.map(str::to_owned).ok_or_else(|| format!("no line {start:?} with a figure in {unit} in: {text}"))
}

/// A folder that goes away with its value.
pub(crate) fn scratch() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(|e| format!("temporary folder: {e}"))
}

/// The file's name without its folder.
pub(crate) fn name_of(volume: &Path) -> String {
    volume.file_name().unwrap_or(volume.as_os_str()).to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_found_by_their_unit_and_missed_when_they_are_not_there() {
        let text =
            "parts     402.7 MVoxel/CPU-s  0.083 CPU-s  975797 records\ncontacts 0.120 CPU-s, 38661 pairs\n";
        assert_eq!(figure(text, "parts", "MVoxel/CPU-s").as_deref(), Ok("402.7"));
        assert_eq!(figure(text, "contacts", "CPU-s,").as_deref(), Ok("0.120"));
        assert!(figure(text, "contacts", "M/s").is_err() && figure(text, "rays", "M/s").is_err());
    }
}
