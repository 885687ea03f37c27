//! What a comparison shows: the two pictures, and maps of where they differ. The page embeds them; Python and Blender get their numbers.
//!
//! All images are scene-linear and have the same size, row 0 at the top. `difference` is what was measured. The maps whose names say
//! `color` are pictures of numbers for the eye, and look as on the page where they are shown without a view transform.

use pumice_picture::Image;
use pumice_picture::agreement::{Agreement, signed_difference_map, tile_difference_map, tile_t_map};
use pumice_picture::metrics::display::linear_from_display;
use pumice_picture::metrics::error_map;

/// A signed difference of this share of the picture's mean has full colour.
const FULL_COLOR: f64 = 0.05;

/// The two pictures of a comparison and the maps of their difference.
#[derive(Clone, Debug, PartialEq)]
pub struct VerifyMaps {
    /// Mean of our pictures; masked pixels are black.
    pub pumice: Image,
    /// Mean of Cycles' pictures; masked pixels are black.
    pub cycles: Image,
    /// `pumice` less `cycles`, by channel: negative where ours is darker.
    pub difference: Image,
    /// The difference of each pixel as a colour: red where Pumice is brighter, full at 5 % of the picture's mean.
    pub difference_color: Image,
    /// The difference of each tile as a colour, in the channel where it is largest: full at its margin.
    pub tile_difference_color: Image,
    /// Welch's t of each tile as a colour, in the channel where it is largest: full at 6.
    pub tile_t_color: Image,
    /// FLIP as a colour: black is nothing.
    pub flip_color: Image,
}

impl VerifyMaps {
    /// The maps of two means of one size.
    pub(super) fn new(pumice: Image, cycles: Image, agreement: &Agreement) -> Self {
        let size = [pumice.width, pumice.height];
        let pairs = pumice.pixels.iter().zip(&cycles.pixels);
        let differences = pairs.map(|(a, b)| [0, 1, 2].map(|c| a[c] - b[c])).collect();
        let signed = signed_difference_map(&pumice, &cycles, &agreement.mask, FULL_COLOR * agreement.scale);
        Self {
            difference: Image::new(size[0], size[1], differences),
            difference_color: linear_from_display(&signed),
            tile_difference_color: linear_from_display(&tile_difference_map(agreement, size)),
            tile_t_color: linear_from_display(&tile_t_map(agreement, size)),
            flip_color: linear_from_display(&error_map(&pumice, &cycles)),
            pumice,
            cycles,
        }
    }

    /// Each image with the name of its field.
    pub fn named(&self) -> [(&'static str, &Image); 7] {
        [
            ("pumice", &self.pumice),
            ("cycles", &self.cycles),
            ("difference", &self.difference),
            ("difference_color", &self.difference_color),
            ("tile_difference_color", &self.tile_difference_color),
            ("tile_t_color", &self.tile_t_color),
            ("flip_color", &self.flip_color),
        ]
    }
}
