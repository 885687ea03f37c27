//! The oracle's volumes, and one of real data.

use std::sync::Arc;

use pumice_core::CompressedVolume;
pub use pumice_oracle::volumes::*;

use super::Dense;

/// A crop of the shipped connectomics volume with every seventh id shown: 96³ voxels of real neurites.
pub fn neurites() -> (Dense, Arc<CompressedVolume>) {
    use std::io::Read;
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/connectomics_32x32x40nm.nrrd");
    let file = std::fs::read(path).unwrap();
    let end = file.windows(2).position(|w| w == b"\n\n").unwrap() + 2;
    assert!(String::from_utf8_lossy(&file[..end]).contains("sizes: 256 256 512"));
    let mut raw = Vec::new();
    flate2::read::GzDecoder::new(&file[end..]).read_to_end(&mut raw).unwrap();
    volume([96, 96, 96], |x, y, z| {
        let at = 4 * ((x + 80) + 256 * ((y + 80) + 256 * (z + 200))) as usize;
        let id = u32::from_le_bytes([raw[at], raw[at + 1], raw[at + 2], raw[at + 3]]);
        if id % 7 == 0 { id } else { 0 }
    })
}
