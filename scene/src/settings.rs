//! How the picture is made: film, integrator, level of detail, when to stop.

use serde::{Deserialize, Serialize};

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
        }
    }
}
