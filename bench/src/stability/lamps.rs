//! Lamps without size, without angle and as wide as the world, over a floor. The radiance of the floor is albedo / π of the irradiance.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::CompressedVolume;
use pumice_oracle::volumes::volume;
use pumice_scene::{Light, LightShape, Mode, Outline, Scene};
use pumice_session::error::Result;

use super::Case;
use super::pictures::{Studio, from_above, lambert, mean_off, sky, surely_off, worst};

const ALBEDO: f32 = 0.6;
const POWER: f64 = 1000.0;
/// Height of a lamp over the piece of floor that the camera sees.
const HEIGHT: f64 = 10.0;
/// Side of that piece of floor. Straight below a lamp, cosines and distances are the same all over it to 1e-10.
const SIDE: f64 = 1e-4;

pub(super) fn measure(
    studio: &mut Studio<'_>,
    reduced: bool,
    tell: &mut dyn FnMut(Case) -> Result<()>,
) -> Result<()> {
    let (_, floor) = volume([16, 16, 4], |_, _, z| u32::from(z < 2));
    // Points and spots: intensity P / 4π divided by the squared distance.
    let from_point = POWER / (4.0 * PI * HEIGHT * HEIGHT);
    for (name, shape, irradiance) in [
        ("a point of size 0", point(0.0), from_point),
        ("a ball of radius 1e-20", point(1e-20), from_point),
        ("a ball of radius 1e-7", point(1e-7), from_point),
        ("a spot of angle 1e-3", spot(1e-3, 0.0), from_point),
        ("a spot of angle π", spot(PI, 0.0), from_point),
        ("a spot of angle 0", spot(0.0, 0.0), 0.0),
        ("a ball with a spot's angle of 0", spot(0.0, 1.0), 0.0),
        // Radiance P / πA, seen under a small solid angle.
        ("an area of size 1e-6", area(1e-6, PI), POWER / (PI * HEIGHT * HEIGHT)),
        // A beam: irradiance P / A.
        ("a beam of size 1e6", area(1e6, 0.0), POWER / 1e12),
        // Seen in all directions, radiance P / 4π²r².
        ("a ball of radius 1e6 around all", point(1e6), POWER / (4.0 * PI * 1e12)),
    ] {
        let pixels = studio.expose(&under(shape), &floor, 4)?;
        let case = match irradiance {
            0.0 => {
                let light = pixels.iter().flatten().fold(0.0, |m: f64, &v| m.max(v.into()));
                case(name, light, "largest value of a pixel", 0.0, "a cone of no width lets nothing through")
            }
            // Inside a ball both sampling strategies draw directions by the cosine, so there is no noise here either.
            _ => {
                let error = worst(&pixels, f64::from(ALBEDO) / PI * irradiance);
                case(name, error, RELATIVE, 5e-6, "a handful of products in f32")
            }
        };
        tell(case)?;
    }

    // Radiance P / πA from the whole hemisphere: the irradiance is π times that.
    let off =
        mean_off(&studio.expose(&under(area(1e6, PI)), &floor, 64)?, f64::from(ALBEDO) / PI * POWER / 1e12);
    // Uniform directions weighted by a cosine: σ is at most 0.58 of the mean, of which 144 pixels × 64 samples leave 0.6 %.
    let reason = "two standard errors of even directions";
    tell(case("an area of size 1e6", off.abs(), "relative error of the mean", 7e-3, reason))?;
    crowds(studio, &floor, if reduced { 512 } else { 100_000 }, tell)?;
    tilted(studio, &floor, tell)
}

/// A crowd of lamps: name after their number, and position and power of each by its index.
struct Crowd(&'static str, fn(u32) -> [f64; 3], fn(u32) -> f64);

/// Evenly spread numbers from 0 to 1: multiples of powers of an irrational number.
fn spread(i: u32, step: f64) -> f64 {
    (f64::from(i) * step).fract()
}

/// A place over the floor, in a box of this width and height.
fn place(i: u32, width: f64, height: f64) -> [f64; 3] {
    [
        8.0 + width * (spread(i, 0.819_172_513_396_164) - 0.5),
        8.0 + width * (spread(i, 0.671_043_606_703_789) - 0.5),
        12.0 + height * spread(i, 0.549_700_477_901_970),
    ]
}

/// So many points that a tree chooses which of them a sample takes; the floor gets the sum of all.
fn crowds(
    studio: &mut Studio<'_>,
    floor: &Arc<CompressedVolume>,
    lamps: u32,
    tell: &mut dyn FnMut(Case) -> Result<()>,
) -> Result<()> {
    let unequal = |i| 10f64.powf(6.0 * spread(i, 0.618_033_988_749_895) - 3.0);
    let near_and_far = |i| if i == 0 { ABOVE } else { place(i, 2e6, 1e6) };
    for Crowd(name, position, power) in [
        Crowd("points over 2,000 units", |i| place(i, 2000.0, 50.0), |_| POWER),
        Crowd("points of powers from 1e-3 to 1e3", |i| place(i, 2000.0, 50.0), unequal),
        Crowd("points, one near and the others up to 1e6 away", near_and_far, |_| POWER),
        Crowd("points in one place", |_| ABOVE, |_| POWER),
    ] {
        let mut scene = under(point(0.0));
        let light = |i| {
            let shape = LightShape::Point { position: position(i), radius: 0.0, soft_falloff: false };
            Light { shape, power_w: power(i) as f32, color: [1.0; 3], visible_to_camera: false }
        };
        scene.lights = (0..lamps).map(light).collect();
        let seen = DVec3::new(8.0, 8.0, 2.0);
        let irradiance: f64 = (0..lamps)
            .map(|i| {
                let way = DVec3::from_array(position(i)) - seen;
                power(i) * way.z / (4.0 * PI * way.length().powi(3))
            })
            .sum();
        let pixels = studio.expose(&scene, floor, 256)?;
        let off = surely_off(&pixels, f64::from(ALBEDO) / PI * irradiance);
        // (Sums of 256 samples of f32.)
        let reason = "four standard errors off the sum of all; rounding of sums in f32";
        tell(case(&format!("{lamps} {name}"), off, "relative error of the mean", 2e-5, reason))?;
    }
    Ok(())
}

/// The floor mirrored and sheared: the cosine must be that with the normal of the transformed floor.
fn tilted(
    studio: &mut Studio<'_>,
    floor: &Arc<CompressedVolume>,
    tell: &mut dyn FnMut(Case) -> Result<()>,
) -> Result<()> {
    let sheared = DMat3::from_cols_array(&[1.0, 0.2, 0.3, -0.3, 1.1, -0.6, 0.4, 0.0, 0.9]);
    for (name, matrix3) in [
        ("mirrored", DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0))),
        ("turned over", DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0))),
        ("sheared", sheared),
        ("sheared and mirrored", sheared * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0))),
        ("sheared, 1e-6 of its size", sheared * 1e-6),
    ] {
        let place = DAffine3 { matrix3, translation: DVec3::new(3.0, -2.0, 1.0) };
        // Takes the face of the slab that is visible from above.
        let across = matrix3.x_axis.cross(matrix3.y_axis).normalize();
        let normal = across * across.z.signum();
        let top = if normal.dot(matrix3.z_axis) > 0.0 { 2.0 } else { 0.0 };
        let seen = place.transform_point3(DVec3::new(8.0, 8.0, top));
        let lamp = seen + DVec3::new(3.0, -1.0, HEIGHT);
        let shape = LightShape::Point { position: lamp.to_array(), radius: 0.0, soft_falloff: false };
        let scale = matrix3.x_axis.length();
        let mut scene = lit(shape, [seen.x, seen.y], SIDE * scale.min(1.0));
        scene.instances[0].world_from_index = place;
        let way = lamp - seen;
        let cos = way.normalize().dot(normal);
        let expected = f64::from(ALBEDO) / PI * POWER * cos / (4.0 * PI * way.length_squared());
        let error = worst(&studio.expose(&scene, floor, 4)?, expected);
        let name = format!("a point over a floor, {name}");
        // The piece of floor extends 7e-5 from its middle, which is 7e-6 of the distance; the irradiance changes three times as much.
        let reason = "the piece of floor seen is 1e-5 of the distance wide";
        tell(case(&name, error, RELATIVE, 2.5e-5, reason))?;
    }
    Ok(())
}

const RELATIVE: &str = "largest relative error of a pixel";

fn case(name: &str, error: f64, unit: &'static str, bar: f64, reason: &'static str) -> Case {
    Case::new("lamps", name, error, unit, bar, reason)
}

fn lit(shape: LightShape, at: [f64; 2], scale: f64) -> Scene {
    let mut scene = from_above(lambert(ALBEDO), sky(0.0), at, scale);
    scene.settings.mode = Mode::OneBounce;
    scene.lights = vec![Light { shape, power_w: POWER as f32, color: [1.0; 3], visible_to_camera: false }];
    scene
}

fn under(shape: LightShape) -> Scene {
    lit(shape, [8.0, 8.0], SIDE)
}

/// Position of a lamp over the middle of the floor.
const ABOVE: [f64; 3] = [8.0, 8.0, 2.0 + HEIGHT];

fn point(radius: f64) -> LightShape {
    LightShape::Point { position: ABOVE, radius, soft_falloff: false }
}

fn spot(angle_rad: f64, radius: f64) -> LightShape {
    let direction = [0.0, 0.0, -1.0];
    LightShape::Spot { position: ABOVE, direction, radius, angle_rad, blend: 0.0, soft_falloff: false }
}

fn area(side: f64, spread_rad: f64) -> LightShape {
    let world_from_light = DAffine3::from_translation(ABOVE.into());
    LightShape::Area { world_from_light, outline: Outline::Rectangle, size: [side; 2], spread_rad }
}
