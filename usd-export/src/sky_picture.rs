//! The picture of a scene's world: which file it is, and how a stage names it.
//!
//! ```text
//! figure.usda, .usdc   the picture stays where it is; the stage names it by the way from its own folder: ./sky.exr, ../skies/sky.exr
//! figure.usdz          the picture is packed beside the stage, as ./sky.exr; a package takes OpenEXR but no Radiance (.hdr)
//! ```
//! The way is relative, so that a folder can be moved or sent with both, and nothing tells whose machine wrote the file.

use std::path::{Component, Path, PathBuf};

use pumice_core::Error;
use pumice_scene::{Environment, Scene};

use crate::{FileFormat, Result};

/// The picture of a world, as a stage refers to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SkyPicture {
    /// The file.
    pub(crate) file: PathBuf,
    /// Its size.
    pub(crate) bytes: u64,
    /// Its path in the stage.
    pub(crate) asset: String,
}

impl SkyPicture {
    /// The picture of the world of a scene that is written to `out`; none where the world is of one colour, or where [`is_packable`] says
    /// that a package cannot hold it.
    ///
    /// # Errors
    /// [`Error::Io`] for a picture that is not there; [`Error::Caller`] for a name that a stage cannot have.
    pub(crate) fn of(scene: &Scene, out: &Path, format: FileFormat) -> Result<Option<Self>> {
        let Environment::Image { path, .. } = &scene.world.environment else { return Ok(None) };
        let found = std::fs::metadata(path).map_err(|source| Error::Io { path: path.clone(), source })?;
        let asset = match format {
            FileFormat::Usdz if is_packable(path) => "./sky.exr".to_owned(),
            FileFormat::Usdz => return Ok(None),
            _ => way(out, path)?,
        };
        Ok(Some(Self { file: path.clone(), bytes: found.len(), asset }))
    }
}

/// Whether a usdz package may hold this picture of a world (Usdz File Format Specification 1.3, *File Types*).
pub(crate) fn is_packable(picture: &Path) -> bool {
    picture.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"))
}

/// The way from the folder of `out` to a file, with `/` between the parts; the file's whole path where they are on different drives.
fn way(out: &Path, to: &Path) -> Result<String> {
    let real = |folder: &Path| {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        folder.canonicalize().map_err(|source| Error::Io { path: folder.to_owned(), source })
    };
    let from = real(out.parent().unwrap_or(Path::new("")))?;
    let to_folder = real(to.parent().unwrap_or(Path::new("")))?;
    let name = to.file_name().unwrap_or_default();
    let text = match relative(&from, &to_folder.join(name)) {
        Some(relative) => relative,
        None => std::path::absolute(to)
            .map_err(|source| Error::Io { path: to.to_owned(), source })?
            .to_str()
            .map(|text| text.replace('\\', "/"))
            .unwrap_or_default(),
    };
    if text.is_empty() || text.chars().any(char::is_control) {
        return Err(Error::Caller(format!(
            "world.environment.image.path: {}: expected a name in Unicode without control characters, as USD takes no other",
            to.display()
        ))
        .into());
    }
    Ok(text)
}

/// The way from a folder to a file, both whole paths; none to another drive, empty where a name is not Unicode.
fn relative(from: &Path, to: &Path) -> Option<String> {
    let (mut from, mut to) = (from.components().peekable(), to.components().peekable());
    while from.peek().is_some() && from.peek() == to.peek() {
        from.next();
        to.next();
    }
    if matches!(to.peek(), Some(Component::Prefix(_) | Component::RootDir)) {
        return None;
    }
    let ups = from.count();
    let mut parts = if ups == 0 { vec!["."] } else { vec![".."; ups] };
    let down: Vec<PathBuf> = to.map(|part| PathBuf::from(part.as_os_str())).collect();
    for part in &down {
        match part.to_str() {
            Some(part) => parts.push(part),
            None => return Some(String::new()),
        }
    }
    Some(parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_leads_from_the_stage_to_the_picture() {
        let folder = tempfile::tempdir().unwrap();
        for made in ["out", "skies/old"] {
            std::fs::create_dir_all(folder.path().join(made)).unwrap();
        }
        for (picture, expected) in [
            ("out/a b@µ.exr", "./a b@µ.exr"),
            ("skies/old/s.exr", "../skies/old/s.exr"),
            ("s.exr", "../s.exr"),
            ("out/../s.exr", "../s.exr"),
        ] {
            let got = way(&folder.path().join("out/figure.usda"), &folder.path().join(picture)).unwrap();
            assert_eq!(got, expected, "{picture}");
        }
        let error =
            way(&folder.path().join("f.usda"), &folder.path().join("a\nb.exr")).unwrap_err().to_string();
        assert!(error.contains("without control characters"), "{error}");
        let nowhere = way(&folder.path().join("f.usda"), &folder.path().join("nowhere/b.exr"));
        assert!(nowhere.unwrap_err().to_string().contains("nowhere"));
    }
}
