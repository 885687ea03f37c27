//! A command to run, with a line of advice for its failure.
//!
//! A tool's own output on failure may be a page, or may not help. The advice is one line that says what failed and what to do.

use std::path::Path;
use std::process::Command;

/// A command, with advice for its failure.
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
    /// The command with this advice.
    pub(crate) fn or_say(command: Command, advice: impl Into<String>) -> Self {
        Self { command, advice: Some(advice.into()) }
    }

    /// The line that reports a failure: the advice, what happened (such as `exit status: 1`), and the command.
    pub(crate) fn failure(&self, what: &str) -> String {
        let said = spelled(&self.command);
        match &self.advice {
            Some(advice) => format!("{advice} ({what} of: {said})"),
            None => format!("{what} of: {said}"),
        }
    }

    /// Runs the command to its end, with output on this terminal.
    pub(crate) fn finish(mut self) -> Result<(), String> {
        match self.command.status() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(self.failure(&status.to_string())),
            Err(e) => Err(self.failure(&e.to_string())),
        }
    }
}

/// The command as typed in a shell, cut after 300 characters.
pub(crate) fn spelled(command: &Command) -> String {
    let program = Path::new(command.get_program());
    let words =
        std::iter::once(program.file_name().unwrap_or(command.get_program())).chain(command.get_args());
    let line = words.map(|w| w.to_string_lossy()).collect::<Vec<_>>().join(" ").replace('\n', "↵");
    // A command may have a long list of test names.
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
