//! The `.pumice` file: a header, a table of sections, the sections.
//!
//! ```text
//! ┌────────┬───────────────┬────────────────┬────────────────┬─
//! │ header │ section table │ section 0      │ section 1      │ …     all offsets multiples of 8, little-endian
//! │ 64 B   │ 48 B each     │ padded with 0  │ padded with 0  │
//! └────────┴───────────────┴────────────────┴────────────────┴─
//! ```
//! `docs/file-format.md` has every field. The modules here, from the ground up:
//!
//! | module | its subject |
//! |---|---|
//! | `fault` | why a file is not read |
//! | `layout`, `codec`, `sections` | header and section table; filters and zstd of one section; sections read and checked |
//! | `nodes` | nodes and boxes as streams that compress well, and back |
//! | `arithmetic`, `sse2`, `slices`, `neighbours`, `equal_neighbours` | the parts of the voxel coder |
//! | `voxel_coder`, `voxel_pieces` | voxels of one piece as a stream of bits, and back; a volume as pieces, and back |
//! | `check` | every invariant of a volume that comes from outside |
//! | `write`, `read`, `label_subset` | a volume into a file, out of a file, and some labels alone out of a file |
//!
//! A volume is written to a temporary file in the same folder, synced, then renamed: a killed process never leaves half a file
//! under the final name.

mod arithmetic;
mod check;
mod codec;
mod equal_neighbours;
mod fault;
mod label_subset;
mod layout;
mod neighbours;
mod nodes;
mod read;
mod sections;
mod slices;
mod sse2;
mod voxel_coder;
mod voxel_pieces;
mod write;

#[cfg(test)]
mod damaged_files;

pub use layout::MAGIC;
pub use write::Level;
