//! `cargo xtask gpu-stats`: what compilers for graphics cards make of the shaders, on a machine without a card.
//!
//! ```text
//! target/mesa: Mesa's driver for AMD cards ─┬─ RADV_FORCE_FAMILY=navi21  ──► pumice bench shaders ─┐
//!                                           ├─ RADV_FORCE_FAMILY=navi31  ──► pumice bench shaders ─┼─► FOLDER/shaders.md, shaders.json
//!                                           └─ RADV_FORCE_FAMILY=gfx1201 ──► pumice bench shaders ─┘
//! ```
//! The driver then compiles for a card that is not there, and draws nothing. Each pipeline is compiled in a process of its own, because a
//! compiler may end its process. What could not be had stands below the tables: other makers' drivers need a device, or programs that
//! pretend one and which no package has here.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::private_mesa::PrivateMesa;
use crate::step::Step;

/// AMD's families that are compiled for, with a card of each.
const FAMILIES: [(&str, &str); 3] =
    [("navi21", "Radeon RX 6900 XT"), ("navi31", "Radeon RX 7900 XTX"), ("gfx1201", "Radeon RX 9070 XT")];
const BACKENDS: [&str; 3] = ["vulkan-rt", "vulkan-query", "vulkan-compute"];
const SCENES: [&str; 3] = ["diffuse", "principled", "all"];

/// Compilers that are not reached, and why.
const NOT_HAD: [&str; 2] = [
    "NVK (NVIDIA): Mesa compiles for a card that is not there only beside a program that pretends one, which comes with Mesa 26.",
    "ANV (Intel): the program that pretends a card is in no package, only in Mesa's source.",
];

/// Options of `cargo xtask gpu-stats`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Options {
    families: Vec<&'static str>,
    scenes: Vec<&'static str>,
    out: Option<PathBuf>,
}

impl Options {
    pub(crate) fn parse(args: &[String]) -> Result<Self, String> {
        let mut options = Self::default();
        let mut args = args.iter();
        while let Some(arg) = args.next() {
            match arg.as_str() {
                "--out" => options.out = Some(args.next().ok_or("--out: expected a folder")?.into()),
                "--scene" => {
                    let name = args.next().ok_or("--scene: expected a kind of scene")?;
                    let known = SCENES.into_iter().find(|scene| scene == name);
                    options.scenes.push(
                        known.ok_or_else(|| {
                            format!("--scene {name}: expected one of {}", SCENES.join(", "))
                        })?,
                    );
                }
                name => match FAMILIES.into_iter().find(|(family, _)| *family == name) {
                    Some((family, _)) => options.families.push(family),
                    None => {
                        let known = FAMILIES.map(|(family, _)| family).join(", ");
                        return Err(format!("unknown family {name}: expected one of {known}"));
                    }
                },
            }
        }
        Ok(options)
    }
}

pub(crate) fn run(root: &Path, target: &Path, options: &Options) -> Result<(), String> {
    let mesa = PrivateMesa::new(target);
    mesa.step(root).finish()?;
    let mut build = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    build.args(["build", "--locked", "-p", "pumice"]).current_dir(root);
    Step::from(build).finish()?;
    let scratch = target.join("gpu-stats");
    let _ = std::fs::remove_dir_all(&scratch);
    let compiler = Compiler { mesa, program: target.join("debug/pumice"), scratch };
    let (mut sections, mut json) = (String::new(), Vec::new());
    let wanted = |family: &str| options.families.is_empty() || options.families.contains(&family);
    // A compiler uses one thread, so all families are compiled at once.
    std::thread::scope(|scope| {
        let compiler = &compiler;
        let all = FAMILIES.into_iter().filter(|(family, _)| wanted(family));
        let all: Vec<_> = all
            .map(|(family, card)| (family, card, scope.spawn(|| compiler.section(family, &options.scenes))))
            .collect();
        for (family, card, made) in all {
            let (section, values) = made.join().map_err(|_| format!("{family}: the task panicked"))?;
            sections.push_str(&format!("## {family} ({card})\n\n{section}\n"));
            json.extend(values);
        }
        Ok::<_, String>(())
    })?;
    if json.is_empty() {
        return Err(format!("nothing was compiled:\n{sections}"));
    }
    let not_had: String = NOT_HAD.iter().map(|line| format!("* {line}\n")).collect();
    let page = format!("{}\n\n{sections}## Not to be had\n\n{not_had}", compiler.head()?);
    print!("\n{page}");
    if let Some(out) = &options.out {
        let written = |name: &str, text: &str| {
            let file = out.join(name);
            std::fs::write(&file, text).map_err(|e| format!("{}: {e}", file.display()))
        };
        std::fs::create_dir_all(out).map_err(|e| format!("{}: {e}", out.display()))?;
        written("shaders.md", &page)?;
        written("shaders.json", &format!("[\n{}\n]\n", json.join(",\n")))?;
    }
    Ok(())
}

/// Rows of Markdown under one heading.
#[derive(Default)]
struct Table {
    heading: String,
    rows: String,
}

impl Table {
    /// Adds the rows of a page's table.
    fn extend(&mut self, page: &str) {
        let mut lines = page.lines().filter(|line| line.starts_with('|'));
        self.heading = lines.by_ref().take(2).map(|line| format!("{line}\n")).collect();
        self.rows.extend(lines.map(|line| format!("{line}\n")));
    }

    fn text(&self) -> String {
        format!("{}{}", self.heading, self.rows)
    }
}

/// Runs `pumice bench shaders` with Mesa's driver for AMD cards.
struct Compiler {
    mesa: PrivateMesa,
    program: PathBuf,
    /// A folder of results for each run.
    scratch: PathBuf,
}

impl Compiler {
    /// The table of a family in Markdown with what was not compiled, and its rows of the file in JSON.
    fn section(&self, family: &str, scenes: &[&str]) -> (String, Vec<String>) {
        let (mut rows, mut failures, mut json) = (Table::default(), String::new(), Vec::new());
        for backend in BACKENDS {
            for scene in SCENES.into_iter().filter(|scene| scenes.is_empty() || scenes.contains(scene)) {
                println!("gpu-stats: {family}, {backend}, {scene}");
                match self.compiled([family, backend, scene]) {
                    Ok((page, values)) => {
                        rows.extend(&page);
                        json.push(values);
                    }
                    Err(what) => failures.push_str(&format!("* {backend}, {scene}: {what}\n")),
                }
            }
        }
        let section = match failures.is_empty() {
            true => rows.text(),
            false => format!("{}\nNot compiled:\n\n{failures}", rows.text()),
        };
        (section, json)
    }

    /// Compiles the shaders of a backend for a kind of scene. Returns the page, and the rows of the file in JSON without their brackets.
    fn compiled(&self, [family, backend, scene]: [&str; 3]) -> Result<(String, String), String> {
        let folder = self.scratch.join(format!("{family}-{backend}-{scene}"));
        let mut command = Command::new(&self.program);
        command.args(["bench", "shaders", "--backends", backend, "--scenes", scene, "--out"]).arg(&folder);
        self.mesa.compile_for_amd(&mut command, family)?;
        let output = command.stdin(Stdio::null()).output();
        let output = output.map_err(|e| format!("{}: {e}", self.program.display()))?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            return Err(format!("{}: {}", output.status, said.lines().last().unwrap_or_default().trim()));
        }
        let read = |name: &str| {
            let file = folder.join(name);
            std::fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))
        };
        let json = read("shaders.json")?;
        let rows = json.trim().strip_prefix('[').and_then(|t| t.strip_suffix(']')).map(str::trim);
        let rows = rows.ok_or_else(|| format!("{}: expected a list in shaders.json", folder.display()))?;
        Ok((read("shaders.md")?, format!("  {rows}")))
    }

    /// Title, machine and driver of the first page: all that stands before its table.
    fn head(&self) -> Result<String, String> {
        let entries =
            std::fs::read_dir(&self.scratch).map_err(|e| format!("{}: {e}", self.scratch.display()))?;
        let mut files: Vec<PathBuf> = entries.flatten().map(|e| e.path().join("shaders.md")).collect();
        files.sort();
        let page = files.iter().find_map(|file| std::fs::read_to_string(file).ok());
        let page = page.ok_or_else(|| format!("{}: expected pages, found none", self.scratch.display()))?;
        let head: Vec<&str> = page.lines().take_while(|line| !line.starts_with('|')).collect();
        Ok(head.join("\n").trim().to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments() {
        let parse = |args: &[&str]| Options::parse(&args.iter().map(|a| (*a).to_owned()).collect::<Vec<_>>());
        assert_eq!(parse(&[]), Ok(Options::default()));
        let expected = Options { families: vec!["navi31"], scenes: vec!["all"], out: Some("a".into()) };
        assert_eq!(parse(&["navi31", "--scene", "all", "--out", "a"]), Ok(expected));
        assert!(parse(&["--out"]).is_err() && parse(&["navi99"]).unwrap_err().contains("gfx1201"));
        assert!(parse(&["--scene"]).is_err() && parse(&["--scene", "x"]).unwrap_err().contains("diffuse"));
    }

    #[test]
    fn tables_become_one() {
        let mut table = Table::default();
        table.extend("# shaders\n\nHere.\n\n| a | b |\n| --- | --- |\n| 1 | 2 |\n");
        table.extend("# shaders\n\nThere.\n\n| a | b |\n| --- | --- |\n| 3 | 4 |\n");
        assert_eq!(table.text(), "| a | b |\n| --- | --- |\n| 1 | 2 |\n| 3 | 4 |\n");
    }
}
