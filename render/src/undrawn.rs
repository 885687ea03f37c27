//! Parts of a scene that no renderer draws yet: they are refused by name, never left out in silence.

use pumice_scene::{Material, Scene};

use crate::RenderError;

/// Refuses a scene with a part that is not drawn yet.
///
/// # Errors
/// [`RenderError::Scene`] names the field.
pub fn refuse_undrawn(scene: &Scene) -> Result<(), RenderError> {
    let refuse = |field: String| Err(RenderError::Scene(format!("{field}: not drawn yet")));
    let settings = &scene.settings;
    if settings.adaptive.is_some() {
        return refuse("settings.adaptive".into());
    }
    if settings.smooth_voxels {
        return refuse("settings.smooth_voxels".into());
    }
    for (i, instance) in scene.instances.iter().enumerate() {
        let style = &instance.style;
        if let Some(field) = undrawn_in(&style.material) {
            return refuse(format!("instances[{i}].style.material.{field}"));
        }
        for (id, material) in &style.materials {
            if let Some(field) = undrawn_in(material) {
                return refuse(format!("instances[{i}].style.materials.{id}.{field}"));
            }
        }
    }
    for (i, mesh) in scene.meshes.iter().enumerate() {
        if mesh.shadow_catcher {
            return refuse(format!("meshes[{i}].shadow_catcher"));
        }
        for (m, material) in mesh.materials.iter().enumerate() {
            if let Some(field) = undrawn_in(material) {
                return refuse(format!("meshes[{i}].materials[{m}].{field}"));
            }
        }
    }
    Ok(())
}

fn undrawn_in(m: &Material) -> Option<&'static str> {
    (m.sheen != 0.0).then_some("sheen")
}
