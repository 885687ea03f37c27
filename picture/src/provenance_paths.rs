//! The paths in a picture's provenance: relative to the folder of the picture, so that both may move together.
//!
//! ```text
//! in memory   /data/study/cells.pumice                        absolute, or as the caller's scene names it
//! in a file   /data/figures/a.exr: ../study/cells.pumice      written against the picture's real folder
//! read back   /data/figures/../study/cells.pumice, tidied     nothing else is tried
//! ```
//! Both sides use the real folder, without symbolic links, because `..` after a link leads elsewhere than it reads. A path on another drive
//! stays absolute. A source that names no file (a volume of an array) stays as it is.

use std::path::{Component, Path, PathBuf};

use crate::Provenance;

/// What a picture file says of where its volumes, meshes and sky are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PicturePaths {
    /// Paths relative to the picture's folder.
    #[default]
    Relative,
    /// Nothing: each path is empty.
    None,
}

/// The provenance as the picture `file` holds it.
pub(crate) fn for_file(provenance: &Provenance, file: &Path, paths: PicturePaths) -> Provenance {
    let mut out = provenance.clone();
    let folder = folder_of(file);
    for path in out.scene.paths_mut() {
        match (paths, &folder) {
            (PicturePaths::None, _) => *path = PathBuf::new(),
            (PicturePaths::Relative, Some(folder)) => {
                if let Some(relative) = std::path::absolute(&*path)
                    .ok()
                    .filter(|absolute| path.is_absolute() || absolute.exists())
                    .and_then(|absolute| relative_to(folder, &absolute))
                {
                    *path = relative;
                }
            }
            // The folder is not there, so neither is the file: writing it gives the system's error.
            (PicturePaths::Relative, None) => {}
        }
    }
    out
}

/// The provenance that was read from the picture `file`, with absolute paths. Empty paths stay empty.
pub(crate) fn from_file(mut provenance: Provenance, file: &Path) -> Provenance {
    let folder = file.canonicalize().ok().as_deref().and_then(Path::parent).map(Path::to_owned);
    if let Some(folder) = folder {
        let given = provenance.scene.paths_mut().filter(|path| !path.as_os_str().is_empty());
        given.for_each(|path| *path = joined(&folder, path));
    }
    provenance
}

/// The real folder of a file, which itself need not exist.
fn folder_of(file: &Path) -> Option<PathBuf> {
    std::path::absolute(file).ok()?.parent()?.canonicalize().ok()
}

/// `file` as seen from `folder`; both are absolute. `None` where no relative path leads there, or where the file would be the folder itself.
fn relative_to(folder: &Path, file: &Path) -> Option<PathBuf> {
    let (mut from, mut to) = (folder.components().peekable(), file.components().peekable());
    let mut shared = 0;
    while from.peek().is_some() && from.peek() == to.peek() {
        from.next();
        to.next();
        shared += 1;
    }
    if shared == 0 || to.peek().is_none() {
        return None;
    }
    // The way up and the way down.
    Some(from.map(|_| Component::ParentDir).chain(to).collect())
}

/// `path` as seen from a real folder: each `..` at its beginning leads to the parent.
fn joined(folder: &Path, path: &Path) -> PathBuf {
    if path.is_absolute() {
        return path.to_owned();
    }
    let (mut folder, mut rest) = (folder, path);
    while let Ok(below) = rest.strip_prefix("..") {
        (folder, rest) = (folder.parent().unwrap_or(folder), below);
    }
    folder.join(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_leads_back_to_the_file_from_wherever_the_picture_is() {
        let folder = Path::new("/a/b/c");
        for (file, relative) in [
            ("/a/b/c/v.pumice", "v.pumice"),
            ("/a/b/c/d/v.pumice", "d/v.pumice"),
            ("/a/b/v.pumice", "../v.pumice"),
            ("/a/x/v.pumice", "../../x/v.pumice"),
            ("/v.pumice", "../../../v.pumice"),
            ("/a/bc/v.pumice", "../../bc/v.pumice"),
        ] {
            let got = relative_to(folder, Path::new(file)).unwrap();
            assert_eq!(got, Path::new(relative));
            assert_eq!(joined(folder, &got), Path::new(file));
        }
        assert_eq!(relative_to(folder, folder), None);
        assert_eq!(joined(folder, Path::new("/old/v.pumice")), Path::new("/old/v.pumice"));
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_behind_a_link_is_left_by_its_real_parent() {
        let root = tempfile::tempdir().unwrap();
        let real = root.path().canonicalize().unwrap();
        std::fs::create_dir_all(real.join("x/pictures")).unwrap();
        std::fs::write(real.join("x/v.pumice"), "").unwrap();
        std::os::unix::fs::symlink(real.join("x/pictures"), real.join("link")).unwrap();
        let mut made = crate::sample_pictures::provenance();
        made.scene.instances[0].source = real.join("x/v.pumice");
        let held = for_file(&made, &real.join("link/a.exr"), PicturePaths::Relative);
        assert_eq!(held.scene.instances[0].source, Path::new("../v.pumice"));
        std::fs::write(real.join("x/pictures/a.exr"), "").unwrap();
        assert_eq!(from_file(held, &real.join("link/a.exr")), made);
        let none = for_file(&made, &real.join("link/a.exr"), PicturePaths::None);
        assert_eq!(none.scene.instances[0].source, Path::new(""));
        assert_eq!(from_file(none.clone(), &real.join("link/a.exr")), none);
    }
}
