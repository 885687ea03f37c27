//! The memory that a film and its picture take, known before either is made.
//!
//! ```text
//! film      a pixel: sums of samples, sums of passes, whether it rests; the colour, which is made of them
//! picture   a pixel: first surface; with it the record that it is taken from, then passes of light and mattes, whichever is more
//! ```
//! Both exist at once when a picture is finished. What is counted here is really written to, so a film that is refused for it would not
//! have fitted; what comes on top, such as a variance or the buffers of a file's writer, is not counted.

use pumice_core::NoMemory;
use pumice_core::reserve::check_room;
use pumice_scene::{Adaptive, Film, Pass};

use crate::film::STRIDE;
use crate::passes::PassSums;

/// Bytes of a colour, a normal or a position.
const TRIPLE: u64 = 12;
/// Bytes of a number.
const NUMBER: u64 = 4;
/// Bytes of the first surface of a pixel, as it is found: depth, label, base colour, normal, position.
const FIRST: u64 = 2 * NUMBER + 3 * TRIPLE;

/// Bytes of a film's sums, and of the colours that are made of them whenever the picture is shown.
pub(crate) fn film_bytes(pixels: u64, kept: PassSums) -> u64 {
    pixels.saturating_mul(TRIPLE + NUMBER * (STRIDE as u64 + kept.stride() as u64))
}

/// Bytes of a picture of that film.
fn picture_bytes(film: &Film, kept: PassSums) -> u64 {
    let light = film.passes.iter().filter(|pass| Pass::LIGHT.contains(pass)).count() as u64;
    let mattes = u64::from(kept.mattes[0]) + u64::from(kept.mattes[1]);
    // Depth and label; base colour, normal and position.
    let always = 2 * NUMBER + 3 * TRIPLE;
    let of_passes = TRIPLE * (light + u64::from(film.passes.has(Pass::ShadowCatcher)))
        + NUMBER * (u64::from(film.transparent) + u64::from(film.passes.has(Pass::Samples)))
        // A layer of a matte has four numbers a pixel and holds two ranks.
        + 4 * NUMBER * mattes * u64::from(kept.ranks / 2);
    pixels_of(film) * (always + of_passes.max(FIRST))
}

fn pixels_of(film: &Film) -> u64 {
    u64::from(film.width) * u64::from(film.height)
}

/// Bytes that a finished picture takes at least, together with its film. `rule` is the scene's adaptive sampling.
pub fn bytes_of(film: &Film, kept: PassSums, rule: Option<Adaptive>) -> u64 {
    let pixels = pixels_of(film);
    let resting = if rule.is_some() { NUMBER * pixels } else { 0 };
    film_bytes(pixels, kept) + resting + picture_bytes(film, kept)
}

/// Checks that there is memory for a film, and for frames of four floats a pixel that show it while it grows; `held_bytes` of it belong to
/// the renderer already.
///
/// # Errors
/// [`NoMemory`] with the size of the film, what it needs and what there is.
pub fn check_shown(film: &Film, kept: PassSums, held_bytes: u64) -> Result<(), NoMemory> {
    let what = format!("film: {} × {} pixels", film.width, film.height);
    check_room(&what, shown_bytes_of(film, kept).saturating_sub(held_bytes))
}

/// Bytes of a film and of a frame of four floats a pixel.
fn shown_bytes_of(film: &Film, kept: PassSums) -> u64 {
    film_bytes(pixels_of(film), kept).saturating_add(4 * NUMBER * pixels_of(film))
}

/// Checks that there is memory for a film and its picture; `held_bytes` of it belong to the renderer already.
///
/// # Errors
/// [`NoMemory`] with the size of the film, what it needs and what there is.
pub fn check(film: &Film, kept: PassSums, rule: Option<Adaptive>, held_bytes: u64) -> Result<(), NoMemory> {
    let passes = film.passes.iter().count();
    let with = match passes {
        0 => String::new(),
        1 => " with 1 pass".to_owned(),
        n => format!(" with {n} passes"),
    };
    let what = format!("film: a picture of {} × {} pixels{with}", film.width, film.height);
    check_room(&what, bytes_of(film, kept, rule).saturating_sub(held_bytes))
}

/// Checks that there is memory for the labels of all pixels of a film, of `bytes` bytes each.
///
/// # Errors
/// [`NoMemory`] with the size of the film, what they need and what there is.
pub fn check_labels(width: u32, height: u32, bytes: usize) -> Result<(), NoMemory> {
    let needed = (u64::from(width) * u64::from(height)).saturating_mul(bytes as u64);
    check_room(&format!("film: the labels of {width} × {height} pixels"), needed)
}

#[cfg(test)]
mod tests {
    use pumice_scene::{Filter, Passes};

    use super::*;

    fn film(width: u32, height: u32, passes: Passes) -> Film {
        Film { passes, ..Film::new(width, height, Filter::Box { width: 1.0 }) }
    }

    #[test]
    fn the_film_that_no_machine_holds_is_refused_with_its_size() {
        // 2³⁰ pixels, which scenes may have, at 452 bytes each.
        let huge = film(65_536, 16_384, Passes::ALL);
        let kept = PassSums::of(&huge, true);
        let error = check(&huge, kept, None, 0).unwrap_err().to_string();
        assert!(
            error.starts_with("film: a picture of 65536 × 16384 pixels with 21 passes needs "),
            "{error}"
        );
        assert!(error.ends_with(" are free") && !error.contains('\n'), "{error}");
        // Held memory is not needed again.
        let all = bytes_of(&huge, kept, None);
        assert_eq!(check(&huge, kept, None, all), Ok(()));
    }

    /// Bytes a pixel, counted by hand: 16 floats are 64 bytes.
    #[test]
    fn each_part_of_a_film_and_its_picture_counts() {
        let of = |passes: &[Pass], transparent: bool, adaptive: bool, catches: bool| {
            let mut film = film(10, 7, passes.iter().copied().collect());
            film.transparent = transparent;
            let rule = adaptive.then_some(Adaptive { threshold: 0.01, min_spp: 4 });
            let bytes = bytes_of(&film, PassSums::of(&film, catches), rule);
            assert_eq!(bytes % 70, 0);
            bytes / 70
        };
        // Four classes of three floats and the colour; depth, label, base colour, normal and position, found and kept. Passes of up to as many
        // bytes find room where these were found.
        let found = 4 + 4 + 3 * 12;
        let plain = 4 * 12 + 12 + 2 * found;
        assert_eq!(of(&[], false, false, false), plain);
        let shown = film(10, 7, Passes::NONE);
        assert_eq!(shown_bytes_of(&shown, PassSums::of(&shown, false)), 70 * (4 * 12 + 12 + 16));
        assert_eq!(of(&[], false, true, false), plain + 4, "a number of samples at rest");
        assert_eq!(of(&[], true, false, false), plain + 4, "alpha in the film");
        assert_eq!(of(&[Pass::Samples], false, false, false), plain);
        assert_eq!(of(&[Pass::Albedo], false, false, false), plain + 6 * 4, "sums of colour and normal");
        // Eleven sums of light in the film, however many are asked for; a colour each in the picture.
        let colors = [Pass::DiffuseColor, Pass::Emission, Pass::GlossyColor, Pass::Environment];
        assert_eq!(of(&colors[..1], false, false, false), plain + 11 * 12);
        assert_eq!(of(&colors, false, false, false), plain + 11 * 12 + 4 * 12 - found);
        // Six ranks: twelve slots of two numbers in the film, three layers of four numbers in the picture.
        let matte = 12 * 2 * 4 + 3 * 16;
        assert_eq!(of(&[Pass::CryptomatteLabel], false, false, false), plain + matte - found);
        assert_eq!(
            of(&[Pass::CryptomatteLabel, Pass::CryptomatteType], false, false, false),
            plain + 2 * matte - found
        );
        // Light of catchers: 11 floats of each class, or 8 where the picture does not show what is behind.
        assert_eq!(of(&[], false, false, true), plain + 4 * 11 * 4);
        assert_eq!(of(&[], true, false, true), plain + 4 + 4 * 8 * 4);
        assert_eq!(of(&[Pass::ShadowCatcher], false, false, true), plain + 4 * 8 * 4);
    }

    #[test]
    fn small_films_are_always_allowed() {
        let small = film(960, 540, Passes::NONE);
        assert_eq!(check(&small, PassSums::of(&small, false), None, 0), Ok(()));
    }
}
