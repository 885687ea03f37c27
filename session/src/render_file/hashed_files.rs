//! Hashes of files that a process has read already: an animated sky of 100 MB is read for its hash once, not for each picture.
//!
//! ```text
//! path ─► device, number, size, times of change ─┬─ as when it was hashed ─► the known hash
//!                                                └─ otherwise             ─► read, and known from now on
//! ```
//! Times of files are coarse. A file that was changed just before it is hashed may change again without another time, so its hash is known
//! only once its last change is older than [`SETTLED`] (git keeps its index by the same rule).

use std::collections::VecDeque;
use std::fs::Metadata;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use pumice_core::content_hash::hash_of_file;

/// Age of a file's last change from which on a further change has another time: the coarsest file systems count two seconds.
const SETTLED: Duration = Duration::from_secs(3);

/// Most files that are known; the one that was hashed first is forgotten.
const MOST_FILES: usize = 64;

/// What tells whether a file has changed.
#[derive(Clone, Debug, PartialEq, Eq)]
struct State {
    bytes: u64,
    modified: SystemTime,
    identity: Identity,
}

/// Device, number, and seconds and nanoseconds of the last change of content or of anything that is known about the file.
#[cfg(unix)]
type Identity = [i128; 4];

#[cfg(unix)]
fn identity_of(_: &Path, found: &Metadata) -> Identity {
    use std::os::unix::fs::MetadataExt as _;
    [found.dev().into(), found.ino().into(), found.ctime().into(), found.ctime_nsec().into()]
}

/// The name without links.
#[cfg(not(unix))]
type Identity = Option<std::path::PathBuf>;

#[cfg(not(unix))]
fn identity_of(path: &Path, _: &Metadata) -> Identity {
    path.canonicalize().ok()
}

impl State {
    fn of(path: &Path) -> std::io::Result<Self> {
        let found = std::fs::metadata(path)?;
        Ok(Self { bytes: found.len(), modified: found.modified()?, identity: identity_of(path, &found) })
    }

    /// Whether a change from now on would show.
    fn is_settled(&self, now: SystemTime) -> bool {
        now.duration_since(self.modified).is_ok_and(|age| age >= SETTLED)
    }
}

/// Files and their hashes, the newest first.
type Known = Mutex<VecDeque<(State, u128)>>;

/// XXH3-128 of the bytes of a file ([`hash_of_file`]), which this process reads once as long as the file does not change.
///
/// # Errors
/// When the file is not there or cannot be read.
pub(super) fn hash_of_file_once(path: &Path) -> std::io::Result<u128> {
    static KNOWN: Known = Mutex::new(VecDeque::new());
    hash_once(&KNOWN, path, hash_of_file)
}

/// The hash of a file by `read`, which is called where the file is not among the `known`.
fn hash_once(
    known: &Known,
    path: &Path,
    read: impl FnOnce(&Path) -> std::io::Result<u128>,
) -> std::io::Result<u128> {
    // Each statement under the lock leaves the list whole.
    let list = || known.lock().unwrap_or_else(PoisonError::into_inner);
    let state = State::of(path)?;
    if let Some(&(_, hash)) = list().iter().find(|(of, _)| *of == state) {
        return Ok(hash);
    }
    let hash = read(path)?;
    // A file that was changed while it was read is not known.
    if state.is_settled(SystemTime::now()) && State::of(path)? == state {
        let mut list = list();
        list.truncate(MOST_FILES - 1);
        list.push_front((state, hash));
    }
    Ok(hash)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// Writes a file whose last change was an hour ago.
    fn written(path: &Path, content: &str) {
        std::fs::write(path, content).unwrap();
        changed_before(path, Duration::from_secs(3600));
    }

    fn changed_before(path: &Path, age: Duration) {
        let file = std::fs::File::options().write(true).open(path).unwrap();
        file.set_modified(SystemTime::now() - age).unwrap();
    }

    #[test]
    fn a_file_is_read_once_until_it_changes() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("sky"), folder.path().join("other"));
        let (known, reads) = (Known::default(), Cell::new(0));
        let hash = |path: &Path| {
            let hash = hash_once(&known, path, |path| {
                reads.set(reads.get() + 1);
                hash_of_file(path)
            });
            assert_eq!(hash.as_ref().ok(), hash_of_file(path).ok().as_ref());
            (hash.ok(), reads.get())
        };
        written(&path, "one sky");
        let (first, _) = hash(&path);
        assert_eq!((hash(&path), hash(&path)), ((first, 1), (first, 1)));
        // Another content of the same length and age, in place and as another file of that name.
        written(&path, "two sky");
        let (second, 2) = hash(&path) else { panic!("the changed file was not read") };
        written(&other, "six sky");
        // The other file is even of the same age.
        let modified = std::fs::metadata(&path).unwrap().modified().unwrap();
        std::fs::File::options().write(true).open(&other).unwrap().set_modified(modified).unwrap();
        std::fs::rename(&other, &path).unwrap();
        let (third, 3) = hash(&path) else { panic!("the other file was not read") };
        assert!(first != second && second != third && third != first);
        // Through a link it is the same file.
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&path, &other).unwrap();
            assert_eq!(hash(&other), (third, 3));
        }
        std::fs::remove_file(&path).unwrap();
        assert_eq!(hash(&path), (None, 3));
    }

    #[test]
    fn a_file_that_was_just_changed_is_read_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky");
        for (age, expected) in [(0, 2), (1, 2), (60, 1)] {
            std::fs::write(&path, "a sky").unwrap();
            changed_before(&path, Duration::from_secs(age));
            let (known, reads) = (Known::default(), Cell::new(0));
            for _ in 0..2 {
                hash_once(&known, &path, |path| {
                    reads.set(reads.get() + 1);
                    hash_of_file(path)
                })
                .unwrap();
            }
            assert_eq!(reads.get(), expected, "changed {age} s before");
        }
    }

    #[test]
    fn the_oldest_files_are_forgotten() {
        let folder = tempfile::tempdir().unwrap();
        let known = Known::default();
        for number in 0..MOST_FILES + 5 {
            let path = folder.path().join(number.to_string());
            written(&path, "a sky");
            hash_once(&known, &path, hash_of_file).unwrap();
        }
        assert_eq!(known.lock().unwrap().len(), MOST_FILES);
    }
}
