//! The light of a figure: a wide warm sun as key light, an even cool sky as fill, and a backdrop that only camera rays see.
//!
//! **Exposure.** A matte face of albedo a that looks straight at the key and into the open sky has the radiance a · (E/π + L), where E
//! is the sun's irradiance and L the sky's radiance. The sum in brackets is 1.14 in each channel: the warm key and the cool fill add
//! up to white. Faces that look elsewhere get less, so that labels show about the colours that they have. Where the key looks straight at
//! a face, no channel up to #e6 clips (an albedo of 0.79, which is (1 − 0.1) / 1.14), because the highlight of plastic adds at most 0.1.

use glam::{DMat3, DVec3};
use pumice_scene::{Environment, Sun, World};

/// Sky: a slightly cool white.
const SKY: [f32; 3] = [0.44, 0.475, 0.52];
/// Irradiance of the sun: π · 0.7.
const KEY_STRENGTH: f32 = 2.2;
/// A slightly warm white.
const KEY_COLOR: [f32; 3] = [1.0, 0.945, 0.885];
/// Angular diameter of the sun: a softbox, whose shadows have soft edges.
const KEY_ANGLE_DEG: f64 = 24.0;
/// Backdrop: bottom and top.
const BACKDROP: [[f32; 3]; 2] = [[0.78, 0.79, 0.80], [0.93, 0.945, 0.96]];

pub(crate) fn world() -> World {
    World { environment: Environment::Constant { radiance: SKY }, backdrop: Some(BACKDROP) }
}

/// The key light: from above and behind the camera's left shoulder.
pub(crate) fn key(camera_axes: &DMat3) -> Sun {
    let from: DVec3 = camera_axes.z_axis * 0.55 - camera_axes.x_axis * 0.65 + camera_axes.y_axis * 0.9;
    Sun {
        direction: (-from).to_array(),
        strength: KEY_STRENGTH,
        color: KEY_COLOR,
        angle_rad: KEY_ANGLE_DEG.to_radians(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_face_toward_the_key_is_neutral_and_does_not_clip_the_colors_that_the_module_says() {
        for (sky, color) in SKY.iter().zip(KEY_COLOR) {
            let of_white = KEY_STRENGTH / std::f32::consts::PI * color + sky;
            assert!((of_white - 1.14).abs() < 0.005, "{of_white}");
        }
    }
}
