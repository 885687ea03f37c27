//! How a label's surface scatters light: the part of Blender's Principled BSDF that is there so far.

use serde::{Deserialize, Serialize};

/// Surface of a label. With `metallic` 0 and `specular` 0 it is Lambert.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// Linear RGB albedo, each in [0, 1].
    pub base_color: [f32; 3],
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// Perceptual roughness in [0, 1]; GGX α is its square.
    pub roughness: f32,
    /// Blender's *IOR Level*: 0 switches the specular layer off, 0.5 leaves `ior` as it is.
    pub specular: f32,
    /// Index of refraction of the dielectric, at least 1.
    pub ior: f32,
    /// Linear RGB radiance that the surface sends out.
    pub emission: [f32; 3],
}

impl Default for Material {
    fn default() -> Self {
        Self {
            base_color: [0.8; 3],
            metallic: 0.0,
            roughness: 0.5,
            specular: 0.5,
            ior: 1.5,
            emission: [0.0; 3],
        }
    }
}
