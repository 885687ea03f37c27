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
//!
//! # Coders of voxels that were measured
//! Of 512³ voxels of cortex: bytes of the voxels alone, without what a file has besides, and CPU seconds of decoding them.
//!
//! | coder | bytes | CPU s |
//! |---|---|---|
//! | stretches of 16 voxels amid one label, three contexts mixed | 1,759,304 | 7 |
//! | runs of voxels amid 14 neighbours of one label; one context of 17 neighbours | 1,841,832 | 0.88 |
//! | amid 12 neighbours, amid 8 | 1,841,940, 1,853,820 | 0.80, 0.71 |
//! | the same 8 by words of 64 voxels, and 17 farther neighbours for a voxel that breaks a run | 1,859,940 | 0.59 |
//! | 20 farther neighbours for every voxel whose label no near one has | 1,829,776 | 0.61 |
//! | 40 of them, and runs filled 16 voxels at a time | 1,804,404 | 0.60 |
//! | contexts of 16 neighbours, of 19 | 1,878,380, 1,813,588 | 0.58, 0.64 |
//! | **this one: 36 farther neighbours; touching labels are found on the way** | **1,811,012** | **0.80** |
//!
//! Stretches leave 55 % of the voxels to be coded. A second context for runs with something near saves 0.04 %, and counts to
//! 1,022 instead of 255 cost 0.2 %: neither was taken. Looking for touching labels in the boxes took 0.3 CPU s, finding them on the way
//! takes 0.1. Comparing sixteen labels at a time by SSE2 saves 0.1: the compiler made forty steps of that loop instead of eight.

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
