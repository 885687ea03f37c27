//! A command to be run, and what to tell whoever runs it when it fails.
//!
//! What a tool says about its own failure may be a page, or nothing that leads on; the advice is one line: what was wanted, and the
//! way out.

use std::path::Path;
use std::process::Command;

/// A command with the advice for its failure.
#[derive(Debug)]
pub(crate) struct Step {
    pub(crate) command: Command,
    pub(crate) advice: Option<String>,
}

impl From<Command> for Step {
    fn from(command: Command) -> Self {
        Self { command, advice: None }
    }
}

impl Step {
    /// The command, with what to say when it fails.
    pub(crate) fn or_say(command: Command, advice: impl Into<String>) -> Self {
        Self { command, advice: Some(advice.into()) }
    }

    /// The one line of a failure: what happened (`exit status: 1`), to which command, and the advice.
    pub(crate) fn failure(&self, what: &str) -> String {
        let said = spelled(&self.command);
        match &self.advice {
            Some(advice) => format!("{advice} ({what} of: {said})"),
            None => format!("{what} of: {said}"),
        }
    }

    /// Runs it to its end, on this terminal.
    pub(crate) fn finish(mut self) -> Result<(), String> {
        match self.command.status() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(self.failure(&status.to_string())),
            Err(e) => Err(self.failure(&e.to_string())),
        }
    }
}

/// The command as one would type it.
pub(crate) fn spelled(command: &Command) -> String {
    let program = Path::new(command.get_program());
    let words =
        std::iter::once(program.file_name().unwrap_or(command.get_program())).chain(command.get_args());
    let line = words.map(|w| w.to_string_lossy()).collect::<Vec<_>>().join(" ").replace('\n', "↵");
    // A long list of test names says no more than its beginning.
    if line.chars().count() > 300 { line.chars().take(300).chain(['…']).collect() } else { line }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    #[test]
    fn a_failure_is_one_line_with_the_way_out() {
        assert_eq!(Step::from(shell("true")).finish(), Ok(()));
        let failed = Step::from(shell("exit 3\n")).finish().unwrap_err();
        assert_eq!(failed, "exit status: 3 of: sh -c exit 3↵");
        let advised = Step::or_say(shell("exit 3"), "no network?").finish().unwrap_err();
        assert_eq!(advised, "no network? (exit status: 3 of: sh -c exit 3)");
        let missing = Command::new("/program/that/is/not/there");
        let advised = Step::or_say(missing, "install it").finish().unwrap_err();
        assert!(advised.starts_with("install it (") && !advised.contains('\n'), "{advised}");
    }
}
