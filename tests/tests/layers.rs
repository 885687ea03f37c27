//! Checks in the manifests that crates depend only on crates of lower layers; docs/architecture.md lists the order.
//!
//! Dependencies of tests and examples are exempt.

#![allow(clippy::expect_used, reason = "tests")]

use std::collections::BTreeMap;
use std::path::Path;

/// Packages from the lowest layer up. Packages of one layer may not depend on each other.
const LAYERS: [&[&str]; 9] = [
    &["pumice-core"],
    &["pumice-formats", "pumice-scene"],
    &["pumice-picture"],
    &["pumice-transport"],
    &["pumice-cpu", "pumice-vulkan", "pumice-export", "pumice-oracle", "pumice-encodings"],
    &["pumice-session"],
    &["pumice-python", "pumice-bench"],
    &["pumice"],
    &["pumice-tests", "xtask"],
];

/// The package name of a manifest, and the names of the workspace's packages in its `[dependencies]`.
fn read(manifest: &str) -> (String, Vec<String>) {
    let (mut name, mut section, mut found) = (String::new(), "", Vec::new());
    for line in manifest.lines() {
        if line.starts_with('[') {
            section = line;
        } else if let Some((key, value)) = line.split_once('=') {
            let key = key.trim().split('.').next().unwrap_or_default();
            match section {
                "[package]" if key == "name" => name = value.trim().trim_matches('"').to_owned(),
                "[dependencies]" if key.starts_with("pumice") => found.push(key.to_owned()),
                _ => {}
            }
        }
    }
    (name, found)
}

fn layer_of(package: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&package))
}

/// A line for each dependency on a package that is not in a lower layer, and for each package without a layer.
fn upward(manifests: &BTreeMap<String, Vec<String>>) -> Vec<String> {
    let mut faults = Vec::new();
    for (package, dependencies) in manifests {
        let Some(own) = layer_of(package) else {
            faults.push(format!("{package} has no layer"));
            continue;
        };
        for dependency in dependencies {
            match layer_of(dependency) {
                Some(below) if below < own => {}
                _ => faults.push(format!("{package} depends on {dependency}, which is not below it")),
            }
        }
    }
    faults
}

/// Dependencies by package, of all members of the workspace.
fn manifests() -> BTreeMap<String, Vec<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = |path: &Path| std::fs::read_to_string(path).expect("a manifest");
    let workspace = text(&root.join("Cargo.toml"));
    let members = workspace.lines().find_map(|l| l.strip_prefix("members = [")).expect("members on one line");
    let folders = members.trim_end_matches(']').split(',').map(|m| m.trim().trim_matches('"'));
    folders.map(|folder| read(&text(&root.join(folder).join("Cargo.toml")))).collect()
}

#[test]
fn no_crate_depends_on_one_above_it() {
    let manifests = manifests();
    assert_eq!(manifests.len(), LAYERS.iter().map(|layer| layer.len()).sum::<usize>());
    // Control of the parser: a known dependency is there.
    assert!(manifests["pumice-cpu"].contains(&"pumice-transport".to_owned()));
    assert_eq!(upward(&manifests), Vec::<String>::new());
}

/// Control: the check finds a dependency on a higher layer, one within a layer, and a package without a layer.
#[test]
fn arrows_upward_are_named() {
    let mut changed = manifests();
    changed.get_mut("pumice-scene").expect("a package").push("pumice-picture".into());
    changed.get_mut("pumice-vulkan").expect("a package").push("pumice-cpu".into());
    changed.insert("pumice-cloud".into(), Vec::new());
    assert_eq!(
        upward(&changed),
        [
            "pumice-cloud has no layer",
            "pumice-scene depends on pumice-picture, which is not below it",
            "pumice-vulkan depends on pumice-cpu, which is not below it",
        ]
    );
    let (name, found) = read(
        "[package]\nname = \"a\"\n[dependencies]\npumice-core.workspace = true\n[dev-dependencies]\npumice-oracle.workspace = true\n",
    );
    assert_eq!((name.as_str(), found), ("a", vec!["pumice-core".to_owned()]));
}
