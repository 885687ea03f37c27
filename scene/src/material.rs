//! How a surface scatters light: Blender's Principled BSDF (version 4 and later) without anisotropy, thin films and nested media.

use serde::{Deserialize, Serialize};

/// The material of a surface. With `metallic`, `specular`, `transmission`, `coat` and `sheen` 0 it is Lambertian.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// Linear RGB albedo, each in [0, 1].
    pub base_color: [f32; 3],
    /// From 0, dielectric, to 1, metal.
    pub metallic: f32,
    /// Perceptual roughness in [0, 1]; GGX α is its square.
    pub roughness: f32,
    /// Blender's *IOR Level*: 0 switches the specular layer off, 0.5 leaves `ior` as it is.
    pub specular: f32,
    /// Linear RGB factor on the specular reflection of dielectrics and on the edge of metals, each in [0, 1].
    pub specular_tint: [f32; 3],
    /// Index of refraction of the dielectric, at least 1.
    pub ior: f32,
    /// Share of the light that passes through the dielectric instead of being scattered below it: from 0, opaque, to 1, clear glass.
    pub transmission: f32,
    /// Share of the diffuse light that is scattered below the surface, in [0, 1].
    pub subsurface: f32,
    /// Mean free path below the surface, in world units for each of RGB, at least 0.
    pub subsurface_radius: [f32; 3],
    /// Weight of a clear layer on top of everything else, in [0, 1].
    pub coat: f32,
    /// Roughness of the clear layer, in [0, 1].
    pub coat_roughness: f32,
    /// Index of refraction of the clear layer, at least 1.
    pub coat_ior: f32,
    /// Linear RGB colour that the clear layer absorbs towards, each in [0, 1].
    pub coat_tint: [f32; 3],
    /// Weight of a velvet-like fuzz near the edges, in [0, 1].
    pub sheen: f32,
    /// Roughness of the fuzz, in [0, 1].
    pub sheen_roughness: f32,
    /// Linear RGB colour of the fuzz, each in [0, 1].
    pub sheen_tint: [f32; 3],
    /// Opacity: 1 opaque, 0 absent. The transparent share lets light pass straight through, unrefracted.
    pub alpha: f32,
    /// Whether light that a rough surface scatters several times is counted (Blender's *Multiscatter GGX*), or lost (*GGX*).
    pub multiscatter: bool,
    /// Linear RGB radiance that the surface emits.
    pub emission: [f32; 3],
}

impl Material {
    /// The default of Blender's Principled BSDF, a grey plastic.
    pub const DEFAULT: Self = Self {
        base_color: [0.8; 3],
        metallic: 0.0,
        roughness: 0.5,
        specular: 0.5,
        specular_tint: [1.0; 3],
        ior: 1.5,
        transmission: 0.0,
        subsurface: 0.0,
        subsurface_radius: [0.05, 0.01, 0.005],
        coat: 0.0,
        coat_roughness: 0.03,
        coat_ior: 1.5,
        coat_tint: [1.0; 3],
        sheen: 0.0,
        sheen_roughness: 0.5,
        sheen_tint: [1.0; 3],
        alpha: 1.0,
        multiscatter: true,
        emission: [0.0; 3],
    };
}

impl Default for Material {
    fn default() -> Self {
        Self::DEFAULT
    }
}
