//! Runs scripts in a Python that has other programs as modules, such as Blender. They read their input from files and write their
//! results to files.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use pumice_core::Job;

use crate::error::{Result, SessionError, io};

/// Time between two looks at a process.
const POLL: Duration = Duration::from_millis(20);

/// A script that runs. It ends with this value.
#[derive(Debug)]
pub struct Script {
    what: String,
    program: PathBuf,
    said: PathBuf,
    child: Child,
}

impl Script {
    /// Starts a script with one argument; `what` names it in errors. Its output goes into the file `said`, whose last line is quoted in
    /// errors. `is_blender` says that the program is Blender and not Python.
    ///
    /// # Errors
    /// When the program cannot be started.
    pub fn start(
        what: &str,
        program: &Path,
        is_blender: bool,
        [script, asked]: [&Path; 2],
        said: &Path,
    ) -> Result<Self> {
        let log = std::fs::File::create(said).map_err(io(said))?;
        let errors = log.try_clone().map_err(io(said))?;
        let mut command = Command::new(program);
        if is_blender {
            command.args(["--background", "--factory-startup", "--python"]).arg(script).arg("--");
        } else {
            command.arg(script);
        }
        let child = command
            .arg(asked)
            .stdin(Stdio::piped())
            .stdout(log)
            .stderr(errors)
            .spawn()
            .map_err(io(program))?;
        Ok(Self { what: what.to_owned(), program: program.to_owned(), said: said.to_owned(), child })
    }

    /// Writes a line to its standard input.
    ///
    /// # Errors
    /// When it does not read any more: what it said last.
    pub fn say(&mut self, line: &str) -> Result<()> {
        let written = match &mut self.child.stdin {
            Some(stdin) => writeln!(stdin, "{line}").and_then(|()| stdin.flush()),
            None => Err(std::io::ErrorKind::BrokenPipe.into()),
        };
        match written {
            Ok(()) => Ok(()),
            Err(_) => {
                let status = self.end(None)?;
                Err(self.failure(status))
            }
        }
    }

    /// Waits until it has made a file.
    ///
    /// # Errors
    /// When it ends before, or `job` is cancelled, which ends it.
    pub fn wait_for(&mut self, path: &Path, job: &Job) -> Result<()> {
        while !path.exists() {
            if let Some(status) = self.child.try_wait().map_err(io(&self.program))?
                && !path.exists()
            {
                return Err(self.failure(status));
            }
            job.check()?;
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    /// Waits for its end.
    ///
    /// # Errors
    /// When it fails, or `job` is cancelled, which ends it.
    pub fn finish(mut self, job: &Job) -> Result<()> {
        self.child.stdin = None;
        match self.end(Some(job))? {
            status if status.success() => Ok(()),
            status => Err(self.failure(status)),
        }
    }

    fn end(&mut self, job: Option<&Job>) -> Result<ExitStatus> {
        loop {
            if let Some(status) = self.child.try_wait().map_err(io(&self.program))? {
                return Ok(status);
            }
            if let Some(job) = job {
                job.check()?;
            }
            std::thread::sleep(POLL);
        }
    }

    /// An error with the last line that it said.
    fn failure(&self, status: ExitStatus) -> SessionError {
        let text = std::fs::read(&self.said).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let last = text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it said nothing");
        SessionError::Caller(format!(
            "{} in {} ended with {status}: {}",
            self.what,
            self.program.display(),
            pumice_core::error::one_line(last)
        ))
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        // A process that has ended cannot be killed, which is what is wanted.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs a script of Python to its end (see [`Script::start`]).
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
    Script::start(what, python, false, [script, asked], said)?.finish(job)
}

/// Whether a program is Blender, and not a Python: it is asked for its version.
///
/// # Errors
/// When it cannot be started.
pub fn is_blender_program(program: &Path) -> Result<bool> {
    let output = Command::new(program).arg("--version").stdin(Stdio::null()).output().map_err(io(program))?;
    Ok(String::from_utf8_lossy(&output.stdout).trim_start().starts_with("Blender"))
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
