//! Cells of tables: ids, colours, numbers. Each parser says what it expected; the caller adds the place.

use std::path::Path;

use pumice_core::error::one_line;

use super::wrong_cell;
use crate::error::Result;
use crate::header_text::shorten;

/// A text from a file as errors quote it: short, in one line, in quotes that show its ends.
pub(super) fn quoted(text: &str) -> String {
    format!("`{}`", one_line(&shorten(text)))
}

/// Parses a label id: decimal digits.
pub(super) fn id(text: &str) -> std::result::Result<u64, String> {
    let is_whole = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    match text.parse() {
        Ok(id) if is_whole => Ok(id),
        _ if is_whole => Err(format!("expected an id up to {}, got {}", u64::MAX, quoted(text))),
        _ if text.is_empty() => Err("expected an id, got an empty cell".into()),
        _ => Err(format!("expected an id, a whole number of 0 or more, got {}", quoted(text))),
    }
}

/// A channel of a colour as a byte.
pub(super) fn byte(text: &str) -> std::result::Result<u8, String> {
    text.parse().map_err(|_| format!("expected a colour from 0 to 255, got {}", quoted(text)))
}

/// A finite number.
pub(super) fn number(text: &str) -> std::result::Result<f64, String> {
    text.parse()
        .ok()
        .filter(|v: &f64| v.is_finite())
        .ok_or_else(|| format!("expected a finite number, got {}", quoted(text)))
}

/// A colour as `#rrggbb` or `rrggbb`; `None` for an empty cell.
pub(super) fn hex_color(text: &str) -> std::result::Result<Option<[f32; 3]>, String> {
    if text.is_empty() {
        return Ok(None);
    }
    let digits = text.strip_prefix('#').unwrap_or(text);
    let is_hex = digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    match u32::from_str_radix(digits, 16) {
        Ok(packed) if is_hex => {
            Ok(Some(color_of_bytes([packed >> 16, packed >> 8, packed].map(|c| c as u8))))
        }
        _ => Err(format!("expected a colour #rrggbb, got {}", quoted(text))),
    }
}

/// An sRGB-encoded colour from bytes.
pub(super) fn color_of_bytes(bytes: [u8; 3]) -> [f32; 3] {
    bytes.map(|byte| f32::from(byte) / 255.0)
}

/// The bytes of an sRGB-encoded colour, rounded.
pub(super) fn bytes_of_color(color: [f32; 3]) -> [u8; 3] {
    color.map(|channel| (channel * 255.0).round() as u8)
}

/// Checks that no id comes twice; `lines` has the line of each.
pub(super) fn check_once(path: &Path, ids: &[u64], lines: &[u64], column: usize) -> Result<()> {
    let mut order: Vec<usize> = (0..ids.len()).collect();
    order.sort_by_key(|&row| (ids[row], row));
    match order.windows(2).find(|pair| ids[pair[0]] == ids[pair[1]]) {
        Some(&[first, second]) => {
            let what = format!("expected each id once, got {} as in line {}", ids[first], lines[first]);
            Err(wrong_cell(path, lines[second], column, what))
        }
        _ => Ok(()),
    }
}
