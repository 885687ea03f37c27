//! Shaders: GLSL in `vulkan-renderer/shaders`, compiled to SPIR-V in `vulkan-renderer/spirv`, which is checked in: whoever builds or
//! uses Pumice needs no shader compiler.
//!
//! ```text
//! shaders/NAME.comp + what it includes ──► glslangValidator ──► spirv/NAME.comp.spv       doubles in integers
//!                                     └─ -DNATIVE_F64 ────────► spirv/NAME.comp.f64.spv   the device's own, where they occur
//! hashes of sources (with the flags) and of results ──────────► spirv/manifest.txt
//! ```
//! Stale is what the manifest does not say: a source that was changed and not compiled, a result that nobody made from it, a file
//! too many. That is asked by hashes alone. Where the very compiler of the manifest is at hand, `--check` also compiles anew and
//! compares the bytes, and asks `spirv-val`.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use xxhash_rust::xxh3::xxh3_128;

use crate::private_mesa::PrivateMesa;

/// Endings of files with an entry point; others are included.
const STAGES: [&str; 5] = ["comp", "rgen", "rint", "rmiss", "rchit"];

/// Flags of every shader; part of what is hashed.
const FLAGS: [&str; 3] = ["--quiet", "--target-env", "vulkan1.2"];

/// Defined for shaders that compute with the device's own doubles.
const NATIVE: &str = "NATIVE_F64";

/// What was asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Options {
    check: bool,
}

impl Options {
    pub(crate) fn parse(args: &[String]) -> Result<Self, String> {
        match args {
            [] => Ok(Self { check: false }),
            [flag] if flag == "--check" => Ok(Self { check: true }),
            _ => Err(format!("unknown argument {}", args.join(" "))),
        }
    }
}

/// Compiles all shaders, or checks that what is there is what the sources give.
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
            "shaders: this machine's compiler is {}, not the manifest's: hashes alone were checked",
            tools.version
        );
        return Ok(());
    }
    for (name, defines) in outputs(&folders)? {
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
                "vulkan-renderer/spirv/{name} is not what the compiler makes: cargo xtask shaders"
            ));
        }
        validated?;
    }
    Ok(())
}

/// Where sources and results lie.
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

/// Fails in one line where sources, results and manifest do not belong together.
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

/// Results by name, with what is defined for each.
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
        return Err(format!("{}: no shader has an entry point", folders.shaders.display()));
    }
    Ok(outputs)
}

fn source_of(output: &str) -> String {
    output.trim_end_matches(".spv").trim_end_matches(".f64").to_string()
}

/// A file and all that it includes, each once, in the order of first mention.
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

/// The compiler and the validator.
struct Tools {
    mesa: PrivateMesa,
    version: String,
}

impl Tools {
    /// Those of the private folder, which is made where it is missing.
    fn find(root: &Path, target: &Path) -> Result<Self, String> {
        let mesa = PrivateMesa::new(target);
        mesa.step(root).finish()?;
        let output = mesa.tool("glslangValidator").arg("--version").output();
        let output = output.map_err(|e| format!("glslangValidator: {e}"))?;
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let version = said.lines().find_map(|l| l.strip_prefix("Glslang Version: "));
        let version = version.ok_or("glslangValidator does not tell its version")?.trim().to_string();
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

/// Runs a tool to its end; what it said belongs to the failure.
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

    /// A folder of its own with one shader that includes a file, compiled (in name) as the manifest says.
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

    /// Each way to be stale is seen.
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
            // A source that includes nothing any more has changed, and one of its forms has none.
            assert!(said.contains(expected) || said.contains("has changed"), "{name}: {said}");
            assert!(said.ends_with("cargo xtask shaders"), "{said}");
            std::fs::remove_dir_all(root).unwrap();
        }
    }

    #[test]
    fn arguments() {
        assert_eq!(Options::parse(&[]), Ok(Options { check: false }));
        assert_eq!(Options::parse(&["--check".into()]), Ok(Options { check: true }));
        assert!(Options::parse(&["x".into()]).is_err());
    }
}
