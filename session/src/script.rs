//! Runs scripts in a Python that has other programs as modules, such as Blender. They read their input from files and write their
//! results to files.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use pumice_core::Job;

use crate::error::{Result, SessionError, io};

/// Runs a script to its end; `what` names it in errors. Its output goes into a file, whose last line is quoted in the error.
///
/// # Errors
/// When the interpreter cannot be started, the script fails, or `job` is cancelled, which ends the script.
pub fn run_script(
    what: &str,
    python: &Path,
    script: &Path,
    asked: &Path,
    said: &Path,
    job: &Job,
) -> Result<()> {
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
        "{what} in {} ended with {status}: {}",
        python.display(),
        pumice_core::error::one_line(last)
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_fails_is_quoted_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("s"), "echo first; echo 'No module named bpy' >&2; exit 3").unwrap();
        let failed = |program: &str| {
            run_script("Cycles", Path::new(program), &path("s"), &path("job"), &path("said"), &Job::new())
                .unwrap_err()
                .to_string()
        };
        assert_eq!(failed("sh"), "Cycles in sh ended with exit status: 3: No module named bpy");
        assert!(failed("/no/such/python").starts_with("/no/such/python: "));
        let job = Job::new();
        job.cancel();
        std::fs::write(path("s"), "exec sleep 100").unwrap();
        let ended =
            run_script("Cycles", Path::new("sh"), &path("s"), &path("job"), &path("said"), &job).unwrap_err();
        assert_eq!(ended.to_string(), "cancelled");
    }
}
