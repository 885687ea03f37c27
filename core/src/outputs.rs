//! The outputs of a command, so that none of them replaces a file that the command reads.
//!
//! ```text
//! declare(out), declare(report), …    before the work: each is a name of its own, free or of an ordinary file
//! check_input(file)                   for each file that is read, also those that a header or a scene names: none of the above
//! ```
//! Two names are the same file where links, hard or symbolic, lead to the same one. An output that is no file yet is no input.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::atomic_file::{TargetError, check_is_file, link_target};

/// What a command is going to write. Clones share one list, so that readers know what their caller writes.
#[derive(Clone, Debug, Default)]
pub struct Outputs(Arc<Mutex<Vec<Output>>>);

#[derive(Debug)]
struct Output {
    name: PathBuf,
    /// Where its links end, in a folder that is named in one way only.
    target: PathBuf,
    /// The file that is there before the work.
    former: Option<FileId>,
}

impl Outputs {
    /// Adds an output.
    ///
    /// # Errors
    /// [`TargetError::Refused`] for the name of something else than a file, and for the file of another output.
    pub fn declare(&self, out: &Path) -> Result<(), TargetError> {
        check_is_file(out)?;
        let target = link_target(out)?;
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty());
        // A folder that is missing is named when the file is written.
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().unwrap_or_default();
        let target = target.file_name().map_or_else(|| target.clone(), |name| folder.join(name));
        let former = file_id(out);
        let mut list = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(other) =
            list.iter().find(|o| o.target == target || (former.is_some() && o.former == former))
        {
            let what =
                format!("expected a file of its own, got that of another output, {}", other.name.display());
            return Err(TargetError::Refused { path: out.to_owned(), what });
        }
        list.push(Output { name: out.to_owned(), target, former });
        Ok(())
    }

    /// Checks that a file which is read is none of the outputs.
    ///
    /// # Errors
    /// [`TargetError::Refused`] with the output's name.
    pub fn check_input(&self, input: &Path) -> Result<(), TargetError> {
        let list = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if list.iter().all(|output| output.former.is_none()) {
            return Ok(());
        }
        let id = file_id(input);
        let Some(output) = list.iter().find(|o| id.is_some() && o.former == id) else { return Ok(()) };
        let also = if output.name == input { String::new() } else { format!(" as {}", input.display()) };
        let what = format!("expected another file for the output, got one that is read{also}");
        Err(TargetError::Refused { path: output.name.clone(), what })
    }
}

/// What tells files apart, whatever they are called: device and number.
#[cfg(unix)]
type FileId = (u64, u64);

#[cfg(unix)]
fn file_id(path: &Path) -> Option<FileId> {
    use std::os::unix::fs::MetadataExt as _;
    std::fs::metadata(path).ok().map(|there| (there.dev(), there.ino()))
}

/// What tells files apart: the name without links. Hard links are not seen through.
#[cfg(not(unix))]
type FileId = PathBuf;

#[cfg(not(unix))]
fn file_id(path: &Path) -> Option<FileId> {
    path.canonicalize().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn an_output_is_no_input_whatever_it_is_called() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("volume"), "").unwrap();
        std::fs::write(at("other"), "").unwrap();
        std::fs::hard_link(at("volume"), at("hard")).unwrap();
        std::os::unix::fs::symlink("volume", at("soft")).unwrap();
        for name in ["volume", "hard", "soft"] {
            let outputs = Outputs::default();
            outputs.declare(&at(name)).unwrap();
            let error = outputs.clone().check_input(&at("volume")).unwrap_err().to_string();
            assert!(error.contains(&format!("{name}: expected another file for the output")), "{error}");
            outputs.check_input(&at("other")).unwrap();
            outputs.check_input(&at("none")).unwrap();
        }
        let outputs = Outputs::default();
        outputs.declare(&at("new")).unwrap();
        outputs.check_input(&at("volume")).unwrap();
    }

    #[test]
    fn two_outputs_are_two_files() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("below")).unwrap();
        let outputs = Outputs::default();
        outputs.declare(&at("report")).unwrap();
        outputs.declare(&at("below/report")).unwrap();
        for same in ["report", "below/../report", "./report"] {
            let error = outputs.declare(&at(same)).unwrap_err().to_string();
            assert!(error.contains("that of another output"), "{error}");
        }
        assert!(outputs.declare(&at("below")).unwrap_err().to_string().ends_with("got a folder"));
    }
}
