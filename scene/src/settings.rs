//! How the picture is made: film, integrator, level of detail, when to stop.

use serde::{Deserialize, Serialize};

use crate::Passes;

/// Pixel reconstruction filter; samples are drawn from it, never splatted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Filter {
    /// Constant over `width` pixels.
    Box {
        /// Full width in pixels.
        width: f32,
    },
    /// Blackman-Harris over `width` pixels (Blender's default 1.5 spans ±1.5 pixels: give 3).
    BlackmanHarris {
        /// Full width in pixels.
        width: f32,
    },
}

/// How light becomes what a screen shows, in pictures of 8 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViewTransform {
    /// The sRGB curve, clamped.
    #[default]
    Standard,
    /// Like Blender's *Filmic*.
    Filmic,
    /// Like Blender's *AgX*.
    Agx,
}

/// The picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Film {
    /// Pixels across, at least 1.
    pub width: u32,
    /// Pixels down, at least 1.
    pub height: u32,
    /// Reconstruction filter.
    pub filter: Filter,
    /// Width of a pixel over its height, above 0.
    #[serde(default = "square")]
    pub pixel_aspect: f64,
    /// What camera rays do not meet is left transparent instead of showing the sky or the backdrop.
    #[serde(default)]
    pub transparent: bool,
    /// Passes that samples must be sorted for; those of the first surface through the middle of each pixel are there unasked.
    #[serde(default)]
    pub passes: Passes,
    /// How many labels, or types, of a pixel its Cryptomatte holds: an even number, 2 to [`Film::MOST_RANKS`].
    #[serde(default = "six")]
    pub cryptomatte_ranks: u32,
    /// Colours are written as floats of 16 bits where the file knows them (OpenEXR).
    #[serde(default)]
    pub half: bool,
    /// How they are shown where the file has what a screen shows (PNG).
    #[serde(default)]
    pub view_transform: ViewTransform,
}

fn six() -> u32 {
    Film::RANKS
}

fn square() -> f64 {
    1.0
}

impl Film {
    /// As in Cycles: three layers of two.
    pub const RANKS: u32 = 6;

    /// Most, as in Cycles.
    pub const MOST_RANKS: u32 = 16;

    /// An opaque film of square pixels.
    pub const fn new(width: u32, height: u32, filter: Filter) -> Self {
        Self {
            width,
            height,
            filter,
            pixel_aspect: 1.0,
            transparent: false,
            passes: Passes::NONE,
            cryptomatte_ranks: Self::RANKS,
            half: false,
            view_transform: ViewTransform::Standard,
        }
    }
}

/// Which light is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// All light, up to [`Settings::bounces`].
    #[default]
    Path,
    /// Direct light only.
    OneBounce,
    /// White surfaces under a white sky within [`Settings::ao_distance`]: no materials, no lights.
    AmbientOcclusion,
}

/// Level of detail: the voxel size at which traversal stops (paper §4.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Lod {
    /// Voxels: exact.
    #[default]
    Voxels,
    /// 4³ cells that hold any voxel; where several labels have one, the lowest dense index.
    Cells,
    /// Whole boxes.
    Boxes,
    /// Per box, by its least distance from the camera: the coarsest level whose element spans at most `pixels` pixels there.
    Distance {
        /// Size in pixels below which an element may be coarser.
        pixels: f32,
    },
}

/// Samples go where the error is (Blender's *Noise Threshold*): a pixel rests once its estimated error is below `threshold`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adaptive {
    /// Relative error of a pixel, above 0.
    pub threshold: f32,
    /// Samples that every pixel gets before it may rest, at least 4: fewer tell nothing of their error.
    pub min_spp: u32,
}

/// How the picture is made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Which light is counted.
    pub mode: Mode,
    /// As Cycles' `max_bounces`: N bounces light N + 1 surface points, and the last ray still collects emission and background.
    pub bounces: u32,
    /// Whether dim paths end at random (unbiased).
    pub russian_roulette: bool,
    /// Reach of [`Mode::AmbientOcclusion`] in world units.
    pub ao_distance: f64,
    /// Level of detail.
    pub lod: Lod,
    /// Every random number follows from it.
    pub seed: u64,
    /// Largest mean of its three channels that light seen, or scattered once, may add to a sample, as Cycles' *Direct Light* clamp;
    /// 0: no clamp. A clamp takes light away: it biases the picture.
    pub clamp_direct: f32,
    /// The same for light after further bounces, as Cycles' *Indirect Light* clamp; 0: no clamp.
    pub clamp_indirect: f32,
    /// Samples by error; none: every pixel gets as many.
    pub adaptive: Option<Adaptive>,
    /// Shades voxels with the direction in which the label's occupancy falls off, instead of their flat faces.
    pub smooth_voxels: bool,
}

impl Settings {
    /// Whether the clamps take any light away.
    pub fn clamps(&self) -> bool {
        self.clamp_direct != 0.0 || self.clamp_indirect != 0.0
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            mode: Mode::Path,
            bounces: 32,
            russian_roulette: true,
            ao_distance: f64::MAX,
            lod: Lod::Voxels,
            seed: 0,
            clamp_direct: 0.0,
            clamp_indirect: 0.0,
            adaptive: None,
            smooth_voxels: false,
        }
    }
}
