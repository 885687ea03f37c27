//! The JSON form of a scene: the types of this crate and nothing else. Its version is checked before any other field.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::{Environment, SCENE_VERSION, Scene, SceneError};

/// Size of the largest scene file that is read. For comparison: materials of 10⁶ labels take some 200 MB.
const LIMIT_BYTES: u64 = 1 << 29;

impl Scene {
    /// Reads and validates the JSON form.
    ///
    /// # Errors
    /// [`SceneError::Json`], [`SceneError::Version`] or [`SceneError::Field`] say what is wrong, by line and column or by field.
    pub fn from_json(text: &str) -> Result<Self, SceneError> {
        // The version is checked first: a scene of another version may have fields that this version does not know.
        #[derive(Deserialize)]
        struct Versioned {
            version: u64,
        }
        let Versioned { version } = serde_json::from_str(text)?;
        if version != u64::from(SCENE_VERSION) {
            return Err(SceneError::Version { got: version, expected: SCENE_VERSION });
        }
        let scene: Self = serde_json::from_str(text)?;
        scene.validate()?;
        Ok(scene)
    }

    /// The JSON form, indented for people to read. Reading it back gives every number exactly.
    ///
    /// # Errors
    /// [`SceneError::Field`] when the scene is not valid, for instance with an infinite number, which has no JSON form; also when a path
    /// is not Unicode.
    pub fn to_json(&self) -> Result<String, SceneError> {
        self.validate()?;
        for (field, path) in self.paths() {
            if path.to_str().is_none() {
                let problem = format!("expected a path in Unicode, got {path:?}");
                return Err(SceneError::Field { field, problem });
            }
        }
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// Reads a scene file. Relative paths in it are resolved against its folder and become absolute, so that they name the same files
    /// wherever the scene is used.
    ///
    /// # Errors
    /// As [`Scene::from_json`], and when the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let file_error = |problem: String| SceneError::Field { field: "file".into(), problem };
        if !std::fs::metadata(path)?.is_file() {
            return Err(file_error("expected an ordinary file".into()));
        }
        let mut text = String::new();
        // Reading one byte more than allowed detects a file that is too long, even one that grows while it is read.
        std::fs::File::open(path)?.take(LIMIT_BYTES + 1).read_to_string(&mut text)?;
        if text.len() as u64 > LIMIT_BYTES {
            return Err(file_error(format!("expected at most {LIMIT_BYTES} bytes, got more")));
        }
        let mut scene = Self::from_json(&text)?;
        let folder = folder_of(path)?;
        scene.paths_mut().for_each(|p| *p = folder.join(&*p));
        Ok(scene)
    }

    /// Writes the JSON form. The file appears complete or not at all. Paths below its folder are written relative to it, so that the
    /// folder can move; relative paths are written as they are and count from that folder.
    ///
    /// # Errors
    /// As [`Scene::to_json`], and when the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), SceneError> {
        let folder = folder_of(path)?;
        let mut scene = self.clone();
        for p in scene.paths_mut() {
            // A path that equals the folder would become empty. It cannot be a file anyway, so it is left as it is.
            if let Ok(below) = p.strip_prefix(&folder)
                && !below.as_os_str().is_empty()
            {
                *p = below.to_owned();
            }
        }
        let text = scene.to_json()?;

        // A rename over a device or a pipe would replace it by a file, for every user of the machine.
        if std::fs::metadata(path).is_ok_and(|there| !there.is_file()) {
            return Err(SceneError::Field {
                field: "file".into(),
                problem: "expected an ordinary file".into(),
            });
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(".pumice-");
        // Temporary files are private by default; a scene gets the permissions that any new file would.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        // If the folder is missing, this call gives the system's own error text: `tempfile` would add its temporary name, which means
        // nothing to the user.
        std::fs::metadata(&folder)?;
        let mut file = builder.tempfile_in(&folder).map_err(|e| std::io::Error::from(e.kind()))?;
        file.write_all(text.as_bytes())?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error)?;
        Ok(())
    }

    /// The paths of all files that the scene names, each with the path of its field in the JSON form.
    fn paths(&self) -> Vec<(String, &Path)> {
        let sources = self.instances.iter().enumerate();
        let mut paths: Vec<_> =
            sources.map(|(i, s)| (format!("instances[{i}].source"), s.source.as_path())).collect();
        let meshes = self.meshes.iter().enumerate();
        paths.extend(meshes.map(|(i, m)| (format!("meshes[{i}].source"), m.source.as_path())));
        if let Environment::Image { path, .. } = &self.world.environment {
            paths.push(("world.environment.image.path".into(), path));
        }
        paths
    }

    fn paths_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let sky = match &mut self.world.environment {
            Environment::Image { path, .. } => Some(path),
            Environment::Constant { .. } => None,
        };
        let meshes = self.meshes.iter_mut().filter(|m| !m.is_built_in()).map(|m| &mut m.source);
        self.instances.iter_mut().map(|i| &mut i.source).chain(meshes).chain(sky)
    }
}

/// The folder that a file is in, as an absolute path.
fn folder_of(path: &Path) -> std::io::Result<PathBuf> {
    let absolute = std::path::absolute(path)?;
    Ok(absolute.parent().unwrap_or(&absolute).to_owned())
}
