//! Writes pictures as PNG files: display values, 8 bits per channel, sRGB.
//!
//! The scene-linear colour is clamped to [0, 1] (NaN becomes 0), encoded with the exact sRGB curve or another
//! [view transform](crate::view_transform), and rounded to the nearest of 256 values. The picture of a transparent film has alpha as a
//! fourth channel; its premultiplied colour is divided by alpha, because PNG is not premultiplied (ISO/IEC 15948 §6.2). With a background
//! it is laid over that colour instead: after the view transform, so that white paper is white in every view. The chunk `sRGB`
//! marks the encoding, `pHYs` the density on paper where it is known, and an `iTXt` chunk with the keyword `pumice` holds the provenance as
//! JSON.

use std::io::{BufRead, Seek, Write};
use std::path::Path;

use pumice_core::reserve::{size_text, zeroed};
use pumice_core::write_atomically;
use rayon::prelude::*;

use crate::annotate::{Inks, over_display};
use crate::exr_file::check_size;
use crate::exr_read::Failure;
use crate::provenance_paths::{PicturePaths, for_file};
use crate::provenance_text::{PROVENANCE_KEY, provenance_to_ascii};
use crate::view_transform::shown;
use crate::{Picture, PictureError, Provenance, ViewTransform};

/// Longest provenance that is read, in bytes: as much as the PNG library reads of all texts of a file as they are stored. A scene with a
/// material for each of 118,251 labels has 24 MB.
const MOST_TEXT_BYTES: usize = 64 << 20;
const METERS_PER_INCH: f64 = 0.0254;

/// Writes the colour with the sRGB curve. The file appears complete or not at all.
///
/// # Errors
/// [`PictureError::Io`] for an error of the system, [`PictureError::File`] when the picture is empty or too large.
pub fn write_png(path: &Path, picture: &Picture) -> Result<(), PictureError> {
    write_png_shown(path, picture, ViewTransform::Standard, None)
}

/// As [`write_png`], with another view transform. A picture with alpha is laid over `background`, if there is one: a display colour, sRGB-encoded,
/// each channel from 0 to 1.
///
/// # Errors
/// As [`write_png`].
pub fn write_png_shown(
    path: &Path,
    picture: &Picture,
    view: ViewTransform,
    background: Option<[f32; 3]>,
) -> Result<(), PictureError> {
    write_png_as(path, picture, view, background, PicturePaths::Relative)
}

/// As [`write_png_shown`]; `paths` says what the file tells of where its sources are.
///
/// # Errors
/// As [`write_png`].
pub fn write_png_as(
    path: &Path,
    picture: &Picture,
    view: ViewTransform,
    background: Option<[f32; 3]>,
    paths: PicturePaths,
) -> Result<(), PictureError> {
    let made = picture.provenance.as_ref().map(|made| for_file(made, path, paths));
    write_atomically(path, |file| {
        write_to(file, picture, made.as_ref(), view, background).map_err(|failure| failure.at(path))
    })
}

/// The bytes of the PNG file of a picture, with the paths of its provenance as they are.
///
/// # Errors
/// As [`write_png`], without a file's name.
pub fn png_bytes(picture: &Picture, view: ViewTransform) -> Result<Vec<u8>, PictureError> {
    let mut bytes = Vec::new();
    let made = picture.provenance.as_ref();
    write_to(&mut bytes, picture, made, view, None)
        .map_err(|failure| failure.at(Path::new("a PNG in memory")))?;
    Ok(bytes)
}

/// The display values of a picture as its PNG file has them, row by row from the top: three bytes a pixel, or four of a transparent film that
/// is laid over no `background`.
///
/// # Errors
/// As [`write_png`], without a file's name.
pub fn display_pixels(
    picture: &Picture,
    view: ViewTransform,
    background: Option<[f32; 3]>,
) -> Result<Vec<u8>, PictureError> {
    pixels_of(picture, view, background).map_err(|failure| failure.at(Path::new("a picture in memory")))
}

/// Whether the bytes of a pixel have alpha.
fn has_alpha(picture: &Picture, background: Option<[f32; 3]>) -> bool {
    picture.alpha.is_some() && background.is_none()
}

fn pixels_of(
    picture: &Picture,
    view: ViewTransform,
    background: Option<[f32; 3]>,
) -> Result<Vec<u8>, Failure> {
    let color = &picture.color;
    let channels = 3 + usize::from(has_alpha(picture, background));
    let mut bytes: Vec<u8> = zeroed(channels * color.pixels.len(), "the display values of a picture")
        .map_err(|e| Failure::File(e.to_string()))?;
    let pixels = bytes.par_chunks_exact_mut(channels).zip(&color.pixels);
    match &picture.alpha {
        None => pixels.for_each(|(to, &pixel)| to.copy_from_slice(&encoded(view, pixel))),
        Some(alpha) if alpha.len() != color.pixels.len() => {
            return Err(Failure::File(format!(
                "alpha: expected {} pixels, got {}",
                color.pixels.len(),
                alpha.len()
            )));
        }
        Some(alpha) => {
            let straight = |pixel: &[f32; 3], a: f32| pixel.map(|c| if a > 0.0 { c / a } else { 0.0 });
            let pixels = pixels.zip(alpha);
            match background {
                None => pixels.for_each(|((to, pixel), &a)| {
                    let [r, g, b] = encoded(view, straight(pixel, a));
                    to.copy_from_slice(&[r, g, b, (f64::from(a).clamp(0.0, 1.0) * 255.0).round() as u8]);
                }),
                Some(behind) => pixels.for_each(|((to, pixel), &a)| {
                    to.copy_from_slice(&laid_over(behind, shown(view, straight(pixel, a)), a));
                }),
            }
        }
    }
    over_display(&picture.marks, &Inks::over(picture, background), &mut bytes, color.width, channels);
    Ok(bytes)
}

/// Pixels per metre of a picture whose density is known; pixels that are not square have two.
fn density(picture: &Picture) -> Option<png::PixelDimensions> {
    let xppu = picture.dpi? / METERS_PER_INCH;
    let aspect = picture.provenance.as_ref().map_or(1.0, |made| made.scene.film.pixel_aspect);
    let [xppu, yppu] = [xppu, xppu * aspect].map(|n| n.round() as u32);
    Some(png::PixelDimensions { xppu, yppu, unit: png::Unit::Meter })
}

fn write_to(
    writer: &mut impl Write,
    picture: &Picture,
    provenance: Option<&Provenance>,
    view: ViewTransform,
    background: Option<[f32; 3]>,
) -> Result<(), Failure> {
    let color = &picture.color;
    check_size(color.width, color.height)?;
    let bytes = pixels_of(picture, view, background)?;

    // `check_size` has checked that both sides fit.
    let mut encoder = png::Encoder::new(&mut *writer, color.width as u32, color.height as u32);
    encoder.set_color(if has_alpha(picture, background) {
        png::ColorType::Rgba
    } else {
        png::ColorType::Rgb
    });
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_pixel_dims(density(picture));
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    if let Some(provenance) = provenance {
        encoder.add_itxt_chunk(PROVENANCE_KEY.into(), provenance_to_ascii(provenance)?)?;
    }
    let mut image = encoder.write_header()?;
    image.write_image_data(&bytes)?;
    image.finish()?;
    Ok(())
}

/// The 8-bit display values of a linear colour, each rounded to the nearest of 256.
fn encoded(view: ViewTransform, linear: [f32; 3]) -> [u8; 3] {
    shown(view, linear).map(|c| (c * 255.0).round() as u8)
}

/// The 8-bit values of a display colour over another one.
fn laid_over(behind: [f32; 3], front: [f64; 3], alpha: f32) -> [u8; 3] {
    let a = f64::from(alpha).clamp(0.0, 1.0);
    [0, 1, 2].map(|c| ((front[c] * a + f64::from(behind[c]) * (1.0 - a)) * 255.0).round() as u8)
}

/// Reads only the provenance; `None` if the file has none.
pub(crate) fn read_provenance_from(bytes: impl BufRead + Seek) -> Result<Option<Provenance>, Failure> {
    let mut reader = png::Decoder::new(bytes).read_info()?;
    let find = |info: &png::Info<'_>| info.utf8_text.iter().find(|t| t.keyword == PROVENANCE_KEY).cloned();
    let mut chunk = find(reader.info());
    if chunk.is_none() {
        // Other programs may move the text chunk behind the pixels.
        reader.finish()?;
        chunk = find(reader.info());
    }
    let Some(mut chunk) = chunk else { return Ok(None) };
    // Other programs may have compressed the text, and 2 MB of it can stand for 2 GB.
    chunk.decompress_text_with_limit(MOST_TEXT_BYTES).map_err(|_| {
        Failure::File(format!(
            "text {PROVENANCE_KEY}: expected at most {} of UTF-8, got more or damaged text",
            size_text(MOST_TEXT_BYTES as u64)
        ))
    })?;
    let text = chunk.get_text()?;
    serde_json::from_str(&text).map(Some).map_err(|e| Failure::File(format!("text {PROVENANCE_KEY}: {e}")))
}

impl From<png::EncodingError> for Failure {
    fn from(error: png::EncodingError) -> Self {
        match error {
            png::EncodingError::IoError(source) => Self::Io(source),
            other => Self::File(format!("cannot be written: {other}")),
        }
    }
}

impl From<png::DecodingError> for Failure {
    fn from(error: png::DecodingError) -> Self {
        match error {
            png::DecodingError::IoError(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => Self::Io(e),
            other => Self::File(format!("damaged PNG file: {other}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::image::Image;
    use crate::metrics::display::linear_from_srgb;
    use crate::sample_pictures;

    fn decoded(path: &Path, color: png::ColorType) -> (u32, u32, Vec<u8>, Option<png::SrgbRenderingIntent>) {
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut bytes).unwrap();
        assert_eq!((frame.color_type, frame.bit_depth), (color, png::BitDepth::Eight));
        (frame.width, frame.height, bytes, reader.info().srgb)
    }

    #[test]
    fn pixels_come_back_as_a_screen_shows_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut picture = sample_pictures::picture(3, 2);
        // Values of the curve that its tables list: 0.18 → 118, 0.5 → 188, 0.0031308 → 10; beyond the ends and no number.
        picture.color = Image::new(
            3,
            2,
            vec![
                [0.0, 0.18, 0.5],
                [1.0, 1.0001, f32::INFINITY],
                [-1.0, f32::NEG_INFINITY, f32::NAN],
                [0.003_130_8, 0.3, 0.8],
                [1e-9, 1e30, -0.0],
                [0.2, 0.2, 0.2],
            ],
        );
        picture.alpha = Some(vec![1.0, 0.5, 0.25, 1.0, 0.0, 1.0]);
        write_png(&path, &picture).unwrap();
        let (_, _, bytes, _) = decoded(&path, png::ColorType::Rgba);
        assert_eq!(bytes[..8], [0, 118, 188, 255, 255, 255, 255, 128], "divided by alpha");
        assert_eq!(bytes[16..20], [0, 0, 0, 0], "nothing where nothing is");
        // Over a background: white where nothing is, the mean of both at half, whatever the view.
        picture.alpha = Some(vec![1.0, 0.5, 0.0, 1.0, 0.0, 1.0]);
        for view in [ViewTransform::Standard, ViewTransform::Filmic, ViewTransform::Agx] {
            write_png_shown(&path, &picture, view, Some([1.0, 1.0, 0.2])).unwrap();
            let (_, _, bytes, _) = decoded(&path, png::ColorType::Rgb);
            assert_eq!(
                (&bytes[6..9], &bytes[12..15]),
                (&[255, 255, 51][..], &[255, 255, 51][..]),
                "{view:?}"
            );
            let bright = encoded(view, [2.0, 2.0002, f32::INFINITY]).map(f64::from);
            let half = [0, 1, 2].map(|c| ((bright[c] + [255.0, 255.0, 51.0][c]) / 2.0) as u8);
            assert!((0..3).all(|c| bytes[3 + c].abs_diff(half[c]) <= 1), "{view:?}: {half:?}, {bytes:?}");
        }
        picture.alpha = None;
        write_png(&path, &picture).unwrap();
        let (width, height, bytes, intent) = decoded(&path, png::ColorType::Rgb);
        assert_eq!((width, height), (3, 2));
        assert_eq!(bytes, [0, 118, 188, 255, 255, 255, 0, 0, 0, 10, 149, 231, 0, 255, 0, 124, 124, 124]);
        assert_eq!(intent, Some(png::SrgbRenderingIntent::RelativeColorimetric));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn values_are_rounded_to_the_nearest() {
        for byte in 0..255u8 {
            let middle = linear_from_srgb((f64::from(byte) + 0.5) / 255.0);
            // 1e-6 either way is beyond f32 rounding and the step of the two curves' joint.
            let encoded = |linear: f64| encoded(ViewTransform::Standard, [linear as f32; 3]);
            assert_eq!(encoded(middle * (1.0 - 1e-6)), [byte; 3]);
            assert_eq!(encoded(middle * (1.0 + 1e-6)), [byte + 1; 3]);
        }
    }

    /// 300 dpi are 11811.02 pixels a metre; pixels twice as wide as high stand twice as close down the page.
    #[test]
    fn the_density_is_in_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut picture = sample_pictures::picture(3, 2);
        let read = |picture: &Picture| {
            write_png(&path, picture).unwrap();
            let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
            png::Decoder::new(file).read_info().unwrap().info().pixel_dims
        };
        let square = read(&picture).unwrap();
        assert_eq!((square.xppu, square.yppu, square.unit), (11_811, 11_811, png::Unit::Meter));
        picture.provenance.as_mut().unwrap().scene.film.pixel_aspect = 2.0;
        assert_eq!(read(&picture).unwrap().yppu, 23_622);
        picture.dpi = None;
        assert!(read(&picture).is_none());
    }

    #[test]
    fn a_full_disk_is_an_io_error() {
        let picture = sample_pictures::picture(30, 30);
        let mut whole = Vec::new();
        let made = picture.provenance.as_ref();
        let view = ViewTransform::Standard;
        write_to(&mut whole, &picture, made, view, None).unwrap();
        for room in [0, 8, 60, whole.len() - 1] {
            // A cursor over a slice writes 0 bytes where the slice ends, which `write_all` reports.
            let mut disk = vec![0; room];
            let error = write_to(&mut Cursor::new(&mut disk[..]), &picture, made, view, None).unwrap_err();
            assert!(matches!(error, Failure::Io(_)), "{room} bytes: {error:?}");
        }
    }
}
