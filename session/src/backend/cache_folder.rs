//! The folder in which compiled pipelines are kept between runs: the platform's cache folder.
//!
//! ```text
//! PUMICE_CACHE set      its value
//! Linux and others      $XDG_CACHE_HOME or ~/.cache            /pumice
//! macOS                 ~/Library/Caches                       /pumice
//! Windows               %LOCALAPPDATA%                         /pumice
//! ```
//! A missing folder is never an error: pipelines are then compiled at each start.

use std::ffi::OsString;
use std::path::PathBuf;

/// Environment variable that names another cache folder; if it is empty, nothing is cached.
pub const CACHE_VARIABLE: &str = "PUMICE_CACHE";

/// The folder of compiled pipelines; `None` where the platform gives no place for it. It may not exist yet.
pub(super) fn pipeline_folder() -> Option<PathBuf> {
    folder(&|name| std::env::var_os(name), std::env::home_dir(), std::env::consts::OS)
        .map(|f| f.join("pipelines"))
}

fn folder(
    variable: &dyn Fn(&str) -> Option<OsString>,
    home: Option<PathBuf>,
    system: &str,
) -> Option<PathBuf> {
    if let Some(chosen) = variable(CACHE_VARIABLE) {
        return (!chosen.is_empty()).then(|| chosen.into());
    }
    // A relative path would mean a different folder for each folder that the program is started in.
    let absolute = |path: OsString| Some(PathBuf::from(path)).filter(|p| p.has_root());
    let home = home.filter(|h| h.has_root());
    let base = match system {
        "windows" => variable("LOCALAPPDATA").and_then(absolute)?,
        "macos" => home?.join("Library/Caches"),
        // XDG Base Directory Specification 0.8: relative paths are ignored.
        _ => variable("XDG_CACHE_HOME").and_then(absolute).or_else(|| Some(home?.join(".cache")))?,
    };
    Some(base.join("pumice"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(variables: &[(&str, &str)], home: Option<&str>, system: &str) -> Option<PathBuf> {
        let variable = |name: &str| variables.iter().find(|v| v.0 == name).map(|v| v.1.into());
        folder(&variable, home.map(PathBuf::from), system)
    }

    #[test]
    fn each_system_has_its_place_and_none_is_no_error() {
        let path = |p: &str| Some(PathBuf::from(p));
        assert_eq!(found(&[], Some("/home/a"), "linux"), path("/home/a/.cache/pumice"));
        assert_eq!(found(&[("XDG_CACHE_HOME", "/c")], Some("/home/a"), "linux"), path("/c/pumice"));
        assert_eq!(
            found(&[("XDG_CACHE_HOME", "c")], Some("/home/a"), "linux"),
            path("/home/a/.cache/pumice")
        );
        assert_eq!(found(&[], Some("/Users/a"), "macos"), path("/Users/a/Library/Caches/pumice"));
        assert_eq!(found(&[("LOCALAPPDATA", "/l")], Some("/u"), "windows"), path("/l/pumice"));
        for nothing in
            [found(&[], None, "linux"), found(&[], Some("a"), "macos"), found(&[], Some("/u"), "windows")]
        {
            assert_eq!(nothing, None);
        }
        assert_eq!(found(&[(CACHE_VARIABLE, "/x")], Some("/home/a"), "linux"), path("/x"));
        assert_eq!(found(&[(CACHE_VARIABLE, "")], Some("/home/a"), "linux"), None);
    }
}
