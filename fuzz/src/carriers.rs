//! Pictures that carry a text as Pumice's provenance, for the reader that `--again` uses.
//!
//! ```text
//! input   0     1 byte    the carrier: PNG with a plain text, PNG with a compressed text, EXR (modulo 3)
//!         1     1 byte    n: the first byte of the text is repeated 2¹⁹ · n times before it, up to 133 MB
//!         2     the text
//! ```
//! Deflate makes a thousandth of such a repetition, so that the input and the file stay small where the text is long. A file that holds the
//! text itself is as long as the text; there it is not repeated.

use std::path::Path;

/// Number of carriers.
pub const COUNT: u8 = 3;

/// Writes the picture that an input of this form stands for; false where the input is too short, or the text cannot be carried.
///
/// # Panics
/// When the file cannot be written.
pub fn put(path: &Path, input: &[u8]) -> bool {
    let [carrier, times, text @ ..] = input else { return false };
    match carrier % COUNT {
        0 => std::str::from_utf8(text).is_ok_and(|text| put_png(path, text, false)),
        1 => {
            let repeated =
                text.first().map(|&byte| vec![byte; usize::from(*times) << 19]).unwrap_or_default();
            let text = [repeated.as_slice(), text].concat();
            std::str::from_utf8(&text).is_ok_and(|text| put_png(path, text, true))
        }
        _ => put_exr(path, text),
    }
}

/// A PNG of one pixel with the text in an `iTXt` chunk.
fn put_png(path: &Path, text: &str, compressed: bool) -> bool {
    let mut bytes = Vec::new();
    let encoder = png::Encoder::new(&mut bytes, 1, 1);
    let mut chunk = png::text_metadata::ITXtChunk::new("pumice", text);
    chunk.compressed = compressed;
    let is_written = encoder.write_header().is_ok_and(|mut writer| {
        writer.write_text_chunk(&chunk).is_ok()
            && writer.write_image_data(&[0]).is_ok()
            && writer.finish().is_ok()
    });
    std::fs::write(path, bytes).unwrap();
    is_written
}

/// An EXR of one pixel with the text as an attribute.
fn put_exr(path: &Path, text: &[u8]) -> bool {
    use exr::prelude::{
        AttributeValue, Encoding, Image, Layer, LayerAttributes, SpecificChannels, Text, Vec2, WritableImage,
    };
    let Some(text) = std::str::from_utf8(text).ok().and_then(Text::new_or_none) else { return false };
    let mut attributes = LayerAttributes::default();
    attributes.other.insert(Text::from("pumice"), AttributeValue::Text(text));
    let pixel = |_: Vec2<usize>| (0f32, 0f32, 0f32);
    let layer = Layer::new((1, 1), attributes, Encoding::UNCOMPRESSED, SpecificChannels::rgb(pixel));
    Image::from_layer(layer).write().to_file(path).is_ok()
}
