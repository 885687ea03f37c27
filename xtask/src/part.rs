//! One part of the run: commands one after the other under one cap of seconds.
//!
//! A command runs in a process group of its own, so that what it started ends with it when the cap is hit or Ctrl-C is pressed.
//! Its output is searched for the runners' closing lines, and passed on: line by line, or, of a part that runs beside another one, as
//! a block when the part ends.

use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
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

/// Process groups that run now.
#[derive(Clone, Default)]
pub(crate) struct Running(Arc<Mutex<Vec<u32>>>);

impl Running {
    /// Ends all groups at once.
    pub(crate) fn kill(&self) {
        self.groups(|groups| groups.iter().for_each(|&group| kill_group(group)));
    }

    fn groups<T>(&self, change: impl FnOnce(&mut Vec<u32>) -> T) -> T {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

fn kill_group(group: u32) {
    // std cannot signal a group; every system with a shell can.
    let _ = Command::new("sh").args(["-c", &format!("kill -KILL -{group}")]).stderr(Stdio::null()).status();
}

/// Where the lines of a part go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Output {
    /// To the terminal, as they come.
    Live,
    /// To the terminal as one block, when the part ends.
    AtTheEnd,
}

/// The lines of a part.
struct Lines {
    output: Output,
    kept: String,
}

impl Lines {
    fn say(&mut self, line: &str) {
        match self.output {
            Output::Live => println!("{line}"),
            Output::AtTheEnd => {
                self.kept.push_str(line);
                self.kept.push('\n');
            }
        }
    }
}

/// Runs the commands until one fails or the cap is hit. With `must_test` a part in which no test ran has failed.
pub(crate) fn run(
    name: &'static str,
    cap_seconds: u64,
    must_test: bool,
    output: Output,
    running: &Running,
    steps: impl FnOnce() -> Result<Vec<Step>, Outcome>,
) -> Row {
    let mut lines = Lines { output, kept: String::new() };
    lines.say(&format!("\n──── {name} (at most {cap_seconds} s) ────"));
    if output == Output::AtTheEnd {
        println!("──── {name} begins; its lines follow when it ends");
    }
    let start = Instant::now();
    let deadline = start + Duration::from_secs(cap_seconds);
    let mut counts = Counts::default();
    let (mut outcome, mut cpu_seconds) = (Outcome::Passed, Some(0.0));
    match steps() {
        Err(early) => outcome = early,
        Ok(steps) => {
            for step in steps {
                let (ended, used) = run_one(step, deadline, running, &mut lines, &mut counts);
                cpu_seconds = cpu_seconds.zip(used).map(|(a, b)| a + b);
                if let Err(what) = ended {
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
        Outcome::Failed(what) => lines.say(&format!("──── {name} FAILED: {what}")),
        Outcome::LeftOut(why) => lines.say(&format!("──── {name} left out: {why}")),
    }
    // One call, so that no line of another part comes between.
    print!("{}", lines.kept);
    Row { name, outcome, counts, seconds: start.elapsed().as_secs_f64(), cpu_seconds, cap_seconds }
}

/// How a step ended, and the CPU seconds that it took.
fn run_one(
    mut step: Step,
    deadline: Instant,
    running: &Running,
    lines: &mut Lines,
    counts: &mut Counts,
) -> (Result<(), String>, Option<f64>) {
    let said = spelled(&step.command);
    lines.say(&format!("$ {said}"));
    let started = step
        .command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .spawn();
    let mut child = match started {
        Ok(child) => child,
        Err(e) => return (Err(step.failure(&e.to_string())), None),
    };
    let group = child.id();
    running.groups(|groups| groups.push(group));

    // Two readers pass the lines on; the channel closes when both pipes have.
    let (send, received) = channel::<String>();
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
        match received.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            Ok(line) => {
                lines.say(&line);
                counts.read(&line);
            }
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {
                capped = true;
                kill_group(group);
                break;
            }
        }
    }
    // Its CPU time can be read once it has ended and before it is waited for.
    let mut used = None;
    while used.is_none() && Instant::now() < deadline && !cpu_seconds::has_ended(group) {
        std::thread::sleep(Duration::from_millis(10));
    }
    if cpu_seconds::has_ended(group) {
        used = cpu_seconds::of(group);
    }
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break Ok(status),
            Ok(None) if Instant::now() >= deadline && !capped => {
                capped = true;
                kill_group(group);
            }
            Ok(None) => std::thread::sleep(Duration::from_millis(10)),
            Err(e) => break Err(format!("{said}: {e}")),
        }
    };
    running.groups(|groups| groups.retain(|&other| other != group));
    let ended = match status {
        Err(e) => Err(e),
        Ok(_) if capped => Err(format!("hit its cap in: {said}")),
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(step.failure(&status.to_string())),
    };
    (ended, used)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    fn row_of(cap_seconds: u64, must_test: bool, script: &str) -> Row {
        let steps = || Ok(vec![shell(script).into()]);
        run("trial", cap_seconds, must_test, Output::AtTheEnd, &Running::default(), steps)
    }

    fn outcome_of(cap_seconds: u64, must_test: bool, script: &str) -> (Outcome, Counts) {
        let row = row_of(cap_seconds, must_test, script);
        (row.outcome, row.counts)
    }

    /// Each of two parts that run at once has the CPU time of its own processes, those that they waited for among them.
    #[test]
    #[cfg(target_os = "linux")]
    fn parts_beside_each_other_have_their_own_seconds() {
        let burn = "sh -c 'i=0; while [ $i -lt 400000 ]; do i=$((i+1)); done'";
        let (busy, idle) = std::thread::scope(|scope| {
            let busy = scope.spawn(|| row_of(60, false, burn).cpu_seconds);
            let idle = scope.spawn(|| row_of(60, false, "sleep 0.5").cpu_seconds);
            (busy.join().unwrap().unwrap(), idle.join().unwrap().unwrap())
        });
        assert!(busy > 4.0 * idle && busy > 0.05, "{busy} s of a loop, {idle} s of sleep");
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
