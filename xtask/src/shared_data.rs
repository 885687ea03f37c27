//! Finds the volumes that may not be shipped, and the test suites that use them.
//!
//! A crate's suite is its integration test `tests/shared_data.rs`, which is declared with `test = false` so that a plain `cargo test`
//! skips it. The suites in Python are `tests/python/test_shared_data_*.py`.

use std::path::{Path, PathBuf};

/// The folder of those volumes (`PUMICE_SHARED_DATA`, or `shared/data` beside the repository), if it exists.
pub(crate) fn folder(root: &Path) -> Option<PathBuf> {
    let path = match std::env::var_os("PUMICE_SHARED_DATA") {
        Some(path) => PathBuf::from(path),
        None => root.parent()?.join("shared/data"),
    };
    path.is_dir().then_some(path)
}

/// Package names of the crates that have such a suite.
///
/// # Errors
/// When a suite is not declared with `test = false`: a plain `cargo test` would run it and fail where the folder is missing.
pub(crate) fn crates(root: &Path) -> Result<Vec<String>, String> {
    let mut packages = Vec::new();
    let folders = std::fs::read_dir(root).map_err(|e| format!("{}: {e}", root.display()))?;
    for folder in folders.flatten().map(|f| f.path()) {
        // The workspace member `tests` has its suite in its own `tests` folder, as every crate has.
        if !folder.join("tests/shared_data.rs").is_file() {
            continue;
        }
        let manifest = folder.join("Cargo.toml");
        let text = std::fs::read_to_string(&manifest).map_err(|e| format!("{}: {e}", manifest.display()))?;
        packages.push(package_with_suite(&text).map_err(|e| format!("{}: {e}", manifest.display()))?);
    }
    packages.sort();
    Ok(packages)
}

fn package_with_suite(manifest: &str) -> Result<String, String> {
    let lines: Vec<String> = manifest.lines().map(|l| l.replace(' ', "")).collect();
    let suites = lines.split(|l| l == "[[test]]").skip(1);
    let declared = suites
        .map(|s| s.split(|l| l.starts_with('[')).next().unwrap_or(s))
        .any(|s| s.iter().any(|l| l == "name=\"shared_data\"") && s.iter().any(|l| l == "test=false"));
    if !declared {
        return Err("tests/shared_data.rs needs [[test]] name = \"shared_data\", test = false".into());
    }
    lines
        .iter()
        .find_map(|l| l.strip_prefix("name=\"")?.strip_suffix('"').map(str::to_owned))
        .ok_or_else(|| "no package name".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suites_must_be_declared() {
        let package = "[package]\nname = \"a\"\n";
        let suite = "[[test]]\nname = \"shared_data\"\ntest = false\n[lints]\n";
        assert_eq!(package_with_suite(&format!("{package}{suite}")), Ok("a".into()));
        assert!(package_with_suite(package).is_err());
        assert!(
            package_with_suite(&format!("{package}[[test]]\nname = \"shared_data\"\n[x]\ntest = false"))
                .is_err()
        );
    }
}
