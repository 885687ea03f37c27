//! The `.pumice` file: a header, a table of sections, then the sections.
//!
//! ```text
//! ┌────────┬───────────────┬────────────────┬────────────────┬─
//! │ header │ section table │ section 0      │ section 1      │ …     all offsets multiples of 8, little-endian
//! │ 64 B   │ 48 B each     │ padded with 0  │ padded with 0  │
//! └────────┴───────────────┴────────────────┴────────────────┴─
//! ```
//! `docs/file-format.md` describes every field. The modules, from the lowest level up:
//!
//! | module | its subject |
//! |---|---|
//! | `fault` | reasons to refuse a file |
//! | `layout`, `codec`, `sections` | header and section table; filters and zstd of one section; reading and checking sections |
//! | `nodes` | converts nodes and boxes to streams that compress well, and back |
//! | `arithmetic`, `sse2`, `slices`, `neighbours`, `equal_neighbours` | the parts of the voxel coder |
//! | `voxel_coder`, `voxel_pieces` | converts the voxels of one piece to a bit stream, and back; converts a volume to pieces, and back |
//! | `check` | every invariant of a volume that comes from outside |
//! | `write`, `read`, `label_subset` | writes a volume to a file, reads it from a file, and reads only some labels of a file |
//! | `series`, `pick` | reads one frame of a time series; reads some boxes of a chunk with their nodes |
//! | `paged` | reads a file chunk by chunk into pages that are drawn from disk |
//! | `file_sink` | writes a volume to a file while it is compressed |
//! | `part`, `merge`, `part_chunk` | what a part of a volume says of itself; joins parts to the volume; one chunk of a part |
//!
//! A volume is written to a temporary file in the same folder, synced, then renamed, so a killed process never leaves an incomplete file
//! under the final name.
//!
//! # Voxel coders that were measured
//! Each row gives, for 512³ voxels of cortex, the bytes of the voxels alone, without the rest of the file, and CPU seconds to decode them.
//!
//! | coder | bytes | CPU s |
//! |---|---|---|
//! | stretches of 16 voxels amid one label, three contexts mixed | 1,759,304 | 7 |
//! | runs of voxels amid 14 neighbours of one label; one context of 17 neighbours | 1,841,832 | 0.88 |
//! | the same amid 12 neighbours, amid 8 | 1,841,940, 1,853,820 | 0.80, 0.71 |
//! | the same 8 by words of 64 voxels, and 17 farther neighbours for a voxel that breaks a run | 1,859,940 | 0.59 |
//! | 20 farther neighbours for every voxel whose label no near neighbour has | 1,829,776 | 0.61 |
//! | 40 of them, and runs filled 16 voxels at a time | 1,804,404 | 0.60 |
//! | contexts of 16 neighbours, of 19 | 1,878,380, 1,813,588 | 0.58, 0.64 |
//! | **in use: 36 farther neighbours; touching labels are found while decoding** | **1,811,012** | **0.80** |
//!
//! With stretches, 55 % of the voxels remain to be coded. Two ideas were rejected: a second context for runs with another label nearby
//! saves 0.04 %, and counts up to 1,022 instead of 255 cost 0.2 %. Searching the boxes for touching labels took 0.3 CPU s; finding them
//! while decoding takes 0.1. Comparing sixteen labels at a time with SSE2 saves 0.1, because the compiler made forty steps of that loop
//! instead of eight.

mod arithmetic;
mod check;
mod codec;
mod equal_neighbours;
mod file_sink;
mod format_error;
mod label_subset;
mod layout;
mod merge;
mod neighbours;
mod nodes;
mod paged;
mod part;
mod part_chunk;
mod pick;
mod read;
mod sections;
mod series;
mod size_limits;
mod slices;
mod sse2;
mod voxel_coder;
mod voxel_pieces;
mod write;

#[cfg(test)]
mod damaged_files;

pub(crate) use file_sink::finish_into_file;
pub(crate) use part::PartHead;

pub use file_sink::WrittenVolume;
pub use layout::MAGIC;
pub use merge::{merge_into_part, merge_parts};
pub use part::{PartInfo, PartSource, read_part};
pub use series::{Series, frames_in_file};
pub use write::CompressionLevel;
