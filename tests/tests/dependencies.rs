//! Checks the dependencies: licences must be compatible with Pumice's own, crates must come from crates.io, and none may need a build tool
//! that users lack.
//!
//! `cargo metadata` lists what the lock file resolves to, for every target and feature.

#![allow(clippy::expect_used, reason = "tests")]

use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

/// SPDX names of licences that are compatible with MIT OR Apache-2.0.
const LICENSES: [&str; 12] = [
    "MIT",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "Zlib",
    "ISC",
    "Unicode-3.0",
    "BSL-1.0",
    "CC0-1.0",
    // BSD without the clause on endorsement, for `libbz2-rs-sys`.
    "bzip2-1.0.6",
    // For the list of certificate authorities in `webpki-roots`: asks of whoever passes it on to keep its text.
    "CDLA-Permissive-2.0",
];
const REGISTRY: &str = "registry+https://github.com/rust-lang/crates.io-index";
/// Crates that need more than a C compiler on a user's machine, with what they need.
const BANNED: [(&str, &str); 2] = [("cmake", "CMake"), ("openssl-sys", "OpenSSL's headers")];

/// A line for each fault of a package: licence, source, banned crate, or a dependency on any version.
fn faults(metadata: &Value) -> Vec<String> {
    let allowed = LICENSES.map(|l| spdx::Licensee::parse(l).expect("a licence that SPDX lists"));
    let mut faults = Vec::new();
    for package in metadata["packages"].as_array().expect("packages") {
        let text = |key: &str| package[key].as_str();
        let name = text("name").expect("a name");
        let expression = text("license").map(|l| spdx::Expression::parse_mode(l, spdx::ParseMode::LAX));
        let is_allowed = match &expression {
            Some(Ok(parsed)) => parsed.evaluate(|required| allowed.iter().any(|l| l.satisfies(required))),
            _ => false,
        };
        if !is_allowed {
            faults.push(format!("{name}: licence {}", text("license").unwrap_or("unknown")));
        }
        // Members of the workspace have no source.
        if text("source").is_some_and(|source| source != REGISTRY) {
            faults.push(format!("{name}: source {}", package["source"]));
        }
        if let Some((_, needs)) = BANNED.iter().find(|(banned, _)| *banned == name) {
            faults.push(format!("{name}: users have no {needs}"));
        }
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let is_ours = package["source"].is_null();
            if is_ours && dependency["req"] == "*" && dependency["path"].is_null() {
                faults.push(format!("{name}: any version of {}", dependency["name"]));
            }
        }
    }
    faults
}

fn metadata() -> Value {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--manifest-path"])
        .arg(manifest)
        .output()
        .expect("cargo metadata");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn all_that_is_built_in_may_be() {
    let metadata = metadata();
    assert!(metadata["packages"].as_array().expect("packages").len() > 100);
    assert_eq!(faults(&metadata), Vec::<String>::new());
}

/// Names of external crates that a member of the workspace depends on and `text` does not mention in backticks.
fn unexplained(metadata: &Value, text: &str) -> Vec<String> {
    let packages = metadata["packages"].as_array().expect("packages");
    let ours = packages.iter().filter(|p| p["source"].is_null());
    let named = ours.flat_map(|p| p["dependencies"].as_array().expect("dependencies"));
    let from_outside = named.filter(|d| d["path"].is_null()).filter_map(|d| d["name"].as_str());
    let mut missing: Vec<String> =
        from_outside.filter(|name| !text.contains(&format!("`{name}`"))).map(str::to_owned).collect();
    missing.sort();
    missing.dedup();
    missing
}

#[test]
fn each_dependency_is_explained() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/dependencies.md");
    let text = std::fs::read_to_string(page).expect("a page");
    let metadata = metadata();
    assert_eq!(unexplained(&metadata, &text), Vec::<String>::new());
    assert_eq!(unexplained(&metadata, &text.replace("`zip`", "zip")), ["zip"]);
}

/// Control: the check finds each kind of fault.
#[test]
fn what_may_not_be_built_in_is_named() {
    let package = |name: &str, license: Value, source: Value, dependencies: Value| json!({ "name": name, "license": license, "source": source, "dependencies": dependencies });
    let registry = json!(REGISTRY);
    let none = json!([]);
    let packages = json!({ "packages": [
        package("good", json!("MIT/Apache-2.0"), registry.clone(), none.clone()),
        package("either", json!("GPL-3.0-only OR MIT"), registry.clone(), none.clone()),
        package("both", json!("GPL-3.0-only AND MIT"), registry.clone(), none.clone()),
        package("silent", Value::Null, registry.clone(), none.clone()),
        package("elsewhere", json!("MIT"), json!("git+https://example.org/x"), none.clone()),
        package("cmake", json!("MIT"), registry, none),
        package("ours", json!("MIT"), Value::Null, json!([
            { "name": "loose", "req": "*" },
            { "name": "sibling", "req": "*", "path": "/sibling" },
        ])),
    ] });
    assert_eq!(
        faults(&packages),
        [
            "both: licence GPL-3.0-only AND MIT",
            "silent: licence unknown",
            "elsewhere: source \"git+https://example.org/x\"",
            "cmake: users have no CMake",
            "ours: any version of \"loose\"",
        ]
    );
}
