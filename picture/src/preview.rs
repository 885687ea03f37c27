//! Denoises the early frames of a live picture with an edge-avoiding filter. Finished pictures are never filtered.
//!
//! The filter of Dammertz, Sewtz, Hanika and Lensch 2010 (*Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination
//! Filtering*), with 3 × 3 taps per level at distances of 1, 2, 4 and 8 pixels, so that four levels cover 31 pixels across with 36 taps.
//! The weight of a neighbour falls as it differs more from the pixel in
//!
//! ```text
//! normal, base colour   of the first surface at the pixel's centre: separates faces and labels
//! position              distance from the pixel's plane over distance from the pixel: separates parallel faces at a step
//! luminance             in units of the noise of both (Schied et al. 2017, *Spatiotemporal Variance-Guided Filtering*, §4.4):
//!                       separates shadows. The filter fades out as the picture converges; the variance is filtered along
//! ```
//! With less than one sample per class no variance is known, and luminance has no effect. Blurring adds a bias that the estimated
//! error does not include; alpha and the passes are unchanged.

use rayon::prelude::*;

use crate::image::Image;
use crate::picture::Picture;

/// Distances of the taps in pixels.
const STEPS: [usize; 4] = [1, 2, 4, 8];

/// Squared difference of two normals at which a neighbour gets weight 0: some 20°; adjacent faces of voxels differ by 2.
const NORMAL: f32 = 0.12;

/// Squared difference of base colours at which a neighbour gets weight 0: colours that are distinguishable side by side.
const ALBEDO: f32 = 0.01;

/// Squared sine of the angle out of the plane at which a neighbour gets weight 0: 8°.
const PLANE: f32 = 0.02;

/// Squared difference of luminance, in variances, at which a neighbour gets weight 0: 2.2 standard deviations. With 4, the noise of mixed
/// pixels at edges let wrong neighbours in, and FLIP rose by 12 %.
const LUMINANCE: f32 = 5.0;

/// The first surface at the centre of each pixel, which guides the filter.
#[derive(Clone, Debug)]
pub struct Guides {
    width: usize,
    height: usize,
    surfaces: Vec<Surface>,
}

#[derive(Clone, Copy, Debug)]
struct Surface {
    normal: [f32; 3],
    albedo: [f32; 3],
    position: [f32; 3],
    is_hit: bool,
}

impl Guides {
    /// The guides of a picture; `None` if it lacks depth, normal, base colour or position.
    pub fn of(picture: &Picture) -> Option<Self> {
        let (depth, normal) = (picture.depth.as_ref()?, picture.normal.as_ref()?);
        let (albedo, position) = (picture.albedo.as_ref()?, picture.position.as_ref()?);
        let surface = |i: usize| Surface {
            normal: normal.pixels[i],
            albedo: albedo.pixels[i],
            position: position.pixels[i],
            is_hit: depth[i].is_finite(),
        };
        let surfaces = (0..depth.len()).map(surface).collect();
        Some(Self { width: picture.color.width, height: picture.color.height, surfaces })
    }

    /// Whether the guides belong to a picture of this size.
    pub fn fit(&self, image: &Image) -> bool {
        (self.width, self.height) == (image.width, image.height)
    }
}

/// The denoised picture. `variance` is that of its pixels, if known. With guides of another size the picture is returned unchanged.
pub fn filtered(image: &Image, variance: Option<&Image>, guides: &Guides) -> Image {
    if !guides.fit(image) {
        return image.clone();
    }
    let noise = |i: usize| variance.map_or(f32::INFINITY, |v| luminance_variance(v.pixels[i]));
    let mut pixels: Vec<([f32; 3], f32)> =
        image.pixels.iter().enumerate().map(|(i, &color)| (color, noise(i))).collect();
    for step in STEPS {
        pixels = level(&pixels, guides, step);
    }
    Image::new(image.width, image.height, pixels.into_iter().map(|(color, _)| color).collect())
}

/// One level: every pixel's mean over 3 × 3 taps `step` pixels apart.
fn level(pixels: &[([f32; 3], f32)], guides: &Guides, step: usize) -> Vec<([f32; 3], f32)> {
    let (width, height) = (guides.width, guides.height);
    let row = |y: usize| {
        (0..width).map(move |x| {
            let (place, mut weights) = (y * width + x, 0.25);
            let (color, noise) = pixels[place];
            let mut sum = color.map(|c| 0.25 * c);
            let mut noise_sum = 0.25 * 0.25 * noise;
            for (dy, dx) in AROUND {
                let (qx, qy) = (x + dx * step, y + dy * step);
                // Counted from one step up and to the left, so that nothing is below zero.
                if qx < step || qy < step || qx - step >= width || qy - step >= height {
                    continue;
                }
                let other = (qy - step) * width + qx - step;
                let tap = if dx == 1 || dy == 1 { 0.125 } else { 0.0625 };
                let weight = tap * likeness(pixels, guides, place, other);
                if weight > 0.0 {
                    let (color, noise) = pixels[other];
                    weights += weight;
                    (0..3).for_each(|c| sum[c] += weight * color[c]);
                    noise_sum += weight * weight * noise;
                }
            }
            (sum.map(|c| c / weights), noise_sum / (weights * weights))
        })
    };
    (0..height).into_par_iter().flat_map_iter(row).collect()
}

/// The eight neighbours, counted from the upper left one.
const AROUND: [(usize, usize); 8] = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2)];

/// Weight of a neighbour: 1 if nothing differs, 0 if one property differs too much. (1 − x/4)⁴ replaces e⁻ˣ, with the same effect.
fn likeness(pixels: &[([f32; 3], f32)], guides: &Guides, place: usize, other: usize) -> f32 {
    let (p, q) = (&guides.surfaces[place], &guides.surfaces[other]);
    if p.is_hit != q.is_hit {
        return 0.0;
    }
    let mut x = 0.0;
    if p.is_hit {
        let apart = difference(q.position, p.position);
        let (out, far) = (dot(p.normal, apart), dot(apart, apart));
        x += square(difference(p.normal, q.normal)) * (4.0 / NORMAL);
        x += square(difference(p.albedo, q.albedo)) * (4.0 / ALBEDO);
        // Two points in one place are in one plane.
        x += if far > 0.0 { out * out / far * (4.0 / PLANE) } else { 0.0 };
    }
    let ((color, noise), (other, other_noise)) = (pixels[place], pixels[other]);
    let noise = noise + other_noise;
    if noise.is_finite() {
        let d = luminance(color) - luminance(other);
        x += d * d / (LUMINANCE * noise + 1e-12) * 4.0;
    }
    let y = (1.0 - 0.25 * x).max(0.0);
    (y * y) * (y * y)
}

fn difference(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn square(a: [f32; 3]) -> f32 {
    dot(a, a)
}

/// Rec. 709.
const LUMA: [f32; 3] = [0.2126, 0.7152, 0.0722];

fn luminance(color: [f32; 3]) -> f32 {
    dot(color, LUMA)
}

/// Variance of the luminance, with channels taken as fully correlated, as noise of light is: (Σ wᵢ σᵢ)².
fn luminance_variance(variance: [f32; 3]) -> f32 {
    luminance(variance.map(f32::sqrt)).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 48;

    /// Two faces at a right angle that meet in the middle column, the left one of two base colours; none in the first four rows.
    fn corner() -> Guides {
        let surface = |i: usize| {
            let (x, y) = (i % SIDE, i / SIDE);
            let left = x < SIDE / 2;
            Surface {
                normal: if left { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] },
                albedo: if left && x < SIDE / 4 { [0.8, 0.2, 0.2] } else { [0.2, 0.8, 0.2] },
                position: match left {
                    true => [x as f32, y as f32, 0.0],
                    false => [(SIDE / 2) as f32, y as f32, -((x - SIDE / 2) as f32)],
                },
                is_hit: y >= 4,
            }
        };
        Guides { width: SIDE, height: SIDE, surfaces: (0..SIDE * SIDE).map(surface).collect() }
    }

    /// The noiseless picture: each part of the corner has its own light, and a shadow with a hard edge lies across.
    fn truth(i: usize) -> f32 {
        let (x, y) = (i % SIDE, i / SIDE);
        let part = if y < 4 {
            0.1
        } else if x < SIDE / 4 {
            0.3
        } else if x < SIDE / 2 {
            0.5
        } else {
            0.9
        };
        if y >= SIDE / 2 { 0.4 * part } else { part }
    }

    /// Numbers in −1 to 1 of variance 1/3.
    fn noise(i: usize) -> f32 {
        let mut x = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        x ^= x >> 29;
        x = x.wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (x >> 40) as f32 / 8_388_608.0 - 1.0
    }

    fn error(image: &Image) -> f32 {
        let squares = image.pixels.iter().enumerate().map(|(i, p)| (p[0] - truth(i)).powi(2));
        squares.sum::<f32>() / (SIDE * SIDE) as f32
    }

    fn noisy(amplitude: f32) -> (Image, Image) {
        let pixels = (0..SIDE * SIDE).map(|i| [truth(i) + amplitude * noise(i); 3]).collect();
        let variance = vec![[amplitude * amplitude / 3.0; 3]; SIDE * SIDE];
        (Image::new(SIDE, SIDE, pixels), Image::new(SIDE, SIDE, variance))
    }

    /// Where the noise is known, neighbours that differ by as much as noise does count for less than half: half of the squared error
    /// stays. Where it is not, most pixels lie amid some 300 of their kind, and an eighth is asked, away from the shadow's edge.
    #[test]
    fn noise_goes_and_edges_stay() {
        let guides = corner();
        let (image, variance) = noisy(0.06);
        let smooth = filtered(&image, Some(&variance), &guides);
        assert!(error(&smooth) < 0.6 * error(&image), "{} of {}", error(&smooth), error(&image));
        let unlit = |i: usize| i / SIDE < SIDE / 2 - 16 || i / SIDE >= SIDE / 2 + 16;
        let away = |image: &Image| -> f32 {
            let all = image.pixels.iter().enumerate().filter(|(i, _)| unlit(*i));
            all.map(|(i, p)| (p[0] - truth(i)).powi(2)).sum()
        };
        let blind = away(&filtered(&image, None, &guides));
        assert!(blind < away(&image) / 8.0, "{blind} of {}", away(&image));
        // The control: where all surfaces are taken for one, edges are lost.
        let mut flat = guides.clone();
        flat.surfaces.fill(guides.surfaces[SIDE * SIDE - 1]);
        let blurred = filtered(&image, None, &flat);
        assert!(error(&blurred) > 2.0 * error(&image), "{}", error(&blurred));
    }

    /// Without noise nothing is blurred, a shadow's edge neither: it fades out as the picture converges.
    #[test]
    fn a_converged_picture_is_left_alone() {
        let (image, variance) = noisy(0.0);
        let smooth = filtered(&image, Some(&variance), &corner());
        let off = image.pixels.iter().zip(&smooth.pixels).map(|(a, b)| (a[0] - b[0]).abs());
        assert!(off.fold(0.0, f32::max) < 1e-6);
        // Where no variance is known the shadow's edge is blurred, and nothing else.
        let blind = filtered(&image, None, &corner());
        let changed = (0..SIDE * SIDE).filter(|&i| (blind.pixels[i][0] - truth(i)).abs() > 1e-6);
        assert!(changed.clone().count() > 0);
        assert!(changed.into_iter().all(|i| (i / SIDE).abs_diff(SIDE / 2) <= 16));
    }

    #[test]
    fn what_does_not_fit_or_is_not_finite_does_no_harm() {
        let guides = corner();
        let other = Image::new(2, 2, vec![[1.0; 3]; 4]);
        assert_eq!(filtered(&other, None, &guides), other);
        assert!(Guides::of(&Picture::of(other)).is_none());
    }
}
