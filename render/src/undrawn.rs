//! Parts of a scene that no renderer draws yet: they are refused by name, never left out in silence.

use pumice_scene::Scene;

use crate::RenderError;

/// Refuses a scene with a part that is not drawn yet.
///
/// # Errors
/// [`RenderError::Scene`] names the field.
pub fn refuse_undrawn(scene: &Scene) -> Result<(), RenderError> {
    let refuse = |field: String| Err(RenderError::Scene(format!("{field}: not drawn yet")));
    for (i, mesh) in scene.meshes.iter().enumerate() {
        if mesh.shadow_catcher {
            return refuse(format!("meshes[{i}].shadow_catcher"));
        }
    }
    Ok(())
}
