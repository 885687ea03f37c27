//! Validation of materials.

use super::{Check, Checked};
use crate::Material;

pub(super) fn validate_material(c: &Check, m: &Material) -> Checked {
    c.each("base_color", m.base_color, |name, v| c.range(name, v, 0.0, 1.0))?;
    c.range("metallic", m.metallic.into(), 0.0, 1.0)?;
    c.range("roughness", m.roughness.into(), 0.0, 1.0)?;
    c.at_least("specular", m.specular.into(), 0.0)?;
    c.each("specular_tint", m.specular_tint, |name, v| c.range(name, v, 0.0, 1.0))?;
    c.at_least("ior", m.ior.into(), 1.0)?;
    c.range("transmission", m.transmission.into(), 0.0, 1.0)?;
    c.range("subsurface", m.subsurface.into(), 0.0, 1.0)?;
    c.color("subsurface_radius", m.subsurface_radius)?;
    c.range("coat", m.coat.into(), 0.0, 1.0)?;
    c.range("coat_roughness", m.coat_roughness.into(), 0.0, 1.0)?;
    c.at_least("coat_ior", m.coat_ior.into(), 1.0)?;
    c.each("coat_tint", m.coat_tint, |name, v| c.range(name, v, 0.0, 1.0))?;
    c.range("sheen", m.sheen.into(), 0.0, 1.0)?;
    c.range("sheen_roughness", m.sheen_roughness.into(), 0.0, 1.0)?;
    c.each("sheen_tint", m.sheen_tint, |name, v| c.range(name, v, 0.0, 1.0))?;
    c.range("alpha", m.alpha.into(), 0.0, 1.0)?;
    c.color("emission", m.emission)
}
