//! `cargo xtask test`: the parts, two at a time.
//!
//! ```text
//! build ──────────────────────► rust ───────────────────────────────────► blender ──────────► …
//! python-env, vulkan-env, blender-env ─► wheel ─► cli ─► python-module ─────────► python ─► …
//! ```
//! Whoever is free takes the first part of the list whose needs (`needed`) are met. What is fetched and unpacked comes while the workspace compiles;
//! later one part leaves the other the core that it does not use itself. The parts that take longest come first, and of these Blender's last, whose
//! threads use a core that is idle. Lines of `build` and `rust` are passed on as they come, those of another part as a block when it ends.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Instant;

use crate::blender::Blender;
use crate::part::{self, Outcome, Output, Row, Running};
use crate::private_mesa::PrivateMesa;
use crate::python_env::Environment;
use crate::step::Step;
use crate::{extension, seconds_table, share, shared_data, wheel};

/// Name, cap in seconds, what it is, in the order in which they begin. The caps are several times what a part needs beside another, so that only a
/// hang or a gross slowdown hits one.
const PARTS: [(&str, u64, &str); 14] = [
    ("build", 1800, "the workspace's tests, the command, the examples"),
    ("python-env", 600, "target/venv from tests/python/requirements.txt"),
    ("vulkan-env", 600, "target/mesa: Vulkan on the CPU, its validation layer, the shader compiler"),
    ("blender-env", 900, "target/venv-bpy: Blender as a module, and the libraries that it lacks here"),
    ("rust", 4000, "compiled shaders are not stale; unit and integration tests of every crate"),
    ("wheel", 1200, "the module pumice for Python, built and installed"),
    ("cli", 2400, "the command: contract, bad input, full disk, Ctrl-C"),
    ("python-module", 2400, "its stub, its types, its tests; the samples of the docs"),
    ("blender", 1800, "the extension, packed and installed as a user does, in Blender without a window"),
    ("python", 1500, "formats, file layout and metrics against other people's code"),
    ("shared-python", 1200, "suites over volumes that may not be shipped, in Python"),
    ("shared-rust", 1500, "the same, in Rust"),
    ("share", 2400, "today's share of the full set"),
    ("rust-docs", 900, "examples in the documentation"),
];
/// Parts that run at once. Three on two cores end no sooner: `rust`, the longest, is then alone at the end (2,150 s, and 2,120 s with two).
const AT_ONCE: usize = 2;
/// Test programs of `pumice-vulkan` that take turns by day, the first of each pair on even days. Their manifest says `test = false`, so that
/// a plain `cargo test` passes them by.
const BACKENDS_BY_TURNS: [&str; 2] = ["renderer_query", "renderer_pipeline"];
const COMPUTE_BY_TURNS: [&str; 2] = ["renderer_passes", "renderer"];

/// Which tests of the hardware backends run without `--full`: what a device keeps after edits and failures. The pictures of their other
/// tests are drawn by `renderer`, and by these backends in the Python module's ladder.
const OF_BACKENDS: [&str; 3] = ["--", "edits::", "failures::"];

/// The oldest Blender that is supported, and the tests that also run in it with `--full`: its importers read files as others do.
const OLDEST_BLENDER: &str = "4.2.23";
const OF_IMPORT: [&str; 2] =
    ["blender-addon/tests/test_usd_import.py", "blender-addon/tests/test_gltf_import.py"];

/// pytest, which names the tests that took longest.
const PYTEST: [&str; 7] =
    ["-m", "pytest", "-q", "--durations=10", "--durations-min=5", "-p", "no:cacheprovider"];

/// With `--full` a part may take this many times its cap: hours.
const FULL_CAP_FACTOR: u64 = 24;

/// What was asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Options {
    full: bool,
    only: Vec<String>,
    share: Option<u64>,
    list: bool,
    /// Another Blender than the listed one.
    bpy: Option<String>,
}

impl Options {
    pub(crate) fn parse(args: &[String]) -> Result<Self, String> {
        let mut options = Self::default();
        let mut args = args.iter();
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or_else(|| format!("{arg} needs a value"));
            match arg.as_str() {
                "--full" => options.full = true,
                "--list" => options.list = true,
                "--bpy" => {
                    let version = value()?;
                    if !version.split('.').all(|n| n.parse::<u32>().is_ok()) {
                        return Err(format!("--bpy {version}: expected a version such as 4.5.15"));
                    }
                    options.bpy = Some(version.clone());
                }
                "--only" => {
                    let name = value()?;
                    if !PARTS.iter().any(|p| p.0 == name) {
                        let names = PARTS.map(|p| p.0).join(", ");
                        return Err(format!("no part is named {name}: expected one of {names}"));
                    }
                    options.only.push(name.clone());
                }
                "--share" => {
                    let text = value()?;
                    let k = text.parse().ok().filter(|&k| k < share::SHARES);
                    options.share = Some(
                        k.ok_or_else(|| format!("--share {text}: expected 0 to {}", share::SHARES - 1))?,
                    );
                }
                _ => return Err(format!("unknown argument {arg}")),
            }
        }
        Ok(options)
    }

    /// Whether a part runs: all do, or those named, and what those need.
    fn wants(&self, part: &str) -> bool {
        let named = |names: &[&str]| self.only.iter().any(|o| names.contains(&o.as_str()));
        self.only.is_empty()
            || named(&[part])
            || match part {
                "python-env" => {
                    named(&["python", "cli", "wheel", "python-module", "blender", "shared-python", "share"])
                }
                "build" => named(&["python", "cli", "python-module", "blender", "shared-python"]),
                "wheel" => named(&["python-module", "blender"]),
                "blender-env" => named(&["blender"]),
                "vulkan-env" => named(&[
                    "rust",
                    "python",
                    "cli",
                    "python-module",
                    "blender",
                    "shared-rust",
                    "shared-python",
                    "share",
                ]),
                _ => false,
            }
    }
}

/// Runs the parts; exit code 0 only when none failed.
pub(crate) fn run(options: &Options) -> ExitCode {
    if options.list {
        PARTS.iter().for_each(|(name, cap, what)| println!("{name:<16}{cap:>6} s  {what}"));
        return ExitCode::SUCCESS;
    }
    let running = Running::default();
    let on_interrupt = running.clone();
    let handled = ctrlc::set_handler(move || {
        on_interrupt.kill();
        std::process::exit(130);
    });
    if let Err(e) = handled {
        eprintln!("xtask: Ctrl-C would leave tests running: {e}");
    }

    let suite = Suite::new(options);
    println!(
        "share {} of {} of the full set (repeat with --share {})",
        suite.share,
        share::SHARES,
        suite.share
    );
    let start = Instant::now();
    let wanted: Vec<&str> = PARTS
        .iter()
        .map(|part| part.0)
        .filter(|name| options.wants(name) && !(options.full && *name == "share"))
        .collect();
    let queue = Queue::of(wanted);
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                while let Some(Next { name, cap, lost }) = queue.next() {
                    let cap = if options.full { cap * FULL_CAP_FACTOR } else { cap };
                    queue.ended(part::run(
                        name,
                        cap,
                        must_test(name),
                        output_of(name),
                        &running,
                        || match lost {
                            Some(part) => Err(Outcome::Failed(format!("{part} failed"))),
                            None => suite.steps(name),
                        },
                    ));
                }
            });
        }
    });

    let rows = queue.in_order();
    println!("\n{}", seconds_table::table(&rows, start.elapsed().as_secs_f64()));
    let failed = rows.iter().any(|r| matches!(r.outcome, Outcome::Failed(_)));
    if failed { ExitCode::from(1) } else { ExitCode::SUCCESS }
}

/// Where the lines of a part go. The two parts whose lines are passed on never run at once, since one needs the other.
fn output_of(part: &str) -> Output {
    match part {
        "build" | "rust" => Output::Live,
        _ => Output::AtTheEnd,
    }
}

/// The parts that a part waits for. Tests cannot begin without their environment: one that was left out for want of it would count as
/// passed.
fn needed(part: &str) -> &'static [&'static str] {
    match part {
        "wheel" => &["python-env", "build"],
        "python" | "cli" | "shared-python" => &["python-env", "vulkan-env", "build"],
        "python-module" => &["python-env", "vulkan-env", "build", "wheel"],
        "blender" => &["python-env", "vulkan-env", "build", "wheel", "blender-env"],
        "rust" | "shared-rust" | "share" => &["vulkan-env", "build"],
        "rust-docs" => &["build"],
        _ => &[],
    }
}

/// Whether a part in which no test ran has failed. There may be no example in the documentation, and no test of the full set whose turn
/// it is.
fn must_test(part: &str) -> bool {
    !matches!(part, "build" | "python-env" | "wheel" | "blender-env" | "vulkan-env" | "rust-docs" | "share")
}

/// The parts that are to run and those that have ended.
struct Queue {
    parts: Mutex<Parts>,
    one_more_ended: Condvar,
}

struct Parts {
    wanted: Vec<&'static str>,
    waiting: Vec<(&'static str, u64)>,
    ended: Vec<Row>,
}

/// A part that may begin.
#[derive(Debug, PartialEq, Eq)]
struct Next {
    name: &'static str,
    cap: u64,
    /// The first part that it needs and that failed.
    lost: Option<&'static str>,
}

impl Queue {
    fn of(wanted: Vec<&'static str>) -> Self {
        let listed = PARTS.into_iter().filter(|part| wanted.contains(&part.0));
        let waiting = listed.map(|(name, cap, _)| (name, cap)).collect();
        let parts = Mutex::new(Parts { wanted, waiting, ended: Vec::new() });
        Self { parts, one_more_ended: Condvar::new() }
    }

    /// Waits for a part that may begin. None is left where nothing waits.
    fn next(&self) -> Option<Next> {
        let parts = self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        let all_wait = |parts: &mut Parts| !parts.waiting.is_empty() && parts.first_ready().is_none();
        let parts = self.one_more_ended.wait_while(parts, all_wait);
        let mut parts = parts.unwrap_or_else(PoisonError::into_inner);
        let (name, cap) = parts.first_ready().map(|place| parts.waiting.remove(place))?;
        let has_failed = |part: &&&str| {
            parts.ended.iter().any(|r| r.name == **part && matches!(r.outcome, Outcome::Failed(_)))
        };
        Some(Next { name, cap, lost: needed(name).iter().find(has_failed).copied() })
    }

    fn ended(&self, row: Row) {
        self.parts.lock().unwrap_or_else(PoisonError::into_inner).ended.push(row);
        self.one_more_ended.notify_all();
    }

    /// The rows as the parts are listed.
    fn in_order(self) -> Vec<Row> {
        let mut rows = self.parts.into_inner().unwrap_or_else(PoisonError::into_inner).ended;
        rows.sort_by_key(|row| PARTS.iter().position(|part| part.0 == row.name));
        rows
    }
}

impl Parts {
    /// Index among the waiting of the first part of which all needs that were asked for have ended.
    fn first_ready(&self) -> Option<usize> {
        let is_met = |part: &&str| !self.wanted.contains(part) || self.ended.iter().any(|r| r.name == *part);
        self.waiting.iter().position(|(name, _)| needed(name).iter().all(&is_met))
    }
}

/// Where everything is.
struct Suite {
    root: PathBuf,
    target: PathBuf,
    shared: Option<PathBuf>,
    share: u64,
    full: bool,
    blender: Blender,
    /// Another Blender, in which only the tests of import run.
    oldest: Option<Blender>,
}

impl Suite {
    fn new(options: &Options) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new(".")).to_path_buf();
        let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from);
        Self {
            shared: shared_data::folder(&root),
            target,
            root,
            share: options.share.unwrap_or_else(share::of_today),
            full: options.full,
            blender: Blender::new(options.bpy.as_deref()),
            oldest: (options.full && options.bpy.is_none()).then(|| Blender::new(Some(OLDEST_BLENDER))),
        }
    }

    fn steps(&self, part: &str) -> Result<Vec<Step>, Outcome> {
        let absent = || Outcome::LeftOut("folder absent (PUMICE_SHARED_DATA or ../shared/data)".into());
        let ignored: &[&str] = if self.full { &["--", "--include-ignored"] } else { &[] };
        let commands = match part {
            "build" => vec![
                // One call, so that each crate is compiled with one set of features.
                self.cargo(&["build", "--workspace", "--lib", "--bins", "--examples", "--tests"]),
            ],
            "python-env" => return Environment::tests().steps(&self.root, &self.target),
            "wheel" => return Ok(vec![wheel::build(&self.root, &self.target, "dev")]),
            "python-module" => return self.module_steps(),
            "blender-env" => {
                let mut steps = self.blender.steps(&self.root, &self.target)?;
                if let Some(oldest) = &self.oldest {
                    steps.extend(oldest.steps(&self.root, &self.target)?);
                }
                return Ok(steps);
            }
            "blender" => return self.blender_steps(),
            "vulkan-env" => return Ok(vec![PrivateMesa::new(&self.target).step(&self.root)]),
            "rust" => {
                let of_backends: &[&str] = if self.full { ignored } else { &OF_BACKENDS };
                // Of the whole workspace, as in each call here: a package by itself is compiled anew with fewer features.
                let by_turns = |programs: &[&'static str], of_them: &[&'static str]| {
                    let named = programs.iter().flat_map(|name| ["--test", *name]);
                    let args = ["test", "--workspace", "--no-fail-fast"].into_iter().chain(named);
                    self.cargo(&args.chain(of_them.iter().copied()).collect::<Vec<_>>())
                };
                let share = self.share.to_string();
                let mut check = vec!["run", "--quiet", "--package", "xtask", "--", "shaders", "--check"];
                check.extend(["--share", &share].iter().filter(|_| !self.full));
                vec![
                    self.cargo(&check),
                    self.cargo(&[&["test", "--workspace", "--tests", "--no-fail-fast"], ignored].concat()),
                    by_turns(self.of_the_day(&COMPUTE_BY_TURNS), ignored),
                    by_turns(self.backends_of_the_day(), of_backends),
                ]
            }
            "rust-docs" => vec![self.cargo(&["test", "--workspace", "--doc", "--no-fail-fast"])],
            "python" => {
                let elsewhere =
                    |name: &str| name.starts_with("test_cli_") || is_shared(name) || is_of_docs(name);
                vec![self.pytest(&|name| !elsewhere(name))?]
            }
            "cli" => vec![self.pytest(&|name| name.starts_with("test_cli_"))?],
            "shared-rust" => {
                self.shared.as_ref().ok_or_else(absent)?;
                let crates = shared_data::crates(&self.root).map_err(Outcome::Failed)?;
                if crates.is_empty() {
                    return Err(Outcome::LeftOut("no crate has such a suite".into()));
                }
                let args = ["test", "--workspace", "--test", "shared_data", "--no-fail-fast"];
                vec![self.cargo(&[args.as_slice(), ignored].concat())]
            }
            "shared-python" => {
                self.shared.as_ref().ok_or_else(absent)?;
                vec![self.pytest(&is_shared)?]
            }
            "share" => vec![self.share_command()?],
            _ => return Err(Outcome::Failed(format!("part {part} has no commands"))),
        };
        Ok(commands.into_iter().map(Step::from).collect())
    }

    /// Which of the renderers that differ from `renderer`'s in how a device finds surfaces are tested: one a day, both with `--full`. Where
    /// the device lacks ray queries and `PUMICE_TEST_BACKENDS` says so, it is the other.
    fn backends_of_the_day(&self) -> &'static [&'static str] {
        match std::env::var("PUMICE_TEST_BACKENDS") {
            Ok(named) if !named.contains("vulkan-query") => &BACKENDS_BY_TURNS[1..],
            _ => self.of_the_day(&BACKENDS_BY_TURNS),
        }
    }

    /// One of two programs: the first on even days; both with `--full`.
    fn of_the_day<'a>(&self, pair: &'a [&'static str; 2]) -> &'a [&'static str] {
        match (self.full, self.share.is_multiple_of(2)) {
            (true, _) => pair,
            (false, true) => &pair[..1],
            (false, false) => &pair[1..],
        }
    }

    /// The wheel installed, its stub compared, the types checked, the tests run, and with them the samples of the docs.
    fn module_steps(&self) -> Result<Vec<Step>, Outcome> {
        let (root, target) = (&self.root, &self.target);
        let python = Environment::tests().interpreter(target);
        let mut types = Command::new(&python);
        types.args(["-m", "mypy", "--strict", "--no-error-summary", "--cache-dir"]);
        types.arg(target.join("mypy")).arg("python/pumice").current_dir(root);
        // A process of its own for the ladder, because a driver that computes on the CPU never frees compiled shaders.
        let [others, ladder] = [
            &["python/tests", "--ignore", "python/tests/test_ladder_on_vulkan.py"][..],
            &["python/tests/test_ladder_on_vulkan.py"],
        ]
        .map(|files| {
            let mut tests = Command::new(&python);
            tests.args(PYTEST).args(files);
            self.surroundings(&mut tests);
            PrivateMesa::new(&self.target).surround_checked(&self.root, &mut tests);
            tests
        });
        Ok(vec![
            wheel::install(target, "dev").map_err(Outcome::Failed)?,
            wheel::generate_stub(root, target),
            wheel::compare_stub(root, target),
            types.into(),
            others.into(),
            ladder.into(),
            self.pytest(&is_of_docs)?.into(),
        ])
    }

    /// The extension packed, then its tests, which install the zip; with `--full` those of import also in the oldest Blender.
    ///
    /// Packed by this process and not by starting the program anew: the part `build` may have replaced its file.
    fn blender_steps(&self) -> Result<Vec<Step>, Outcome> {
        let mut steps =
            extension::pack(&self.root, &self.target, "dev", &self.blender).map_err(Outcome::Failed)?;
        let tests = |blender: &Blender, files: &[&str]| {
            let mut tests = blender.python(&self.target);
            tests.args(PYTEST).args(files);
            tests.env("PUMICE_EXTENSION_ZIP", extension::zip(&self.target, "dev"));
            self.surroundings(&mut tests);
            PrivateMesa::new(&self.target).surround_checked(&self.root, &mut tests);
            Step::from(tests)
        };
        steps.push(tests(&self.blender, &["blender-addon/tests"]));
        steps.extend(self.oldest.iter().map(|oldest| tests(oldest, &OF_IMPORT)));
        Ok(steps)
    }

    /// The ignored tests whose turn it is. The Python ones run within their own parts (see `tests/python/share.py`).
    fn share_command(&self) -> Result<Command, Outcome> {
        let programs: Vec<&str> = ["--tests"]
            .into_iter()
            .chain(COMPUTE_BY_TURNS.iter().flat_map(|name| ["--test", name]))
            .collect();
        let list = [&["test", "--quiet", "--workspace"], &programs[..], &["--", "--ignored", "--list"]];
        let listing = self
            .cargo(&list.concat())
            .output()
            .map_err(|e| Outcome::Failed(format!("cargo test --list: {e}")))?;
        if !listing.status.success() {
            let said = String::from_utf8_lossy(&listing.stderr);
            return Err(Outcome::Failed(format!("cargo test --list: {}", said.trim())));
        }
        let names = share::names_in(&String::from_utf8_lossy(&listing.stdout), self.share);
        if names.is_empty() {
            return Err(Outcome::LeftOut(format!("no ignored Rust test is in share {}", self.share)));
        }
        let run = ["test", "--workspace", "--no-fail-fast"].into_iter().chain(programs);
        let run = run.chain(["--", "--ignored", "--exact"]);
        let args: Vec<&str> = run.chain(names.iter().map(String::as_str)).collect();
        Ok(self.cargo(&args))
    }

    fn cargo(&self, args: &[&str]) -> Command {
        let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        command.args(args);
        self.surroundings(&mut command);
        PrivateMesa::new(&self.target).surround(&mut command);
        command
    }

    /// pytest over the test files whose names pass.
    fn pytest(&self, wanted: &dyn Fn(&str) -> bool) -> Result<Command, Outcome> {
        let folder = self.root.join("tests/python");
        let entries =
            std::fs::read_dir(&folder).map_err(|e| Outcome::Failed(format!("{}: {e}", folder.display())))?;
        let mut files: Vec<String> = entries
            .flatten()
            .filter_map(|e| e.file_name().into_string().ok())
            .filter(|name| name.starts_with("test_") && name.ends_with(".py") && wanted(name))
            .map(|name| format!("tests/python/{name}"))
            .collect();
        files.sort();
        if files.is_empty() {
            return Err(Outcome::LeftOut("no test file".into()));
        }
        let mut command = Command::new(Environment::tests().interpreter(&self.target));
        command.args(PYTEST).args(files);
        self.surroundings(&mut command);
        PrivateMesa::new(&self.target).surround_checked(&self.root, &mut command);
        Ok(command)
    }

    fn surroundings(&self, command: &mut Command) {
        let set = if self.full { "full".into() } else { format!("{}/{}", self.share, share::SHARES) };
        command
            .current_dir(&self.root)
            .env("PUMICE", self.target.join("debug/pumice"))
            .env("PUMICE_TEST_SHARE", set)
            // Tests leave nothing in the folders of whoever runs them.
            .env("PUMICE_CACHE", self.target.join("tmp/cache"))
            .env("PYTHONDONTWRITEBYTECODE", "1");
        if let Some(shared) = &self.shared {
            command.env("PUMICE_SHARED_DATA", shared);
        }
        // What `cargo run` told this program about itself is not for others.
        command.env_remove("CARGO_MANIFEST_DIR").env_remove("CARGO_MANIFEST_PATH");
    }
}

fn is_shared(name: &str) -> bool {
    name.starts_with("test_shared_data_")
}

/// Tests of the docs, whose samples need the module.
fn is_of_docs(name: &str) -> bool {
    name.starts_with("test_docs_")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No two parts wait for each other: each waits for parts alone that are listed before it.
    #[test]
    fn parts_wait_for_earlier_ones() {
        let place = |name: &str| PARTS.iter().position(|p| p.0 == name).unwrap();
        for (name, ..) in PARTS {
            for part in needed(name) {
                assert!(place(part) < place(name), "{name} waits for {part}");
            }
        }
        assert!(needed("rust").contains(&"build"), "only one part's lines are passed on at a time");
    }

    #[test]
    fn a_part_waits_for_what_it_needs_and_hears_of_its_failure() {
        let row = |name, outcome| Row {
            name,
            outcome,
            counts: Default::default(),
            seconds: 0.0,
            cpu_seconds: None,
            cap_seconds: 1,
        };
        let queue = Queue::of(vec!["wheel", "build", "python-env"]);
        let begun = || queue.next().map(|next| next.name);
        assert_eq!((begun(), begun()), (Some("build"), Some("python-env")));
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| queue.next());
            queue.ended(row("build", Outcome::Failed("no compiler".into())));
            std::thread::sleep(std::time::Duration::from_millis(50));
            assert!(!waiting.is_finished(), "python-env has not ended");
            queue.ended(row("python-env", Outcome::Passed));
            let wheel = Next { name: "wheel", cap: 1200, lost: Some("build") };
            assert_eq!(waiting.join().unwrap(), Some(wheel));
        });
        assert_eq!(queue.next(), None);
        let names: Vec<&str> = queue.in_order().iter().map(|row| row.name).collect();
        assert_eq!(names, ["build", "python-env"]);
        // A need that was not asked for is not waited for.
        assert_eq!(Queue::of(vec!["wheel"]).next(), Some(Next { name: "wheel", cap: 1200, lost: None }));
    }

    fn parsed(args: &[&str]) -> Result<Options, String> {
        Options::parse(&args.iter().map(|a| a.to_string()).collect::<Vec<_>>())
    }

    #[test]
    fn arguments() {
        let options = parsed(&["--full", "--only", "cli", "--share", "3"]).unwrap();
        assert_eq!(
            options,
            Options { full: true, only: vec!["cli".into()], share: Some(3), ..Options::default() }
        );
        assert!(options.wants("cli") && options.wants("build") && options.wants("python-env"));
        assert!(!options.wants("rust") && !options.wants("blender-env"));
        let options = parsed(&["--only", "blender", "--bpy", "4.5.15"]).unwrap();
        assert_eq!(options.bpy.as_deref(), Some("4.5.15"));
        for part in ["build", "python-env", "vulkan-env", "wheel", "blender-env"] {
            assert!(options.wants(part), "{part}");
        }
        assert!(!options.wants("python-module"));
        assert!(PARTS.iter().all(|p| parsed(&[]).unwrap().wants(p.0)));
        // The oldest Blender comes beside the listed one with `--full`, unless another one is asked for.
        let oldest = |args: &[&str]| Suite::new(&parsed(args).unwrap()).oldest.map(|b| b.environment.folder);
        assert_eq!(oldest(&["--full"]).as_deref(), Some("venv-bpy-4.2.23"));
        assert!(oldest(&[]).is_none() && oldest(&["--full", "--bpy", "4.5.15"]).is_none());
        for bad in [
            &["--only", "nonsense"][..],
            &["--only"],
            &["--share", "28"],
            &["--share", "-1"],
            &["-x"],
            &["--bpy", "newest"],
        ] {
            assert!(parsed(bad).is_err(), "{bad:?}");
        }
    }
}
