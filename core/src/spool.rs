//! Bytes that are written from first to last and read again in this order: in memory or, beyond a limit, in a temporary file.
//!
//! ```text
//! scratch file   │ a │ b │ a │ c │ a │      shared by many spools, without a name: nothing remains however the process ends
//! spool a        [place, length] …, and what is in memory
//! ```
//! The disk space of a scratch file is free again when it is dropped.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use bytemuck::Pod;

use crate::reserve::{make_room, zeroed};
use crate::{Error, Result};

/// What memory is for, in errors.
const WHAT: &str = "a part of the volume";

/// Bytes that a reader of a spool holds.
const READ_BYTES: usize = 1 << 16;

/// A temporary file that takes what does not fit into memory. It is made when it is first needed.
pub struct Scratch {
    /// The folder, or the path of a file that is kept.
    folder: PathBuf,
    file: Mutex<Option<(std::sync::Arc<File>, u64)>>,
}

impl std::fmt::Debug for Scratch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Scratch").field("folder", &self.folder).finish_non_exhaustive()
    }
}

impl Scratch {
    /// None yet, in this folder.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), file: Mutex::default() }
    }

    /// One that appends to the file at `path` behind its first `end` bytes and does not remove it; without the file there is a new one.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn kept_at(path: &Path, end: u64) -> Result<Self> {
        let io = |source| Error::Io { path: path.to_owned(), source };
        let mut options = File::options();
        let file = options.read(true).write(true).create(true).truncate(false).open(path).map_err(io)?;
        file.set_len(end).map_err(io)?;
        Ok(Self { folder: path.to_owned(), file: Mutex::new(Some((std::sync::Arc::new(file), end))) })
    }

    /// Number of bytes that were appended.
    pub(crate) fn len(&self) -> u64 {
        self.file.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map_or(0, |open| open.1)
    }

    /// Another one in the same folder.
    #[must_use]
    pub fn another(&self) -> Self {
        Self::new(&self.folder)
    }

    pub(crate) fn error(&self, source: std::io::Error) -> Error {
        Error::Io { path: self.folder.clone(), source }
    }

    /// Appends bytes; returns their place.
    ///
    /// # Errors
    /// [`Error::Io`] with the folder, as where the disk is full.
    pub fn append(&self, bytes: &[u8]) -> Result<u64> {
        // The end moves only after all bytes were written, so a failed write leaves the state as it was.
        let mut state = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let (file, end) = match &mut *state {
            Some(open) => open,
            None => {
                let file = tempfile::tempfile_in(&self.folder).map_err(|e| self.error(e))?;
                state.insert((std::sync::Arc::new(file), 0))
            }
        };
        let mut to = &**file;
        to.seek(SeekFrom::Start(*end)).and_then(|_| to.write_all(bytes)).map_err(|e| self.error(e))?;
        let place = *end;
        *end += bytes.len() as u64;
        Ok(place)
    }

    /// Reads bytes that were appended.
    ///
    /// # Errors
    /// [`Error::Io`] with the folder.
    pub fn read(&self, bytes: &mut [u8], at: u64) -> Result<()> {
        let open = self.file.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(|(f, _)| f.clone());
        match open {
            Some(file) => read_exact_at(&file, bytes, at).map_err(|e| self.error(e)),
            None => Err(self.error(std::io::ErrorKind::UnexpectedEof.into())),
        }
    }

    /// Whether anything was written.
    #[cfg(test)]
    pub(crate) fn is_used(&self) -> bool {
        self.file.lock().unwrap().is_some()
    }
}

/// Bytes in the order in which they were written.
pub(crate) struct Spool<'a> {
    scratch: &'a Scratch,
    memory: Vec<u8>,
    /// Bytes that stay in memory.
    limit: usize,
    /// Places and lengths in the scratch file of what was written before `memory`.
    extents: Vec<(u64, u64)>,
    len: u64,
}

impl<'a> Spool<'a> {
    /// An empty spool that keeps at most `limit_bytes` in memory.
    pub(crate) fn new(scratch: &'a Scratch, limit_bytes: u64) -> Self {
        let limit = usize::try_from(limit_bytes).unwrap_or(usize::MAX);
        Self { scratch, memory: Vec::new(), limit, extents: Vec::new(), len: 0 }
    }

    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.len += bytes.len() as u64;
        if self.memory.len() + bytes.len() > self.limit {
            self.flush()?;
            if bytes.len() > self.limit {
                let place = self.scratch.append(bytes)?;
                self.extents.push((place, bytes.len() as u64));
                return Ok(());
            }
        }
        make_room(&mut self.memory, bytes.len(), WHAT)?;
        self.memory.extend_from_slice(bytes);
        Ok(())
    }

    /// Moves what is in memory to the scratch file.
    pub(crate) fn flush(&mut self) -> Result<()> {
        if !self.memory.is_empty() {
            let place = self.scratch.append(&self.memory)?;
            self.extents.push((place, self.memory.len() as u64));
            self.memory.clear();
        }
        Ok(())
    }

    /// Moves what is in memory to the scratch file, and gives the memory back.
    pub(crate) fn release(&mut self) -> Result<()> {
        self.flush()?;
        self.memory = Vec::new();
        Ok(())
    }

    /// Appends all bytes of another.
    pub(crate) fn append(&mut self, other: &Spool<'_>) -> Result<()> {
        let (mut reader, mut left) = (other.reader(), other.len());
        let mut piece = zeroed(left.min(READ_BYTES as u64) as usize, WHAT)?;
        while left > 0 {
            let piece = &mut piece[..left.min(READ_BYTES as u64) as usize];
            reader.read(piece)?;
            self.write(piece)?;
            left -= piece.len() as u64;
        }
        Ok(())
    }

    /// Forgets all bytes.
    pub(crate) fn clear(&mut self) {
        (self.memory, self.extents, self.len) = (Vec::new(), Vec::new(), 0);
    }

    /// Number of bytes.
    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    pub(crate) fn reader(&self) -> SpoolReader<'_> {
        SpoolReader { spool: self, extent: 0, within: 0, buffer: Vec::new(), at: 0 }
    }

    /// All bytes.
    #[cfg(test)]
    pub(crate) fn to_vec(&self) -> Result<Vec<u8>> {
        let mut all = zeroed(self.len as usize, WHAT)?;
        self.reader().read(&mut all)?;
        Ok(all)
    }
}

/// Reads a spool from its first byte on.
pub(crate) struct SpoolReader<'a> {
    spool: &'a Spool<'a>,
    /// The extent that is read, and the bytes of it that were read. After the last extent comes what is in memory.
    extent: usize,
    within: u64,
    buffer: Vec<u8>,
    at: usize,
}

impl SpoolReader<'_> {
    /// Reads exactly as many bytes.
    pub(crate) fn read(&mut self, mut bytes: &mut [u8]) -> Result<()> {
        while !bytes.is_empty() {
            let ready = &self.buffer[self.at..];
            if !ready.is_empty() {
                let n = ready.len().min(bytes.len());
                bytes[..n].copy_from_slice(&ready[..n]);
                self.at += n;
                bytes = &mut bytes[n..];
                continue;
            }
            match self.spool.extents.get(self.extent) {
                Some(&(place, length)) => {
                    let n = (length - self.within).min(READ_BYTES as u64) as usize;
                    if bytes.len() >= n {
                        // Into the caller's own memory.
                        self.spool.scratch.read(&mut bytes[..n], place + self.within)?;
                        bytes = &mut bytes[n..];
                    } else {
                        (self.at, self.buffer) = (0, std::mem::take(&mut self.buffer));
                        self.buffer.resize(n, 0);
                        self.spool.scratch.read(&mut self.buffer, place + self.within)?;
                    }
                    self.within += n as u64;
                    if self.within == length {
                        (self.extent, self.within) = (self.extent + 1, 0);
                    }
                }
                None => {
                    let from = self.within as usize;
                    let Some(ready) = self.spool.memory.get(from..from + bytes.len()) else {
                        return Err(self.spool.scratch.error(std::io::ErrorKind::UnexpectedEof.into()));
                    };
                    bytes.copy_from_slice(ready);
                    self.within += bytes.len() as u64;
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Reads one value.
    pub(crate) fn value<T: Pod>(&mut self) -> Result<T> {
        let mut value = T::zeroed();
        self.read(bytemuck::bytes_of_mut(&mut value))?;
        Ok(value)
    }

    /// Appends so many values to a list.
    pub(crate) fn values<T: Pod>(&mut self, count: usize, to: &mut Vec<T>) -> Result<()> {
        make_room(to, count, WHAT)?;
        let from = to.len();
        to.resize(from + count, T::zeroed());
        self.read(bytemuck::cast_slice_mut(&mut to[from..]))
    }
}

/// Reads at an offset without moving the cursor, which other threads share.
#[cfg(unix)]
fn read_exact_at(file: &File, bytes: &mut [u8], at: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, at)
}

/// Reads at an offset; each Windows call both sets the cursor and reads, so threads do not interfere.
#[cfg(windows)]
fn read_exact_at(file: &File, bytes: &mut [u8], at: u64) -> std::io::Result<()> {
    use std::os::windows::fs::FileExt;
    let mut done = 0;
    while done < bytes.len() {
        match file.seek_read(&mut bytes[done..], at + done as u64)? {
            0 => return Err(std::io::ErrorKind::UnexpectedEof.into()),
            n => done += n,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Several spools that share a file give back what was written to each, whatever stays in memory and in whatever pieces it is read.
    #[test]
    fn what_was_written_is_read() {
        for limit in [0, 1, 10, 1000, u64::MAX] {
            let scratch = Scratch::new(&std::env::temp_dir());
            let mut spools: Vec<Spool<'_>> = (0..3).map(|_| Spool::new(&scratch, limit)).collect();
            let mut expected = vec![Vec::new(); 3];
            for i in 0..300usize {
                let bytes: Vec<u8> = (0..i * 7 % 41).map(|k| (i * 31 + k) as u8).collect();
                spools[i % 3].write(&bytes).unwrap();
                expected[i % 3].extend(bytes);
            }
            for (spool, expected) in spools.iter().zip(&expected) {
                assert_eq!((spool.len(), &spool.to_vec().unwrap()), (expected.len() as u64, expected));
                let (mut reader, mut got) = (spool.reader(), Vec::new());
                while got.len() < expected.len() {
                    let n = (1 + got.len() % 23).min(expected.len() - got.len());
                    reader.values::<u8>(n, &mut got).unwrap();
                }
                assert!(&got == expected && reader.value::<u8>().is_err());
            }
            assert_eq!(scratch.is_used(), limit < 1500, "{limit}");
        }
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let scratch = Scratch::new(Path::new("/nowhere/at/all"));
        let error = Spool::new(&scratch, 0).write(&[1]).unwrap_err();
        assert!(error.to_string().contains("/nowhere/at/all"), "{error}");
    }
}
