//! An equirectangular picture of the surroundings, and the distribution that samples directions from it.
//!
//! **Directions.** As Cycles' `direction_to_equirectangular`: u = ½ − atan2(y, x) / 2π, v = 1 − acos(z) / π with v = 1 in the first row.
//! The middle of the picture is seen along +x, its left quarter along +y, and its first row is up (+z). `rotation_rad` rotates the picture
//! about +z, counter-clockwise as seen from above: a Mapping node (Point) before Blender's Environment Texture that rotates about z by θ is
//! a rotation of −θ. (Cycles 5.0.1 agrees in nine views, six straight and three rotated by 0.7, to 1.2e-3 at most, which is the
//! interpolation error between the pixels of a sine 64 wide.)
//!
//! ```text
//!        u = 0        ¼         ½         ¾         1
//! row 0  ┌────────────┬─────────┬─────────┬─────────┐  +z
//!        │−x         +y        +x        −y       −x│  horizon in the middle
//! last   └────────────┴─────────┴─────────┴─────────┘  −z
//! ```
//! **Sampling.** Values are interpolated linearly between pixel centres (wrapping in u, clamped at the poles). Directions are sampled by
//! brightness, the largest channel, *above the mean* over all directions: what lies below the mean is left to BSDF sampling, which finds
//! even light better than a map can, and MIS weights both (Karlík et al. 2019, *MIS Compensation*). Under a picture with small bright spots
//! over a floor that halves the variance. A picture that is nearly even is not sampled at all.
//!
//! The cells between pixel centres, `height` + 1 rows of `width`, are chosen by their excess times their solid angle, and the place within a
//! cell by inverting the two linear cdfs, so the density follows the interpolated excess: a bright spot one pixel wide adds no variance of
//! its own. It does so per row and column, not per solid angle, which differ by the sine of the polar angle; the density divides by it.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use pumice_core::NoMemory;
use pumice_core::reserve::reserved;
use pumice_picture::image::Image;

use crate::cdf_guide::CdfGuide;
use crate::sky_irradiance::SkyIrradiance;

/// A picture with its sampling distribution (see the module).
#[derive(Clone, Debug)]
pub struct EnvironmentTable {
    /// The picture, in scene-linear values.
    pub image: Image,
    /// Factor on the picture's values.
    pub strength: f32,
    /// Rotation, counter-clockwise about +z.
    pub rotation_rad: f64,
    /// Brightness above which directions are sampled, without `strength`: the mean over all.
    pub floor: f32,
    /// Irradiance of the light above the mean, for choosing among lights; 0 where nothing is sampled.
    pub irradiance: SkyIrradiance,
    /// Cumulative probabilities of rows of cells: height + 2 entries from 0 to 1.
    pub row_cdf: Vec<f64>,
    /// Cumulative probabilities within each row of cells: width + 1 entries from 0 to 1.
    pub column_cdf: Vec<f32>,
    /// Of each row of cells, the density per solid angle where the brightness (without `strength`) and the sine of the polar angle are 1.
    pub row_density: Vec<f32>,
    /// To the rows, and to the columns of each row.
    guides: [CdfGuide; 2],
}

/// A picture with less than this part of its light above the mean is not sampled.
const EVEN: f64 = 1e-3;

/// Sine of the polar angle by which densities are divided where the true one is smaller: keeps them finite at the poles.
const LEAST_SINE: f64 = 1e-6;

impl EnvironmentTable {
    /// Builds the distribution of a scene-linear picture.
    ///
    /// # Errors
    /// Names a pixel that is negative or not finite; or says that the picture has no pixels, no light, or too little memory.
    pub fn new(image: Image, strength: f32, rotation_rad: f64) -> Result<Self, String> {
        let (width, height) = (image.width, image.height);
        let of_row = |y: usize| {
            let row = &image.pixels[y * width..][..width];
            let sum: f64 = row.iter().map(|p| f64::from(Vec3::from_array(*p).max_element())).sum();
            sum * pixel_solid_angle(y, width, height)
        };
        let mean = (0..height).map(of_row).sum::<f64>() / (4.0 * PI);
        Self::above(mean.clamp(0.0, f64::from(f32::MAX)) as f32, image, strength, rotation_rad)
    }

    /// [`EnvironmentTable::new`] with another brightness than the mean above which directions are sampled: above 0 are all with light.
    ///
    /// # Errors
    /// As [`EnvironmentTable::new`].
    pub fn above(floor: f32, image: Image, strength: f32, rotation_rad: f64) -> Result<Self, String> {
        let (width, height) = (image.width, image.height);
        if width == 0 || height == 0 {
            return Err("expected at least one pixel, got none".into());
        }
        if let Some(i) = image.pixels.iter().position(|p| p.iter().any(|v| !v.is_finite() || *v < 0.0)) {
            return Err(format!(
                "expected finite radiance of at least 0, got {:?} in pixel ({}, {})",
                image.pixels[i],
                i % width,
                i / width
            ));
        }
        if !image.pixels.iter().flatten().any(|v| *v > 0.0) {
            return Err("expected a pixel brighter than 0, got none".into());
        }
        let brightness = |x: usize, y: usize| {
            (Vec3::from_array(image.pixels[y * width + x]).max_element() - floor).max(0.0)
        };
        let no_memory = |e: NoMemory| e.to_string();
        let what = "the distribution of the picture's light";
        let mut column_cdf = reserved((width + 1) * (height + 1), what).map_err(no_memory)?;
        let mut row_weights = Vec::with_capacity(height + 1);
        for row in 0..=height {
            let (top, bottom) = rows_around(row, height);
            let of_column = |x: usize| f64::from(brightness(x, top)) + f64::from(brightness(x, bottom));
            let of_cell = |x: usize| 0.25 * (of_column(x) + of_column((x + 1) % width));
            let sum: f64 = (0..width).map(of_cell).sum();
            let mut end = 0.0;
            column_cdf.push(0.0);
            for x in 0..width {
                end += of_cell(x);
                column_cdf.push(if x + 1 == width || sum == 0.0 { 1.0 } else { (end / sum) as f32 });
            }
            row_weights.push(sum * cell_solid_angle(row, width, height));
        }
        let total: f64 = row_weights.iter().sum();
        let is_even = total <= EVEN * 4.0 * PI * f64::from(floor);
        let mut row_cdf = vec![0.0];
        let mut end = 0.0;
        for weight in &row_weights {
            end += if is_even { 0.0 } else { weight / total };
            row_cdf.push(end);
        }
        row_cdf[height + 1] = 1.0;
        let row_density = (0..=height)
            .map(|row| {
                let [above, below] = row_angles(row, height);
                let sine = (above.cos() - below.cos()) / (below - above);
                if is_even { 0.0 } else { (sine / total) as f32 }
            })
            .collect();
        let of_rows = CdfGuide::new([&row_cdf[1..=height]].into_iter(), height, what);
        let columns = column_cdf.chunks_exact(width + 1).map(|row| &row[1..width]);
        let of_columns = CdfGuide::new(columns, width, what);
        let guides = [of_rows.map_err(no_memory)?, of_columns.map_err(no_memory)?];
        let mean = if is_even { 0.0 } else { (total / 4.0) as f32 * strength };
        let columns: Vec<(f64, f64)> =
            (0..width).map(|x| azimuth_of(x as f64 + 0.5, width, rotation_rad).sin_cos()).collect();
        let light = (0..height).flat_map(|y| {
            let (sin, z) = (PI * (y as f64 + 0.5) / height as f64).sin_cos();
            let solid_angle = pixel_solid_angle(y, width, height);
            let weight = move |x: usize| f64::from(brightness(x, y)) * solid_angle;
            columns.iter().zip(0..).map(move |((s, c), x)| (DVec3::new(sin * c, sin * s, z), weight(x)))
        });
        let irradiance = SkyIrradiance::new(mean, light);
        Ok(Self {
            image,
            strength,
            rotation_rad,
            floor,
            irradiance,
            row_cdf,
            column_cdf,
            row_density,
            guides,
        })
    }

    /// Picture coordinates of a direction: pixels from the left and from the top.
    #[inline]
    fn place(&self, direction: DVec3) -> (f64, f64) {
        let azimuth = direction.y.atan2(direction.x) - self.rotation_rad;
        let u = 0.5 - azimuth / (2.0 * PI);
        // (`rem_euclid(1.0)`, without its division.)
        let rest = if u.abs() < 1e15 { u - (u as i64) as f64 } else { u % 1.0 };
        let u = if rest < 0.0 { rest + 1.0 } else { rest };
        let v = (direction.z / direction.length()).clamp(-1.0, 1.0).acos() / PI;
        (u * self.image.width as f64, v * self.image.height as f64)
    }

    /// Radiance from a direction, whose length may be any above 0.
    #[inline]
    pub fn eval(&self, direction: DVec3) -> Vec3 {
        let (x, y) = self.place(direction);
        self.between(x, y)
    }

    /// [`EnvironmentTable::eval`] and [`EnvironmentTable::pdf`] of one direction at once.
    #[inline]
    pub fn eval_with_pdf(&self, direction: DVec3) -> (Vec3, f32) {
        let (x, y) = self.place(direction);
        let (pixels, place) = self.around(x, y);
        let sine = direction.truncate().length() / direction.length();
        let pdf = self.density(bilinear(pixels.map(|p| self.excess(p)), place), y, sine);
        (bilinear(pixels, place) * self.strength, pdf)
    }

    /// The pixels around a place in the picture, upper left, upper right, lower left, lower right, without `strength`; and the place among
    /// them, from 0 to 1.
    #[inline]
    fn around(&self, x: f64, y: f64) -> ([Vec3; 4], [f32; 2]) {
        let (width, height) = (self.image.width, self.image.height);
        let (x, y) = (x - 0.5, (y - 0.5).clamp(0.0, (height - 1) as f64));
        let (x0, y0) = (x.floor(), y.floor());
        let left = if x0 < 0.0 { width - 1 } else { (x0 as usize).min(width - 1) };
        let right = if left + 1 == width { 0 } else { left + 1 };
        let (top, bottom) = (y0 as usize, (y0 as usize + 1).min(height - 1));
        let at = |x: usize, y: usize| Vec3::from_array(self.image.pixels[y * width + x]);
        (
            [at(left, top), at(right, top), at(left, bottom), at(right, bottom)],
            [(x - x0) as f32, (y - y0) as f32],
        )
    }

    fn between(&self, x: f64, y: f64) -> Vec3 {
        let (pixels, place) = self.around(x, y);
        bilinear(pixels, place) * self.strength
    }

    /// Brightness of a pixel above the mean.
    #[inline]
    fn excess(&self, pixel: Vec3) -> f32 {
        (pixel.max_element() - self.floor).max(0.0)
    }

    /// Density at a place in the picture whose polar angle has this sine.
    #[inline]
    fn density(&self, brightness: f32, y: f64, sine: f64) -> f32 {
        let row = ((y + 0.5) as usize).min(self.image.height);
        (f64::from(brightness * self.row_density[row]) / sine.max(LEAST_SINE)) as f32
    }

    /// Density per solid angle with which [`EnvironmentTable::sample`] samples a direction.
    #[inline]
    pub fn pdf(&self, direction: DVec3) -> f32 {
        self.eval_with_pdf(direction).1
    }

    /// Samples a unit direction; returns it with its radiance and its density per solid angle.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> (DVec3, Vec3, f32) {
        let (width, height) = (self.image.width, self.image.height);
        let v = f64::from(u[1]);
        let [of_rows, of_columns] = &self.guides;
        let row = of_rows.count_up_to(0, &self.row_cdf[1..=height], v);
        let in_row =
            ((v - self.row_cdf[row]) / (self.row_cdf[row + 1] - self.row_cdf[row])).clamp(0.0, 1.0) as f32;
        let ends = &self.column_cdf[row * (width + 1)..][..=width];
        let left = of_columns.count_up_to(row, &ends[1..width], f64::from(u[0]));
        let in_column = ((u[0] - ends[left]) / (ends[left + 1] - ends[left])).clamp(0.0, 1.0);
        let (top, bottom) = rows_around(row, height);
        let right = if left + 1 == width { 0 } else { left + 1 };
        let at = |x: usize, y: usize| Vec3::from_array(self.image.pixels[y * width + x]);
        let pixels = [at(left, top), at(right, top), at(left, bottom), at(right, bottom)];
        let [a, b, c, d] = pixels.map(|p| self.excess(p));
        let fy = sample_linear(a + b, c + d, in_row);
        let fx = sample_linear(a + (c - a) * fy, b + (d - b) * fy, in_column);
        let [above, below] = row_angles(row, height);
        let polar = above + (below - above) * f64::from(fy);
        let place_x = left as f64 + 0.5 + f64::from(fx);
        let azimuth = azimuth_of(place_x, width, self.rotation_rad);
        let ((sin, z), (s, c)) = (polar.sin_cos(), azimuth.sin_cos());
        let radiance = bilinear(pixels, [fx, fy]) * self.strength;
        let brightness = bilinear(pixels.map(|p| self.excess(p)), [fx, fy]);
        let pdf = (f64::from(brightness * self.row_density[row]) / sin.max(LEAST_SINE)) as f32;
        (DVec3::new(sin * c, sin * s, z), radiance, pdf)
    }
}

/// The angle from +x to the direction of a place in a picture of this width.
#[inline]
fn azimuth_of(place_x: f64, width: usize, rotation_rad: f64) -> f64 {
    (0.5 - place_x / width as f64) * 2.0 * PI + rotation_rad
}

/// Polar angles of the upper and the lower border of a row of cells.
fn row_angles(row: usize, height: usize) -> [f64; 2] {
    let angle = |y: f64| PI * y.clamp(0.0, height as f64) / height as f64;
    [angle(row as f64 - 0.5), angle(row as f64 + 0.5)]
}

/// The rows of pixels above and below a row of cells; at the poles they are the same.
#[inline]
fn rows_around(row: usize, height: usize) -> (usize, usize) {
    (row.saturating_sub(1), row.min(height - 1))
}

/// Solid angle of one cell of a row of cells.
fn cell_solid_angle(row: usize, width: usize, height: usize) -> f64 {
    let [above, below] = row_angles(row, height);
    2.0 * PI / width as f64 * (above.cos() - below.cos())
}

/// Bilinear interpolation of upper left, upper right, lower left, lower right.
#[inline]
fn bilinear<T>([a, b, c, d]: [T; 4], [x, y]: [f32; 2]) -> T
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Sub<Output = T> + std::ops::Mul<f32, Output = T>,
{
    let (upper, lower) = (a + (b - a) * x, c + (d - c) * x);
    upper + (lower - upper) * y
}

/// Inverts the cdf of a density on [0, 1] that goes linearly from `from` to `to`.
#[inline]
fn sample_linear(from: f32, to: f32, u: f32) -> f32 {
    let root = (from * from + (to * to - from * from) * u).max(0.0).sqrt();
    let both = from + root;
    if both > 0.0 { (u * (from + to) / both).clamp(0.0, 1.0) } else { u }
}

/// Solid angle of one pixel of row `y`.
fn pixel_solid_angle(y: usize, width: usize, height: usize) -> f64 {
    let z = |row: usize| (PI * row as f64 / height as f64).cos();
    2.0 * PI / width as f64 * (z(y) - z(y + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp() -> Image {
        let mut image = Image::new(16, 8, vec![[0.1, 0.2, 0.3]; 128]);
        image.pixels[2 * 16 + 5] = [50.0, 40.0, 30.0];
        image.pixels[0] = [9.0; 3];
        image
    }

    #[test]
    fn directions_are_those_of_cycles() {
        let mut image = Image::new(4, 3, vec![[0.0; 3]; 12]);
        image.pixels[4 + 1] = [1.0, 0.0, 0.0];
        let table = EnvironmentTable::new(image.clone(), 2.0, 0.0).expect("valid");
        // Pixel 1 of 4 has its centre at u = 3/8: azimuth π/4.
        assert!((table.eval(DVec3::new(1.0, 1.0, 0.0)).x - 2.0).abs() < 1e-6);
        assert!(table.eval(DVec3::new(-1.0, -1.0, 0.0)).x.abs() < 1e-6);
        let turned = EnvironmentTable::new(image, 2.0, PI).expect("valid");
        assert!((turned.eval(DVec3::new(-3.0, -3.0, 0.0)).x - 2.0).abs() < 1e-6);
    }

    /// Sampled directions fall into bins as their density predicts; the density integrates to 1 on a grid that shares no code with it.
    #[test]
    fn samples_follow_the_density() {
        let table = EnvironmentTable::new(lamp(), 1.0, 0.7).expect("valid");
        let (nz, na) = (400, 800);
        let (mut integral, mut light, mut bright) = (0.0, 0.0, 0.0);
        for i in 0..nz {
            for j in 0..na {
                let z = -1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(nz);
                let a = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(na);
                let s = (1.0 - z * z).sqrt();
                let d = DVec3::new(s * a.cos(), s * a.sin(), z);
                let (pdf, l) = (table.pdf(d), f64::from(table.eval(d).x));
                integral += f64::from(pdf);
                light += l;
                bright += if pdf > 0.0 { l } else { 0.0 };
            }
        }
        let cell = 4.0 * PI / f64::from(nz * na);
        // Cells of 1/400 of a bump two pixels wide; in the row at the pole the density is not bounded.
        assert!((integral * cell - 1.0).abs() < 0.01, "{}", integral * cell);
        let n = 1 << 16;
        let (mut estimate, mut wrong) = (0.0, 0.0);
        for i in 0..n {
            // Not 0: at the pole itself every azimuth is the same direction.
            let u =
                [(i as f32 + 0.5) / n as f32, ((i as u32).reverse_bits() | 0x4000) as f32 / 4_294_967_296.0];
            let (d, l, pdf) = table.sample(u);
            assert!((table.eval(d) - l).abs().max_element() < 1e-3 && (d.length() - 1.0).abs() < 1e-12);
            assert!((table.pdf(d) / pdf - 1.0).abs() < 1e-3, "{pdf} sampled, {} found", table.pdf(d));
            estimate += f64::from(l.x / pdf);
            wrong += f64::from(l.x) * 4.0 * PI;
        }
        let (exact, estimate, wrong) = (bright * cell, estimate / f64::from(n), wrong / f64::from(n));
        // Quadrature of a bilinear bump two cells wide, which is cut where it falls below the mean: 0.3 %.
        assert!((estimate / exact - 1.0).abs() < 3e-3, "{estimate} for {exact}");
        assert!((wrong / exact - 1.0).abs() > 0.5, "the check cannot tell a uniform density: {wrong}");
        assert!(bright < 0.95 * light, "what is below the mean is left to BSDF sampling");
    }

    #[test]
    fn an_even_picture_is_not_sampled_and_a_small_spot_is() {
        let even = Image::new(8, 4, vec![[0.2, 0.3, 0.1]; 32]);
        let table = EnvironmentTable::new(even.clone(), 1.0, 0.0).expect("valid");
        assert_eq!((table.irradiance.mean, table.pdf(DVec3::X)), (0.0, 0.0));
        let mut spot = even;
        spot.pixels[12] = [3.0; 3];
        let table = EnvironmentTable::new(spot.clone(), 1.0, 0.0).expect("valid");
        let (_, radiance, _) = table.sample([0.5, 0.5]);
        assert!(table.irradiance.mean > 0.0 && radiance.x > table.floor);
        // Above 0 all is sampled, with the irradiance of the whole picture.
        let all = EnvironmentTable::above(0.0, spot, 1.0, 0.0).expect("valid");
        assert!(all.pdf(DVec3::Z) > 0.0 && all.irradiance.mean > PI as f32 * 0.3);
    }

    #[test]
    fn bad_pixels_are_named() {
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            let mut image = lamp();
            image.pixels[16 + 3][1] = bad;
            let error = EnvironmentTable::new(image, 1.0, 0.0).expect_err("refused");
            assert!(error.contains("pixel (3, 1)"), "{error}");
        }
    }
}
