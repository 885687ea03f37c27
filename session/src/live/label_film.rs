//! What lies under the centre of every pixel of a live picture, so that a client that follows the mouse need not ask the worker.
//!
//! ```text
//!   client: label_film ──► None, wanted ······················ label_film ──► the film, again and again
//!   worker:   a slice of samples ──► all first surfaces ──► publishes it      an edit that moves surfaces ──► wanted anew
//! ```
//! It is made only when a client asks, after the first samples of the whole film: it costs about as much as a sample without bounces.
//! Label and depth of a pixel are those of one hit, the first along the ray through the aperture's centre: glass and transparent surfaces
//! count, cuts and hidden labels are away, and smooth normals do not move it.

use pumice_scene::Scene;
use pumice_transport::SeenSurface;

/// Edits after which every pixel still sees the same surface: of light, materials and colours.
pub(super) const KEEPING_EDITS: [&str; 9] = [
    "world",
    "suns",
    "lights",
    "material",
    "auto_color",
    "label_materials",
    "groups",
    "group_material",
    "mesh_materials",
];

/// Instance, label and depth under the centre of every pixel, as [`Live::pick`](super::Live::pick) finds them.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelFilm {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Revision of the scene that it was made of.
    pub revision: u64,
    /// `[id of the instance, dense label index + 1]` of each pixel, row by row from the **top**; `[id of the mesh, 0]` on a mesh, and
    /// `[0, 0]` where there is nothing.
    pub pixels: Vec<[u32; 2]>,
    /// Distance of that surface from the camera along its view axis, in world units, for each pixel; infinite where there is nothing.
    pub depth: Vec<f32>,
}

impl LabelFilm {
    /// The film of a renderer's answer to [`Renderer::seen_surfaces`](pumice_transport::Renderer::seen_surfaces) about a picture of that
    /// size; `ids` are those that [`ids`] gives for its scene.
    pub(super) fn new(revision: u64, size: [u32; 2], ids: &[u32], seen: &[Option<SeenSurface>]) -> Self {
        let known = |s: &Option<SeenSurface>| {
            let s = (*s)?;
            Some(([*ids.get(s.instance as usize)?, s.label.map_or(0, |label| label + 1)], s.depth))
        };
        let (pixels, depth) = seen.iter().map(|s| known(s).unwrap_or(([0; 2], f32::INFINITY))).unzip();
        Self { width: size[0], height: size[1], revision, pixels, depth }
    }
}

/// Ids of the instances of a scene and, after them, of its meshes: as surfaces count them.
pub(super) fn ids(scene: &Scene) -> Vec<u32> {
    let instances = scene.instances.iter().map(|instance| instance.id);
    instances.chain(scene.meshes.iter().map(|mesh| mesh.id)).collect()
}
