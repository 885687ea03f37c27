//! The `.pumice` file: a header, a table of sections, the sections.
//!
//! ```text
//! ┌────────┬───────────────┬────────────────┬────────────────┬─
//! │ header │ section table │ section 0      │ section 1      │ …     all offsets multiples of 8, little-endian
//! │ 64 B   │ 48 B each     │ padded with 0  │ padded with 0  │
//! └────────┴───────────────┴────────────────┴────────────────┴─
//! ```
//! `docs/file-format.md` has every field; this module's parts are: `layout` (header and table), `codec` (filters and
//! compression of one section), `nodes` (nodes and boxes taken apart into streams that compress well, and put together again),
//! `voxel_pieces` (a volume as its voxels, which `voxel_coder` codes by way of `slices`, `equal_neighbours`, `neighbours`, `sse2` and `arithmetic`), `write` and
//! `read`, `label_subset` (some labels alone), `legacy` and `voxels_of_version_2` (files of versions 1 and 2), `check` (every invariant of a
//! volume that comes from outside).
//!
//! A volume is written to a temporary file in the same folder, synced, then renamed: a killed process never leaves half a file
//! under the final name.

mod arithmetic;
mod check;
mod codec;
mod equal_neighbours;
mod label_subset;
mod layout;
mod legacy;
mod neighbours;
mod nodes;
mod read;
mod slices;
mod sse2;
mod voxel_coder;
mod voxel_pieces;
mod voxels_of_version_2;
mod write;

#[cfg(test)]
mod damaged_files;

pub use layout::MAGIC;
pub use write::Level;

/// What is wrong with a file, before its path is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    /// Name of the section, or `HEAD`.
    pub(crate) section: [u8; 4],
    /// Byte within the file where the section lies or, in header and table, of the field.
    pub(crate) at: u64,
    /// Expected and got.
    pub(crate) what: String,
}
