//! Errors of scenes. Each text is one line that says what is wrong and where.

use pumice_core::TargetError;
use pumice_core::error::excerpt;

/// Why a scene is refused.
///
/// The text of each variant is one line: control characters from a file are escaped, and long names are cut.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A field has a value that is not allowed.
    #[error("{field}: {problem}")]
    Field {
        /// Path of the field in the JSON form, such as `instances[0].style.materials.17.roughness`.
        field: String,
        /// What was expected and what was found.
        problem: String,
    },
    /// The text is not valid JSON, or not the JSON form of a scene.
    #[error("{field}line {line}, column {column}: {what}")]
    Json {
        /// Path of the field with a colon and a space behind it; empty where the text as a whole is wrong.
        field: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1; 0 is before the first character.
        column: usize,
        /// What the parser expected.
        what: String,
    },
    /// The scene has another version of the JSON form.
    #[error("version: this program reads scenes of version {expected}, got {got}")]
    Version {
        /// Version that the file states.
        got: u64,
        /// [`crate::SCENE_VERSION`].
        expected: u32,
    },
    /// The operating system reports an error.
    #[error("{0}")]
    Io(#[from] std::io::Error),
}

/// Most characters of a parser's message that an error text repeats: names in it come from the file and may be megabytes long.
const MOST_CHARS: usize = 300;

impl SceneError {
    /// What the parser found wrong at the field with this path, `.` for the whole text.
    pub(crate) fn json(path: &str, error: &serde_json::Error) -> Self {
        let (line, column) = (error.line(), error.column());
        let text = error.to_string();
        // serde_json ends its text with the line and column, which the variant has as fields.
        let what = text.strip_suffix(&format!(" at line {line} column {column}")).unwrap_or(&text);
        let field = if path == "." { String::new() } else { format!("{}: ", excerpt(path, MOST_CHARS)) };
        Self::Json { field, line, column, what: excerpt(what, MOST_CHARS) }
    }
}

impl From<TargetError> for SceneError {
    fn from(error: TargetError) -> Self {
        match error {
            // The file's name is for the caller to say, as it is where a scene is read.
            TargetError::Io { source, .. } => Self::Io(source),
            TargetError::Refused { what, .. } => Self::Field { field: "file".into(), problem: what },
        }
    }
}
