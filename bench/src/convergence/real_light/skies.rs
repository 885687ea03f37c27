//! Pictures of skies by formula, so that no picture has to be shipped: equirectangular, +z up, the middle of the picture along +x.

use std::f64::consts::PI;

use glam::DVec3;
use pumice_picture::Image;

/// Pixels across and down.
const SIZE: [usize; 2] = [256, 128];

/// Directions and radiances of the spots; each is as a studio light looks in an HDR picture.
const SPOTS: [([f64; 3], f64); 5] = [
    ([-0.6, -0.5, 0.6], 400.0),
    ([0.8, -0.4, 0.45], 200.0),
    ([0.1, 0.9, 0.4], 120.0),
    ([-0.9, 0.3, 0.3], 80.0),
    ([0.2, -0.3, 0.95], 250.0),
];
/// Radius at which a spot has fallen to 1/e, radians: 1.4 pixels.
const SPOT_RADIUS_RAD: f64 = 0.035;

/// A dim room, lighter above, with five small bright spots. They take a hundredth of the sphere and give about two thirds of the
/// light.
pub(super) fn spots() -> Image {
    drawn(|direction| {
        let room = DVec3::new(0.16, 0.17, 0.19) * (1.0 + 0.6 * direction.z);
        let glow: f64 = SPOTS
            .iter()
            .map(|(towards, radiance)| {
                let apart = direction.angle_between(DVec3::from_array(*towards));
                radiance * (-(apart / SPOT_RADIUS_RAD).powi(2)).exp()
            })
            .sum();
        room + DVec3::new(1.0, 0.96, 0.9) * glow
    })
}

/// A clear sky with its sun in direction `sun`, which itself is left out, over dark ground: the relative luminance of CIE S 011 (2003),
/// type 12, times 0.5 for the zenith; below 2° above the horizon as at 2°. The colour goes from white at the horizon to blue above.
pub(super) fn clear(sun: DVec3) -> Image {
    const A: f64 = -1.0;
    const B: f64 = -0.32;
    const C: f64 = 10.0;
    const D: f64 = -3.0;
    const E: f64 = 0.45;
    let gradation = |cos_zenith: f64| 1.0 + A * (B / cos_zenith.max(0.035)).exp();
    let indicatrix =
        |apart: f64| 1.0 + C * ((D * apart).exp() - (D * PI / 2.0).exp()) + E * apart.cos().powi(2);
    let zenith = gradation(1.0) * indicatrix(sun.angle_between(DVec3::Z));
    drawn(|direction| {
        if direction.z < 0.0 {
            return DVec3::new(0.06, 0.055, 0.05);
        }
        let luminance = 0.5 * gradation(direction.z) * indicatrix(direction.angle_between(sun)) / zenith;
        DVec3::new(1.0, 1.0, 1.0).lerp(DVec3::new(0.5, 0.75, 1.4), direction.z.sqrt()) * luminance
    })
}

/// The picture whose pixels have the radiance of their centres' directions.
fn drawn(radiance: impl Fn(DVec3) -> DVec3) -> Image {
    let [width, height] = SIZE;
    let pixel = |i: usize| {
        let azimuth = (0.5 - ((i % width) as f64 + 0.5) / width as f64) * 2.0 * PI;
        let (sin, cos) = (((i / width) as f64 + 0.5) / height as f64 * PI).sin_cos();
        let light = radiance(DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos));
        light.as_vec3().to_array()
    };
    Image::new(width, height, (0..width * height).map(pixel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use pumice_transport::EnvironmentTable;

    /// The renderer's own table, which shares no code with the drawing, finds each spot where it was put.
    #[test]
    fn light_is_in_the_direction_where_it_was_put() {
        let table = EnvironmentTable::new(spots(), 1.0, 0.0).unwrap();
        for (towards, radiance) in SPOTS {
            let towards = DVec3::from_array(towards);
            let there = f64::from(table.eval(towards).x);
            // Between pixel centres 0.7 pixels away at most, of which bilinear interpolation of the peak keeps more than 3/4.
            assert!(there > 0.75 * radiance && there < 1.1 * radiance, "{towards}: {there}");
            assert!(table.eval(-towards).x < 1.0, "its mirror image is dark");
        }
        let sun = DVec3::new(0.6, 0.0, 0.8);
        let table = EnvironmentTable::new(clear(sun), 1.0, 0.0).unwrap();
        let near = table.eval(sun).y;
        assert!(near > table.eval(DVec3::new(-0.6, 0.0, 0.8)).y * 2.0 && table.eval(-sun).y < 0.1);
        // The zenith has half of a unit, bluish: 0.5 × 0.75 in green.
        assert!((table.eval(DVec3::Z).y - 0.375).abs() < 0.02, "{}", table.eval(DVec3::Z).y);
    }

    /// Numerically: the spots give more than 0.6 of the light of the sphere from 0.02 of it.
    #[test]
    fn spots_give_most_of_the_light_from_little_of_the_sphere() {
        let image = spots();
        let (mut bright, mut all, mut area, mut sphere) = (0.0, 0.0, 0.0, 0.0);
        for (i, pixel) in image.pixels.iter().enumerate() {
            let solid = (((i / image.width) as f64 + 0.5) / image.height as f64 * PI).sin();
            let light = f64::from(pixel[1]) * solid;
            (all, sphere) = (all + light, sphere + solid);
            if pixel[1] > 1.0 {
                (bright, area) = (bright + light, area + solid);
            }
        }
        assert!(bright / all > 0.6 && area / sphere < 0.02, "{} from {}", bright / all, area / sphere);
    }
}
