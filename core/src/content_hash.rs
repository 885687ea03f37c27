//! The content hash: identifies the content of a volume, so that pictures can name the data that they show.
//!
//! It is XXH3 (128 bits, seed 0) over, little-endian: dims (3 × u32), number of labels (u64), their ids (u64 each), then for each box in
//! order: lowest voxel (3 × u32), extent in voxels (3 × u32), dense label index (u32), occupied and solid masks (u64 each), and the fields
//! (u64 each) of its cells that are occupied and not solid. The form is canonical, so two volumes have the same hash exactly when they have
//! the same size and the same id in every voxel. Spacing, names and types are not part of it.

use std::io::{ErrorKind, Read as _};
use std::path::Path;

use xxhash_rust::xxh3::Xxh3;

use crate::leaves::Class;
use crate::{BoxView, CompressedVolume};

/// Bytes of boxes that are hashed at once.
const PIECE: usize = 1 << 14;
/// Bytes of a box: seven numbers, two masks and a field for each of 64 cells.
const MOST_BYTES_OF_BOX: usize = 7 * 4 + 2 * 8 + 64 * 8;

impl CompressedVolume {
    /// Content hash of the volume, defined in the module [`crate::content_hash`] and computed once. For a volume loaded with chosen labels
    /// it is the hash of the whole volume, as stored in its file.
    pub fn content_hash(&self) -> u128 {
        *self.hash.get_or_init(|| self.hash_of_boxes())
    }

    fn hash_of_boxes(&self) -> u128 {
        let mut hash = begun(self.info.dims, self.labels.ids());
        self.add_boxes(&mut hash);
        hash.digest128()
    }

    /// Adds all boxes to a hash.
    pub(crate) fn add_boxes(&self, hash: &mut Xxh3) {
        // Hashing is fastest in large pieces.
        let mut bytes = Vec::with_capacity(PIECE + MOST_BYTES_OF_BOX);
        self.for_each_box(|label, b| {
            append_box(&mut bytes, label, &b);
            if bytes.len() >= PIECE {
                hash.update(&bytes);
                bytes.clear();
            }
        });
        hash.update(&bytes);
    }
}

/// Appends what is hashed of a box.
fn append_box(bytes: &mut Vec<u8>, label: u32, b: &BoxView<'_>) {
    for v in b.origin.iter().chain(&b.extent).chain([&label]) {
        bytes.extend(v.to_le_bytes());
    }
    bytes.extend(b.node.occupied.to_le_bytes());
    let (at, mut solid) = (bytes.len(), 0u64);
    bytes.extend(solid.to_le_bytes());
    for ((_, class), (c, field)) in b.node.classes().zip(b.node.fields()) {
        match class {
            Class::Solid => solid |= 1 << c,
            _ => bytes.extend_from_slice(&field.to_le_bytes()),
        }
    }
    bytes[at..at + 8].copy_from_slice(&solid.to_le_bytes());
}

/// The content hash of a time series: XXH3 (128 bits, seed 0) of the content hashes of its frames, 16 bytes each. The hash of a frame is that
/// of a volume with the ids of all frames.
pub(crate) fn of_frames(hashes: &[u128]) -> u128 {
    let mut hash = Xxh3::new();
    hashes.iter().for_each(|of_frame| hash.update(&of_frame.to_le_bytes()));
    hash.digest128()
}

/// The hash of what comes before the boxes.
pub(crate) fn begun(dims: [u32; 3], ids: &[u64]) -> Xxh3 {
    let mut hash = Xxh3::new();
    for d in dims {
        hash.update(&d.to_le_bytes());
    }
    hash.update(&(ids.len() as u64).to_le_bytes());
    for id in ids {
        hash.update(&id.to_le_bytes());
    }
    hash
}

/// XXH3-128 of the bytes of a file, read in pieces: for files that a picture depends on and that are no volumes, such as its sky.
///
/// # Errors
/// When the file cannot be read.
pub fn hash_of_file(path: &Path) -> std::io::Result<u128> {
    let mut file = std::fs::File::open(path)?;
    let mut hash = Xxh3::new();
    let mut piece = vec![0; 1 << 20];
    loop {
        match file.read(&mut piece) {
            Ok(0) => return Ok(hash.digest128()),
            Ok(n) => hash.update(&piece[..n]),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}
