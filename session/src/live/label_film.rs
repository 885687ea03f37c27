//! The label under the centre of every pixel of a live picture, so that a client that follows the mouse need not ask the worker.
//!
//! ```text
//!   client: label_film ──► None, wanted ······················ label_film ──► the film, again and again
//!   worker:   a slice of samples ──► all first surfaces ──► publishes it      an edit that moves surfaces ──► wanted anew
//! ```
//! It is made only when a client asks, after the first samples of the whole film: it costs about as much as a sample without bounces.

use pumice_transport::SeenLabel;

/// Edits after which every pixel still sees the same label: of light, materials and colours.
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

/// The label under the centre of every pixel, as [`Live::pick`](super::Live::pick) finds it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelFilm {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Revision of the scene that it was made of.
    pub revision: u64,
    /// `[id of the instance, dense label index + 1]` of each pixel, row by row from the **top**; `[0, 0]` where there is no label.
    pub pixels: Vec<[u32; 2]>,
}

impl LabelFilm {
    /// The film of a renderer's answer to [`Renderer::labels`](pumice_transport::Renderer::labels) about a picture of that size;
    /// `ids` are those of the instances by their position in the scene.
    pub(super) fn new(revision: u64, size: [u32; 2], ids: &[u32], labels: &[Option<SeenLabel>]) -> Self {
        let pixel = |seen: &Option<SeenLabel>| {
            let seen = (*seen)?;
            Some([*ids.get(seen.instance as usize)?, seen.label + 1])
        };
        let pixels = labels.iter().map(|seen| pixel(seen).unwrap_or_default()).collect();
        Self { width: size[0], height: size[1], revision, pixels }
    }
}
