//! PLY, binary and little-endian: faces with the label of each.
//!
//! ```text
//! header      text: the elements and their properties; a comment for each label: volume, number, id, name, type
//! vertex      x y z f32, red green blue u8          15 bytes; each face has its own
//! face        count u8, vertices u32                25 bytes for a rectangle
//!             label u32, volume u32
//! ```
//! `label` is the dense index of the label within its volume, `volume` the id of the instance. Colours are base colours in sRGB; they are
//! of vertices, because most programs read no colours of faces. (Turk 1994, *The PLY Polygon File Format*)

use std::io::Write;

use pumice_core::Error;
use serde_json::json;

use super::{Surfaces, put_corners_in_world};
use crate::Result;
use crate::budget::fits_32_bits;
use crate::drawn::Drawn;

/// Bytes that are produced at a time, but for the last face.
const PIECE: usize = 1 << 17;

impl Surfaces<'_> {
    /// Writes a PLY file.
    ///
    /// # Errors
    /// [`pumice_core::Error::Limit`] for more vertices than 32 bits number; errors of `out`.
    pub(crate) fn write_ply(&self, out: &mut dyn Write) -> Result<()> {
        let faces = self.face_count();
        let vertices = fits_32_bits("vertices of a PLY file", self.corner_count())?;
        writeln!(out, "ply\nformat binary_little_endian 1.0")?;
        writeln!(out, "comment Written by pumice {}", env!("CARGO_PKG_VERSION"))?;
        self.write_labels(out)?;
        writeln!(out, "element vertex {vertices}")?;
        for property in ["float x", "float y", "float z", "uchar red", "uchar green", "uchar blue"] {
            writeln!(out, "property {property}")?;
        }
        writeln!(out, "element face {faces}")?;
        writeln!(
            out,
            "property list uchar uint vertex_indices\nproperty uint label\nproperty uint volume\nend_header"
        )?;
        self.write_vertices(out)?;
        self.write_faces(out)
    }

    fn write_labels(&self, out: &mut dyn Write) -> Result<()> {
        for (drawn, surface) in &self.all {
            write_labels_of(drawn, surface.faces().map(|face| face.label()), out)?;
        }
        Ok(())
    }

    fn write_vertices(&self, out: &mut dyn Write) -> Result<()> {
        let (mut buffer, mut corners) = (Vec::new(), Vec::new());
        for (drawn, surface) in &self.all {
            let colors: Vec<[u8; 3]> = drawn.materials.iter().map(|m| m.base_color.map(srgb)).collect();
            for (face, material) in surface.faces().zip(surface.materials()) {
                put_corners_in_world(face, &drawn.instance.world_from_index, &mut corners);
                for corner in &corners {
                    let position = corner.as_vec3().to_array();
                    position.iter().for_each(|c| buffer.extend_from_slice(&c.to_le_bytes()));
                    buffer.extend_from_slice(&colors[material]);
                }
                write_if_full(&mut buffer, out)?;
            }
        }
        Ok(out.write_all(&buffer)?)
    }

    fn write_faces(&self, out: &mut dyn Write) -> Result<()> {
        let (mut buffer, mut first) = (Vec::new(), 0u32);
        for (drawn, surface) in &self.all {
            for face in surface.faces() {
                let corners = face.corner_count();
                let as_byte = u8::try_from(corners).map_err(|_| Error::Limit {
                    what: "corners of a face in a PLY file".into(),
                    limit: u8::MAX.into(),
                    got: corners as u64,
                })?;
                buffer.push(as_byte);
                for number in
                    (0..corners as u32).map(|corner| first + corner).chain([face.label(), drawn.instance.id])
                {
                    buffer.extend_from_slice(&number.to_le_bytes());
                }
                // The last vertex of the file has a number of 32 bits; the one after it needs none.
                first = first.wrapping_add(corners as u32);
                write_if_full(&mut buffer, out)?;
            }
        }
        Ok(out.write_all(&buffer)?)
    }
}

/// Writes a buffer and empties it, once it has enough.
fn write_if_full(buffer: &mut Vec<u8>, out: &mut dyn Write) -> Result<()> {
    if buffer.len() >= PIECE {
        out.write_all(buffer)?;
        buffer.clear();
    }
    Ok(())
}

/// Writes a comment for each label that a surface has: `label VOLUME NUMBER` and the JSON list `[id, name, type]`, which has no line break.
pub(super) fn write_labels_of(
    drawn: &Drawn<'_>,
    labels: impl Iterator<Item = u32>,
    out: &mut dyn Write,
) -> Result<()> {
    let table = drawn.volume.labels();
    let mut is_there = vec![false; drawn.visible.len()];
    labels.for_each(|label| is_there[label as usize] = true);
    for (label, id) in (0u32..).zip(table.ids()).filter(|(label, _)| is_there[*label as usize]) {
        let name = drawn.volume.note(label).and_then(|note| note.name.as_deref());
        let kind = table.type_of(label).and_then(|t| table.type_names().get(usize::from(t)));
        writeln!(out, "comment label {} {label} {}", drawn.instance.id, json!([id, name, kind]))?;
    }
    Ok(())
}

/// A linear share of light as a number of a display (IEC 61966-2-1).
pub(super) fn srgb(linear: f32) -> u8 {
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_are_those_of_displays() {
        // Known pairs of the standard's curve.
        assert_eq!([0.0, 0.001, 0.215_861, 0.5, 1.0].map(srgb), [0, 3, 128, 188, 255]);
    }
}
