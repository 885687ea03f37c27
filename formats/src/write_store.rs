//! Writes a volume as a folder of chunks: OME-Zarr or Neuroglancer precomputed.
//!
//! ```text
//! ids of a chunk from the caller ──► bytes of the label type ──► encoded ──► a file, or a part of a shard ──► hidden folder beside OUT
//!                                                                                                        ──► rename to OUT
//! ```
//! The folder appears under its name when it is complete, and replaces nothing. Memory: one chunk and its encoded form. A process that is killed
//! may leave a folder `.pumice-…`.

use std::path::{Path, PathBuf};

use pumice_core::{AnnotationTable, VolumeInfo, reserve};

use crate::error::{FormatError, Result};
use crate::write::{DecodeIds, encode};
use crate::{write_ome_zarr, write_precomputed};

/// Voxels along a side of a chunk where nothing else is asked for.
pub const CHUNK_SIDE: u32 = 64;

/// Least and largest side of a chunk.
pub const CHUNK_SIDES: std::ops::RangeInclusive<u32> = 8..=128;

/// Chunks along a side of a shard.
pub(crate) const SHARD_SIDE: u32 = 8;

/// A kind of folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreFormat {
    /// OME-Zarr.
    OmeZarr {
        /// Version of OME-NGFF, and so of Zarr.
        version: OmeVersion,
        /// Whether 8 × 8 × 8 chunks lie in a file; Zarr 3 only.
        sharded: bool,
    },
    /// Neuroglancer precomputed.
    Precomputed {
        /// Encoding of the chunks.
        encoding: PrecomputedEncoding,
        /// Whether each chunk is a file of gzip whose name ends with `.gz`, as cloud-volume writes them.
        gzip: bool,
    },
}

/// A version of OME-NGFF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OmeVersion {
    /// On Zarr 2.
    V0_4,
    /// On Zarr 3.
    V0_5,
}

impl OmeVersion {
    /// Both versions.
    pub const ALL: [Self; 2] = [Self::V0_4, Self::V0_5];

    /// The version's number.
    pub fn name(self) -> &'static str {
        match self {
            Self::V0_4 => "0.4",
            Self::V0_5 => "0.5",
        }
    }
}

/// Encoding of the chunks of a precomputed volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrecomputedEncoding {
    /// Plain numbers.
    Raw,
    /// Blocks of 8 × 8 × 8 voxels with a table of ids each; of 32 or 64 bits.
    CompressedSegmentation,
}

impl PrecomputedEncoding {
    /// Both encodings.
    pub const ALL: [Self; 2] = [Self::Raw, Self::CompressedSegmentation];

    /// Its name, as in the file `info`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::CompressedSegmentation => "compressed_segmentation",
        }
    }
}

/// Writes a volume as the folder `out`, in chunks of `side`³ voxels. `table` has what is known of labels. `decode` is called once for each chunk.
/// Returns what the format does not hold, a line each.
///
/// # Errors
/// When `out` exists, its folder is missing, the disk is full, a label does not fit the type, a size is out of range, or `decode` fails. After an
/// error there is nothing under the final name.
pub fn write_store(
    out: &Path,
    info: &VolumeInfo,
    table: &AnnotationTable,
    format: StoreFormat,
    side: u32,
    decode: &mut DecodeIds<'_>,
) -> pumice_core::Result<Vec<String>> {
    check_is_free(out)?;
    if info.voxels() == 0 {
        return Err(FormatError::option(out, "the volume has no voxels, so there is nothing to write").into());
    }
    if !CHUNK_SIDES.contains(&side) {
        let what = format!(
            "the side of a chunk is {side}, expected {} to {}",
            CHUNK_SIDES.start(),
            CHUNK_SIDES.end()
        );
        return Err(FormatError::option(out, what).into());
    }
    reserve::check_room("a chunk", u64::from(side).pow(3) * 32).map_err(FormatError::memory(out))?;
    let folder = NewFolder::beside(out)?;
    let job = StoreJob { out, folder: folder.path(), info, side };
    let notes = match format {
        StoreFormat::OmeZarr { version, sharded } => {
            write_ome_zarr::write(&job, table, version, sharded, decode)?
        }
        StoreFormat::Precomputed { encoding, gzip } => {
            write_precomputed::write(&job, table, encoding, gzip, decode)?
        }
    };
    folder.appear(out)?;
    Ok(notes)
}

/// Checks that nothing has the name of a folder that is to be written.
///
/// # Errors
/// [`FormatError::Option`] where something has it.
pub fn check_is_free(out: &Path) -> std::result::Result<(), FormatError> {
    match std::fs::symlink_metadata(out) {
        Err(error) if crate::store_files::is_absent(&error) => Ok(()),
        Err(source) => Err(FormatError::Io { path: out.to_owned(), source }),
        Ok(_) => Err(FormatError::option(
            out,
            "expected the name of a new folder, got one that exists: remove it, or choose another",
        )),
    }
}

/// What the writers of all kinds of folders need.
pub(crate) struct StoreJob<'a> {
    /// The final name, for messages.
    pub(crate) out: &'a Path,
    /// The folder that is filled.
    pub(crate) folder: &'a Path,
    pub(crate) info: &'a VolumeInfo,
    /// Voxels along a side of a chunk.
    pub(crate) side: u32,
}

impl StoreJob<'_> {
    /// Chunks along x, y, z.
    pub(crate) fn grid(&self) -> [u32; 3] {
        self.info.dims.map(|dim| dim.div_ceil(self.side))
    }

    /// First voxel and size of a chunk, which is cut off at the volume's end.
    pub(crate) fn place(&self, chunk: [u32; 3]) -> ([u32; 3], [u32; 3]) {
        let origin = chunk.map(|c| c * self.side);
        (origin, [0, 1, 2].map(|a| self.side.min(self.info.dims[a] - origin[a])))
    }

    /// Ids as little-endian values of the volume's type.
    pub(crate) fn encode(&self, ids: &[u64], bytes: &mut Vec<u8>) -> Result<()> {
        bytes.clear();
        encode(self.out, ids, self.info.label_type, bytes)
    }

    /// Writes a file of the folder; `below` may have folders, which are made.
    pub(crate) fn put(&self, below: &str, bytes: &[u8]) -> Result<()> {
        let path = self.folder.join(below);
        let io = |source| FormatError::Io { path: self.out.join(below), source };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(io)?;
        }
        std::fs::write(path, bytes).map_err(io)
    }

    /// Writes a file of JSON.
    pub(crate) fn put_json(&self, below: &str, value: &serde_json::Value) -> Result<()> {
        self.put(below, format!("{value:#}\n").as_bytes())
    }
}

/// All cells of a grid, the first axis fastest.
pub(crate) fn cells(grid: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    let [x, y, z] = grid;
    (0..z).flat_map(move |k| (0..y).flat_map(move |j| (0..x).map(move |i| [i, j, k])))
}

/// A folder that has only a temporary name. It is removed when the value is dropped.
struct NewFolder(tempfile::TempDir);

impl NewFolder {
    fn beside(out: &Path) -> Result<Self> {
        let io = |source| FormatError::Io { path: out.to_owned(), source };
        let parent = out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::metadata(parent).map_err(io)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(".pumice-");
        // Temporary folders are private by default; this one gets the permissions of any new folder.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            builder.permissions(std::fs::Permissions::from_mode(0o777));
        }
        builder.tempdir_in(parent).map(Self).map_err(|e| io(e.kind().into()))
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn appear(self, out: &Path) -> Result<()> {
        check_is_free(out)?;
        std::fs::rename(self.0.path(), out).map_err(FormatError::io(out))?;
        // Nothing has the temporary name any more.
        let _: PathBuf = self.0.keep();
        Ok(())
    }
}
