//! Code that the fuzz targets share. A target gives bytes from libFuzzer to one reader. For any bytes, the reader must return a value or an
//! error, without a panic or an overflow, in at most 10 seconds, and without excessive memory.
//!
//! ```text
//! bytes ──► input file (scratch) ──► reader ──► use of the result
//!   └──► correct checksums (checksums), or a valid file around arbitrary sections (sections)
//! ```
//! Without correct checksums nearly every input would be refused at a checksum.

pub mod allocator;
pub mod carried_scene;
pub mod carriers;
pub mod checksums;
pub mod files;
pub mod scratch;
pub mod sections;
pub mod seeds;
pub mod server;
pub mod stores;
pub mod volume;

#[global_allocator]
static ALLOCATOR: allocator::Limited = allocator::Limited;
