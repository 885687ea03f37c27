//! This program, started again: a measurement of memory needs a process of its own.

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;
use std::process::Command;

use pumice_session::error::{Result, SessionError, io};
use serde::de::DeserializeOwned;

/// This program, and the words that lead to one of its benches: `pumice bench export`, or `pumice-bench export`.
pub(crate) struct Itself {
    path: PathBuf,
    words: Vec<OsString>,
}

impl Itself {
    /// The bench of this name, which is the one that runs.
    pub(crate) fn of(bench: &str) -> Result<Self> {
        let path = std::env::current_exe().map_err(io("this program"))?;
        let mut words: Vec<OsString> = std::env::args_os().skip(1).take_while(|word| word != bench).collect();
        words.push(bench.into());
        Ok(Self { path, words })
    }

    /// What a process with these arguments prints, one line of JSON.
    ///
    /// # Errors
    /// Where it cannot be started, ends with another status than 0 (with its last line), or prints something else.
    pub(crate) fn report<T: DeserializeOwned, A: AsRef<OsStr>>(
        &self,
        arguments: impl IntoIterator<Item = A>,
    ) -> Result<T> {
        let output =
            Command::new(&self.path).args(&self.words).args(arguments).output().map_err(io(&self.path))?;
        if !output.status.success() {
            let text = String::from_utf8_lossy(&output.stderr);
            let line = text.lines().next_back().unwrap_or("it said nothing");
            let what = format!("a process of this bench ended with {}: {line}", output.status);
            return Err(SessionError::Caller(what));
        }
        serde_json::from_slice(&output.stdout).map_err(|e| {
            SessionError::Caller(format!("the report of a process of this bench is not JSON: {e}"))
        })
    }
}
