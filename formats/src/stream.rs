//! Streams of the plain bytes of voxels, in file order, whatever their storage.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use pumice_core::{Outputs, open_input};

use crate::error::{FormatError, Result};

/// Number of bytes that are read from disk at once.
const READ_BYTES: usize = 256 << 10;

/// Number of bytes that are read at once to skip them.
const SKIP_BYTES: usize = 16 << 10;

/// Number of bytes that are read past the buffer: copies would cost more than a call of the system.
const DIRECT_BYTES: usize = 4 << 10;

/// The plain bytes of voxels, read once from first to last.
pub(crate) trait ByteStream: Send {
    /// Fills part of `buffer` and returns the number of bytes, which is 0 only at the end of the data.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize>;

    /// Skips `bytes` bytes; returns how many of them existed.
    fn skip(&mut self, bytes: u64) -> Result<u64> {
        let mut scratch = [0; SKIP_BYTES];
        let mut left = bytes;
        while left > 0 {
            let piece = scratch.len().min(usize::try_from(left).unwrap_or(usize::MAX));
            let n = self.read(&mut scratch[..piece])?;
            if n == 0 {
                break;
            }
            left -= n as u64;
        }
        Ok(bytes - left)
    }

    /// Reads until `buffer` is full or the data end; returns the number of bytes.
    fn fill(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            match self.read(&mut buffer[filled..])? {
                0 => break,
                n => filled += n,
            }
        }
        Ok(filled)
    }

    /// Offset in the file up to which it has been read, for messages.
    fn position(&self) -> Option<u64> {
        None
    }
}

/// A buffered file that counts the bytes taken from it.
pub(crate) struct CountingFile {
    file: BufReader<File>,
    /// Length of the file when it was opened.
    file_bytes: u64,
    taken: Arc<AtomicU64>,
}

impl CountingFile {
    /// Opens `path` and skips to byte `offset`.
    pub(crate) fn open(path: &Path, offset: u64) -> Result<Self> {
        let mut file = open_file(path)?;
        file.seek(SeekFrom::Start(offset)).map_err(FormatError::io(path))?;
        let file_bytes = file.metadata().map_err(FormatError::io(path))?.len();
        let (file, taken) = (BufReader::with_capacity(READ_BYTES, file), Arc::new(AtomicU64::new(offset)));
        Ok(Self { file, file_bytes, taken })
    }

    /// A handle on the counter of bytes taken, which starts at the file's start.
    pub(crate) fn taken(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.taken)
    }

    /// Skips bytes without reading them.
    fn skip(&mut self, bytes: u64) -> io::Result<u64> {
        let buffered = self.file.buffer().len();
        if let Some(bytes) = usize::try_from(bytes).ok().filter(|&bytes| bytes <= buffered) {
            self.consume(bytes);
            return Ok(bytes as u64);
        }
        let at = self.taken.load(Ordering::Relaxed);
        let step = bytes.min(self.file_bytes.saturating_sub(at));
        self.file.seek(SeekFrom::Start(at + step))?;
        self.taken.store(at + step, Ordering::Relaxed);
        Ok(step)
    }
}

impl Read for CountingFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = if buffer.len() >= DIRECT_BYTES && self.file.buffer().is_empty() {
            self.file.get_mut().read(buffer)?
        } else {
            self.file.read(buffer)?
        };
        self.taken.fetch_add(n as u64, Ordering::Relaxed);
        Ok(n)
    }
}

impl BufRead for CountingFile {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.file.fill_buf()
    }

    fn consume(&mut self, n: usize) {
        self.file.consume(n);
        self.taken.fetch_add(n as u64, Ordering::Relaxed);
    }
}

/// Opens an ordinary file for reading.
pub(crate) fn open_file(path: &Path) -> Result<File> {
    open_input(path).map_err(FormatError::io(path))
}

/// The files with the voxels, of which a header has the names, relative to its folder. Each is looked for at once, so that a missing one
/// is reported before any work is done.
pub(crate) fn detached_files(header: &Path, names: &[String], outputs: &Outputs) -> Result<Vec<PathBuf>> {
    let folder = header.parent().unwrap_or(Path::new(""));
    let files: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    for data in &files {
        outputs.check_input(data)?;
        open_input(data).map_err(|source| FormatError::Detached {
            header: header.to_owned(),
            data: data.clone(),
            source,
        })?;
    }
    Ok(files)
}

/// Voxels stored without compression.
pub(crate) struct PlainStream {
    path: PathBuf,
    file: CountingFile,
}

impl PlainStream {
    /// The bytes of `path` from `offset` on.
    pub(crate) fn open(path: &Path, offset: u64) -> Result<Self> {
        Ok(Self { path: path.to_owned(), file: CountingFile::open(path, offset)? })
    }
}

impl ByteStream for PlainStream {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        self.file.read(buffer).map_err(FormatError::io(&self.path))
    }

    fn skip(&mut self, bytes: u64) -> Result<u64> {
        self.file.skip(bytes).map_err(FormatError::io(&self.path))
    }

    fn position(&self) -> Option<u64> {
        Some(self.file.taken.load(Ordering::Relaxed))
    }
}

/// Several streams of known length, one after the other: slices in separate files.
///
/// Each is opened only when it is needed, so that a thousand slices need one file handle.
pub(crate) struct ChainedStream {
    open_part: Box<dyn FnMut(usize) -> Result<Box<dyn ByteStream>> + Send>,
    paths: Vec<PathBuf>,
    part_bytes: u64,
    current: Option<Box<dyn ByteStream>>,
    part: usize,
    left_in_part: u64,
}

impl ChainedStream {
    /// A chain of `part_bytes` bytes from each of `paths`; `open_part(index)` opens a part.
    pub(crate) fn new(
        paths: Vec<PathBuf>,
        part_bytes: u64,
        open_part: impl FnMut(usize) -> Result<Box<dyn ByteStream>> + Send + 'static,
    ) -> Self {
        Self {
            open_part: Box::new(open_part),
            paths,
            part_bytes,
            current: None,
            part: 0,
            left_in_part: part_bytes,
        }
    }

    /// The stream of the current part, opened if necessary; `None` after the last part.
    fn current(&mut self) -> Result<Option<&mut Box<dyn ByteStream>>> {
        if self.left_in_part == 0 {
            self.part += 1;
            self.left_in_part = self.part_bytes;
            self.current = None;
        }
        if self.part >= self.paths.len() {
            return Ok(None);
        }
        if self.current.is_none() {
            self.current = Some((self.open_part)(self.part)?);
        }
        Ok(self.current.as_mut())
    }

    fn short(&self) -> FormatError {
        FormatError::Short {
            path: self.paths[self.part].clone(),
            expected: self.part_bytes,
            got: self.part_bytes - self.left_in_part,
            at: self.current.as_ref().and_then(|c| c.position()),
        }
    }
}

impl ByteStream for ChainedStream {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if buffer.is_empty() || self.current()?.is_none() {
            return Ok(0);
        }
        let piece = buffer.len().min(usize::try_from(self.left_in_part).unwrap_or(usize::MAX));
        let n = match self.current.as_mut() {
            Some(current) => current.read(&mut buffer[..piece])?,
            None => 0,
        };
        if n == 0 {
            return Err(self.short());
        }
        self.left_in_part -= n as u64;
        Ok(n)
    }

    fn skip(&mut self, bytes: u64) -> Result<u64> {
        let mut left = bytes;
        while left > 0 {
            // Parts that are skipped as a whole are never opened.
            if self.left_in_part == 0 || (self.current.is_none() && left >= self.left_in_part) {
                if self.part >= self.paths.len() {
                    break;
                }
                left -= self.left_in_part;
                self.part += 1;
                self.left_in_part = self.part_bytes;
                self.current = None;
                continue;
            }
            let step = left.min(self.left_in_part);
            let Some(current) = self.current()? else { break };
            if current.skip(step)? < step {
                return Err(self.short());
            }
            self.left_in_part -= step;
            left -= step;
        }
        Ok(bytes - left)
    }
}
