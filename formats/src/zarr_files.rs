//! A folder as the store that the crate `zarrs` reads: one file a chunk or shard.
//!
//! Unlike the crate's own store it keeps nothing about files that were read, so that 10⁶ chunks cost no memory, and it opens ordinary files
//! only.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Seek, SeekFrom};
use std::path::PathBuf;
use std::sync::Arc;

use pumice_core::{open_input, reserve};
use zarrs::storage::byte_range::{ByteRange, ByteRangeIterator};
use zarrs::storage::{Bytes, MaybeBytes, MaybeBytesIterator, ReadableStorageTraits, StorageError, StoreKey};

use crate::bounded_decoder::check_blosc;
use crate::server;
use crate::store_files::{Part, is_absent, is_on_server};

/// Largest answer of a server that is read before it is known what a chunk holds: metadata of version 3.
const MOST_METADATA: u64 = 64 << 20;

/// Files below a folder, by their path in it.
#[derive(Debug)]
pub(crate) struct ZarrFiles {
    folder: PathBuf,
    /// Bytes of a chunk, where chunks are frames of blosc.
    blosc_most: Option<u64>,
    /// Most bytes of an answer of a server.
    answer_most: u64,
}

impl ZarrFiles {
    pub(crate) fn new(folder: PathBuf) -> Self {
        Self { folder, blosc_most: None, answer_most: MOST_METADATA }
    }

    /// Checks that chunks, which are frames of blosc, hold at most so many bytes: `zarrs` decodes those of Zarr 2 by itself, and allocates what they
    /// say.
    pub(crate) fn with_blosc_of(self, most: u64) -> Self {
        Self { blosc_most: Some(most), ..self }
    }

    /// Takes answers of a server of so many bytes, if those are more than metadata may have.
    pub(crate) fn with_answers_of(self, most: u64) -> Self {
        Self { answer_most: most.max(MOST_METADATA), ..self }
    }

    pub(crate) fn path(&self, key: &StoreKey) -> PathBuf {
        self.folder.join(key.as_str())
    }

    /// A part of a file on a server; `None` where there is no file.
    fn ask(&self, key: &StoreKey, part: Part) -> Result<MaybeBytes, StorageError> {
        match server::read(&self.path(key), part, self.answer_most) {
            Ok(bytes) => Ok(Some(bytes.into())),
            Err(error) if is_absent(&error) => Ok(None),
            Err(error) => Err(io(error)),
        }
    }

    /// The whole of a file.
    fn whole(&self, key: &StoreKey) -> Result<MaybeBytes, StorageError> {
        if is_on_server(&self.folder) {
            return self.ask(key, Part::Whole);
        }
        let Some((mut file, size)) = self.open(key)? else { return Ok(None) };
        part(&mut file, size, ByteRange::FromStart(0, None)).map(Some)
    }

    /// The file with its size; `None` where there is none.
    fn open(&self, key: &StoreKey) -> Result<Option<(File, u64)>, StorageError> {
        let opened = open_input(&self.path(key)).and_then(|file| {
            let bytes = file.metadata()?.len();
            Ok((file, bytes))
        });
        match opened {
            Ok(opened) => Ok(Some(opened)),
            Err(error) if is_absent(&error) => Ok(None),
            Err(error) => Err(io(error)),
        }
    }
}

fn part_of(range: ByteRange) -> Part {
    match range {
        ByteRange::FromStart(begin, None) => Part::From(begin),
        ByteRange::FromStart(begin, Some(size)) => Part::Piece { begin, size },
        ByteRange::Suffix(size) => Part::Last(size),
    }
}

fn io(error: Error) -> StorageError {
    StorageError::IOError(Arc::new(error))
}

/// Reads a part of a file of `size` bytes.
fn part(file: &mut File, size: u64, range: ByteRange) -> Result<Bytes, StorageError> {
    let (start, length) = match range {
        ByteRange::FromStart(start, None) => (start, size.checked_sub(start)),
        ByteRange::FromStart(start, Some(length)) => {
            (start, start.checked_add(length).filter(|&end| end <= size).map(|_| length))
        }
        ByteRange::Suffix(length) => (size.saturating_sub(length), Some(length).filter(|&l| l <= size)),
    };
    let Some(length) = length.and_then(|length| usize::try_from(length).ok()) else {
        // The crate's own text of a range adds offset and length, which may be more than 64 bits hold.
        let wanted = match range {
            ByteRange::FromStart(start, None) => format!("those from {start}"),
            ByteRange::FromStart(start, Some(length)) => format!("{length} from {start}"),
            ByteRange::Suffix(length) => format!("the last {length}"),
        };
        let what = format!("the file ends after {size} bytes, {wanted} are wanted");
        return Err(io(Error::new(ErrorKind::UnexpectedEof, what)));
    };
    // The file has so many bytes.
    let mut bytes =
        reserve::zeroed::<u8>(length, "a chunk").map_err(|e| StorageError::Other(e.to_string()))?;
    file.seek(SeekFrom::Start(start)).and_then(|_| file.read_exact(&mut bytes)).map_err(io)?;
    Ok(bytes.into())
}

impl ReadableStorageTraits for ZarrFiles {
    fn get(&self, key: &StoreKey) -> Result<MaybeBytes, StorageError> {
        let Some(bytes) = self.whole(key)? else { return Ok(None) };
        // The names of descriptions begin with a dot.
        if let Some(most) = self.blosc_most.filter(|_| !key.as_str().starts_with('.')) {
            check_blosc(&bytes, most).map_err(StorageError::Other)?;
        }
        Ok(Some(bytes))
    }

    fn get_partial_many<'a>(
        &'a self,
        key: &StoreKey,
        byte_ranges: ByteRangeIterator<'a>,
    ) -> Result<MaybeBytesIterator<'a>, StorageError> {
        if is_on_server(&self.folder) {
            let parts: Option<Vec<Bytes>> =
                byte_ranges.map(|range| self.ask(key, part_of(range))).collect::<Result<_, _>>()?;
            return Ok(parts.map(|parts| Box::new(parts.into_iter().map(Ok)) as Box<_>));
        }
        let Some((mut file, size)) = self.open(key)? else { return Ok(None) };
        Ok(Some(Box::new(byte_ranges.map(move |range| part(&mut file, size, range)))))
    }

    fn size_key(&self, key: &StoreKey) -> Result<Option<u64>, StorageError> {
        if is_on_server(&self.folder) {
            return match server::size(&self.path(key)) {
                Ok(bytes) => Ok(Some(bytes)),
                Err(error) if is_absent(&error) => Ok(None),
                Err(error) => Err(io(error)),
            };
        }
        Ok(self.open(key)?.map(|(_, size)| size))
    }

    fn supports_get_partial(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_beyond_the_file_are_errors() {
        let path = std::env::temp_dir().join(format!("pumice-ranges-{}", std::process::id()));
        std::fs::write(&path, [1, 2, 3]).unwrap();
        let read = |range| part(&mut File::open(&path).unwrap(), 3, range);
        assert_eq!(read(ByteRange::FromStart(1, Some(2))).unwrap().as_ref(), [2, 3]);
        assert_eq!(read(ByteRange::FromStart(1, None)).unwrap().as_ref(), [2, 3]);
        assert_eq!(read(ByteRange::Suffix(1)).unwrap().as_ref(), [3]);
        for (range, wanted) in [
            (ByteRange::FromStart(2, Some(2)), "2 from 2"),
            (ByteRange::FromStart(4, None), "those from 4"),
            (ByteRange::Suffix(4), "the last 4"),
            // No sum of these fits into 64 bits.
            (
                ByteRange::FromStart(u64::MAX, Some(u64::MAX)),
                "18446744073709551615 from 18446744073709551615",
            ),
        ] {
            let error = read(range).unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
        std::fs::remove_file(&path).unwrap();
    }
}
