//! Light from an equirectangular picture: radiance of a direction, and directions drawn in proportion to it.
//!
//! ```text
//!            u = 0      ¼      ½      ¾      1          u = ½ − atan2(d.y, d.x) / 2π      (Cycles' direction_to_equirectangular)
//!   v = 1    ┌──────────── +z ────────────┐  row 0      v = ½ + atan2(d.z, hypot(d.x, d.y)) / π
//!            │ −x     +y     +x     −y    │
//!   v = 0    └──────────── −z ────────────┘  last row   rows of the picture run from the top
//! ```
//! A pixel is one constant: its texel is the rectangle of (u, v) that it covers, its solid angle is exact,
//! 2π / width · (sin of upper elevation − sin of lower). The light is drawn in two steps, a row by its share of the whole, a pixel
//! by its share of the row, then a point evenly within the texel's solid angle; so pdf is share / solid angle, the same
//! everywhere in a texel, and `radiance` and `pdf` agree at every direction: nothing is blended between pixels (Pharr, Jakob,
//! Humphreys, *Physically Based Rendering*, 4th ed., §12.5, but with exact solid angles in the place of sin θ at the middle).
//!
//! `rotation_rad` turns the light about +z, counter-clockwise seen from above: with +π/2, what the picture shows at +x comes
//! from +y.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;

use glam::DVec3;

use crate::{Image, PictureError, read_exr};

/// Numbers in [0, 1) stay below this: the greatest f64 below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// A direction towards the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentSample {
    /// Unit vector away from the scene, world space.
    pub direction: DVec3,
    /// Radiance from there.
    pub radiance: [f32; 3],
    /// Density per steradian, above 0.
    pub pdf: f32,
}

/// An image that lights from infinity, ready to be sampled.
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    image: Image,
    strength: f32,
    rotation_rad: f64,
    /// Height + 1: share of the light above each row.
    rows: Vec<f64>,
    /// Height × (width + 1): share of the row's light left of each column.
    columns: Vec<f64>,
    /// Height + 1: sine of the elevation of each row's upper edge, 1 to −1.
    sin_edges: Vec<f64>,
}

impl EnvironmentMap {
    /// Loads an OpenEXR picture.
    ///
    /// # Errors
    /// As [`read_exr`]; [`PictureError::File`] for what [`Self::new`] refuses.
    pub fn load(path: &Path, rotation_rad: f64, strength: f32) -> Result<Self, PictureError> {
        let picture = read_exr(path)?;
        Self::new(picture.color, rotation_rad, strength)
            .map_err(|what| PictureError::File { path: path.to_owned(), what })
    }

    /// Prepares a picture of linear Rec. 709 radiance. A picture that is black all over lights nothing, but is no error: see
    /// [`Self::is_black`].
    ///
    /// # Errors
    /// One line that names the first pixel (from the top left, 0) that is negative, infinite or not a number, or says that
    /// rotation or strength are.
    pub fn new(image: Image, rotation_rad: f64, strength: f32) -> Result<Self, String> {
        if !rotation_rad.is_finite() {
            return Err(format!("environment: expected a finite rotation, got {rotation_rad}"));
        }
        if !strength.is_finite() || strength < 0.0 {
            return Err(format!("environment: expected a finite strength of 0 or more, got {strength}"));
        }
        if image.pixels.is_empty() {
            return Err("environment: the picture has no pixels".into());
        }
        let bad = |p: &[f32; 3]| p.iter().any(|v| !v.is_finite() || *v < 0.0 || !(v * strength).is_finite());
        if let Some(i) = image.pixels.iter().position(bad) {
            let (x, y, [r, g, b]) = (i % image.width, i / image.width, image.pixels[i]);
            return Err(format!(
                "environment: expected finite radiance of 0 or more, got ({r}, {g}, {b}) × {strength} at pixel ({x}, {y})"
            ));
        }
        let elevation_rad = |row: usize| FRAC_PI_2 - PI * row as f64 / image.height as f64;
        let sin_edges: Vec<f64> = (0..=image.height).map(|row| elevation_rad(row).sin()).collect();
        let mut columns = Vec::with_capacity(image.height * (image.width + 1));
        let mut rows = Vec::with_capacity(image.height + 1);
        let mut above = 0.0;
        rows.push(0.0);
        for (y, pixels) in image.pixels.chunks_exact(image.width).enumerate() {
            let of_row = cumulate(&mut columns, pixels.iter().map(|&p| luminance(p)));
            above += of_row * (sin_edges[y] - sin_edges[y + 1]);
            rows.push(above);
        }
        normalize(&mut rows);
        Ok(Self { image, strength, rotation_rad, rows, columns, sin_edges })
    }

    /// Whether no direction has light: there is nothing to sample.
    pub fn is_black(&self) -> bool {
        self.strength == 0.0 || self.rows[self.image.height] == 0.0
    }

    /// Radiance from a direction, of any length above 0.
    pub fn radiance(&self, direction: DVec3) -> [f32; 3] {
        let [x, y] = self.texel(direction);
        self.image.pixels[y * self.image.width + x].map(|v| v * self.strength)
    }

    /// A direction drawn in proportion to the luminance, for two numbers in [0, 1); `None` where [`Self::is_black`].
    pub fn sample(&self, u: [f64; 2]) -> Option<EnvironmentSample> {
        if self.is_black() {
            return None;
        }
        let (y, down) = draw(&self.rows, u[1]);
        let (x, across) = draw(self.row(y), u[0]);
        let sin_elevation = self.sin_edges[y] + down * (self.sin_edges[y + 1] - self.sin_edges[y]);
        let azimuth_rad = TAU * (0.5 - (x as f64 + across) / self.image.width as f64) + self.rotation_rad;
        let cos_elevation = (1.0 - sin_elevation * sin_elevation).max(0.0).sqrt();
        let (sin, cos) = azimuth_rad.sin_cos();
        Some(EnvironmentSample {
            direction: DVec3::new(cos_elevation * cos, cos_elevation * sin, sin_elevation),
            radiance: self.image.pixels[y * self.image.width + x].map(|v| v * self.strength),
            pdf: self.pdf_of_texel(x, y),
        })
    }

    /// Density per steradian with which [`Self::sample`] gives a direction; 0 where it gives none.
    pub fn pdf(&self, direction: DVec3) -> f32 {
        if self.is_black() {
            return 0.0;
        }
        let [x, y] = self.texel(direction);
        self.pdf_of_texel(x, y)
    }

    /// The two numbers for which [`Self::sample`] gives a direction; `None` where its density is 0.
    pub fn invert_sample(&self, direction: DVec3) -> Option<[f64; 2]> {
        let [x, y] = self.texel(direction);
        if self.pdf(direction) == 0.0 {
            return None;
        }
        let (u, _) = self.uv(direction);
        let across = u * self.image.width as f64 - x as f64;
        let sin_elevation = direction.z / direction.length();
        let down = (self.sin_edges[y] - sin_elevation) / (self.sin_edges[y] - self.sin_edges[y + 1]);
        let back = |cdf: &[f64], i: usize, t: f64| cdf[i] + t.clamp(0.0, 1.0) * (cdf[i + 1] - cdf[i]);
        Some([back(self.row(y), x, across), back(&self.rows, y, down)])
    }

    fn row(&self, y: usize) -> &[f64] {
        let entries = self.image.width + 1;
        &self.columns[y * entries..(y + 1) * entries]
    }

    fn pdf_of_texel(&self, x: usize, y: usize) -> f32 {
        let row = self.row(y);
        let share = (self.rows[y + 1] - self.rows[y]) * (row[x + 1] - row[x]);
        let solid_angle = TAU / self.image.width as f64 * (self.sin_edges[y] - self.sin_edges[y + 1]);
        (share / solid_angle) as f32
    }

    /// (u, v) of a direction, u in [0, 1), v in [0, 1].
    fn uv(&self, d: DVec3) -> (f64, f64) {
        let azimuth_rad = d.y.atan2(d.x) - self.rotation_rad;
        let u = (0.5 - azimuth_rad / TAU).rem_euclid(1.0).min(BELOW_ONE);
        (u, 0.5 + d.z.atan2(d.x.hypot(d.y)) / PI)
    }

    /// Column and row of the pixel that a direction meets.
    fn texel(&self, d: DVec3) -> [usize; 2] {
        let (u, v) = self.uv(d);
        let at = |t: f64, n: usize| ((t * n as f64) as usize).min(n - 1);
        [at(u, self.image.width), at(1.0 - v, self.image.height)]
    }
}

/// Rec. 709 luminance (ITU-R BT.709-6 §3).
fn luminance([r, g, b]: [f32; 3]) -> f64 {
    0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
}

/// Appends the running sums of `weights` from 0 on, as shares of their sum, which it gives back.
fn cumulate(cdf: &mut Vec<f64>, weights: impl Iterator<Item = f64>) -> f64 {
    let first = cdf.len();
    let mut sum = 0.0;
    cdf.push(sum);
    for weight in weights {
        sum += weight;
        cdf.push(sum);
    }
    normalize(&mut cdf[first..]);
    sum
}

/// Divides running sums by the last, where that is above 0.
fn normalize(cdf: &mut [f64]) {
    let sum = cdf.last().copied().unwrap_or(0.0);
    if sum > 0.0 {
        cdf.iter_mut().for_each(|c| *c /= sum);
    }
}

/// The step of a CDF, one with a share above 0, that `u` falls into, and how far into it, in [0, 1).
fn draw(cdf: &[f64], u: f64) -> (usize, f64) {
    let u = u.clamp(0.0, BELOW_ONE);
    // The first entry is 0 and the last 1: entry i is the last that is at most u, so entry i + 1 lies above it.
    let i = cdf.partition_point(|&c| c <= u) - 1;
    (i, ((u - cdf[i]) / (cdf[i + 1] - cdf[i])).min(BELOW_ONE))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Passes, Picture, write_exr};

    struct Random(u64);

    impl Random {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }
        fn direction(&mut self) -> DVec3 {
            let (z, a) = (2.0 * self.unit() - 1.0, TAU * self.unit());
            DVec3::new((1.0 - z * z).sqrt() * a.cos(), (1.0 - z * z).sqrt() * a.sin(), z)
        }
    }

    /// A picture of random colours with some black pixels, a black row and a bright sun.
    fn noise(width: usize, height: usize) -> Image {
        let mut random = Random(3);
        let pixel = |i: usize| {
            let dark = random.unit() < 0.2 || i / width == 2;
            [0; 3].map(|_| if dark { 0.0 } else { random.unit() as f32 })
        };
        let mut image = Image::new(width, height, (0..width * height).map(pixel).collect());
        image.pixels[width + 3] = [9.0, 8.0, 7.0];
        image
    }

    /// Column and row of a direction, as the module's drawing says, in degrees.
    fn naive_texel(d: DVec3, width: usize, height: usize) -> [usize; 2] {
        let azimuth_deg = d.y.atan2(d.x).to_degrees();
        let elevation_deg = d.z.clamp(-1.0, 1.0).asin().to_degrees();
        let x = (180.0 - azimuth_deg) / 360.0 * width as f64;
        let y = (90.0 - elevation_deg) / 180.0 * height as f64;
        [(x as usize).min(width - 1), (y as usize).min(height - 1)]
    }

    #[test]
    fn directions_meet_the_pixels_that_cycles_shows() {
        let image = Image::new(8, 2, (0..16).map(|i| [i as f32, 0.0, 0.0]).collect());
        let map = EnvironmentMap::new(image, 0.0, 2.0).unwrap();
        let red = |x: f64, y: f64, z: f64| map.radiance(DVec3::new(x, y, z))[0] / 2.0;
        // Just either side of each axis, above and below the horizon.
        assert_eq!([red(1.0, 0.1, 0.1), red(1.0, -0.1, 0.1)], [3.0, 4.0], "+x is the centre");
        assert_eq!([red(0.1, 1.0, 0.1), red(-0.1, 1.0, 0.1)], [2.0, 1.0], "+y is a quarter from the left");
        assert_eq!([red(-1.0, 0.1, -0.1), red(-1.0, -0.1, -0.1)], [8.0, 15.0], "−x is the seam");
        assert_eq!(
            [red(-0.1, -1.0, -0.1), red(0.1, -1.0, -0.1)],
            [14.0, 13.0],
            "−y is a quarter from the right"
        );
        assert!(red(0.0, 0.0, 1.0) < 8.0 && red(0.0, 0.0, -1.0) >= 8.0);
        assert!(red(-1.0, 0.0, 0.0).is_finite() && red(-1.0, -0.0, 0.0).is_finite());

        let image = noise(37, 19);
        let map = EnvironmentMap::new(image.clone(), 0.0, 1.0).unwrap();
        let mut random = Random(5);
        for _ in 0..10_000 {
            let d = random.direction();
            let [x, y] = naive_texel(d, 37, 19);
            assert_eq!(map.radiance(d * 7.5), image.pixels[y * 37 + x], "{d}");
        }
    }

    #[test]
    fn rotation_turns_the_light_counter_clockwise() {
        let still = EnvironmentMap::new(noise(16, 8), 0.0, 1.0).unwrap();
        let turned = EnvironmentMap::new(noise(16, 8), FRAC_PI_2, 1.0).unwrap();
        let mut random = Random(9);
        for _ in 0..1000 {
            let d = random.direction();
            let by_quarter = DVec3::new(-d.y, d.x, d.z);
            assert_eq!(turned.radiance(by_quarter), still.radiance(d));
            assert_eq!(turned.pdf(by_quarter), still.pdf(d));
        }
    }

    #[test]
    fn sample_pdf_and_invert_agree() {
        for rotation_rad in [0.0, 1.0, -40.0] {
            let map = EnvironmentMap::new(noise(16, 8), rotation_rad, 3.0).unwrap();
            let mut random = Random(11);
            for _ in 0..20_000 {
                let u = [random.unit(), random.unit()];
                let s = map.sample(u).unwrap();
                assert!((s.direction.length() - 1.0).abs() < 1e-14);
                assert!(s.pdf > 0.0 && s.radiance.iter().any(|&v| v > 0.0));
                assert_eq!((map.pdf(s.direction), map.radiance(s.direction)), (s.pdf, s.radiance), "{u:?}");
                let back = map.invert_sample(s.direction).unwrap();
                // The shares of steps here are above 1e-4 and angles carry some 1e-16, near the poles 1e-11.
                assert!((0..2).all(|a| (back[a] - u[a]).abs() < 1e-9), "{u:?} → {back:?}");
            }
            for u in [[0.0, 0.0], [1.0, 1.0], [0.0, BELOW_ONE], [BELOW_ONE, 0.0]] {
                let s = map.sample(u).unwrap();
                assert!(s.pdf > 0.0 && s.direction.is_finite(), "{u:?}");
            }
        }
    }

    /// Sum over a fine grid of directions of pdf · dω, which shares neither shares nor solid angles with the map.
    #[test]
    fn the_density_integrates_to_one() {
        let map = EnvironmentMap::new(noise(16, 8), 0.3, 1.0).unwrap();
        // The grid's cells divide the texels (8 · 80 rows, 16 · 20 columns, turned by the rotation), so that each is constant.
        let (rows, columns) = (640, 320);
        let mut sum = 0.0;
        for i in 0..rows {
            let elevation = FRAC_PI_2 - PI * (i as f64 + 0.5) / rows as f64;
            for k in 0..columns {
                let azimuth = TAU * (k as f64 + 0.5) / columns as f64 + 0.3;
                let (cos, sin) = (elevation.cos(), elevation.sin());
                let d = DVec3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
                sum += f64::from(map.pdf(d)) * cos * (PI / rows as f64) * (TAU / columns as f64);
            }
        }
        // Midpoints err by (π / 640)² / 24 = 1.0e-6 relative.
        assert!((sum - 1.0).abs() < 2e-6, "{sum}");
    }

    /// χ² of directions in bins of a quarter texel each against luminance × solid angle, `weight` giving the latter.
    fn chi_square(
        map: &EnvironmentMap,
        image: &Image,
        solid_angle: impl Fn(f64, f64) -> f64,
    ) -> (f64, usize) {
        let (width, height) = (image.width, image.height);
        let mut counts = vec![0u32; 4 * width * height];
        let mut random = Random(17);
        let samples = 400_000;
        for _ in 0..samples {
            let d = map.sample([random.unit(), random.unit()]).unwrap().direction;
            let [x, y] = naive_texel(d, 2 * width, 2 * height);
            counts[y * 2 * width + x] += 1;
        }
        let expected: Vec<f64> = (0..counts.len())
            .map(|i| {
                let (x, y) = (i % (2 * width), i / (2 * width));
                let edge = |row: usize| FRAC_PI_2 - PI * row as f64 / (2 * height) as f64;
                let [r, g, b] = image.pixels[y / 2 * width + x / 2].map(f64::from);
                (0.2126 * r + 0.7152 * g + 0.0722 * b) * solid_angle(edge(y), edge(y + 1))
            })
            .collect();
        let total: f64 = expected.iter().sum();
        let (mut statistic, mut bins) = (0.0, 0usize);
        for (&count, e) in counts.iter().zip(expected.iter().map(|e| e / total * f64::from(samples))) {
            if e == 0.0 {
                assert_eq!(count, 0, "a sample where there is no light");
            } else if e >= 5.0 {
                statistic += (f64::from(count) - e).powi(2) / e;
                bins += 1;
            }
        }
        (statistic, bins - 1)
    }

    /// Above this a χ² statistic is at level 1e-4: the normal quantile 3.719 in Wilson and Hilferty's 1931 approximation.
    fn critical(freedom: usize) -> f64 {
        let t = 2.0 / (9.0 * freedom as f64);
        freedom as f64 * (1.0 - t + 3.719 * t.sqrt()).powi(3)
    }

    #[test]
    fn samples_follow_luminance_and_solid_angle() {
        let image = noise(16, 8);
        let map = EnvironmentMap::new(image.clone(), 0.0, 1.0).unwrap();
        let (statistic, freedom) = chi_square(&map, &image, |upper, lower| upper.sin() - lower.sin());
        assert!(freedom > 250, "{freedom}");
        assert!(statistic < critical(freedom), "χ² {statistic}, {freedom} degrees of freedom");
        // Negative control: rows taken as flat strips, as if solid angles within a texel were even in elevation.
        let strip = |upper: f64, _: f64| {
            let row = ((FRAC_PI_2 - upper) / PI * 8.0 + 1e-9).floor();
            (FRAC_PI_2 - PI * row / 8.0).sin() - (FRAC_PI_2 - PI * (row + 1.0) / 8.0).sin()
        };
        let (statistic, freedom) = chi_square(&map, &image, strip);
        assert!(statistic > 10.0 * critical(freedom), "the check would miss it: χ² {statistic}");
    }

    #[test]
    fn a_sun_in_one_pixel_is_found() {
        let mut image = Image::new(512, 256, vec![[0.5; 3]; 512 * 256]);
        image.pixels[40 * 512 + 77] = [1e8; 3];
        let map = EnvironmentMap::new(image, 0.0, 1.0).unwrap();
        let mut random = Random(23);
        let (mut hits, mut least, mut most) = (0, f64::INFINITY, 0.0f64);
        for _ in 0..20_000 {
            let s = map.sample([random.unit(), random.unit()]).unwrap();
            hits += usize::from(s.radiance[0] == 1e8);
            let estimate = f64::from(s.radiance[0]) / f64::from(s.pdf);
            (least, most) = (least.min(estimate), most.max(estimate));
        }
        // Grey light drawn by luminance: each sample alone is the whole integral, to the rounding of f32.
        assert!(most / least - 1.0 < 1e-6, "{least} to {most}");
        // Solid angle of the sun's texel: 2π/512 · (sin of its edges' elevations apart), 7.1e-5 sr; of the sky 4π · 0.5.
        let (upper, lower) = (FRAC_PI_2 - PI * 40.0 / 256.0, FRAC_PI_2 - PI * 41.0 / 256.0);
        let sun = 1e8 * TAU / 512.0 * (upper.sin() - lower.sin());
        assert!((least / (sun + 0.5 * (4.0 * PI)) - 1.0).abs() < 1e-5, "{least}");
        assert!(hits > 19_900, "{hits} of 20,000 at the sun, which has 99.9 % of the light");
    }

    #[test]
    fn black_lights_nothing() {
        let black = EnvironmentMap::new(Image::new(4, 2, vec![[0.0; 3]; 8]), 0.0, 1.0).unwrap();
        let unlit = EnvironmentMap::new(noise(4, 4), 0.0, 0.0).unwrap();
        for map in [black, unlit] {
            assert!(map.is_black());
            assert_eq!(map.sample([0.5, 0.5]), None);
            assert_eq!((map.radiance(DVec3::X), map.pdf(DVec3::X)), ([0.0; 3], 0.0));
            assert_eq!(map.invert_sample(DVec3::X), None);
        }
    }

    #[test]
    fn odd_pixels_are_refused_by_name() {
        let with = |value: f32| {
            let mut image = noise(8, 4);
            image.pixels[2 * 8 + 5][1] = value;
            image
        };
        for value in [f32::NAN, f32::INFINITY, -1e-9] {
            let error = EnvironmentMap::new(with(value), 0.0, 1.0).unwrap_err();
            assert!(error.ends_with("at pixel (5, 2)") && !error.contains('\n'), "{error}");
        }
        assert!(EnvironmentMap::new(with(1e30), 0.0, 1e30).unwrap_err().ends_with("at pixel (5, 2)"));
        assert!(EnvironmentMap::new(noise(8, 4), f64::NAN, 1.0).is_err());
        assert!(EnvironmentMap::new(noise(8, 4), 0.0, -1.0).is_err());

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        let picture = |color| Picture {
            color,
            variance: None,
            depth: None,
            label: None,
            albedo: None,
            normal: None,
            provenance: None,
        };
        write_exr(&path, &picture(with(-1.0)), &Passes::NONE).unwrap();
        let error = EnvironmentMap::load(&path, 0.0, 1.0).unwrap_err().to_string();
        assert!(error.contains("sky.exr") && error.contains("pixel (5, 2)"), "{error}");
        write_exr(&path, &picture(noise(8, 4)), &Passes::NONE).unwrap();
        let map = EnvironmentMap::load(&path, 0.0, 1.0).unwrap();
        assert_eq!(map.radiance(DVec3::new(1.0, 1e-3, 0.1)), noise(8, 4).pixels[8 + 3]);
    }
}
