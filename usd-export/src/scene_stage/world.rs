//! The world as a DomeLight.
//!
//! A dome without a matrix has the pole of its picture along +y, the picture's middle along +z, and its left quarter along +x (UsdLux,
//! `DomeLight`, which follows OpenEXR's latitude-longitude maps). Ours has the pole along +z, the middle along +x and the left quarter
//! along +y, turned about +z by the world's rotation r. So the dome's matrix takes
//!
//! ```text
//! +x ─► (−sin r, cos r, 0)     +y ─► (0, 0, 1)     +z ─► (cos r, sin r, 0)
//! ```
//! Neither picture is mirrored: from within, both continue to the right of their middle with their right half.
//!
//! The backdrop, which only the camera sees, has no word in UsdLux; it is a note.

use glam::{DAffine3, DMat3, DVec3};
use pumice_scene::{Environment, World};

use super::placement::{note, placement};
use crate::usd::{Prim, Property, Value};

/// The world as a prim; none where it is a picture and the file has no path to it.
pub(super) fn prim(world: &World, picture: Option<&str>) -> Option<Prim<'static>> {
    let float = |value| Property::new("inputs:intensity", "float", Value::Float(value));
    let mut properties = match (&world.environment, picture) {
        (Environment::Constant { radiance }, _) => {
            // The colour has a largest component of 1, which fields for colours in programs can show.
            let brightest = radiance.iter().fold(0.0f32, |a, b| a.max(*b));
            let color = radiance.map(|c| if brightest > 0.0 { c / brightest } else { 1.0 });
            vec![float(brightest), Property::new("inputs:color", "color3f", Value::Float3(color))]
        }
        (Environment::Image { rotation_rad, strength, .. }, Some(asset)) => {
            let (sin, cos) = rotation_rad.sin_cos();
            let axes = DMat3::from_cols(DVec3::new(-sin, cos, 0.0), DVec3::Z, DVec3::new(cos, sin, 0.0));
            let mut properties = Vec::from(placement(&DAffine3::from_mat3(axes)));
            properties.extend([
                float(*strength),
                Property::new("inputs:texture:file", "asset", Value::Asset(asset.into())),
                Property::new("inputs:texture:format", "token", Value::Token("latlong".into())),
            ]);
            properties
        }
        (Environment::Image { .. }, None) => return None,
    };
    if let Some([bottom, top]) = world.backdrop {
        let text = format!("[{bottom:?}, {top:?}]");
        properties.push(note("backdrop", "string", Value::String(text)));
    }
    Some(Prim { name: "world".into(), type_name: "DomeLight", properties, ..Prim::default() })
}
