//! What can be wrong with a scene, in one line that says what and where.

/// What is wrong with a scene.
///
/// The text of each variant is one line: whatever a file holds, control characters are escaped and long names are cut.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A field's value makes no sense.
    #[error("{field}: {problem}")]
    Field {
        /// Its path in the JSON form, such as `instances[0].style.materials.17.roughness`.
        field: String,
        /// Expected and got.
        problem: String,
    },
    /// The text is no scene.
    #[error("line {line}, column {column}: {what}")]
    Json {
        /// Line, from 1.
        line: usize,
        /// Column, from 1; 0 is before the first character.
        column: usize,
        /// What the parser expected.
        what: String,
    },
    /// Another version of the form.
    #[error("version: this program reads scenes of version {expected}, got {got}")]
    Version {
        /// In the file.
        got: u64,
        /// [`crate::SCENE_VERSION`].
        expected: u32,
    },
    /// The system refused.
    #[error("{0}")]
    Io(#[from] std::io::Error),
}

/// Most characters of a parser's message that are repeated: names in it come from the file and may be megabytes long.
const MOST_CHARS: usize = 300;

impl From<serde_json::Error> for SceneError {
    fn from(error: serde_json::Error) -> Self {
        let (line, column) = (error.line(), error.column());
        let text = error.to_string();
        // serde_json repeats the place at the end of its text.
        let what = text.strip_suffix(&format!(" at line {line} column {column}")).unwrap_or(&text);
        Self::Json { line, column, what: one_line(what) }
    }
}

/// `text` without control characters and no longer than [`MOST_CHARS`].
pub(crate) fn one_line(text: &str) -> String {
    let mut out = String::new();
    for (i, c) in text.chars().enumerate() {
        if i == MOST_CHARS {
            return out + "…";
        }
        // U+2028 and U+2029 break lines too.
        if c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}
