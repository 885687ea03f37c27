//! STL, binary: triangles alone, without labels and materials.
//!
//! ```text
//!  0  header      80 bytes of text, which must not begin with "solid"
//! 80  triangles   u32
//! 84  triangle    normal 3 × f32, three corners 3 × f32, u16 0: 50 bytes; faces are fans
//! ```

use std::io::Write;

use glam::DVec3;

use super::{Surfaces, put_corners_in_world};
use crate::Result;
use crate::budget::fits_32_bits;

/// Bytes that are produced at a time, but for the last face.
const PIECE: usize = 1 << 17;

impl Surfaces<'_> {
    /// Writes an STL file.
    ///
    /// # Errors
    /// [`pumice_core::Error::Limit`] for more triangles than 32 bits count; errors of `out`.
    pub(crate) fn write_stl(&self, out: &mut dyn Write) -> Result<()> {
        let triangles = self.corner_count() - 2 * self.face_count();
        write_header("", fits_32_bits("triangles of an STL file", triangles)?, out)?;
        let (mut buffer, mut corners) = (Vec::new(), Vec::new());
        for (drawn, surface) in &self.all {
            for face in surface.faces() {
                put_corners_in_world(face, &drawn.instance.world_from_index, &mut corners);
                for second in 1..corners.len() - 1 {
                    let [a, b, c] = [0, second, second + 1].map(|corner| corners[corner]);
                    // A sheared matrix does not turn normals as it turns points; the product of two sides is right for any.
                    let normal =
                        (b - a).normalize_or_zero().cross((c - a).normalize_or_zero()).normalize_or_zero();
                    put_triangle([normal, a, b, c], &mut buffer);
                }
                if buffer.len() >= PIECE {
                    out.write_all(&buffer)?;
                    buffer.clear();
                }
            }
        }
        Ok(out.write_all(&buffer)?)
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
