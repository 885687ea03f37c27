//! A lamp of the scene, prepared for sampling: a ball (point and spot) or a flat shape that emits to one side (area).
//!
//! | lamp | radiance, for power P, as in Cycles |
//! |---|---|
//! | ball of radius r | P / (4π² r²): from everywhere it looks like a disk of area π r², so P / (4π) W/sr |
//! | point | no radiance: P / (4π) W/sr |
//! | spot | the same, times the transmission of its cone |
//! | area of size A | P / (π A), times the transmission of its spread |
//! | beam (an area of spread 0) | no radiance: irradiance P / A on the surfaces that it hits |
//!
//! A lamp is seen from a [`Receiver`]. Three results must agree, and tests check it: `sample` draws a direction, and `meet` finds the lamp
//! along a direction; both return the radiance and the density that `sample` has there. Lamps cast no shadows and do not occlude one
//! another, as in Cycles: rays pass through them.
//!
//! **Numbers.** The vector from the receiver to the lamp's middle is computed in f64 and rounded once; everything else is f32, as on the
//! graphics processor.

mod area;
mod ball;
mod disk;
mod lamp_tree;
mod many;
mod spherical_rectangle;

use std::f64::consts::PI;

use glam::{DVec3, Vec2, Vec3};
use pumice_scene::{Light, LightShape, Outline};

pub(crate) use lamp_tree::LampTree;
pub(crate) use many::ManyLamps;
pub use spherical_rectangle::SphericalRectangle;

/// Smaller balls, in world units, are treated as points, and smaller sides are widened to this: radiance must fit an f32, and 1/r² must not
/// be denormal.
const LEAST_SIZE: f64 = 1e-15;

/// Spreads below this, in radians, are treated as parallel, because f32 directions cannot resolve them.
const LEAST_SPREAD: f64 = 1e-4;

/// Stands for the tangent of half a spread of π: so large that the tangent of every other angle is small beside it, while its inverse is
/// not denormal.
const WIDEST_TAN: f32 = 1e18;

/// Added to cosines by which lights are chosen, so that rounding hides no light that touches the horizon.
pub(crate) const HORIZON: f32 = 1e-6;

/// Least squared distance to a lamp by which it is chosen.
const LEAST_SQUARED_TO_LAMP: f32 = 1e-30;

/// Least cosine at a flat lamp by which it is chosen: its edge may be nearer than its middle.
const LEAST_LAMP_COSINE: f32 = 1e-3;

/// The shape of a lamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum LampKind {
    /// A ball, or a point where the radius is 0.
    Ball = 0,
    /// A ball whose light is confined to a cone.
    Spot = 1,
    /// A rectangle that emits to one side.
    Rectangle = 2,
    /// An ellipse that emits to one side.
    Ellipse = 3,
}

/// A lamp, prepared for sampling.
#[derive(Clone, Copy, Debug)]
pub struct ReadyLamp {
    /// Middle of the lamp, in the world.
    pub position: DVec3,
    /// Shape.
    pub kind: LampKind,
    /// Unit vector along which a spot or an area emits; 0 for a ball.
    pub axis: Vec3,
    /// Unit vectors along the sides of an area.
    pub sides: [Vec3; 2],
    /// Radius of a ball, in both entries; half of an area's extent along its sides.
    pub half: [f32; 2],
    /// Radiance before cone or spread; intensity in W/sr for a point, irradiance for a beam.
    pub radiance: Vec3,
    /// 1 − cos of half the angle of a spot's cone.
    pub one_minus_cos_half_angle: f32,
    /// 1 / (one_minus_cos_half_angle · blend), at most 1e30.
    pub inverse_blend: f32,
    /// Tangent of half an area's spread; 0 for a beam.
    pub tan_half_spread: f32,
    /// Factor that keeps the lamp's power the same when the spread confines it.
    pub spread_factor: f32,
    /// Whether a ball is drawn as a disk that faces the receiver (*Soft Falloff*).
    pub soft: bool,
    /// Whether camera rays see it.
    pub visible_to_camera: bool,
    /// Intensity along its axis, for choosing among lights: luminance of W/sr; of a beam, of its irradiance.
    pub intensity: f32,
}

/// The point at which light arrives.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position in the world.
    pub point: DVec3,
    /// Unit normal on the side from which the surface is seen.
    pub normal: Vec3,
    /// Whether light from behind counts too, because the surface transmits light.
    pub both_sides: bool,
}

/// Light from a lamp along one direction.
#[derive(Clone, Copy, Debug)]
pub struct LampSample {
    /// Unit vector towards the lamp.
    pub direction: Vec3,
    /// Distance to the lamp.
    pub distance: f32,
    /// Radiance; irradiance where `pdf` is 0.
    pub radiance: Vec3,
    /// Density per solid angle of [`ReadyLamp::sample`]; 0 for a single direction that no scattered ray can meet.
    pub pdf: f32,
}

/// The unit vector along one that is not 0, however short: its square may be 0 in an f64.
fn unit(v: DVec3) -> DVec3 {
    (v / v.abs().max_element()).normalize()
}

impl ReadyLamp {
    /// Prepares a lamp of the scene.
    pub fn new(light: &Light) -> Self {
        let power = f64::from(light.power_w);
        let color = Vec3::from_array(light.color);
        let of = |radiance: f64| color * radiance as f32;
        let mut lamp = Self {
            position: DVec3::ZERO,
            kind: LampKind::Ball,
            axis: Vec3::ZERO,
            sides: [Vec3::ZERO; 2],
            half: [0.0; 2],
            radiance: Vec3::ZERO,
            one_minus_cos_half_angle: 0.0,
            inverse_blend: 0.0,
            tan_half_spread: 0.0,
            spread_factor: 0.0,
            soft: false,
            visible_to_camera: light.visible_to_camera,
            intensity: 0.0,
        };
        match light.shape {
            LightShape::Point { position, radius, soft_falloff }
            | LightShape::Spot { position, radius, soft_falloff, .. } => {
                lamp.soft = soft_falloff;
                lamp.position = DVec3::from_array(position);
                let is_point = radius < LEAST_SIZE;
                lamp.half = [if is_point { 0.0 } else { radius as f32 }; 2];
                lamp.radiance = of(power / (4.0 * PI) / if is_point { 1.0 } else { PI * radius * radius });
            }
            LightShape::Area { world_from_light, outline, size, spread_rad } => {
                let m = world_from_light.matrix3;
                lamp.position = world_from_light.translation;
                lamp.kind = match outline {
                    Outline::Rectangle => LampKind::Rectangle,
                    Outline::Ellipse => LampKind::Ellipse,
                };
                lamp.axis = (-unit(m.z_axis)).as_vec3();
                lamp.sides = [m.x_axis, m.y_axis].map(|a| unit(a).as_vec3());
                let [width, height] =
                    [(m.x_axis, size[0]), (m.y_axis, size[1])].map(|(a, s)| (a.length() * s).max(LEAST_SIZE));
                lamp.half = [width, height].map(|s| (0.5 * s) as f32);
                let area = width * height * if outline == Outline::Ellipse { PI / 4.0 } else { 1.0 };
                let half_spread = 0.5 * spread_rad;
                if spread_rad < LEAST_SPREAD {
                    lamp.radiance = of(power / area);
                } else {
                    lamp.radiance = of(power / (PI * area));
                    let tan = half_spread.tan();
                    // ∫ cos (1 − tan x / tan a) 2 sin over the cone is (tan a − a) / tan a, where tan a − a is of third order at small a.
                    let narrow = half_spread.powi(3) / 3.0 * (1.0 + 0.4 * half_spread * half_spread);
                    if spread_rad >= PI || tan >= f64::from(WIDEST_TAN) {
                        (lamp.tan_half_spread, lamp.spread_factor) = (WIDEST_TAN, 1.0 / WIDEST_TAN);
                    } else {
                        let rest = if half_spread > 0.02 { tan - half_spread } else { narrow };
                        (lamp.tan_half_spread, lamp.spread_factor) = (tan as f32, (1.0 / rest) as f32);
                    }
                }
            }
        }
        if let LightShape::Spot { direction, angle_rad, blend, .. } = light.shape {
            lamp.kind = LampKind::Spot;
            lamp.axis = DVec3::from_array(direction).normalize().as_vec3();
            // 1 − cos h = 2 sin²(h/2) avoids cancellation in narrow cones.
            let one_minus_cos = 2.0 * (0.25 * angle_rad).sin().powi(2);
            lamp.one_minus_cos_half_angle = one_minus_cos as f32;
            lamp.inverse_blend = (1.0 / (one_minus_cos * f64::from(blend))).min(1e30) as f32;
        }
        lamp.intensity = lamp.intensity_of();
        lamp
    }

    /// Whether the lamp emits at all.
    pub fn is_lit(&self) -> bool {
        self.radiance.max_element() > 0.0
            && (self.kind != LampKind::Spot || self.one_minus_cos_half_angle > 0.0)
    }

    /// Intensity along the axis, all colours together; of a beam, its irradiance.
    fn intensity_of(&self) -> f32 {
        let l = self.radiance.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        let pi = std::f32::consts::PI;
        let [u, v] = self.half;
        let along_axis = self.tan_half_spread * self.spread_factor;
        match self.kind {
            LampKind::Rectangle | LampKind::Ellipse if self.tan_half_spread == 0.0 => l,
            LampKind::Rectangle => 4.0 * u * v * (l * along_axis),
            LampKind::Ellipse => pi * u * v * (l * along_axis),
            LampKind::Ball | LampKind::Spot => l * if u == 0.0 { 1.0 } else { pi * u * u },
        }
    }

    /// About the irradiance that a receiver can have from the lamp, for choosing among lights; 0 only where it has none. Its cosine is the
    /// largest of any point of a ball around what lights the receiver: the lamp, or the part of it that a spread leaves.
    #[inline]
    pub fn irradiance_at(&self, from: &Receiver) -> f32 {
        let mut way = (self.position - from.point).as_vec3();
        let height = -way.dot(self.axis);
        let is_flat = self.kind as u32 >= LampKind::Rectangle as u32;
        if is_flat && height <= 0.0 {
            return 0.0;
        }
        let [u, v] = self.half;
        let mut radius = if is_flat { (u * u + v * v).sqrt() } else { u };
        // The shares of a flat lamp are along its sides.
        let mut share = Vec2::ONE;
        if self.kind == LampKind::Spot {
            share.x = self.about_through_cone(way);
        } else if is_flat && self.tan_half_spread < WIDEST_TAN {
            let Some(lit) = self.lit_part(way) else { return 0.0 };
            (way, radius, share) = (lit.way, lit.radius, lit.share);
        }
        let squared = way.length_squared().max(radius * radius).max(LEAST_SQUARED_TO_LAMP);
        let distance = squared.sqrt();
        let mut cos = 1.0;
        if !from.both_sides {
            cos = ((way.dot(from.normal) + radius) / distance + HORIZON).clamp(0.0, 1.0);
        }
        let intensity = self.intensity;
        if !is_flat {
            intensity * (share.x / squared) * cos
        } else if self.tan_half_spread == 0.0 {
            intensity * cos
        } else {
            // One share after the other, for a small one of a wide lamp, near by, must not underflow.
            let lamp_cos = (height / distance).max(LEAST_LAMP_COSINE);
            intensity * (share.x / distance) * (share.y / distance) * lamp_cos * cos
        }
    }

    /// Samples a direction towards the lamp; `None` where the sample carries no light.
    #[inline]
    pub fn sample(&self, from: &Receiver, u: [f32; 2]) -> Option<LampSample> {
        let to_middle = (self.position - from.point).as_vec3();
        match self.kind {
            LampKind::Ball | LampKind::Spot if self.soft => self.sample_disk(to_middle, u),
            LampKind::Ball | LampKind::Spot => self.sample_ball(to_middle, from, u),
            LampKind::Rectangle | LampKind::Ellipse => self.sample_area(to_middle, u),
        }
    }

    /// The lamp as a ray in this unit direction sees it.
    #[inline]
    pub fn meet(&self, from: &Receiver, direction: Vec3) -> Option<LampSample> {
        let to_middle = (self.position - from.point).as_vec3();
        match self.kind {
            LampKind::Ball | LampKind::Spot if self.soft => self.meet_disk(to_middle, direction),
            LampKind::Ball | LampKind::Spot => self.meet_ball(to_middle, from, direction),
            LampKind::Rectangle | LampKind::Ellipse => self.meet_area(to_middle, direction),
        }
    }
}
