//! `cargo xtask shaders`: compiles the GLSL in `vulkan-renderer/shaders` to SPIR-V in `vulkan-renderer/spirv`. The SPIR-V is checked in, so
//! that building Pumice takes no shader compiler.
//!
//! ```text
//! shaders/NAME.comp + includes ──► glslangValidator ──► spirv/NAME.comp.spv       doubles emulated in integers
//!                             └─ -DNATIVE_F64 ────────► spirv/NAME.comp.f64.spv   the device's own doubles, if the shader uses doubles
//! hashes of sources (with the flags) and of results ──► spirv/manifest.txt
//! ```
//! `--check` compares hashes with the manifest, and finds sources that changed after compiling, results that differ from those compiled,
//! and extra files. If this machine has exactly the compiler that the manifest names, it also compiles again, compares the bytes, and
//! runs `spirv-val`: all shaders, or with `--share K` every fourth, another one each day.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use xxhash_rust::xxh3::xxh3_128;

use crate::private_mesa::PrivateMesa;

/// Extensions of files with an entry point; other files are only included.
const STAGES: [&str; 5] = ["comp", "rgen", "rint", "rmiss", "rchit"];

/// Compiler flags of every shader, which are hashed with the sources.
const FLAGS: [&str; 3] = ["--quiet", "--target-env", "vulkan1.2"];

/// Macro that is defined for shaders that use the device's own doubles.
const NATIVE: &str = "NATIVE_F64";

/// Shaders are compiled again by this many turns.
const TURNS: usize = 4;

/// Options of `cargo xtask shaders`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Options {
    check: bool,
    /// The share of the full set to which compiling again is limited.
    share: Option<usize>,
}

impl Options {
    pub(crate) fn parse(args: &[String]) -> Result<Self, String> {
        match args {
            [] => Ok(Self::default()),
            [flag] if flag == "--check" => Ok(Self { check: true, share: None }),
            [flag, share, number] if flag == "--check" && share == "--share" => {
                let number = number.parse().map_err(|_| format!("--share {number}: expected a number"))?;
                Ok(Self { check: true, share: Some(number) })
            }
            _ => Err(format!("unknown argument {}", args.join(" "))),
        }
    }

    /// Whether the shader at this place of the list is compiled again.
    fn compiles(self, place: usize) -> bool {
        self.share.is_none_or(|share| place % TURNS == share % TURNS)
    }
}

/// Compiles all shaders, or checks that the compiled shaders match their sources.
pub(crate) fn run(root: &Path, target: &Path, options: &Options) -> Result<(), String> {
    let folders = Folders::new(root);
    if !options.check {
        let tools = Tools::find(root, target)?;
        return build(&folders, &tools);
    }
    stale(&folders)?;
    let tools = Tools::find(root, target)?;
    let listed = read(&folders.spirv.join("manifest.txt"))?;
    if listed.lines().next() != Some(format!("compiler {}", tools.version).as_str()) {
        println!(
            "shaders: this machine has {}, not the compiler of the manifest, so only hashes were checked",
            tools.version
        );
        return Ok(());
    }
    let turn = outputs(&folders)?.into_iter().enumerate().filter(|(place, _)| options.compiles(*place));
    for (_, (name, defines)) in turn {
        let file = target.join(format!("shader-check-{}.spv", std::process::id()));
        let compiled = tools.compile(&folders.shaders, &source_of(&name), &defines, &file);
        let bytes =
            compiled.and_then(|()| std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display())));
        let validated = tools.validate(&file);
        let _ = std::fs::remove_file(&file);
        let checked_in = folders.spirv.join(&name);
        let expected = std::fs::read(&checked_in).map_err(|e| format!("{}: {e}", checked_in.display()))?;
        if bytes? != expected {
            return Err(format!(
                "vulkan-renderer/spirv/{name} differs from the compiler's output for its source: cargo xtask shaders"
            ));
        }
        validated?;
    }
    Ok(())
}

/// Folders of sources and results.
struct Folders {
    shaders: PathBuf,
    spirv: PathBuf,
}

impl Folders {
    fn new(root: &Path) -> Self {
        let base = root.join("vulkan-renderer");
        Self { shaders: base.join("shaders"), spirv: base.join("spirv") }
    }
}

/// Fails with one line if sources, results and manifest do not match, by their hashes.
fn stale(folders: &Folders) -> Result<(), String> {
    let manifest = folders.spirv.join("manifest.txt");
    let listed = read(&manifest)?;
    let listed: BTreeMap<&str, (&str, &str)> = listed
        .lines()
        .skip(1)
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            Some((words.next()?, (words.next()?, words.next()?)))
        })
        .collect();
    let expected = outputs(folders)?;
    let anew = "cargo xtask shaders";
    for (name, defines) in &expected {
        let source = source_of(name);
        let Some(&(source_hash, spirv_hash)) = listed.get(name.as_str()) else {
            return Err(format!("vulkan-renderer/spirv/{name} is missing: {anew}"));
        };
        if source_hash != hash_of_source(&folders.shaders, &source, defines)? {
            return Err(format!(
                "vulkan-renderer/shaders/{source} has changed since it was compiled: {anew}"
            ));
        }
        let file = folders.spirv.join(name);
        let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        if spirv_hash != hash(&bytes) {
            return Err(format!("vulkan-renderer/spirv/{name} is not what was compiled: {anew}"));
        }
    }
    let mut known: BTreeSet<&str> = expected.keys().map(String::as_str).collect();
    known.insert("manifest.txt");
    for name in names(&folders.spirv)?.iter().map(String::as_str).chain(listed.keys().copied()) {
        if !known.contains(name) {
            return Err(format!("vulkan-renderer/spirv/{name} has no source: {anew}"));
        }
    }
    Ok(())
}

fn build(folders: &Folders, tools: &Tools) -> Result<(), String> {
    let outputs = outputs(folders)?;
    std::fs::create_dir_all(&folders.spirv).map_err(|e| format!("{}: {e}", folders.spirv.display()))?;
    let mut manifest = format!("compiler {}\n", tools.version);
    for (name, defines) in &outputs {
        let source = source_of(name);
        let file = folders.spirv.join(name);
        tools.compile(&folders.shaders, &source, defines, &file)?;
        tools.validate(&file)?;
        let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        let source_hash = hash_of_source(&folders.shaders, &source, defines)?;
        manifest.push_str(&format!("{name} {source_hash} {}\n", hash(&bytes)));
    }
    for name in names(&folders.spirv)? {
        if !outputs.contains_key(&name) {
            let file = folders.spirv.join(&name);
            std::fs::remove_file(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        }
    }
    let file = folders.spirv.join("manifest.txt");
    std::fs::write(&file, manifest).map_err(|e| format!("{}: {e}", file.display()))?;
    println!("shaders: {} compiled by {}", outputs.len(), tools.version);
    Ok(())
}

/// Names of all result files, with the macros that are defined for each.
fn outputs(folders: &Folders) -> Result<BTreeMap<String, Vec<&'static str>>, String> {
    let mut outputs = BTreeMap::new();
    for name in names(&folders.shaders)? {
        let stage = Path::new(&name).extension().and_then(OsStr::to_str).unwrap_or_default();
        if !STAGES.contains(&stage) {
            continue;
        }
        let knows_doubles = sources(&folders.shaders, &name)?.iter().any(|(_, text)| text.contains(NATIVE));
        outputs.insert(format!("{name}.spv"), vec![]);
        if knows_doubles {
            outputs.insert(format!("{name}.f64.spv"), vec![NATIVE]);
        }
    }
    if outputs.is_empty() {
        return Err(format!(
            "{}: expected shaders with an entry point (.comp, .rgen, .rint, .rmiss, .rchit), found none",
            folders.shaders.display()
        ));
    }
    Ok(outputs)
}

fn source_of(output: &str) -> String {
    output.trim_end_matches(".spv").trim_end_matches(".f64").to_string()
}

/// Names and texts of a file and all that it includes, each once, in the order of first mention.
fn sources(folder: &Path, name: &str) -> Result<Vec<(String, String)>, String> {
    let mut found: Vec<(String, String)> = Vec::new();
    let mut wanted = vec![name.to_string()];
    while let Some(name) = wanted.pop() {
        if found.iter().any(|(n, _)| *n == name) {
            continue;
        }
        let text = read(&folder.join(&name))?;
        let included = text.lines().filter_map(|l| l.trim().strip_prefix("#include \"")?.strip_suffix('"'));
        let included: Vec<String> = included.map(str::to_string).collect();
        wanted.extend(included.into_iter().rev());
        found.push((name, text));
    }
    Ok(found)
}

fn hash_of_source(folder: &Path, name: &str, defines: &[&str]) -> Result<String, String> {
    let mut all = format!("{} {}\n", FLAGS.join(" "), defines.join(" "));
    for (name, text) in sources(folder, name)? {
        all.push_str(&format!("{name} {}\n{text}", text.len()));
    }
    Ok(hash(all.as_bytes()))
}

fn hash(bytes: &[u8]) -> String {
    format!("{:032x}", xxh3_128(bytes))
}

fn read(file: &Path) -> Result<String, String> {
    std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))
}

fn names(folder: &Path) -> Result<Vec<String>, String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut names: Vec<String> = entries.flatten().filter_map(|e| e.file_name().into_string().ok()).collect();
    names.sort();
    Ok(names)
}

/// The shader compiler and the validator.
struct Tools {
    mesa: PrivateMesa,
    version: String,
}

impl Tools {
    /// The tools in the private folder of Mesa, which is made if it is missing.
    fn find(root: &Path, target: &Path) -> Result<Self, String> {
        let mesa = PrivateMesa::new(target);
        mesa.step(root).finish()?;
        let output = mesa.tool("glslangValidator").arg("--version").output();
        let output = output.map_err(|e| format!("glslangValidator: {e}"))?;
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let version = said.lines().find_map(|l| l.strip_prefix("Glslang Version: "));
        let version = version
            .ok_or("glslangValidator --version: expected a line `Glslang Version: …`, found none")?
            .trim()
            .to_string();
        Ok(Self { mesa, version: format!("glslangValidator {version}") })
    }

    fn compile(&self, folder: &Path, source: &str, defines: &[&str], to: &Path) -> Result<(), String> {
        let mut command = self.mesa.tool("glslangValidator");
        command.current_dir(folder).args(FLAGS).args(defines.iter().map(|d| format!("-D{d}")));
        finished(command.arg("-o").arg(to).arg(source), &format!("vulkan-renderer/shaders/{source}"))
    }

    fn validate(&self, file: &Path) -> Result<(), String> {
        let mut command = self.mesa.tool("spirv-val");
        command.args(["--target-env", "vulkan1.2", "--scalar-block-layout"]).arg(file);
        finished(&mut command, &format!("{}", file.display()))
    }
}

/// Runs a tool to its end; the error text holds the first error that it printed.
fn finished(command: &mut Command, what: &str) -> Result<(), String> {
    let output = command.output().map_err(|e| format!("{what}: {e}"))?;
    if output.status.success() {
        return Ok(());
    }
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    let first = said.lines().find(|l| l.contains("ERROR") || l.contains("error")).unwrap_or(said.trim());
    Err(format!("{what}: {}", first.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A temporary folder with one shader that includes a file, fake results, and a manifest that matches both.
    fn compiled(name: &str) -> (PathBuf, Folders) {
        let root = std::env::temp_dir().join(format!("xtask-shaders-{name}-{}", std::process::id()));
        let folders = Folders::new(&root);
        std::fs::create_dir_all(&folders.shaders).unwrap();
        std::fs::create_dir_all(&folders.spirv).unwrap();
        std::fs::write(folders.shaders.join("a.comp"), "#include \"b.glsl\"\nvoid main() {}\n").unwrap();
        std::fs::write(folders.shaders.join("b.glsl"), "#ifdef NATIVE_F64\n#endif\n").unwrap();
        let mut manifest = "compiler none\n".to_string();
        for (output, defines) in outputs(&folders).unwrap() {
            std::fs::write(folders.spirv.join(&output), &output).unwrap();
            let source = hash_of_source(&folders.shaders, "a.comp", &defines).unwrap();
            manifest.push_str(&format!("{output} {source} {}\n", hash(output.as_bytes())));
        }
        std::fs::write(folders.spirv.join("manifest.txt"), manifest).unwrap();
        (root, folders)
    }

    #[test]
    fn what_is_checked_in_is_what_the_sources_give() {
        stale(&Folders::new(&crate::root())).unwrap();
    }

    /// The check finds each kind of mismatch.
    #[test]
    fn what_is_stale_is_found() {
        type Change = fn(&Folders);
        let cases: [(&str, Change, &str); 5] = [
            ("source", |f| std::fs::write(f.shaders.join("a.comp"), "").unwrap(), "has no source"),
            (
                "include",
                |f| std::fs::write(f.shaders.join("b.glsl"), "// NATIVE_F64").unwrap(),
                "has changed",
            ),
            ("result", |f| std::fs::write(f.spirv.join("a.comp.spv"), "x").unwrap(), "not what was compiled"),
            ("more", |f| std::fs::write(f.spirv.join("c.comp.spv"), "x").unwrap(), "has no source"),
            ("new", |f| std::fs::write(f.shaders.join("d.rint"), "x").unwrap(), "is missing"),
        ];
        for (name, change, expected) in cases {
            let (root, folders) = compiled(name);
            assert_eq!(stale(&folders), Ok(()), "{name}");
            change(&folders);
            let said = stale(&folders).unwrap_err();
            // A source that no longer includes the file has changed, and its result with native doubles has no source.
            assert!(said.contains(expected) || said.contains("has changed"), "{name}: {said}");
            assert!(said.ends_with("cargo xtask shaders"), "{said}");
            std::fs::remove_dir_all(root).unwrap();
        }
    }

    #[test]
    fn arguments() {
        let parsed = |args: &[&str]| Options::parse(&args.iter().map(|a| a.to_string()).collect::<Vec<_>>());
        assert_eq!(parsed(&[]), Ok(Options { check: false, share: None }));
        assert_eq!(parsed(&["--check"]), Ok(Options { check: true, share: None }));
        assert_eq!(parsed(&["--check", "--share", "9"]), Ok(Options { check: true, share: Some(9) }));
        for bad in [&["x"][..], &["--share", "9"], &["--check", "--share"], &["--check", "--share", "x"]] {
            assert!(parsed(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn each_shader_has_its_turn() {
        let turns =
            |place| (0..TURNS).filter(move |&s| Options { check: true, share: Some(s) }.compiles(place));
        assert!((0..40).all(|place| turns(place).count() == 1));
        assert!((0..40).all(|place| Options { check: true, share: None }.compiles(place)));
    }
}
