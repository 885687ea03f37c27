//! STL, binary: triangles alone, without labels and materials.
//!
//! ```text
//!  0  header      80 bytes of text, which must not begin with "solid"
//! 80  triangles   u32
//! 84  triangle    normal 3 × f32, three corners 3 × f32, u16 0: 50 bytes, two for each rectangle
//! ```

use std::io::Write;

use glam::DVec3;

use super::{Surfaces, corners_in_world, fits_32_bits};
use crate::Result;

/// Rectangles that are produced at a time.
const PIECE: usize = 4096;

impl Surfaces<'_> {
    /// Writes an STL file.
    ///
    /// # Errors
    /// [`pumice_core::Error::Limit`] for more triangles than 32 bits count; errors of `out`.
    pub(crate) fn write_stl(&self, out: &mut dyn Write) -> Result<()> {
        let triangles = fits_32_bits("triangles of an STL file", 2 * self.rectangles())?;
        write_header("", triangles, out)?;
        let mut buffer = Vec::new();
        for (drawn, surface) in &self.all {
            for piece in surface.rectangles.chunks(PIECE) {
                buffer.clear();
                for rectangle in piece {
                    let [a, b, c, d] = corners_in_world(rectangle, &drawn.instance.world_from_index);
                    // A sheared matrix does not turn normals as it turns points; the product of two sides is right for any.
                    let normal =
                        (b - a).normalize_or_zero().cross((d - a).normalize_or_zero()).normalize_or_zero();
                    put_triangle([normal, a, b, c], &mut buffer);
                    put_triangle([normal, a, c, d], &mut buffer);
                }
                out.write_all(&buffer)?;
            }
        }
        Ok(())
    }
}

/// Writes what comes before the triangles: who wrote them, a remark, their number.
pub(super) fn write_header(remark: &str, triangles: u32, out: &mut dyn Write) -> Result<()> {
    let mut header = [b' '; 80];
    let text = format!("Written by pumice {}{remark}", env!("CARGO_PKG_VERSION"));
    header.iter_mut().zip(text.bytes()).for_each(|(to, from)| *to = from);
    out.write_all(&header)?;
    Ok(out.write_all(&triangles.to_le_bytes())?)
}

/// Appends a triangle: its normal and its corners.
pub(super) fn put_triangle(vectors: [DVec3; 4], buffer: &mut Vec<u8>) {
    for number in vectors.iter().flat_map(|v| v.as_vec3().to_array()) {
        buffer.extend_from_slice(&number.to_le_bytes());
    }
    buffer.extend_from_slice(&[0, 0]);
}
