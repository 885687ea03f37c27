//! The lens of a figure's camera: what is in focus, and how wide it is open.
//!
//! A figure has no size of its own: it may be a neuron or a mountain. For its lens it is a thing of ten centimetres, whose bounding box of
//! [`DIAGONAL`](super::DIAGONAL) units has a diagonal of 100 mm, photographed with a lens of 72 mm. So f/2.8 blurs as it does on a table.

use glam::DVec3;
use pumice_scene::{Aperture, Camera};

use super::framing::FOV_DEG;
use super::selector::Selector;

/// Millimetres of a world unit, for apertures by f-number.
const MM_PER_UNIT: f64 = 10.0;
/// Width of the frame behind the lens, as Blender's *Sensor Width*.
const FRAME_MM: f64 = 36.0;

/// What is in focus.
#[derive(Clone, Debug, PartialEq)]
pub enum FocusOn {
    /// A distance along the view axis in world units.
    Distance(f64),
    /// The middle of the bounds of these labels.
    Labels(Selector),
}

impl FocusOn {
    /// Parses a selector, or a distance, which is a number with a point: `17` is a label, `17.0` a distance.
    ///
    /// # Errors
    /// The expected form, if `text` has another.
    pub fn parse(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(distance) if text.contains('.') => match distance {
                d if d > 0.0 && f64::is_finite(d) => Ok(Self::Distance(d)),
                _ => Err(format!("expected a distance above 0, got {text}")),
            },
            _ => Selector::parse(text).map(Self::Labels),
        }
    }
}

/// How wide a lens is open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Opening {
    /// An f-number, such as 2.8: the focal length over the diameter.
    FNumber(f64),
    /// Radius in world units.
    Radius(f64),
}

impl Opening {
    /// Parses an f-number, `f/2.8`, or a radius in world units, `0.5`.
    ///
    /// # Errors
    /// The expected form, if `text` has another.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (number, opening): (_, fn(f64) -> Self) = match text.strip_prefix("f/") {
            Some(number) => (number, Self::FNumber),
            None => (text, Self::Radius),
        };
        match number.parse() {
            Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(opening(value)),
            _ => Err(format!(
                "expected an f-number such as f/2.8, or a radius above 0 in world units, got {text}"
            )),
        }
    }

    fn radius(self) -> f64 {
        let focal_length_mm = FRAME_MM / 2.0 / (FOV_DEG.to_radians() / 2.0).tan();
        match self {
            Self::Radius(radius) => radius,
            Self::FNumber(n) => focal_length_mm / (2.0 * n) / MM_PER_UNIT,
        }
    }
}

/// A lens of finite opening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// What is sharp.
    pub focus: SharpAt,
    /// Its opening.
    pub opening: Opening,
}

/// What a lens keeps sharp, found in the volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SharpAt {
    /// The middle of what is framed.
    Middle,
    /// A distance along the view axis in world units.
    Distance(f64),
    /// A point in index space.
    Index(DVec3),
}

impl Lens {
    /// The opening by default: blurs what is a third of the figure away from the focus by some hundredths of the picture.
    pub const DEFAULT_OPENING: Opening = Opening::FNumber(2.8);

    /// The aperture of a camera; `middle` and the point in focus are in world space.
    pub(super) fn aperture(&self, camera: &Camera, to_world: impl Fn(DVec3) -> DVec3) -> Aperture {
        let pose = &camera.world_from_camera;
        let depth = |p: DVec3| (pose.translation - p).dot(pose.matrix3.z_axis);
        let focus_distance = match self.focus {
            SharpAt::Middle => depth(DVec3::ZERO),
            SharpAt::Distance(distance) => distance,
            SharpAt::Index(p) => depth(to_world(p)),
        };
        Aperture { radius: self.opening.radius(), focus_distance, blades: 0, rotation_rad: 0.0, ratio: 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_with_a_point_is_a_distance() {
        assert_eq!(FocusOn::parse("17.5"), Ok(FocusOn::Distance(17.5)));
        assert_eq!(FocusOn::parse("17"), Ok(FocusOn::Labels(Selector::parse("17").unwrap())));
        assert_eq!(FocusOn::parse("type:axon"), Ok(FocusOn::Labels(Selector::parse("type:axon").unwrap())));
        for bad in ["0.0", "-1.5", "", "1.0e999"] {
            assert!(FocusOn::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn openings_are_read_or_refused() {
        assert_eq!(Opening::parse("f/2.8"), Ok(Opening::FNumber(2.8)));
        assert_eq!(Opening::parse("0.5"), Ok(Opening::Radius(0.5)));
        for bad in ["f/0", "f/", "0", "-1", "nan", "inf", "f2.8", "2,8"] {
            assert!(Opening::parse(bad).unwrap_err().ends_with(bad), "{bad}");
        }
        // 18 mm / tan 14° = 72.194 mm: the radius at f/2 is a quarter of that, at 10 mm a unit.
        assert!((Opening::FNumber(2.0).radius() - 1.804_85).abs() < 1e-4);
    }
}
