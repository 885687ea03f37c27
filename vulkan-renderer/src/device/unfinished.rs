//! Remembers what did not come back: a shader compiler that ended its process, a launch that hung the device.
//!
//! Either would happen again at each start, and no fallback helps against the first. So a file beside the cached pipelines marks each
//! compilation, locked by its process and removed when the compilation ends:
//!
//! ```text
//! 00001002-0000744c-…-….pipelines                          what the driver compiled
//! 00001002-0000744c-…-….vulkan-rt.4711-0.unfinished        process 4711 compiles, or did when it ended
//! 00001002-0000744c-…-….vulkan-rt.4711-1.hung              a launch of process 4711 hung the device
//! ```
//! A file that no process locks was left by one that did not live to remove it. One such file may mean that someone closed the program
//! while it compiled; two, or a hang, mean that the backend does not work here. Another driver has files of another name.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::{Backend, Candidate, Instance, pipeline_cache};

const COMPILING: &str = "unfinished";
const HUNG: &str = "hung";

/// Compilations without an end after which a backend counts as broken.
const STRIKES: usize = 2;

/// What earlier processes left for one backend on one device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unfinished {
    compilations: Vec<PathBuf>,
    hangs: Vec<PathBuf>,
}

/// Finds what earlier processes left in the cache folder.
pub fn unfinished(instance: &Instance, candidate: &Candidate, backend: Backend, folder: &Path) -> Unfinished {
    // SAFETY: the candidate's handle is of this instance.
    let properties = unsafe { instance.calls().get_physical_device_properties(candidate.physical) };
    left_beside(&folder.join(pipeline_cache::file_name(&properties)), backend)
}

impl Unfinished {
    /// Why the backend should not be tried again; `None` where nothing speaks against it.
    pub fn why(&self) -> Option<String> {
        match (&self.hangs[..], &self.compilations[..]) {
            ([hang, ..], _) => Some(format!("a launch hung at an earlier start ({})", hang.display())),
            ([], [first, rest @ ..]) if rest.len() + 1 >= STRIKES => Some(format!(
                "the process ended {} times while its driver compiled shaders ({})",
                rest.len() + 1,
                first.display()
            )),
            _ => None,
        }
    }

    /// Forgets it. A file that cannot be removed stays.
    pub fn forget(&self) {
        for file in self.compilations.iter().chain(&self.hangs) {
            let _ = std::fs::remove_file(file);
        }
    }
}

/// The marks of this process.
struct Own {
    paths: Vec<PathBuf>,
    /// The process is about to end, so it marks nothing.
    ending: bool,
}

static OWN: Mutex<Own> = Mutex::new(Own { paths: Vec::new(), ending: false });

fn own() -> MutexGuard<'static, Own> {
    OWN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the marks of compilations in progress, for good. To be called before the process ends by itself, so that it is not taken for one that
/// they ended.
pub fn abandon_compiling() {
    let mut own = own();
    own.ending = true;
    for path in own.paths.drain(..) {
        let _ = std::fs::remove_file(path);
    }
}

/// A compilation in progress. It ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Compiling {
    /// The locked file and where it lies; none where there is no cache folder or it cannot be written.
    file: Option<(PathBuf, File)>,
}

impl Compiling {
    /// Marks that this process compiles for `backend`; `pipelines` is the device's file of cached pipelines.
    pub(super) fn begin(pipelines: Option<&Path>, backend: Backend) -> Self {
        let mark = |pipelines: &Path| -> std::io::Result<(PathBuf, File)> {
            if let Some(folder) = pipelines.parent() {
                std::fs::create_dir_all(folder)?;
            }
            // Locked before it has its name, so that nobody finds it without a lock.
            let path = marker(pipelines, backend, COMPILING);
            let unnamed = path.with_extension("tmp");
            let file = File::create(&unnamed)?;
            let locked = file.try_lock().map_err(std::io::Error::from);
            // Whoever abandons the compilations meanwhile waits until the mark is among them.
            let mut own = own();
            let ending = || if own.ending { Err(std::io::ErrorKind::Interrupted.into()) } else { Ok(()) };
            if let Err(e) = locked.and_then(|()| ending()).and_then(|()| std::fs::rename(&unnamed, &path)) {
                let _ = std::fs::remove_file(&unnamed);
                return Err(e);
            }
            own.paths.push(path.clone());
            Ok((path, file))
        };
        Self { file: pipelines.and_then(|p| mark(p).ok()) }
    }

    /// The driver has compiled: what earlier processes left behind did not lie with it.
    pub(super) fn succeed(self, pipelines: Option<&Path>, backend: Backend) {
        if let Some(pipelines) = pipelines {
            let left = left_beside(pipelines, backend);
            Unfinished { hangs: Vec::new(), ..left }.forget();
        }
    }
}

impl Drop for Compiling {
    fn drop(&mut self) {
        if let Some((path, _locked)) = &self.file {
            own().paths.retain(|other| other != path);
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Marks that a launch has hung the device. A folder that cannot be written is ignored.
pub(super) fn mark_hang(pipelines: Option<&Path>, backend: Backend) {
    if let Some(pipelines) = pipelines {
        let _ = std::fs::write(marker(pipelines, backend, HUNG), b"");
    }
}

/// A new marker's path.
fn marker(pipelines: &Path, backend: Backend, kind: &str) -> PathBuf {
    static MARKERS: AtomicU64 = AtomicU64::new(0);
    let number = MARKERS.fetch_add(1, Ordering::Relaxed);
    pipelines.with_extension(format!("{}.{}-{number}.{kind}", backend.name(), std::process::id()))
}

/// Markers of a backend that no process locks.
fn left_beside(pipelines: &Path, backend: Backend) -> Unfinished {
    let mut left = Unfinished::default();
    let (Some(folder), Some(stem)) = (pipelines.parent(), pipelines.file_stem().and_then(|s| s.to_str()))
    else {
        return left;
    };
    let prefix = format!("{stem}.{}.", backend.name());
    let Ok(entries) = std::fs::read_dir(folder) else { return left };
    for path in entries.flatten().map(|entry| entry.path()) {
        let is_ours = path.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.starts_with(&prefix));
        match path.extension().and_then(|e| e.to_str()) {
            Some(HUNG) if is_ours => left.hangs.push(path),
            // (A file system without locks tells nothing.)
            Some(COMPILING) if is_ours => match File::open(&path).map(|file| file.try_lock()) {
                Ok(Ok(())) => left.compilations.push(path),
                Ok(Err(TryLockError::WouldBlock | TryLockError::Error(_))) | Err(_) => {}
            },
            _ => {}
        }
    }
    left.compilations.sort();
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAYS: Backend = Backend::RayPipeline;

    fn files(folder: &Path) -> usize {
        std::fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn two_compilers_that_ended_their_process_are_enough() {
        let folder = tempfile::tempdir().unwrap();
        let pipelines = folder.path().join("sub/1-2-3.pipelines");
        let left = || left_beside(&pipelines, RAYS);
        assert_eq!(left(), Unfinished::default());
        // One that lives is not counted, and leaves nothing when it ends.
        let living = Compiling::begin(Some(&pipelines), RAYS);
        assert_eq!((left(), files(pipelines.parent().unwrap())), (Unfinished::default(), 1));
        drop(living);
        assert_eq!(files(pipelines.parent().unwrap()), 0);
        // A process that ends releases its lock and leaves its file.
        let crash = || File::create(marker(&pipelines, RAYS, COMPILING)).unwrap();
        crash();
        assert_eq!((left().compilations.len(), left().why()), (1, None));
        crash();
        let why = left().why().unwrap();
        assert!(why.contains("ended 2 times") && why.contains("1-2-3.vulkan-rt."), "{why}");
        // Other backends and drivers are not concerned.
        assert_eq!(left_beside(&pipelines, Backend::Compute), Unfinished::default());
        assert_eq!(left_beside(&pipelines.with_file_name("1-2-4.pipelines"), RAYS), Unfinished::default());
        // A compilation that ends takes all back.
        Compiling::begin(Some(&pipelines), RAYS).succeed(Some(&pipelines), RAYS);
        assert_eq!((left().why(), files(pipelines.parent().unwrap())), (None, 0));
    }

    #[test]
    fn one_hang_is_enough_and_compiling_does_not_excuse_it() {
        let folder = tempfile::tempdir().unwrap();
        let pipelines = folder.path().join("1-2-3.pipelines");
        mark_hang(Some(&pipelines), RAYS);
        let left = || left_beside(&pipelines, RAYS);
        assert!(left().why().unwrap().contains("a launch hung"));
        Compiling::begin(Some(&pipelines), RAYS).succeed(Some(&pipelines), RAYS);
        assert_eq!(left().hangs.len(), 1);
        left().forget();
        assert_eq!((left().why(), files(folder.path())), (None, 0));
    }

    #[test]
    fn without_a_folder_nothing_is_kept() {
        drop(Compiling::begin(None, RAYS));
        mark_hang(None, RAYS);
        let folder = tempfile::tempdir().unwrap();
        let in_a_file = folder.path().join("file/1-2-3.pipelines");
        File::create(folder.path().join("file")).unwrap();
        drop(Compiling::begin(Some(&in_a_file), RAYS));
        mark_hang(Some(&in_a_file), RAYS);
        assert_eq!((left_beside(&in_a_file, RAYS), files(folder.path())), (Unfinished::default(), 1));
    }
}
