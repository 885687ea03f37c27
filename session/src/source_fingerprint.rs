//! What tells the source of a volume from others, so that parts of different sources are not joined.
//!
//! ```text
//! file             its length, and its bytes: all of a small one, of a larger one 64 pieces from first to last
//! store (folder)   the files that describe it, at the top and one folder below; not its chunks, which may be millions
//! store (server)   the same files, at the top alone
//! other folder     names and lengths of its files (TIFF slices)
//! both             the table of joined ids, in the same way
//! time series      all of its files or stores, one after another
//! ```
//! It depends on no path and no time, so copies on several machines have the same one. A change of voxels that keeps all lengths may go unseen.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use pumice_core::{CancelFlag, PartSource, open_input};
use pumice_formats::{OpenOptions, is_on_server, server_descriptions};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use crate::error::{Result, io};

/// Pieces that are read of a large file, and their bytes.
const PIECES: u64 = 64;
const PIECE_BYTES: u64 = 1 << 16;

/// Names of the files that describe a store.
const METADATA: [&str; 7] =
    [".zarray", ".zattrs", ".zgroup", ".zmetadata", "zarr.json", "info", "attributes.json"];

/// What a part says of its source: a file or folder, and how it is read.
///
/// # Errors
/// When the source or the table of joined ids cannot be read.
pub fn source_of(path: &Path, reading: &OpenOptions) -> Result<PartSource> {
    source_of_all(&[path], reading)
}

/// The same for a time series in these files or folders, one after another.
///
/// # Errors
/// As [`source_of`].
pub(crate) fn source_of_all(paths: &[&Path], reading: &OpenOptions) -> Result<PartSource> {
    let mut hash = Xxh3::new();
    paths.iter().try_for_each(|path| add_source(path, &mut hash, &reading.cancelled))?;
    reading.relabel.iter().try_for_each(|table| add_file(table, &mut hash))?;
    let path = paths.first().copied().unwrap_or(Path::new(""));
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    Ok(PartSource { name, fingerprint: format!("{:032x}", hash.digest128()), reading: reading.to_string() })
}

/// Adds what tells a file or folder from others.
fn add_source(path: &Path, hash: &mut Xxh3, cancelled: &CancelFlag) -> Result<()> {
    if is_on_server(path) {
        for (name, bytes) in server_descriptions(path, cancelled)? {
            hash.update(name.as_bytes());
            hash.update(&(bytes.len() as u64).to_le_bytes());
            hash.update(&bytes);
        }
        return Ok(());
    }
    let files = files_of(path)?;
    for file in &files {
        if path.is_dir() {
            hash.update(file.file_name().unwrap_or_default().as_encoded_bytes());
        }
        add_file(file, hash)?;
    }
    if files.is_empty() {
        add_names(path, hash)?;
    }
    Ok(())
}

/// When a source was changed last, as far as its fingerprint sees its files: seconds and nanoseconds since 1970, and the length of each. Of
/// files on a server, a hash in place of the time.
///
/// # Errors
/// When the source cannot be read.
pub fn changes_of(path: &Path, reading: &OpenOptions) -> Result<Vec<(u64, u32, u64)>> {
    if is_on_server(path) {
        let of_file = |(_, bytes): (&str, Vec<u8>)| (xxh3_64(&bytes), 0, bytes.len() as u64);
        return Ok(server_descriptions(path, &reading.cancelled)?.into_iter().map(of_file).collect());
    }
    let files = files_of(path)?;
    let own = if files.is_empty() { vec![path.to_owned()] } else { files };
    let of_file = |path: &PathBuf| {
        let there = std::fs::metadata(path).map_err(io(path))?;
        // Systems without times of files tell changes by lengths alone.
        let since = there.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let since = since.unwrap_or_default();
        Ok((since.as_secs(), since.subsec_nanos(), there.len()))
    };
    own.iter().chain(&reading.relabel).map(of_file).collect()
}

/// The file itself, or the files that describe a store; none for another folder.
fn files_of(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut folders = vec![path.to_owned()];
    for entry in std::fs::read_dir(path).map_err(io(path))? {
        let entry = entry.map_err(io(path))?;
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            folders.push(entry.path());
        }
    }
    folders[1..].sort_unstable();
    let candidates = folders.iter().flat_map(|folder| METADATA.map(|name| folder.join(name)));
    Ok(candidates.filter(|path| path.is_file()).collect())
}

/// Adds the length of a file, and its bytes or a sample of them.
fn add_file(path: &Path, hash: &mut Xxh3) -> Result<()> {
    let mut file: File = open_input(path).map_err(io(path))?;
    let length = file.metadata().map_err(io(path))?.len();
    hash.update(&length.to_le_bytes());
    let mut piece = Vec::new();
    let mut add = |at: u64, bytes: u64| -> std::io::Result<()> {
        piece.clear();
        file.seek(SeekFrom::Start(at))?;
        (&mut file).take(bytes).read_to_end(&mut piece)?;
        hash.update(&piece);
        Ok(())
    };
    if length <= PIECES * PIECE_BYTES {
        return add(0, length).map_err(io(path));
    }
    let step =
        |piece: u64| (u128::from(length - PIECE_BYTES) * u128::from(piece) / u128::from(PIECES - 1)) as u64;
    (0..PIECES).try_for_each(|piece| add(step(piece), PIECE_BYTES)).map_err(io(path))
}

/// Adds names and lengths of the files in a folder.
fn add_names(folder: &Path, hash: &mut Xxh3) -> Result<()> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io(folder))? {
        let entry = entry.map_err(io(folder))?;
        let length = entry.metadata().map_err(io(entry.path()))?.len();
        files.push((entry.file_name(), length));
    }
    files.sort_unstable();
    for (name, length) in files {
        hash.update(name.as_encoded_bytes());
        hash.update(&length.to_le_bytes());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(path: &Path) -> PartSource {
        source_of(path, &OpenOptions::default()).unwrap()
    }

    #[test]
    fn copies_agree_and_other_bytes_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let copy = folder.path().join("copy");
        std::fs::create_dir(&copy).unwrap();
        let (a, b) = (folder.path().join("a.raw"), copy.join("a.raw"));
        for length in [100usize, 9 << 20] {
            let mut bytes: Vec<u8> = (0..length).map(|i| (i % 251) as u8).collect();
            std::fs::write(&a, &bytes).unwrap();
            std::fs::write(&b, &bytes).unwrap();
            assert_eq!(of(&a), of(&b));
            bytes[length - 1] ^= 1;
            std::fs::write(&b, &bytes).unwrap();
            assert_ne!(of(&a), of(&b));
            std::fs::write(&b, &bytes[1..]).unwrap();
            assert_ne!(of(&a), of(&b));
        }
    }

    #[test]
    fn a_store_is_told_by_what_describes_it() {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("store");
        std::fs::create_dir_all(store.join("s0")).unwrap();
        std::fs::write(store.join("attributes.json"), "{}").unwrap();
        std::fs::write(store.join("s0/attributes.json"), "{\"a\": 1}").unwrap();
        let before = of(&store);
        std::fs::write(store.join("s0/0"), "chunk").unwrap();
        assert_eq!(of(&store), before);
        std::fs::write(store.join("s0/attributes.json"), "{\"a\": 2}").unwrap();
        assert_ne!(of(&store), before);

        let slices = folder.path().join("slices");
        std::fs::create_dir(&slices).unwrap();
        std::fs::write(slices.join("1.tif"), "x").unwrap();
        let before = of(&slices);
        std::fs::write(slices.join("2.tif"), "x").unwrap();
        assert_ne!(of(&slices), before);
    }
}
