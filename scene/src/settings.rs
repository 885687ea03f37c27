//! Settings of the picture: film, integrator, level of detail, and when pixels stop sampling.

use serde::{Deserialize, Serialize};

use crate::Passes;

/// Pixel reconstruction filter, by filter importance sampling: sample positions are drawn from it, nothing is splatted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Filter {
    /// Constant over `width` pixels.
    Box {
        /// Full width in pixels.
        width: f32,
    },
    /// Blackman-Harris over `width` pixels. Blender's default of 1.5 spans ±1.5 pixels, which is a width of 3 here.
    BlackmanHarris {
        /// Full width in pixels.
        width: f32,
    },
}

/// How scene-linear light becomes display values in pictures of 8 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViewTransform {
    /// The sRGB curve, clamped.
    #[default]
    Standard,
    /// An approximation of Blender's *Filmic*.
    Filmic,
    /// An approximation of Blender's *AgX*.
    Agx,
}

/// Size, filter, passes and file options of the picture.
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
    /// Whether the background is transparent instead of showing the sky or the backdrop.
    #[serde(default)]
    pub transparent: bool,
    /// Display colour behind the picture of a transparent film in files that hold display values (PNG), which then have no alpha:
    /// sRGB-encoded, each channel in [0, 1]. It is added after the view transform, which does not change it.
    #[serde(default)]
    pub background: Option<[f32; 3]>,
    /// Passes that need the samples sorted by kind of light. The passes of the first surface at the centre of each pixel always exist.
    #[serde(default)]
    pub passes: Passes,
    /// How many labels, or types, the Cryptomatte holds per pixel: an even number, 2 to [`Film::MOST_RANKS`].
    #[serde(default = "six")]
    pub cryptomatte_ranks: u32,
    /// Distance from the border, as a share of the shorter side, over which the shadows on shadow catchers fade to nothing: in
    /// [0, 0.5], 0 for shadows that reach the border. The pass of caught shadows does not fade.
    #[serde(default)]
    pub shadow_fade: f64,
    /// Whether colours are written as 16-bit floats, in formats that have them (OpenEXR).
    #[serde(default)]
    pub half: bool,
    /// View transform of files that hold display values (PNG).
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
    /// Default of [`Film::cryptomatte_ranks`], as in Cycles: three layers of two.
    pub const RANKS: u32 = 6;

    /// Largest [`Film::cryptomatte_ranks`], as in Cycles.
    pub const MOST_RANKS: u32 = 16;

    /// An opaque film of square pixels without extra passes.
    pub const fn new(width: u32, height: u32, filter: Filter) -> Self {
        Self {
            width,
            height,
            filter,
            pixel_aspect: 1.0,
            transparent: false,
            background: None,
            passes: Passes::NONE,
            cryptomatte_ranks: Self::RANKS,
            shadow_fade: 0.0,
            half: false,
            view_transform: ViewTransform::Standard,
        }
    }

    /// [`Film::shadow_fade`] in whole pixels.
    pub fn shadow_fade_pixels(&self) -> u32 {
        (self.shadow_fade * f64::from(self.width.min(self.height))).ceil() as u32
    }
}

/// Which light the picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// All light, up to [`Settings::bounces`].
    #[default]
    Path,
    /// Direct light only.
    OneBounce,
    /// White surfaces under a white sky, occluded within [`Settings::ao_distance`]: no materials, no lights.
    AmbientOcclusion,
}

/// Level of detail: the voxel size at which traversal stops (paper §4.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Lod {
    /// Single voxels: exact.
    #[default]
    Voxels,
    /// Cells of 4³ voxels that hold at least one voxel; where several labels share a cell, the lowest dense index wins.
    Cells,
    /// Whole boxes of up to 16³ voxels.
    Boxes,
    /// Chosen for each box by its least distance from the camera: the coarsest level whose elements span at most `pixels` pixels there.
    Distance {
        /// Largest size of an element in pixels.
        pixels: f32,
    },
}

/// Adaptive sampling (Blender's *Noise Threshold*): a pixel rests, taking no more samples, once its estimated error is below `threshold`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adaptive {
    /// Relative error at which a pixel rests, above 0.
    pub threshold: f32,
    /// Samples that every pixel gets before it may rest, at least 4: fewer give no usable estimate of their error.
    pub min_spp: u32,
}

/// Settings of the integrator, level of detail and random seed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Which light the picture shows.
    pub mode: Mode,
    /// Number of bounces, as Cycles' `max_bounces`: N bounces light N + 1 surface points, and the last ray still collects emission and
    /// background.
    pub bounces: u32,
    /// Whether dim paths end at random (unbiased).
    pub russian_roulette: bool,
    /// Reach of [`Mode::AmbientOcclusion`] in world units.
    pub ao_distance: f64,
    /// Level of detail.
    pub lod: Lod,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Largest value, as the mean of RGB, that light seen directly or scattered once may add to a sample: Cycles' *Direct Light*
    /// clamp; 0: no clamp. A clamp removes light, so it biases the picture.
    pub clamp_direct: f32,
    /// The same for light after further bounces, as Cycles' *Indirect Light* clamp; 0: no clamp.
    pub clamp_indirect: f32,
    /// Adaptive sampling; without it every pixel gets the same number of samples.
    pub adaptive: Option<Adaptive>,
    /// Whether voxels are shaded with smooth normals, the direction in which the label's occupancy falls off, instead of flat faces.
    pub smooth_voxels: bool,
}

impl Settings {
    /// Whether a clamp is switched on.
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
