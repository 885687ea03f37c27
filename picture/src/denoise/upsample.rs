//! Enlarges a denoised frame of some pixels of a film to the whole film: edges are those of the film's own first surfaces.
//!
//! Joint bilateral upsampling, after Kopf, Cohen, Lischinski and Uyttendaele (2007): light comes from the pixels of the frame around a pixel of the
//! film, by distance and by how alike the surfaces are, and is multiplied by the base colour of the film's pixel. First surfaces cost a small part of
//! samples, so a film with light in a quarter of its pixels shows all of its outlines.
//!
//! ```text
//! weight   tent of the distance × 1 if both pixels show the same label of the same instance, else 0 × likeness of normal and base colour
//! ```
//! The tent reaches to the next pixels of the frame, and twice as far where these are of other surfaces. What is too small for the frame to have a
//! pixel of it near takes the light of other surfaces.

use pumice_core::NoMemory;
use pumice_core::reserve::reserved;
use rayon::prelude::*;

use super::divisor;
use super::guides::{Guides, likeness};
use super::planes::Layout;
use crate::coarse_pixels::CoarsePixels;
use crate::image::Image;

/// Reaches of the tent in pixels of the frame; the next is tried where the sum of weights within one is below [`LEAST_WEIGHT`].
const REACHES: [f32; 2] = [1.0, 2.0];

/// Widest reach.
const WIDEST: f32 = REACHES[1];

/// Sum of weights from which on the pixels of a tent are enough. Four pixels of the same surface have 1 together, or 4 within the wider tent.
const LEAST_WEIGHT: f32 = 1.0 / 16.0;

/// Name of the picture's memory in messages.
const ENLARGED: &str = "denoiser: an enlarged frame";

/// Light and coverage of a pixel: red, green, blue, alpha.
type Light = [f32; 4];

/// A frame at the size of its film.
#[derive(Clone, Debug, PartialEq)]
pub struct Enlarged {
    /// Linear Rec. 709 radiance, rows from the top.
    pub color: Image,
    /// From 0 to 1 a pixel, in the same order; `None` where the frame has no alpha.
    pub alpha: Option<Vec<f32>>,
}

/// The whole film as a frame of some of its pixels shows it, with its alpha where it has one. `coarse` are the guides of the frame, `fine`
/// those of the film. `None` where their sizes do not belong together.
///
/// # Errors
/// [`NoMemory`] where there is none for 16 bytes a pixel of the film and as many of the frame.
pub fn upsampled(
    frame: &Image,
    alpha: Option<&[f32]>,
    pixels: &CoarsePixels,
    [coarse, fine]: [&Guides; 2],
) -> Result<Option<Enlarged>, NoMemory> {
    let size = |[width, height]: [u32; 2]| [width as usize, height as usize];
    let of = |guides: &Guides| [guides.layout.width, guides.layout.height];
    let [width, height] = size(pixels.film());
    let fits = [frame.width, frame.height] == of(coarse)
        && alpha.is_none_or(|alpha| alpha.len() == frame.pixels.len())
        && size(pixels.size()) == of(coarse)
        && of(fine) == [width, height];
    if !fits || frame.pixels.is_empty() {
        return Ok(None);
    }
    let mut light: Vec<Light> = reserved(frame.pixels.len(), ENLARGED)?;
    light.extend((0..frame.pixels.len()).map(|i| {
        let at = coarse.layout.place(i % frame.width, i / frame.width);
        let color = frame.pixels[i];
        let [r, g, b] = std::array::from_fn(|c| color[c] / divisor(coarse.albedo[c][at]));
        [r, g, b, alpha.map_or(1.0, |alpha| alpha[i])]
    }));
    let places = [places(pixels.columns(), width), places(pixels.rows(), height)];
    let shown = Shown { light: &light, coarse, fine, places: &places };

    let mut image: Vec<[f32; 3]> = reserved(width * height, ENLARGED)?;
    image.resize(width * height, [0.0; 3]);
    let mut covered: Vec<f32> = Vec::new();
    if alpha.is_some() {
        covered = reserved(width * height, ENLARGED)?;
        covered.resize(width * height, 0.0);
        let rows = image.par_chunks_mut(width).zip(covered.par_chunks_mut(width)).enumerate();
        rows.for_each(|(y, (image, covered))| {
            for (x, (pixel, alpha)) in image.iter_mut().zip(covered).enumerate() {
                let [r, g, b, a] = shown.pixel(x, y);
                (*pixel, *alpha) = ([r, g, b], a);
            }
        });
    } else {
        image.par_chunks_mut(width).enumerate().for_each(|(y, image)| {
            for (x, pixel) in image.iter_mut().enumerate() {
                let [r, g, b, _] = shown.pixel(x, y);
                *pixel = [r, g, b];
            }
        });
    }
    Ok(Some(Enlarged { color: Image::new(width, height, image), alpha: alpha.map(|_| covered) }))
}

/// Where each of `count` columns (or rows) of the film lies among those `shown` by the frame, in columns of the frame.
fn places(shown: impl Iterator<Item = u32>, count: usize) -> Vec<f32> {
    let shown: Vec<u32> = shown.collect();
    // Beyond the first and the last as far apart as the others are on average.
    let average = (count as f32 / shown.len().max(1) as f32).max(1.0);
    let place = |x: u32| {
        let after = shown.partition_point(|&of| of <= x);
        match (after.checked_sub(1).map(|i| shown[i]), shown.get(after)) {
            (Some(left), Some(right)) => (after - 1) as f32 + (x - left) as f32 / (right - left) as f32,
            (Some(left), None) => (after - 1) as f32 + (x - left) as f32 / average,
            (None, right) => -((right.copied().unwrap_or(x) - x) as f32 / average),
        }
    };
    (0..count as u32).map(place).collect()
}

/// Light times what it was divided by at a place of these guides.
#[inline(always)]
fn times([r, g, b, a]: Light, guides: &Guides, at: usize) -> Light {
    let of = |c: usize| divisor(guides.albedo[c][at]);
    [r * of(0), g * of(1), b * of(2), a]
}

/// What the film's pixels are made of.
struct Shown<'a> {
    /// Light of each pixel of the frame.
    light: &'a [Light],
    coarse: &'a Guides,
    fine: &'a Guides,
    /// Where the columns and the rows of the film lie among those of the frame.
    places: &'a [Vec<f32>; 2],
}

/// A weighted sum.
#[derive(Clone, Copy, Default)]
struct Sum {
    light: Light,
    weight: f32,
}

impl Sum {
    fn add(&mut self, light: &Light, weight: f32) {
        for (sum, light) in self.light.iter_mut().zip(light) {
            *sum += weight * light;
        }
        self.weight += weight;
    }

    /// The mean of what was added; black where that is nothing.
    fn mean(&self) -> Light {
        if self.weight > 0.0 { self.light.map(|sum| sum / self.weight) } else { [0.0; 4] }
    }
}

impl Shown<'_> {
    /// Colour and alpha of a pixel of the film.
    fn pixel(&self, x: usize, y: usize) -> Light {
        let (place, at) = ([self.places[0][x], self.places[1][y]], self.fine.layout.place(x, y));
        let is_of_kind = |other: usize| self.fine.is_surface[at] == self.coarse.is_surface[other];
        let alike = |reach| {
            self.sum(place, reach, |i, other| {
                let weight = if is_of_kind(other) { self.likeness(at, other) } else { 0.0 };
                (self.light[i], weight)
            })
        };
        let of_kind =
            || self.sum(place, WIDEST, |i, other| (self.light[i], if is_of_kind(other) { 1.0 } else { 0.0 }));
        // Light where nothing is seen is divided by a base colour of 0, that of surfaces by another.
        let any =
            || self.sum(place, WIDEST, |i, other| (times(self.light[i], self.coarse, other), 1.0)).mean();
        let light = REACHES.iter().map(|&reach| alike(reach)).find(|sum| sum.weight >= LEAST_WEIGHT);
        let light = light.or_else(|| Some(of_kind()).filter(|sum| sum.weight > 0.0));
        light.map_or_else(any, |light| times(light.mean(), self.fine, at))
    }

    /// The sum of what `of` gives, each with a weight, over the pixels of the frame around a place. `of` gets their number and their place in the
    /// frame's guides. What is not finite takes no part.
    #[inline(always)]
    fn sum(&self, [x, y]: [f32; 2], reach: f32, of: impl Fn(usize, usize) -> (Light, f32)) -> Sum {
        let Layout { width, height } = self.coarse.layout;
        let mut sum = Sum::default();
        for row in within(y, reach, height) {
            let down = (1.0 - (y - row as f32).abs() / reach).max(0.0);
            for column in within(x, reach, width) {
                let tent = down * (1.0 - (x - column as f32).abs() / reach).max(0.0);
                let (light, weight) = of(row * width + column, self.coarse.layout.place(column, row));
                let weight = tent * weight;
                if weight > 0.0 && light.iter().all(|v| v.is_finite()) {
                    sum.add(&light, weight);
                }
            }
        }
        sum
    }

    /// How alike the surface at place `fine` of the film's guides and that at `coarse` of the frame's are: 1 where nothing is seen in both.
    fn likeness(&self, fine: usize, coarse: usize) -> f32 {
        let is_of_label = self.fine.label[fine] == self.coarse.label[coarse]
            && self.fine.instance[fine] == self.coarse.instance[coarse];
        let squared = |of: [&[Vec<f32>; 3]; 2]| -> f32 {
            (0..3).map(|c| (of[0][c][fine] - of[1][c][coarse]).powi(2)).sum()
        };
        let normal = squared([&self.fine.normal, &self.coarse.normal]);
        let albedo = squared([&self.fine.albedo, &self.coarse.albedo]);
        if is_of_label { likeness(normal, albedo) } else { 0.0 }
    }
}

/// The columns (or rows) of a frame with `count` of them that a tent around `place` reaches.
fn within(place: f32, reach: f32, count: usize) -> std::ops::Range<usize> {
    // What is below 0 becomes 0.
    (place - reach).ceil() as usize..((place + reach).floor() as usize + 1).min(count)
}

#[cfg(test)]
mod tests {
    use super::super::guides::GuideSurface;
    use super::*;

    const FILM: [u32; 2] = [27, 14];
    const FRAME: [u32; 2] = [14, 7];

    /// Numbers from 0 to below `n`.
    fn random(seed: u64) -> impl FnMut(u64) -> u64 {
        let mut state = seed;
        move |n| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) % n
        }
    }

    fn surface(label: u32, albedo: f32) -> GuideSurface {
        GuideSurface { normal: [0.0, 0.0, 1.0], albedo: [albedo, 0.5 * albedo, 0.25], label, instance: 0 }
    }

    /// The guides of the film where `of` says what each pixel shows, and of a frame of it.
    fn guides(pixels: &CoarsePixels, of: impl Fn(u32, u32) -> Option<GuideSurface> + Sync) -> [Guides; 2] {
        let size = |[width, height]: [u32; 2]| [width as usize, height as usize];
        let coarse = Guides::by_pixels(size(pixels.size()), |x, y| {
            let [x, y] = pixels.pixel(x as u32, y as u32);
            of(x, y)
        });
        let fine = Guides::by_pixels(size(pixels.film()), |x, y| of(x as u32, y as u32));
        [coarse.unwrap(), fine.unwrap()]
    }

    /// A frame whose pixels have the colour of what `of` gives for pixels of the film.
    fn frame(pixels: &CoarsePixels, of: impl Fn(u32, u32) -> [f32; 3]) -> Image {
        let [width, height] = pixels.size();
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let colors = places.map(|(x, y)| {
            let [x, y] = pixels.pixel(x, y);
            of(x, y)
        });
        Image::new(width as usize, height as usize, colors.collect())
    }

    /// Even light on two labels, beside nothing: the film has the edges of its own surfaces, which the frame cannot tell. An enlargement without
    /// them is off by the difference of the colours.
    #[test]
    fn edges_are_those_of_the_film() {
        let pixels = CoarsePixels::new(FILM, FRAME);
        let of = |x: u32, y: u32| match (x + y / 3, y) {
            (_, 0..3) => None,
            (0..12, _) => Some(surface(1, 0.25)),
            _ => Some(surface(2, 0.75)),
        };
        let color = |x, y| of(x, y).map_or([3.0, 2.0, 1.0], |s| s.albedo.map(|a| 2.0 * divisor(a)));
        let alpha = |x, y| if of(x, y).is_some() { 1.0 } else { 0.0 };
        let [coarse, fine] = guides(&pixels, of);
        let small = frame(&pixels, color);
        let covered: Vec<f32> = frame(&pixels, |x, y| [alpha(x, y); 3]).pixels.iter().map(|p| p[0]).collect();
        let with = upsampled(&small, Some(&covered), &pixels, [&coarse, &fine]).unwrap().unwrap();
        let (image, alphas) = (with.color, with.alpha.unwrap());
        let mut squares = 0;
        for y in 0..FILM[1] {
            for x in 0..FILM[0] {
                let i = (y * FILM[0] + x) as usize;
                let (got, expected) = (image.pixels[i], color(x, y));
                // A mean of up to 16 equal numbers, off by a few times 2⁻²⁴.
                assert!(
                    (0..3).all(|c| (got[c] - expected[c]).abs() < 1e-5),
                    "{x}, {y}: {got:?} {expected:?}"
                );
                assert!((alphas[i] - alpha(x, y)).abs() < 1e-6, "{x}, {y}");
                let square = small.pixels[(y / 2 * FRAME[0] + x / 2) as usize];
                squares += usize::from((square[0] - expected[0]).abs() > 0.1);
            }
        }
        assert!(squares > 10, "{squares} pixels of the frame as squares are wrong");
        let without = upsampled(&small, None, &pixels, [&coarse, &fine]).unwrap().unwrap();
        assert!(without == Enlarged { color: image, alpha: None });
    }

    /// Against the definition in f64, over all pixels of the frame, for labels, instances, normals and base colours at random.
    #[test]
    fn light_is_that_of_the_definition() {
        for (film, size) in
            [(FILM, FRAME), ([16, 16], [4, 4]), ([9, 5], [3, 2]), ([1, 1], [1, 1]), ([2, 8], [1, 8])]
        {
            let pixels = CoarsePixels::new(film, size);
            let mut draw = random(u64::from(film[0]));
            let all = (film[0] * film[1]) as usize;
            let shown: Vec<_> = (0..all)
                .map(|_| {
                    let normal = [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.8, 0.0, 0.6]][draw(3) as usize];
                    let of = surface(draw(2) as u32, 0.25 + 0.01 * draw(6) as f32);
                    let of = GuideSurface { normal, instance: draw(8) as u32 / 7, ..of };
                    (draw(6) > 0).then_some(of)
                })
                .collect();
            let of = |x: u32, y: u32| shown[(y * film[0] + x) as usize];
            let [coarse, fine] = guides(&pixels, of);
            let values: Vec<f32> =
                (0..all).map(|_| if draw(20) == 0 { f32::NAN } else { draw(100) as f32 / 50.0 }).collect();
            let value = |x: u32, y: u32| values[(y * film[0] + x) as usize];
            let small = frame(&pixels, |x, y| [value(x, y); 3]);
            let image = upsampled(&small, None, &pixels, [&coarse, &fine]).unwrap().unwrap().color;

            let [columns, rows]: [Vec<u32>; 2] = [pixels.columns().collect(), pixels.rows().collect()];
            // Distance along an axis from a pixel of the film to the `to`th of the frame, in pixels of the frame.
            let distance = |x: u32, shown: &[u32], count: u32, to: usize| {
                let average = (f64::from(count) / shown.len() as f64).max(1.0);
                let x = f64::from(x);
                let place = match shown.iter().rposition(|&of| f64::from(of) <= x) {
                    None => (x - f64::from(shown[0])) / average,
                    Some(i) if i + 1 == shown.len() => i as f64 + (x - f64::from(shown[i])) / average,
                    Some(i) => i as f64 + (x - f64::from(shown[i])) / f64::from(shown[i + 1] - shown[i]),
                };
                (place - to as f64).abs()
            };
            for (y, x) in (0..film[1]).flat_map(|y| (0..film[0]).map(move |x| (y, x))) {
                let own = of(x, y);
                // Sums of light and weight: of surfaces alike within both reaches, of surfaces at all, of colours.
                let mut sums = [[0.0f64; 2]; 4];
                for (row, column) in (0..rows.len()).flat_map(|r| (0..columns.len()).map(move |c| (r, c))) {
                    let [there_x, there_y] = pixels.pixel(column as u32, row as u32);
                    let (other, color) = (of(there_x, there_y), f64::from(value(there_x, there_y)));
                    if color.is_nan() {
                        continue;
                    }
                    let light = color / (other.map_or(0.0, |s| f64::from(s.albedo[0])) + 0.01);
                    let far = [distance(x, &columns, film[0], column), distance(y, &rows, film[1], row)];
                    let tent = |reach: f64| far.iter().map(|d| (1.0 - d / reach).max(0.0)).product::<f64>();
                    let alike = match (own, other) {
                        (None, None) => 1.0,
                        (Some(a), Some(b)) if (a.label, a.instance) == (b.label, b.instance) => {
                            let squared = |a: [f32; 3], b: [f32; 3]| {
                                (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>()
                            };
                            let [normal, albedo] = [squared(a.normal, b.normal), squared(a.albedo, b.albedo)];
                            (1.0 - normal / 4.0 - albedo / 0.01).max(0.0).powi(4)
                        }
                        _ => 0.0,
                    };
                    let of_kind = if own.is_some() == other.is_some() { tent(2.0) } else { 0.0 };
                    let parts = [
                        (light, tent(1.0) * alike),
                        (light, tent(2.0) * alike),
                        (light, of_kind),
                        (color, tent(2.0)),
                    ];
                    for (sum, (value, weight)) in sums.iter_mut().zip(parts) {
                        *sum = [sum[0] + weight * value, sum[1] + weight];
                    }
                }
                let mean = |[sum, weight]: [f64; 2]| sum / weight;
                let times = own.map_or(0.0, |s| f64::from(s.albedo[0])) + 0.01;
                let expected = match sums.map(|[_, weight]| weight) {
                    [near, ..] if near >= 1.0 / 16.0 => mean(sums[0]) * times,
                    [_, far, ..] if far >= 1.0 / 16.0 => mean(sums[1]) * times,
                    [_, _, of_kind, _] if of_kind > 0.0 => mean(sums[2]) * times,
                    [.., any] if any > 0.0 => mean(sums[3]),
                    _ => 0.0,
                };
                let got = f64::from(image.pixels[(y * film[0] + x) as usize][0]);
                // Single precision, with weights that are differences of numbers up to the frame's width.
                assert!(
                    (got - expected).abs() < 2e-4 * (1.0 + expected),
                    "{film:?} {x}, {y}: {got} {expected}"
                );
            }
        }
    }

    #[test]
    fn sizes_that_do_not_belong_together_are_told() {
        let pixels = CoarsePixels::new(FILM, FRAME);
        let [coarse, fine] = guides(&pixels, |_, _| None);
        let small = frame(&pixels, |_, _| [1.0; 3]);
        let of = |small: &Image, alpha: Option<&[f32]>, guides| {
            upsampled(small, alpha, &pixels, guides).unwrap().is_some()
        };
        assert!(of(&small, None, [&coarse, &fine]));
        assert!(!of(&small, None, [&fine, &coarse]));
        assert!(!of(&small, None, [&coarse, &coarse]));
        assert!(!of(&small, Some(&[1.0]), [&coarse, &fine]));
        assert!(!of(&Image::new(1, 1, vec![[1.0; 3]]), None, [&coarse, &fine]));
    }
}
