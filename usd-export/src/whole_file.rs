//! Writes files that appear complete or not at all, also when the job is cancelled or the process killed in between.
//!
//! Two files that belong together, such as a `.gltf` and its `.bin`, cannot appear in the same moment. So the one beside has its content in
//! its name, and another content never takes the place of a file that somebody refers to:
//!
//! ```text
//! figure.gltf ─names─► figure.77aa….bin                                       the former export
//! figure.gltf ─names─► figure.77aa….bin     figure.0b3f….bin                   the new file beside appears
//! figure.gltf ─names─► figure.0b3f….bin     figure.77aa….bin                   the new file appears, in place of the former one
//! figure.gltf ─names─► figure.0b3f….bin                                       the former file beside is removed
//! ```
//! A process that is killed between two of these lines leaves a file beside that nobody refers to, and `figure.gltf` as it was before or as
//! it is after. One that is killed while it writes may leave a file `.pumice-…`, which is what a file is called until it is whole.

use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use pumice_core::{Error, Job, TargetError, WrittenFile, link_target};
use xxhash_rust::xxh3::Xxh3;

use crate::{ExportError, Result};

/// Most bytes of a file's name that the name of the file beside it repeats. Systems allow 255; what follows takes 17 and an ending.
const MOST_STEM_BYTES: usize = 200;

impl From<TargetError> for ExportError {
    fn from(error: TargetError) -> Self {
        Self::Volume(error.into())
    }
}

/// Writes a file with `write`, which fails once the job is cancelled. Returns the bytes written.
///
/// # Errors
/// [`Error::Io`] with the file's name where it cannot be written; [`Error::Cancelled`]; errors of `write`.
pub(crate) fn write_whole(
    path: &Path,
    job: &Job,
    write: impl FnOnce(&mut Output<'_, '_>) -> Result<()>,
) -> Result<u64> {
    let (file, bytes) = written(path, job, write)?;
    file.appear(path)?;
    Ok(bytes)
}

/// A file for `path` that is whole and has not appeared, and its bytes.
fn written(
    path: &Path,
    job: &Job,
    write: impl FnOnce(&mut Output<'_, '_>) -> Result<()>,
) -> Result<(WrittenFile, u64)> {
    let mut bytes = 0;
    let file = WrittenFile::for_place(path, |out| {
        let mut out = Cancellable { out, job };
        write(&mut out)?;
        bytes = out.seek(SeekFrom::End(0))?;
        Ok(())
    });
    // What is whole has not appeared yet: here is the last moment to stop.
    job.check()?;
    let file = file.map_err(|error| match error {
        ExportError::Write(source) => Error::Io { path: path.to_owned(), source }.into(),
        other => other,
    })?;
    Ok((file, bytes))
}

/// Writes a file without a name in the folder of `path`, which is gone once it is closed. Returns it from its beginning, and its bytes.
///
/// # Errors
/// As [`write_whole`].
pub(crate) fn temporary_beside(
    path: &Path,
    job: &Job,
    write: impl FnOnce(&mut Output<'_, '_>) -> Result<()>,
) -> Result<(File, u64)> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::tempfile_in(folder)?;
    let mut buffered = BufWriter::new(&mut file);
    write(&mut Cancellable { out: &mut buffered, job })?;
    buffered.flush()?;
    drop(buffered);
    let bytes = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::Start(0))?;
    Ok((file, bytes))
}

/// Writes a file and one beside it that it refers to. `write` gets the name of that, `STEM.CONTENT.ENDING`: the stem of `path`, in which
/// white space and what parsers take for a sign are underscores, and the hash of what is in it. The file beside that a former file at
/// `path` refers to is removed. Returns the bytes of both.
///
/// # Errors
/// As [`write_whole`]; then a former file and what it refers to stay as they are, and nothing else stays. [`Error::Caller`] for a name that
/// is not in UTF-8.
pub(crate) fn write_with_beside(
    path: &Path,
    ending: &str,
    job: &Job,
    write_beside: impl FnOnce(&mut dyn Write) -> Result<()>,
    write: impl FnOnce(&str, &mut dyn Write) -> Result<()>,
) -> Result<u64> {
    // A link stays: both files are where it leads to, one beside the other.
    let path = &link_target(path)?;
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    let stem = stem.ok_or_else(|| Error::Caller(format!("{}: expected a name in UTF-8", path.display())))?;
    let named = |content: u64| format!("{}.{content:016x}.{ending}", one_word(stem));

    // Write both under temporary names.
    let mut content = Xxh3::new();
    let (file_beside, bytes_beside) =
        written(path, job, |out| write_beside(&mut Hashing { out, content: &mut content }))?;
    let name = named(content.digest());
    let (file, bytes) = written(path, job, |out| write(&name, out))?;

    // Let the one appear that nobody refers to yet, then the one that refers to it.
    let beside = path.with_file_name(&name);
    let was_there = beside.exists();
    let former = former_beside(path, &name)?;
    file_beside.appear(&beside)?;
    if let Err(error) = file.appear(path) {
        if !was_there {
            remove(beside)?;
        }
        return Err(error.into());
    }
    former.into_iter().try_for_each(remove)?;
    Ok(bytes + bytes_beside)
}

/// Removes a file, if it is there still.
fn remove(path: PathBuf) -> Result<()> {
    match std::fs::remove_file(&path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::Io { path, source }.into())
        }
        _ => Ok(()),
    }
}

/// A name as one word, which no parser of names takes for several, and short enough to have something behind it.
fn one_word(stem: &str) -> String {
    let stem = &stem[..stem.floor_char_boundary(MOST_STEM_BYTES)];
    stem.replace(|c: char| c.is_whitespace() || c.is_control() || matches!(c, '\\' | '#' | '"'), "_")
}

/// Files beside `path`, named as `name` is but for the content, to which the file at `path` refers.
fn former_beside(path: &Path, name: &str) -> Result<Vec<PathBuf>> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let mut former = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(io(error).into()),
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let other = entry.map_err(io)?.file_name();
        if let Some(content) = other.to_str().filter(|other| *other != name).and_then(|o| content_of(o, name))
            && holds(&mut former, content.as_bytes()).map_err(io)?
        {
            found.push(path.with_file_name(&other));
        }
    }
    Ok(found)
}

/// The end `.CONTENT.ENDING` of a name that differs from another in its content alone. It has no character that a `.gltf` codes.
fn content_of<'a>(other: &'a str, name: &str) -> Option<&'a str> {
    let at = name.rfind('.')?.checked_sub(17)?;
    let (content, ending) = other.get(at..).filter(|_| other[..at] == name[..at])?.split_at_checked(17)?;
    let is_content =
        content.strip_prefix('.')?.bytes().all(|b| b.is_ascii_digit() || matches!(b, b'a'..=b'f'));
    (is_content && ending == &name[at + 17..]).then_some(&other[at..])
}

/// Whether a file holds these bytes somewhere. It is read in pieces, each with the end of the one before.
fn holds(file: &mut File, sought: &[u8]) -> std::io::Result<bool> {
    const PIECE: u64 = 1 << 20;
    file.seek(SeekFrom::Start(0))?;
    let mut piece = Vec::new();
    loop {
        let kept = piece.len().min(sought.len() - 1);
        piece.drain(..piece.len() - kept);
        if (&*file).take(PIECE).read_to_end(&mut piece)? == 0 {
            return Ok(false);
        }
        if piece.windows(sought.len()).any(|window| window == sought) {
            return Ok(true);
        }
    }
}

/// Computes the hash of what passes through.
struct Hashing<'a, W> {
    out: &'a mut W,
    content: &'a mut Xxh3,
}

impl<W: Write> Write for Hashing<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.content.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

/// What a file is written to.
pub(crate) type Output<'a, 'f> = Cancellable<'a, BufWriter<&'f mut File>>;

/// Fails once the job is cancelled, so that long arrays do not delay it.
pub(crate) struct Cancellable<'a, W> {
    out: &'a mut W,
    job: &'a Job,
}

impl<W: Write> Write for Cancellable<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.job.check().map_err(std::io::Error::other)?;
        self.out.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

impl<W: Seek> Seek for Cancellable<'_, W> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.out.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_whole_or_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let text = |out: &mut Output<'_, '_>| Ok(out.write_all(b"text")?);
        let path = folder.path().join("a.usda");
        assert_eq!(write_whole(&path, &Job::new(), text).unwrap(), 4);
        assert_eq!(std::fs::read(&path).unwrap(), b"text");

        // Where writing fails or is cancelled, the former file stays.
        let job = Job::new();
        let fails = |out: &mut Output<'_, '_>| {
            out.write_all(&[0; 1 << 20])?;
            job.cancel();
            Ok(out.write_all(b"more")?)
        };
        assert_eq!(write_whole(&path, &job, fails).unwrap_err().to_string(), "cancelled");
        let full = |_: &mut Output<'_, '_>| Err(std::io::Error::from(std::io::ErrorKind::StorageFull).into());
        let error = write_whole(&path, &Job::new(), full).unwrap_err().to_string();
        assert!(error.contains("a.usda: ") && error.contains("no storage space"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"text");
        std::fs::create_dir(folder.path().join("c.usda")).unwrap();
        let error = write_whole(&folder.path().join("c.usda"), &Job::new(), text).unwrap_err().to_string();
        assert!(error.ends_with("expected an ordinary file, got a folder"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing else is left");
    }

    /// Names and contents of the files in a folder, and which of the files beside the text at `figure.gltf` names.
    fn pair_in(folder: &Path) -> (Vec<String>, String, String) {
        let mut names: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        let text = std::fs::read_to_string(folder.join("figure.gltf")).unwrap_or_default();
        let beside = text.lines().next().map(|name| std::fs::read_to_string(folder.join(name)).unwrap());
        (names, text, beside.unwrap_or_default())
    }

    fn full(_: &mut dyn Write) -> Result<()> {
        Err(std::io::Error::from(std::io::ErrorKind::StorageFull).into())
    }

    #[test]
    fn a_file_and_the_one_beside_it_belong_together() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("figure.gltf");
        let beside = |text: &'static str| move |out: &mut dyn Write| Ok(out.write_all(text.as_bytes())?);
        let naming = |name: &str, out: &mut dyn Write| Ok(write!(out, "{name}\nand more")?);
        let write = |text| write_with_beside(&path, "bin", &Job::new(), beside(text), naming);
        let bytes = write("one").unwrap();
        let one = pair_in(folder.path());
        assert_eq!((one.0.len(), one.2.as_str()), (2, "one"));
        assert_eq!(bytes, one.1.len() as u64 + 3);

        // A pair that fails in place of another leaves that, wherever it fails.
        let error = write_with_beside(&path, "bin", &Job::new(), full, naming).unwrap_err().to_string();
        assert!(error.contains("figure.gltf: ") && error.contains("no storage space"), "{error}");
        write_with_beside(&path, "bin", &Job::new(), beside("x"), |_, out| full(out)).unwrap_err();
        let job = Job::new();
        let cancels = |name: &str, out: &mut dyn Write| {
            job.cancel();
            naming(name, out)
        };
        let error = write_with_beside(&path, "bin", &job, beside("x"), cancels).unwrap_err().to_string();
        assert_eq!((error.as_str(), pair_in(folder.path())), ("cancelled", one.clone()));

        // The same again is the same; another takes its place, and what the former named is gone.
        write("one").unwrap();
        assert_eq!(pair_in(folder.path()), one);
        write("two").unwrap();
        let two = pair_in(folder.path());
        assert_eq!((two.0.len(), two.2.as_str()), (2, "two"));
        assert_ne!(one.0, two.0);

        // What a file of another name refers to stays, and so does what nobody refers to, because it may be somebody's.
        std::fs::rename(&path, folder.path().join("kept.gltf")).unwrap();
        std::fs::write(folder.path().join("figure.0123456789abcdef.bin"), "somebody's").unwrap();
        write("three").unwrap();
        let three = pair_in(folder.path());
        assert_eq!((three.0.len(), three.2.as_str()), (5, "three"));
        assert!(two.0.iter().filter(|name| name.ends_with(".bin")).all(|name| three.0.contains(name)));
    }

    #[test]
    fn a_new_pair_that_fails_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("figure.gltf");
        let one = |out: &mut dyn Write| Ok(out.write_all(b"one")?);
        write_with_beside(&path, "bin", &Job::new(), one, |_, out| full(out)).unwrap_err();
        assert_eq!(pair_in(folder.path()).0, [""; 0]);
        // The name is taken while the files are written: the one beside, which has appeared, goes again.
        let taken = |_: &str, _: &mut dyn Write| Ok(std::fs::create_dir(&path)?);
        let error = write_with_beside(&path, "bin", &Job::new(), one, taken).unwrap_err().to_string();
        assert!(error.ends_with("expected an ordinary file, got a folder"), "{error}");
        assert_eq!(pair_in(folder.path()).0, ["figure.gltf"]);
    }

    #[test]
    fn names_beside_are_one_word_and_short() {
        assert_eq!(one_word("my \"figure\"\n#3 µ"), "my__figure___3_µ");
        let long = "µ".repeat(120);
        assert_eq!(one_word(&long), "µ".repeat(100));
        let name = "a.b.0123456789abcdef.bin";
        assert_eq!(content_of("a.b.00000000000000aa.bin", name), Some(".00000000000000aa.bin"));
        for other in [
            "a.c.00000000000000aa.bin",
            "a.b.00000000000000aa.mtl",
            "a.b.00000000000000AA.bin",
            "a.b.bin",
            "µ",
        ] {
            assert_eq!(content_of(other, name), None, "{other}");
        }
    }

    #[test]
    fn bytes_are_found_across_pieces() {
        let mut file = tempfile::tempfile().unwrap();
        let mut bytes = vec![b'.'; 3 << 20];
        bytes[(1 << 20) - 3..][..6].copy_from_slice(b"sought");
        bytes[(3 << 20) - 4..].copy_from_slice(b"last");
        file.write_all(&bytes).unwrap();
        for (text, is_there) in [("sought", true), ("last", true), ("lasts", false), ("other", false)] {
            assert_eq!(holds(&mut file, text.as_bytes()).unwrap(), is_there, "{text}");
        }
    }
}
