//! One part of the run: commands one after the other under one cap of seconds.
//!
//! A command runs in a process group of its own, so that what it started ends with it when the cap is hit or Ctrl-C is pressed.
//! Its output is passed on line by line and searched for the runners' closing lines.

use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use crate::closing_lines::Counts;
use crate::cpu_seconds;
use crate::step::{Step, spelled};

/// How a part went.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    Passed,
    Failed(String),
    /// Not run, and why; does not count as passed.
    LeftOut(String),
}

/// A row of the table.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) outcome: Outcome,
    pub(crate) counts: Counts,
    pub(crate) seconds: f64,
    pub(crate) cpu_seconds: Option<f64>,
    pub(crate) cap_seconds: u64,
}

/// Process group that runs now; 0 when none does.
#[derive(Clone, Default)]
pub(crate) struct Running(Arc<AtomicU32>);

impl Running {
    /// Ends the group at once.
    pub(crate) fn kill(&self) {
        let group = self.0.load(Ordering::SeqCst);
        if group != 0 {
            // std cannot signal a group; every system with a shell can.
            let _ = Command::new("sh")
                .args(["-c", &format!("kill -KILL -{group}")])
                .stderr(Stdio::null())
                .status();
        }
    }
}

/// Runs the commands until one fails or the cap is hit. With `must_test` a part in which no test ran has failed.
pub(crate) fn run(
    name: &'static str,
    cap_seconds: u64,
    must_test: bool,
    running: &Running,
    steps: impl FnOnce() -> Result<Vec<Step>, Outcome>,
) -> Row {
    println!("\n──── {name} (at most {cap_seconds} s) ────");
    let (start, cpu_start) = (Instant::now(), cpu_seconds::of_children());
    let deadline = start + Duration::from_secs(cap_seconds);
    let mut counts = Counts::default();
    let mut outcome = Outcome::Passed;
    match steps() {
        Err(early) => outcome = early,
        Ok(steps) => {
            for step in steps {
                if let Err(what) = run_one(step, deadline, running, &mut counts) {
                    outcome = Outcome::Failed(what);
                    break;
                }
            }
        }
    }
    if must_test && outcome == Outcome::Passed && counts.passed == 0 {
        outcome = Outcome::Failed("ran no test".into());
    }
    match &outcome {
        Outcome::Passed => {}
        Outcome::Failed(what) => println!("──── {name} FAILED: {what}"),
        Outcome::LeftOut(why) => println!("──── {name} left out: {why}"),
    }
    Row {
        name,
        outcome,
        counts,
        seconds: start.elapsed().as_secs_f64(),
        cpu_seconds: cpu_start.zip(cpu_seconds::of_children()).map(|(a, b)| b - a),
        cap_seconds,
    }
}

fn run_one(mut step: Step, deadline: Instant, running: &Running, counts: &mut Counts) -> Result<(), String> {
    let said = spelled(&step.command);
    println!("$ {said}");
    let started = step
        .command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .spawn();
    let mut child = started.map_err(|e| step.failure(&e.to_string()))?;
    running.0.store(child.id(), Ordering::SeqCst);

    // Two readers pass the lines on; the channel closes when both pipes have.
    let (send, lines) = channel::<String>();
    let pipes: [Option<Box<dyn Read + Send>>; 2] =
        [child.stdout.take().map(|p| Box::new(p) as _), child.stderr.take().map(|p| Box::new(p) as _)];
    for pipe in pipes.into_iter().flatten() {
        let send = send.clone();
        std::thread::spawn(move || {
            for line in BufReader::new(pipe).split(b'\n').map_while(Result::ok) {
                if send.send(String::from_utf8_lossy(&line).into_owned()).is_err() {
                    break;
                }
            }
        });
    }
    drop(send);

    let mut capped = false;
    loop {
        match lines.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            Ok(line) => {
                println!("{line}");
                counts.read(&line);
            }
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {
                capped = true;
                running.kill();
                break;
            }
        }
    }
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break Ok(status),
            Ok(None) if Instant::now() >= deadline && !capped => {
                capped = true;
                running.kill();
            }
            Ok(None) => std::thread::sleep(Duration::from_millis(10)),
            Err(e) => break Err(format!("{said}: {e}")),
        }
    };
    running.0.store(0, Ordering::SeqCst);
    match status? {
        _ if capped => Err(format!("hit its cap in: {said}")),
        status if status.success() => Ok(()),
        status => Err(step.failure(&status.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    fn outcome_of(cap_seconds: u64, must_test: bool, script: &str) -> (Outcome, Counts) {
        let row =
            run("trial", cap_seconds, must_test, &Running::default(), || Ok(vec![shell(script).into()]));
        (row.outcome, row.counts)
    }

    #[test]
    fn exit_codes_and_counts_decide() {
        let line = "echo 'test result: ok. 2 passed; 0 failed; 0 ignored'";
        assert_eq!(outcome_of(60, true, line), (Outcome::Passed, Counts { passed: 2, failed: 0 }));
        assert_eq!(outcome_of(60, true, "true").0, Outcome::Failed("ran no test".into()));
        assert_eq!(outcome_of(60, false, "true").0, Outcome::Passed);
        assert!(matches!(outcome_of(60, true, &format!("{line}; exit 3")).0, Outcome::Failed(_)));
    }

    /// A grandchild that ignores everything but SIGKILL and holds the pipe open ends with its group.
    #[test]
    fn the_cap_ends_the_whole_group() {
        let mark = std::env::temp_dir().join(format!("xtask-cap-{}", std::process::id()));
        let script = format!("(trap '' TERM INT; sleep 5; touch {}) & sleep 300", mark.display());
        let (outcome, _) = outcome_of(1, false, &script);
        assert!(matches!(&outcome, Outcome::Failed(what) if what.starts_with("hit its cap")), "{outcome:?}");
        std::thread::sleep(Duration::from_secs(5));
        assert!(!mark.exists(), "the grandchild lived on");
    }
}
