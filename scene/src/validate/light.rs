//! Validation of suns and lamps.

use super::{Check, Checked};
use crate::{Light, LightShape, Sun};

/// Longest sides and radii of lamps, and how far from the origin they lie at most along each axis: squares of distances must fit an f32.
const MOST_LENGTH: f64 = 1e18;

pub(super) fn validate_sun(c: &Check, sun: &Sun) -> Checked {
    c.direction("direction", sun.direction)?;
    c.at_least("strength", sun.strength.into(), 0.0)?;
    c.color("color", sun.color)?;
    c.range("angle_rad", sun.angle_rad, 0.0, std::f64::consts::PI)?;
    // `pumice_transport::ReadySun` stores the radiance within the cone as f32, which a very narrow sun would overflow.
    let cone = std::f64::consts::PI * (0.5 * sun.angle_rad).sin().powi(2);
    let brightest = sun.color.iter().fold(0.0, |a: f32, &b| a.max(b)).max(1.0);
    let radiance =
        f64::from(sun.strength) * f64::from(brightest) / if sun.angle_rad > 0.0 { cone } else { 1.0 };
    c.field("angle_rad", radiance <= f64::from(f32::MAX), || {
        format!(
            "expected 0 or an angle wide enough for its strength, got {}: radiance {radiance}",
            sun.angle_rad
        )
    })
}

pub(super) fn validate_light(c: &Check, light: &Light) -> Checked {
    c.at_least("power_w", light.power_w.into(), 0.0)?;
    c.color("color", light.color)?;
    match &light.shape {
        LightShape::Point { position, radius, soft_falloff: _ } => {
            near(c, "shape.point.position", *position)?;
            c.range("shape.point.radius", *radius, 0.0, MOST_LENGTH)
        }
        LightShape::Spot { position, direction, radius, angle_rad, blend, soft_falloff: _ } => {
            near(c, "shape.spot.position", *position)?;
            c.direction("shape.spot.direction", *direction)?;
            c.range("shape.spot.radius", *radius, 0.0, MOST_LENGTH)?;
            c.range("shape.spot.angle_rad", *angle_rad, 0.0, std::f64::consts::PI)?;
            c.range("shape.spot.blend", (*blend).into(), 0.0, 1.0)
        }
        LightShape::Area { world_from_light, outline: _, size, spread_rad } => {
            c.without_shear("shape.area.world_from_light", world_from_light)?;
            near(c, "shape.area.world_from_light", world_from_light.translation.to_array())?;
            let m = world_from_light.matrix3;
            for (name, size, axis) in
                [("shape.area.size[0]", size[0], m.x_axis), ("shape.area.size[1]", size[1], m.y_axis)]
            {
                c.above(name, size, 0.0)?;
                // The squares of numbers up to 1e300 overflow, so that this is infinite: also too long.
                let length = axis.length() * size;
                c.field(name, length <= MOST_LENGTH, || {
                    format!("expected a side of at most {MOST_LENGTH:e}, got {length:e} in the world")
                })?;
            }
            c.range("shape.area.spread_rad", *spread_rad, 0.0, std::f64::consts::PI)
        }
    }?;
    // `pumice_transport::ReadyLamp` stores the radiance as f32, which a very strong and small lamp would overflow.
    let brightest = light.color.iter().fold(1.0, |a: f32, &b| a.max(b));
    let radiance = f64::from(light.power_w) * f64::from(brightest) / square_of(&light.shape);
    c.field("power_w", radiance <= f64::from(f32::MAX), || {
        format!("expected less power or a larger lamp, got {}: radiance {radiance}", light.power_w)
    })
}

/// Checks the middle of a lamp.
fn near(c: &Check, name: &str, position: [f64; 3]) -> Checked {
    c.point(name, position)?;
    c.field(name, position.iter().all(|v| v.abs() <= MOST_LENGTH), || {
        format!("expected a place within {MOST_LENGTH:e} of the origin, got {position:?}")
    })
}

/// About the area over which a lamp emits its power, in world units squared. Point and spot lights below `LEAST_SIZE` count as points
/// (1), and sides of area lights count as at least that long.
fn square_of(shape: &LightShape) -> f64 {
    const LEAST_SIZE: f64 = 1e-15;
    match shape {
        LightShape::Point { radius, .. } | LightShape::Spot { radius, .. } if *radius < LEAST_SIZE => 1.0,
        LightShape::Point { radius, .. } | LightShape::Spot { radius, .. } => radius * radius,
        LightShape::Area { world_from_light, size, .. } => {
            let m = world_from_light.matrix3;
            let side = |axis: glam::DVec3, size: f64| (axis.length() * size).max(LEAST_SIZE);
            // An ellipse covers π/4 of its rectangle; 0.75 is just below that, and serves for both outlines.
            0.75 * side(m.x_axis, size[0]) * side(m.y_axis, size[1])
        }
    }
}
