//! The JSON form of a scene: the types of this crate and nothing else. Its version is checked before any other field.

use std::path::{Path, PathBuf};

use pumice_core::{read_input, write_text};
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
        #[serde(expecting = "an object with the fields of a scene")]
        struct Versioned {
            version: u64,
        }
        let Versioned { version } = parsed(text)?;
        if version != u64::from(SCENE_VERSION) {
            return Err(SceneError::Version { got: version, expected: SCENE_VERSION });
        }
        let scene: Self = parsed(text)?;
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
        serde_json::to_string_pretty(self)
            .map(|text| text + "\n")
            .map_err(|error| SceneError::json(".", &error))
    }

    /// Reads a scene file. Relative paths in it are resolved against its folder and become absolute, so that they name the same files
    /// wherever the scene is used.
    ///
    /// # Errors
    /// As [`Scene::from_json`], and when the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let text = String::from_utf8(read_input(path, LIMIT_BYTES)?)
            .map_err(|e| std::io::Error::new(std::io::ErrorKind::InvalidData, e.utf8_error()))?;
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
        Ok(write_text(path, &scene.to_json()?)?)
    }

    /// The paths of all files that the scene names, volumes with their tables of joined ids, meshes, sky, each with the path of its field in the JSON form.
    pub fn paths(&self) -> Vec<(String, &Path)> {
        let mut paths = Vec::new();
        for (i, instance) in self.instances.iter().enumerate() {
            paths.push((format!("instances[{i}].source"), instance.source.as_path()));
            if let Some(table) = &instance.reading.relabel {
                paths.push((format!("instances[{i}].reading.relabel"), table));
            }
        }
        let meshes = self.meshes.iter().enumerate().filter(|(_, m)| !m.is_built_in());
        paths.extend(meshes.map(|(i, m)| (format!("meshes[{i}].source"), m.source.as_path())));
        if let Environment::Image { path, .. } = &self.world.environment {
            paths.push(("world.environment.image.path".into(), path));
        }
        paths
    }

    /// The paths of [`Scene::paths`] in the same order, to be changed.
    pub fn paths_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let sky = match &mut self.world.environment {
            Environment::Image { path, .. } => Some(path),
            Environment::Constant { .. } => None,
        };
        let meshes = self.meshes.iter_mut().filter(|m| !m.is_built_in()).map(|m| &mut m.source);
        let of_instances = self
            .instances
            .iter_mut()
            .flat_map(|i| std::iter::once(&mut i.source).chain(i.reading.relabel.as_mut()));
        of_instances.chain(meshes).chain(sky)
    }
}

/// What a text is the JSON form of.
pub(crate) fn parsed<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, SceneError> {
    // Editors of Windows put a byte order mark before a text.
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let mut reader = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(&mut reader)
        .map_err(|error| told(text, &error.path().to_string(), error.inner()))?;
    reader.end().map_err(|error| SceneError::json(".", &error))?;
    Ok(value)
}

/// What is wrong with a text. Python writes numbers that JSON does not have, and no parser says so.
fn told(text: &str, path: &str, error: &serde_json::Error) -> SceneError {
    let told = SceneError::json(path, error);
    let line = text.lines().nth(error.line().saturating_sub(1)).unwrap_or_default();
    // The column counts bytes from 1 and is that of the first unexpected one, which stands behind a sign.
    let at = error.column().saturating_sub(1);
    let sign = at.saturating_sub(1);
    let at = if line.as_bytes().get(sign) == Some(&b'-') { sign } else { at };
    let rest = line.get(at..).unwrap_or_default();
    match (told, ["NaN", "Infinity", "-Infinity"].iter().find(|&word| rest.starts_with(word))) {
        (SceneError::Json { field, line, column, .. }, Some(word)) => {
            SceneError::Json { field, line, column, what: format!("{word} is no number of JSON") }
        }
        (told, _) => told,
    }
}

/// The folder that a file is in, as an absolute path.
fn folder_of(path: &Path) -> std::io::Result<PathBuf> {
    let absolute = std::path::absolute(path)?;
    Ok(absolute.parent().unwrap_or(&absolute).to_owned())
}
