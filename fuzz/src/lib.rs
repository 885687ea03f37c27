//! What the fuzz targets share. A target gives bytes of libFuzzer's making to one reader; whatever the bytes are, the reader must
//! answer with a value or an error: no panic, no overflow, no more than 10 seconds, no memory out of proportion.
//!
//! ```text
//! bytes ──► input file (scratch) ──► reader ──► use of what came out
//!   └──► right checksums (checksums), or a whole file around free sections (sections): else nearly every input ends at a checksum
//! ```

pub mod allocator;
pub mod checksums;
pub mod files;
pub mod scratch;
pub mod sections;
pub mod seeds;
pub mod volume;

#[global_allocator]
static ALLOCATOR: allocator::Limited = allocator::Limited;
