//! Wavefront OBJ as text, and the materials in an `.mtl` beside it.
//!
//! ```text
//! mtllib NAME.CONTENT.mtl    the name of the .obj, and a hash
//! o volume_7                 an object for each volume
//! g 17_axon                  a group for each label: its id, and its name where it has one
//! usemtl volume_7_0
//! v 1 0 2.5                  the corners of a face
//! …
//! f 1 2 3 4                  numbers count from 1 through the whole file
//! ```
//! In the `.mtl` `Kd` is the base colour, linear, and `Pr`, `Pm`, `Pc`, `Pcr`, `Ps` are the extension for physically based materials, which
//! Blender and others read. `Tf` is transmission where there is any, as Blender writes and reads it. Tints and subsurface scattering have no
//! word.

use std::io::Write;
use std::path::Path;

use pumice_core::reserve::{collected, sort_by_key};
use pumice_core::{Error, Job};
use pumice_scene::Material;

use super::{Surfaces, put_corners_in_world};
use crate::Result;
use crate::drawn::Drawn;
use crate::labelled_surface::{FACES, Face};
use crate::whole_file::write_with_beside;

impl Surfaces<'_> {
    /// Writes an `.obj` and its `.mtl`: both, or neither. Returns the bytes of both.
    ///
    /// # Errors
    /// [`pumice_core::Error::Caller`] for a name that is not in UTF-8; [`pumice_core::Error::Io`];
    /// [`pumice_core::Error::Cancelled`].
    pub(crate) fn write_obj_and_mtl(&self, path: &Path, job: &Job) -> Result<u64> {
        let obj = |materials_in: &str, out: &mut dyn Write| self.write_obj(materials_in, out);
        write_with_beside(path, "mtl", job, |out| self.write_mtl(out), obj)
    }

    /// Writes the `.obj`, which names its materials' file.
    fn write_obj(&self, materials_in: &str, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "# Written by pumice {}\nmtllib {materials_in}", env!("CARGO_PKG_VERSION"))?;
        let (mut next, mut corners) = (1u64, Vec::new());
        for (drawn, surface) in &self.all {
            writeln!(out, "o {}", drawn.name())?;
            let count = surface.face_count() as usize;
            let mut by_label: Vec<&dyn Face> =
                collected(count, surface.faces(), FACES).map_err(Error::from)?;
            sort_by_key(&mut by_label, |face| face.label(), FACES).map_err(Error::from)?;
            for group in by_label.chunk_by(|a, b| a.label() == b.label()) {
                let label = group[0].label();
                writeln!(out, "g {}", group_name(drawn, label))?;
                writeln!(out, "usemtl {}", material_name(drawn, drawn.material_of[label as usize] as usize))?;
                for face in group {
                    put_corners_in_world(*face, &drawn.instance.world_from_index, &mut corners);
                    for corner in &corners {
                        let [x, y, z] = corner.as_vec3().to_array();
                        writeln!(out, "v {x} {y} {z}")?;
                    }
                    write!(out, "f")?;
                    (next..next + corners.len() as u64).try_for_each(|corner| write!(out, " {corner}"))?;
                    writeln!(out)?;
                    next += corners.len() as u64;
                }
            }
        }
        Ok(())
    }

    /// Writes the `.mtl`.
    fn write_mtl(&self, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "# Written by pumice {}", env!("CARGO_PKG_VERSION"))?;
        for (drawn, surface) in &self.all {
            let all = drawn.materials.iter().enumerate();
            for (number, material) in all.filter(|(number, _)| surface.has_material(*number)) {
                write_material(&material_name(drawn, number), material, out)?;
            }
        }
        Ok(())
    }
}

pub(super) fn material_name(drawn: &Drawn<'_>, number: usize) -> String {
    format!("{}_{number}", drawn.name())
}

/// Id and name of a label. A space would begin another group's name, so it becomes an underscore.
pub(super) fn group_name(drawn: &Drawn<'_>, label: u32) -> String {
    let id = drawn.volume.labels().ids()[label as usize];
    match drawn.volume.note(label).and_then(|note| note.name.as_deref()) {
        Some(name) => format!("{id}_{}", one_word(name)),
        None => id.to_string(),
    }
}

fn one_word(text: &str) -> String {
    text.replace(|c: char| c.is_whitespace() || c.is_control() || c == '\\' || c == '#', "_")
}

pub(super) fn write_material(name: &str, material: &Material, out: &mut dyn Write) -> Result<()> {
    let rgb = |[r, g, b]: [f32; 3]| format!("{r} {g} {b}");
    writeln!(out, "\nnewmtl {name}\nKd {}\nKe {}", rgb(material.base_color), rgb(material.emission))?;
    // Specular colour and exponent are what programs without the extension draw: Blender's exporter writes them so.
    let gloss = 1000.0 * (1.0 - material.roughness).powi(2);
    writeln!(
        out,
        "Ks {}\nNs {gloss}\nNi {}\nd {}",
        rgb([material.specular; 3]),
        material.ior,
        material.alpha
    )?;
    writeln!(out, "illum 2\nPr {}\nPm {}", material.roughness, material.metallic)?;
    if material.transmission > 0.0 {
        writeln!(out, "Tf {}", rgb([material.transmission; 3]))?;
    }
    writeln!(out, "Pc {}\nPcr {}\nPs {}", material.coat, material.coat_roughness, material.sheen)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_groups_are_one_word() {
        assert_eq!(one_word("left ventricle\t#2\n"), "left_ventricle__2_");
        assert_eq!(one_word("Kortex-µ/3"), "Kortex-µ/3");
    }
}
