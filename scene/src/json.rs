//! The JSON form of a scene: these types and nothing else, with a version that is looked at first.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::{Environment, SCENE_VERSION, Scene};

/// What is wrong with a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A field's value makes no sense.
    #[error("{field}: {problem}")]
    Field {
        /// Its path in the JSON form.
        field: String,
        /// Expected and got.
        problem: String,
    },
    /// The text is no scene.
    #[error("line {line}, column {column}: {what}")]
    Json {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What the parser expected.
        what: String,
    },
    /// Another version of the form.
    #[error("version: this program reads scenes of version {expected}, got {got}")]
    Version {
        /// In the file.
        got: u64,
        /// [`SCENE_VERSION`].
        expected: u32,
    },
    /// The system refused.
    #[error("{0}")]
    Io(#[from] std::io::Error),
}

/// Largest scene file that is read: materials of 10⁶ labels take some 200 MB.
const LIMIT_BYTES: u64 = 1 << 29;

impl From<serde_json::Error> for SceneError {
    fn from(error: serde_json::Error) -> Self {
        let text = error.to_string();
        // serde_json repeats the place at the end of its text.
        let what = text.rsplit_once(" at line ").map_or(text.as_str(), |(what, _)| what);
        // It also repeats names out of the text, which may hold line breaks: an error is one line.
        let what = what.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect();
        Self::Json { line: error.line(), column: error.column(), what }
    }
}

impl Scene {
    /// Reads and validates the JSON form.
    ///
    /// # Errors
    /// What is wrong, by line and column or by field.
    pub fn from_json(text: &str) -> Result<Self, SceneError> {
        // The version before anything else: fields of other versions are not this one's business.
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

    /// The JSON form, for people to read. Every number comes back as it was.
    ///
    /// # Errors
    /// [`SceneError::Field`] when the scene is not valid: an infinite number has no JSON form.
    pub fn to_json(&self) -> Result<String, SceneError> {
        self.validate()?;
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// Reads a scene file; relative paths in it are taken from its folder.
    ///
    /// # Errors
    /// As [`Scene::from_json`], and when the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let bytes = std::fs::metadata(path)?.len();
        if bytes > LIMIT_BYTES {
            let problem = format!("expected at most {LIMIT_BYTES} bytes, got {bytes}");
            return Err(SceneError::Field { field: "file".into(), problem });
        }
        let mut scene = Self::from_json(&std::fs::read_to_string(path)?)?;
        // Absolute, so that the scene means the same wherever it is saved to.
        let folder = std::path::absolute(path)?.parent().unwrap_or(Path::new("")).to_owned();
        let resolve = |p: &mut PathBuf| *p = folder.join(&*p);
        scene.instances.iter_mut().for_each(|i| resolve(&mut i.source));
        if let Environment::Image { path, .. } = &mut scene.world.environment {
            resolve(path);
        }
        Ok(scene)
    }

    /// Writes the JSON form; the file is there whole or not at all.
    ///
    /// # Errors
    /// As [`Scene::to_json`], and when the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), SceneError> {
        let text = self.to_json()?;
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(text.as_bytes())?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error)?;
        Ok(())
    }
}
