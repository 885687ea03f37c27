//! Header and section table of a `.pumice` file.
//!
//! ```text
//! header   0  8  magic 89 "PUMICE" 0A            table entry   0  4  name, ASCII
//!          8  4  version, 6                                    4  1  compression: 0 none, 1 zstd
//!         12  4  contents: 0 boxes, 1 voxels, 2 a part         5  1  element width w of the filters, in bytes
//!         16  8  length of the file                            6  1  filters: bit 0 delta, bit 1 planes
//!         24  8  offset of the section table, 64               7  1  0
//!         32  4  number of sections                            8  8  offset in the file, a multiple of 8
//!         36  4  number of frames                              16  8  bytes in the file
//!         40 16  content hash                                 24  8  bytes when decoded
//!         56  8  XXH3-64 of bytes 0 to 56 and the table       32  8  XXH3-64 of the bytes in the file
//!                                                             40  4  0: of the volume; k: of chunk k − 1
//!                                                             44  4  0
//! ```

use rustc_hash::FxHashSet;
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use super::format_error::{FormatError, Stop};

/// First bytes of every `.pumice` file.
pub const MAGIC: [u8; 8] = *b"\x89PUMICE\n";
pub(super) const HEADER_BYTES: usize = 64;
pub(super) const ENTRY_BYTES: usize = 48;
/// Largest number of sections: 16 for each of the most chunks that a volume can have boxes in, and 64. (The table lies within the file, so
/// its length bounds what a damaged count makes the reader allocate.)
pub(super) const MAX_SECTIONS: u32 = 1 << 28;

/// Bytes of a frame in the section `FRAM` of a time series: its content hash.
pub(super) const FRAME_BYTES: u64 = 16;

/// Version of the files that this program writes; it reads no other version.
pub(super) const VERSION: u32 = 6;

/// The form in which a file holds its volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Contents {
    /// Boxes and nodes, as they are in memory or packed.
    Boxes = 0,
    /// Arithmetically coded voxels.
    Voxels = 1,
    /// Boxes and nodes of some chunks of a volume, packed: what `merge_parts` joins.
    Part = 2,
}

impl Contents {
    /// The kind that has this number in the header.
    fn of_number(number: u32) -> Option<Self> {
        [Self::Boxes, Self::Voxels, Self::Part].into_iter().find(|&kind| kind as u32 == number)
    }
}

/// How a section's bytes are compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Encoding {
    pub(super) zstd: bool,
    /// Bytes of an element for the filters; 1 without filters.
    pub(super) width: u8,
    pub(super) delta: bool,
    pub(super) planes: bool,
}

/// An entry of the section table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    pub(super) name: [u8; 4],
    /// Index of the chunk that it belongs to; `None` where it belongs to the volume.
    pub(super) chunk: Option<u32>,
    pub(super) encoding: Encoding,
    pub(super) offset: u64,
    pub(super) stored: u64,
    pub(super) decoded: u64,
    pub(super) checksum: u64,
}

impl Entry {
    /// The entry of a section with these bytes, which is not placed in the file yet.
    pub(super) fn of_stored(
        name: [u8; 4],
        chunk: Option<u32>,
        encoding: Encoding,
        stored: &[u8],
        decoded: u64,
    ) -> Self {
        let checksum = section_checksum(stored);
        Self { name, chunk, encoding, offset: 0, stored: stored.len() as u64, decoded, checksum }
    }
}

/// Header and section table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) contents: Contents,
    /// Number of frames: 1, or those of a time series.
    pub(super) frames: u32,
    pub(super) file_bytes: u64,
    pub(super) content_hash: u128,
    pub(super) entries: Vec<Entry>,
}

/// Rounds an offset up to a multiple of 8.
pub(super) fn align(offset: u64) -> u64 {
    offset.next_multiple_of(8)
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes[at..].iter().take(4).rev().fold(0, |v, &b| v << 8 | u32::from(b))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}

impl Layout {
    /// The entry of a section of the volume, or `None` if the file does not have the section.
    pub(super) fn entry(&self, name: &[u8; 4]) -> Option<&Entry> {
        self.entries.iter().find(|e| e.name == *name && e.chunk.is_none())
    }

    /// Serialises header and table.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER_BYTES + ENTRY_BYTES * self.entries.len());
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((self.contents as u32).to_le_bytes());
        bytes.extend(self.file_bytes.to_le_bytes());
        bytes.extend((HEADER_BYTES as u64).to_le_bytes());
        bytes.extend((self.entries.len() as u32).to_le_bytes());
        bytes.extend(self.frames.to_le_bytes());
        bytes.extend(self.content_hash.to_le_bytes());
        bytes.extend([0; 8]);
        for e in &self.entries {
            let filters = u8::from(e.encoding.delta) | u8::from(e.encoding.planes) << 1;
            bytes.extend(e.name);
            bytes.extend([u8::from(e.encoding.zstd), e.encoding.width, filters, 0]);
            let chunk = e.chunk.map_or(0, |chunk| u64::from(chunk) + 1);
            for v in [e.offset, e.stored, e.decoded, e.checksum, chunk] {
                bytes.extend(v.to_le_bytes());
            }
        }
        let checksum = checksum(&bytes);
        bytes[56..HEADER_BYTES].copy_from_slice(&checksum.to_le_bytes());
        bytes
    }

    /// Checks the other fields of a header, then returns the number of sections that it declares.
    pub(super) fn sections(header: &[u8; HEADER_BYTES], file_bytes: u64) -> Result<u32, Stop> {
        let expect = |at: usize, what: &str, expected: u64, got: u64| {
            if expected == got {
                Ok(())
            } else {
                Err(Stop::Fault(FormatError::in_header(
                    at as u64,
                    format!("{what}: expected {expected}, got {got}"),
                )))
            }
        };
        if header[..8] != MAGIC {
            return Err(FormatError::in_header(
                0,
                "expected the signature of a .pumice file, got another".into(),
            )
            .into());
        }
        let version = u32_at(header, 8);
        if version != VERSION {
            return Err(Stop::Version(version));
        }
        contents_of(header)?;
        expect(16, "length of the file (truncated?)", u64_at(header, 16), file_bytes)?;
        expect(24, "offset of the section table", HEADER_BYTES as u64, u64_at(header, 24))?;
        // A time series has the content hash of each frame as it is, so a damaged number does not make the reader allocate.
        let (frames, most_frames) = (u32_at(header, 36), (file_bytes / FRAME_BYTES).max(1));
        if frames == 0 || u64::from(frames) > most_frames {
            let what = format!("number of frames: expected 1 to {most_frames}, got {frames}");
            return Err(FormatError::in_header(36, what).into());
        }
        let sections = u32_at(header, 32);
        if sections > MAX_SECTIONS {
            return Err(FormatError::in_header(
                32,
                format!("number of sections: expected at most {MAX_SECTIONS}, got {sections}"),
            )
            .into());
        }
        Ok(sections)
    }

    /// Checks and parses header and table. `bytes` start at the file's first byte and end at the table's end; `file_bytes` is the file's
    /// length.
    pub(super) fn parse(bytes: &[u8], file_bytes: u64) -> Result<Self, Stop> {
        let contents = contents_of(bytes)?;
        let entries = Self::parse_table(bytes, file_bytes)?;
        let content_hash = u128::from(u64_at(bytes, 40)) | u128::from(u64_at(bytes, 48)) << 64;
        Ok(Self { contents, frames: u32_at(bytes, 36), file_bytes, content_hash, entries })
    }

    /// Parses the entries of the section table; each section must begin where the previous one ends.
    fn parse_table(bytes: &[u8], file_bytes: u64) -> Result<Vec<Entry>, FormatError> {
        let (expected, got) = (checksum(bytes), u64_at(bytes, 56));
        if expected != got {
            return Err(FormatError::in_header(
                56,
                format!("checksum of header and table: expected {got:016x}, got {expected:016x}"),
            ));
        }
        let mut entries: Vec<Entry> = Vec::new();
        let mut known: FxHashSet<([u8; 4], u64)> = FxHashSet::default();
        let mut end = bytes.len() as u64;
        for (i, b) in bytes[HEADER_BYTES..].chunks_exact(ENTRY_BYTES).enumerate() {
            let at = (HEADER_BYTES + i * ENTRY_BYTES) as u64;
            let name = [b[0], b[1], b[2], b[3]];
            let (zstd, width, filters) = (b[4], b[5], b[6]);
            if zstd > 1 || filters > 3 || b[7] != 0 || !(1..=8).contains(&width) {
                return Err(FormatError::in_header(
                    at + 4,
                    format!("encoding of section {i}: got unknown {:?}", &b[4..8]),
                ));
            }
            let encoding =
                Encoding { zstd: zstd == 1, width, delta: filters & 1 != 0, planes: filters & 2 != 0 };
            let (offset, stored, decoded) = (u64_at(b, 8), u64_at(b, 16), u64_at(b, 24));
            if offset != align(end) {
                return Err(FormatError::in_header(
                    at + 8,
                    format!("offset of section {i}: expected {}, got {offset}", align(end)),
                ));
            }
            end = offset.saturating_add(stored);
            if end > file_bytes {
                return Err(FormatError::in_header(
                    at + 16,
                    format!("end of section {i}: expected at most {file_bytes}, got {end}"),
                ));
            }
            if !encoding.zstd && stored != decoded {
                return Err(FormatError::in_header(
                    at + 24,
                    format!("size of section {i}: expected {stored}, got {decoded}"),
                ));
            }
            let chunk = u64_at(b, 40);
            let index = u32::try_from(chunk).map_err(|_| {
                FormatError::in_header(
                    at + 40,
                    format!("chunk of section {i}: expected below 2^32, got {chunk}"),
                )
            })?;
            if !known.insert((name, chunk)) {
                return Err(FormatError::in_header(
                    at,
                    format!("name of section {i}: {:?} comes twice", name.escape_ascii().to_string()),
                ));
            }
            let chunk = index.checked_sub(1);
            entries.push(Entry { name, chunk, encoding, offset, stored, decoded, checksum: u64_at(b, 32) });
        }
        if align(end) != file_bytes {
            return Err(FormatError::in_header(
                16,
                format!("length of the file: expected {}, got {file_bytes}", align(end)),
            ));
        }
        Ok(entries)
    }
}

/// The form that a header declares.
fn contents_of(header: &[u8]) -> Result<Contents, FormatError> {
    let got = u32_at(header, 12);
    Contents::of_number(got).ok_or_else(|| {
        FormatError::in_header(
            12,
            format!("contents: expected 0 (boxes), 1 (voxels) or 2 (a part), got {got}"),
        )
    })
}

/// XXH3-64 of header and table without the checksum itself.
fn checksum(bytes: &[u8]) -> u64 {
    let mut hash = Xxh3::new();
    hash.update(&bytes[..56]);
    hash.update(&bytes[HEADER_BYTES..]);
    hash.digest()
}

/// Checksum of a section's bytes in the file.
pub(super) fn section_checksum(stored: &[u8]) -> u64 {
    xxh3_64(stored)
}
