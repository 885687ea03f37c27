//! The floor of a figure: a shadow catcher just below what is shown.

use glam::{DAffine3, DMat3, DVec3};
use pumice_scene::{Material, Mesh};

use super::DIAGONAL;

/// Half the side of the floor. Shadows of a figure fade long before its edge.
const HALF_SIDE: f64 = 10.0 * DIAGONAL;
/// Distance between the floor and the lowest point above it: faces in one plane would flicker.
const GAP: f64 = DIAGONAL / 1000.0;

/// [`pumice_scene::Film::shadow_fade`]: the soft shadow under the sky has no end, and the page around a figure shows where it is cut off.
pub(super) const FADE: f64 = 0.1;

/// A floor below the height `lowest`: a built-in plane, so that a scene and a picture need no file for it.
pub(super) fn floor_below(lowest: f64) -> Mesh {
    Mesh {
        id: 1,
        source: Mesh::PLANE.into(),
        world_from_mesh: DAffine3 {
            matrix3: DMat3::from_diagonal(DVec3::new(HALF_SIDE, HALF_SIDE, 1.0)),
            translation: DVec3::new(0.0, 0.0, lowest - GAP),
        },
        materials: vec![Material {
            base_color: [0.8; 3],
            roughness: 1.0,
            specular: 0.0,
            ..Material::default()
        }],
        shadow_catcher: true,
    }
}
