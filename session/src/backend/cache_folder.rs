//! Where compiled pipelines are kept from one start to the next: the folder that the platform has for what can be made again.
//!
//! ```text
//! PUMICE_CACHE set      its value
//! Linux and others      $XDG_CACHE_HOME or ~/.cache            /pumice
//! macOS                 ~/Library/Caches                       /pumice
//! Windows               %LOCALAPPDATA%                         /pumice
//! ```
//! Nothing of it is ever an error: without a folder, pipelines are compiled at each start.

use std::ffi::OsString;
use std::path::PathBuf;

/// Names another folder for what can be made again; empty: none is kept.
pub const CACHE_VARIABLE: &str = "PUMICE_CACHE";

/// The folder of compiled pipelines, where there is a place for it. It may not exist yet.
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
    // A relative path would be another folder in each place that the program is started from.
    let absolute = |path: OsString| Some(PathBuf::from(path)).filter(|p| p.has_root());
    let home = home.filter(|h| h.has_root());
    let base = match system {
        "windows" => variable("LOCALAPPDATA").and_then(absolute)?,
        "macos" => home?.join("Library/Caches"),
        // XDG Base Directory Specification 0.8: a relative path is to be ignored.
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
