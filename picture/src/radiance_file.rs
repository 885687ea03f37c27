//! Reads Radiance pictures (`.hdr`), in which most environments are published: four bytes a pixel, three mantissas and an exponent
//! (Ward 1991, *Real Pixels*, Graphics Gems II).
//!
//! The numbers are taken as they stand: `EXPOSURE` of the header is not divided out, as in Blender and OpenImageIO. Rows come from the top,
//! pixels from the left (`-Y H +X W`); other orders are refused.

use std::io::{BufReader, Seek, SeekFrom};
use std::path::Path;

use ::image::codecs::hdr::HdrDecoder;
use ::image::error::ImageError;
use ::image::{ColorType, ImageDecoder};
use pumice_core::open_input;

use pumice_core::reserve::zeroed;

use crate::exr_file::check_size;
use crate::exr_read::Failure;
use crate::{Image, PictureError};

/// Pixels that a byte of a file can hold at most: two bytes repeat a channel of 127 pixels, and a pixel has four channels.
const MAX_PIXELS_PER_BYTE: u64 = 16;

/// The first bytes of a file of this kind.
pub const MAGIC: &[u8] = b"#?";

/// Reads scene-linear colours.
///
/// # Errors
/// [`PictureError::Io`] for an error of the system, [`PictureError::File`] for a damaged file, or one that claims more pixels than its
/// bytes can hold.
pub fn read_hdr(path: &Path) -> Result<Image, PictureError> {
    read(path).map_err(|failure| failure.at(path))
}

fn read(path: &Path) -> Result<Image, Failure> {
    let mut file = open_input(path).map_err(Failure::Io)?;
    let length_bytes = file.seek(SeekFrom::End(0)).map_err(Failure::Io)?;
    file.rewind().map_err(Failure::Io)?;
    let decoder = HdrDecoder::new(BufReader::new(file))?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    let pixels = width as u64 * height as u64;
    if pixels > length_bytes.saturating_mul(MAX_PIXELS_PER_BYTE) {
        return Err(Failure::File(format!(
            "damaged Radiance file: its {length_bytes} bytes cannot hold the {width} × {height} pixels it claims"
        )));
    }
    if decoder.color_type() != ColorType::Rgb32F {
        return Err(Failure::File(format!("Radiance file: expected RGB, got {:?}", decoder.color_type())));
    }
    let mut pixels =
        zeroed::<[f32; 3]>(width * height, "the picture").map_err(|e| Failure::File(e.to_string()))?;
    decoder.read_image(bytemuck::cast_slice_mut(&mut pixels))?;
    Ok(Image { width, height, pixels })
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        match error {
            ImageError::IoError(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => Self::Io(e),
            ImageError::IoError(_) => Self::File("damaged Radiance file: it ends too early".into()),
            other => {
                let what = other.to_string().replace('\n', " ");
                Self::File(format!("damaged Radiance file: {what}"))
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    /// A file of flat pixels, as its specification has them.
    fn file(header: &str, pixels: &[[u8; 4]]) -> Vec<u8> {
        let mut bytes = header.as_bytes().to_vec();
        pixels.iter().for_each(|p| bytes.extend(p));
        bytes
    }

    fn read_bytes(bytes: &[u8]) -> Result<Image, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.hdr");
        std::fs::write(&path, bytes).unwrap();
        read_hdr(&path).map_err(|e| e.to_string().replace(&path.display().to_string(), "sky.hdr"))
    }

    const HEADER: &str = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=4\n\n-Y 1 +X 3\n";

    #[test]
    fn numbers_are_the_mantissas_times_the_exponent() {
        let image = read_bytes(&file(HEADER, &[[128, 64, 32, 129], [0, 0, 0, 0], [255, 0, 1, 140]])).unwrap();
        assert_eq!((image.width, image.height), (3, 1));
        // Mantissa / 256 · 2^(exponent − 128): Ward's own decoder adds half a step, Blender's and this one do not.
        let expected = |m: [u8; 3], e: i32| m.map(|m| f32::from(m) / 256.0 * 2f32.powi(e - 128));
        assert_eq!(image.pixels[0], expected([128, 64, 32], 129));
        assert_eq!(image.pixels[1], [0.0; 3]);
        assert_eq!(image.pixels[2], expected([255, 0, 1], 140));
    }

    /// What is damaged or absurd gets one line, and no memory for what is not there.
    #[test]
    fn damaged_files_are_refused() {
        let good = file(HEADER, &[[128, 64, 32, 129]; 3]);
        for length in 0..good.len() {
            let error = read_bytes(&good[..length]).unwrap_err();
            assert!(error.starts_with("sky.hdr: ") && !error.contains('\n'), "{length}: {error}");
        }
        let large = HEADER.replace("-Y 1 +X 3", "-Y 30000 +X 30000");
        let error = read_bytes(&file(&large, &[[1; 4]; 3])).unwrap_err();
        assert!(error.contains("cannot hold the 30000 × 30000 pixels"), "{error}");
        for order in ["+Y 1 +X 3", "-Y 0 +X 3", "-Y 1 +X -3", "-Y 1 +X 99999999999"] {
            let error = read_bytes(&file(&HEADER.replace("-Y 1 +X 3", order), &[[1; 4]; 3])).unwrap_err();
            assert!(error.starts_with("sky.hdr: ") && !error.contains('\n'), "{order}: {error}");
        }
    }
}
