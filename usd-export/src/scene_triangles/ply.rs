//! PLY, binary and little-endian: rectangles with the label of each.
//!
//! ```text
//! header      text: the elements and their properties; a comment for each label: volume, number, id, name, type
//! vertex      x y z f32, red green blue u8          15 bytes, four for each rectangle
//! face        4 as u8, four vertices u32            25 bytes
//!             label u32, volume u32
//! ```
//! `label` is the dense index of the label within its volume, `volume` the id of the instance. Colours are base colours in sRGB; they are
//! of vertices, because most programs read no colours of faces. (Turk 1994, *The PLY Polygon File Format*)

use std::io::Write;

use serde_json::json;

use super::{Surfaces, corners_in_world, fits_32_bits, places};
use crate::Result;
use crate::drawn::Drawn;

/// Rectangles that are produced at a time.
const PIECE: usize = 4096;

impl Surfaces<'_> {
    /// Writes a PLY file.
    ///
    /// # Errors
    /// [`pumice_core::Error::Limit`] for more vertices than 32 bits number; errors of `out`.
    pub(crate) fn write_ply(&self, out: &mut dyn Write) -> Result<()> {
        let faces = self.rectangles();
        let vertices = fits_32_bits("vertices of a PLY file", 4 * faces)?;
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
            write_labels_of(drawn, surface.rectangles.iter().map(|r| r.label), out)?;
        }
        Ok(())
    }

    fn write_vertices(&self, out: &mut dyn Write) -> Result<()> {
        let mut buffer = Vec::new();
        for (drawn, surface) in &self.all {
            for (material, range) in drawn.materials.iter().zip(&surface.of_material) {
                let color = material.base_color.map(srgb);
                for piece in surface.rectangles[places(range)].chunks(PIECE) {
                    buffer.clear();
                    for corner in
                        piece.iter().flat_map(|r| corners_in_world(r, &drawn.instance.world_from_index))
                    {
                        corner
                            .as_vec3()
                            .to_array()
                            .iter()
                            .for_each(|c| buffer.extend_from_slice(&c.to_le_bytes()));
                        buffer.extend_from_slice(&color);
                    }
                    out.write_all(&buffer)?;
                }
            }
        }
        Ok(())
    }

    fn write_faces(&self, out: &mut dyn Write) -> Result<()> {
        let (mut buffer, mut first) = (Vec::new(), 0u32);
        for (drawn, surface) in &self.all {
            for piece in surface.rectangles.chunks(PIECE) {
                buffer.clear();
                for rectangle in piece {
                    buffer.push(4);
                    for number in [first, first + 1, first + 2, first + 3, rectangle.label, drawn.instance.id]
                    {
                        buffer.extend_from_slice(&number.to_le_bytes());
                    }
                    // The last vertex of the file has a number of 32 bits; the one after it needs none.
                    first = first.wrapping_add(4);
                }
                out.write_all(&buffer)?;
            }
        }
        Ok(())
    }
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
