//! Checks that every function that traces a ray on the CPU has a twin among the shaders, or a stated reason why only the host computes it.
//!
//! A shader names its twin at its head ("twin of PATH"). A function has the same name on both sides; a method has its type's name in front:
//! `Bsdf::eval` is `bsdf_eval`. A new file or function on the CPU, private ones too, fails the test until it has a twin or a line in
//! `pairs/host.rs`. No device is needed.

#![allow(clippy::expect_used, clippy::panic, reason = "tests")]

#[path = "pairs/host.rs"]
mod host;
#[path = "pairs/sources.rs"]
mod sources;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use sources::{head_of, rust_functions, shader_functions, shader_names};

/// The texts that are checked. The negative controls pass changed ones.
#[derive(Clone)]
struct Sources {
    /// Rust files by their path from the root.
    rust: BTreeMap<String, String>,
    /// Shaders by their name.
    shaders: BTreeMap<String, String>,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn files(folder: &str, endings: &[&str]) -> BTreeMap<String, String> {
    let entries = std::fs::read_dir(root().join(folder)).expect("a folder");
    let paths = entries.map(|e| e.expect("an entry").path());
    let wanted = paths.filter(|p| endings.iter().any(|e| p.extension().is_some_and(|x| x == *e)));
    let read = wanted.map(|p| {
        let name = p.file_name().and_then(|n| n.to_str()).expect("a name").to_owned();
        (name, std::fs::read_to_string(&p).expect("a source"))
    });
    read.collect()
}

impl Sources {
    fn read() -> Self {
        let mut rust = BTreeMap::new();
        for folder in host::FOLDERS {
            for (name, source) in files(folder, &["rs"]) {
                rust.insert(format!("{folder}/{name}"), source);
            }
        }
        for path in host::FILES {
            rust.insert((*path).to_owned(), std::fs::read_to_string(root().join(path)).expect("a source"));
        }
        let shaders = files("vulkan-renderer/shaders", &["glsl", "comp", "rgen", "rint", "rmiss"]);
        Self { rust, shaders }
    }

    /// The Rust files that a shader's head names; a name that does not exist is the error.
    fn named_by(&self, shader: &str) -> Result<Vec<String>, String> {
        let head = head_of(&self.shaders[shader]);
        let is_path = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
        let words = head.split(|c: char| !is_path(c)).map(|w| w.trim_end_matches('.'));
        let mut found: Vec<String> = Vec::new();
        for word in words.filter(|w| w.ends_with(".rs") && w.len() > 3) {
            // Paths are tried from the root, from this crate, and from the folder of the file named before.
            let beside = found.last().and_then(|p| Some(format!("{}/{word}", p.rsplit_once('/')?.0)));
            let places =
                [word.to_owned(), format!("vulkan-renderer/{word}"), format!("vulkan-renderer/src/{word}")];
            let place = places.into_iter().chain(beside).find(|p| root().join(p).is_file());
            found.push(place.ok_or(format!("{shader} names {word}, which does not exist"))?);
        }
        Ok(found)
    }

    /// All faults, one line each.
    fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let mut shaders_of: BTreeMap<String, Vec<&str>> = BTreeMap::new();
        for shader in self.shaders.keys() {
            let alone = host::SHADERS_ALONE.iter().any(|(name, _)| name == shader);
            match self.named_by(shader) {
                Err(fault) => faults.push(fault),
                Ok(named) => {
                    let is_twin = head_of(&self.shaders[shader]).contains("win of ") && !named.is_empty();
                    if is_twin == alone {
                        faults.push(match alone {
                            true => format!("{shader} has a twin and is listed as one without"),
                            false => {
                                format!("{shader} names no twin at its head, and pairs/host.rs no reason")
                            }
                        });
                    }
                    for path in named {
                        shaders_of.entry(path).or_default().push(shader);
                    }
                }
            }
        }
        for (path, source) in &self.rust {
            let is_host = host::HOST_FILES.iter().any(|(name, _)| name == path);
            let shaders = shaders_of.get(path);
            match (shaders, is_host) {
                (None, true) => continue,
                (None, false) => {
                    faults.push(format!("{path} has no shader that names it"));
                    continue;
                }
                (Some(s), true) => faults.push(format!("{path} is the host's alone, but {s:?} name it")),
                (Some(_), false) => {}
            }
            let names = shaders.into_iter().flatten().flat_map(|s| shader_functions(&self.shaders[*s]));
            self.compare(path, source, &names.collect(), &mut faults);
        }
        let listed = host::HOST_FILES.iter().map(|(path, _)| *path);
        let listed = listed.chain(host::HOST_FUNCTIONS.iter().map(|(path, _)| *path));
        let listed = listed.chain(host::OTHER_NAMES.iter().map(|(path, _)| *path));
        let gone = listed.filter(|path| !self.rust.contains_key(*path));
        faults.extend(gone.map(|path| format!("{path} is listed and does not exist")));
        let shaders = host::SHADERS_ALONE.iter().filter(|(name, _)| !self.shaders.contains_key(*name));
        faults.extend(shaders.map(|(name, _)| format!("{name} is listed and does not exist")));
        faults
    }

    /// Compares the functions of a file with those of its shaders.
    fn compare(&self, path: &str, source: &str, shader: &BTreeSet<String>, faults: &mut Vec<String>) {
        let of_path = |list: &'static [host::Listed]| {
            let entries = list.iter().filter(move |(p, _)| *p == path);
            entries.flat_map(|(_, entries)| entries.iter().copied()).collect::<BTreeMap<_, _>>()
        };
        let (hosts, others) = (of_path(host::HOST_FUNCTIONS), of_path(host::OTHER_NAMES));
        let functions = rust_functions(source);
        for function in &functions {
            let has_twin = match others.get(function.as_str()) {
                Some(other) => shader.contains(*other),
                None => shader_names(function).iter().any(|n| shader.contains(n)),
            };
            match (has_twin, hosts.contains_key(function.as_str())) {
                (true, false) | (false, true) => {}
                (false, false) => faults.push(format!("{path}: {function} has no twin")),
                (true, true) => {
                    faults.push(format!("{path}: {function} has a twin and is listed as the host's"))
                }
            }
        }
        let gone = hosts.keys().chain(others.keys()).filter(|f| !functions.iter().any(|g| g == *f));
        faults.extend(gone.map(|f| format!("{path}: {f} is listed and does not exist")));
    }
}

#[test]
fn every_function_has_its_twin() {
    let sources = Sources::read();
    assert!(sources.rust.len() > 20 && sources.shaders.len() > 30);
    let faults = sources.faults();
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

/// Negative control: what is new on the CPU, or removed from a shader, is reported.
#[test]
fn missing_twins_are_named() {
    let sources = Sources::read();
    let fault_of = |change: &dyn Fn(&mut Sources)| {
        let mut changed = sources.clone();
        change(&mut changed);
        changed.faults().join("\n")
    };
    let bsdf = "transport/src/bsdf.rs";
    let rust = |path: &'static str, from: &'static str, to: &'static str| {
        fault_of(&move |s: &mut Sources| {
            let source = s.rust.get_mut(path).expect("a file");
            assert!(source.contains(from), "{path} has no {from}");
            *source = source.replacen(from, to, 1);
        })
    };
    let shader = |name: &'static str, from: &'static str, to: &'static str| {
        fault_of(&move |s: &mut Sources| {
            let source = s.shaders.get_mut(name).expect("a shader");
            assert!(source.contains(from), "{name} has no {from}");
            *source = source.replacen(from, to, 1);
        })
    };
    let added = "pub fn transmit(x: f32) -> f32 {\n    x\n}\n\npub fn luminance(";
    assert_eq!(rust(bsdf, "pub fn luminance(", added), format!("{bsdf}: transmit has no twin"));
    let method = "pub fn transmit(&self) {}\n\n    pub fn eval(";
    assert_eq!(rust(bsdf, "pub fn eval(", method), format!("{bsdf}: Bsdf::transmit has no twin"));
    let ggx = "transport/src/bsdf/ggx.rs";
    let private = "fn ggx_g1(h: Vec3) {}\npub(super) fn ggx_d(";
    assert_eq!(rust(ggx, "pub(super) fn ggx_d(", private), format!("{ggx}: ggx_g1 has no twin"));
    let renamed = shader("lights.glsl", "infinite_emission(", "lights_lost(");
    assert_eq!(renamed, "transport/src/lights.rs: Lights::infinite_emission has no twin");
    let gone = shader("sun.glsl", "transport/src/sun.rs", "transport/src/moon.rs");
    assert!(gone.contains("sun.glsl names transport/src/moon.rs, which does not exist"), "{gone}");
    assert!(gone.contains("transport/src/sun.rs has no shader that names it"), "{gone}");
    let silent = shader("node.glsl", "twin of", "like");
    assert_eq!(silent, "node.glsl names no twin at its head, and pairs/host.rs no reason");
    let new_file = fault_of(&|s: &mut Sources| {
        s.rust.insert("cpu-renderer/src/media.rs".to_owned(), "pub fn scatter() {}".to_owned());
    });
    assert_eq!(new_file, "cpu-renderer/src/media.rs has no shader that names it");
    let new_shader = fault_of(&|s: &mut Sources| {
        s.shaders.insert("fog.glsl".to_owned(), "// Fog.\n".to_owned());
    });
    assert_eq!(new_shader, "fog.glsl names no twin at its head, and pairs/host.rs no reason");
    // A reason for a function that no longer exists is a fault.
    let stale = rust("transport/src/filter.rs", "fn half_distribution(", "fn distribution(");
    assert!(stale.contains("half_distribution is listed and does not exist"), "{stale}");
}

/// Functions are found in code that is formatted as in this repository, and nothing else is taken for a function.
#[test]
fn functions_are_listed() {
    let rust = "pub fn a<T: B>(t: T) {}\nconst fn b() {}\nimpl<T: Tracer> Walk<T> for Long<T> {\n    pub(crate) fn c() {\n    }\n}\n\
        impl std::fmt::Display for x::Y {\n    fn d(&self) {}\n}\n// fn e()\n#[cfg(test)]\nfn f() {}\n";
    assert_eq!(rust_functions(rust), ["a", "b", "Long::c", "Y::d"]);
    let glsl = "// void a(\nvec3 b(vec3 x) {\n    return c(x);\n}\nconst uint D = e(1);\nprecise float f(float x) {\nvoid g();\n";
    assert_eq!(shader_functions(glsl), ["b", "g"]);
    assert_eq!(
        shader_names("PixelSampler::film"),
        ["pixel_sampler_film", "pixel_film", "sampler_film", "film"]
    );
}
