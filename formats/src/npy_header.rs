//! Parses the header of a `.npy` array: a Python dictionary of three known keys, written as text.

use std::path::Path;

use pumice_core::error::one_line;

use crate::error::{FormatError, Result};
use crate::header_text::shorten;
use crate::stream::ByteStream;

/// First bytes of an array.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";

/// Longest header that is read, in bytes; NumPy's own reader stops at 10 000 bytes by default.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// Largest number of axes of an array (`NPY_MAXDIMS` of NumPy 2).
const MAX_AXES: usize = 64;

/// Type, order and shape of an array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NpyHeader {
    /// A type such as `<u4`, or the text of a list of fields.
    pub(crate) descr: String,
    pub(crate) fortran_order: bool,
    pub(crate) shape: Vec<u64>,
    /// Number of bytes from the file's start to the first voxel.
    pub(crate) bytes: u64,
}

impl NpyHeader {
    /// The shape as NumPy prints it.
    pub(crate) fn shape_text(&self) -> String {
        let sizes: Vec<String> = self.shape.iter().map(u64::to_string).collect();
        format!("({})", sizes.join(", "))
    }
}

/// Reads the header at the start of `stream`; the stream is at the first voxel afterwards.
pub(crate) fn read(path: &Path, stream: &mut dyn ByteStream) -> Result<NpyHeader> {
    let bad = |what: String| FormatError::damaged(path, what);
    let mut take = |n: usize| {
        let mut bytes = vec![0; n];
        let got = stream.fill(&mut bytes)?;
        if got < n {
            return Err(bad(format!("the NPY header is cut off: expected {n} more bytes, got {got}")));
        }
        Ok(bytes)
    };
    let start = take(8)?;
    if !start.starts_with(MAGIC) {
        return Err(bad(format!(
            "the array begins with {:02x?}, expected the magic \\x93NUMPY",
            &start[..6]
        )));
    }
    let length_bytes = match start[6] {
        1 => 2,
        2 | 3 => 4,
        other => {
            return Err(FormatError::unsupported(
                path,
                format!("the NPY version is {other}.{}", start[7]),
                "versions 1, 2 and 3 are read",
            ));
        }
    };
    // The length is little-endian whatever the array's byte order.
    let length = take(length_bytes)?.iter().rev().fold(0usize, |n, &b| n << 8 | usize::from(b));
    if length > MAX_HEADER_BYTES {
        return Err(FormatError::Limit {
            path: path.to_owned(),
            what: "the NPY header's length".into(),
            got: format!("{length} bytes"),
            limit: MAX_HEADER_BYTES as u64,
        });
    }
    let text = take(length)?;
    let text = String::from_utf8_lossy(&text);
    let (descr, fortran_order, shape) = parse(text.trim())
        .map_err(|what| bad(format!("the NPY header {:?}: {what}", shorten(text.trim()))))?;
    Ok(NpyHeader { descr, fortran_order, shape, bytes: (8 + length_bytes + length) as u64 })
}

/// Parses the dictionary and returns its three values.
fn parse(text: &str) -> std::result::Result<(String, bool, Vec<u64>), String> {
    let (mut descr, mut fortran_order, mut shape) = (None, None, None);
    let mut rest = text.strip_prefix('{').ok_or("expected a dictionary")?.trim_start();
    while !rest.starts_with('}') {
        let (key, after) = string(rest).ok_or("expected a quoted key")?;
        let after = after.trim_start().strip_prefix(':').ok_or("expected a colon after a key")?.trim_start();
        let (value, after) = value(after).ok_or("a value does not end")?;
        match key {
            // Messages have it, and a forged one may be long and have line ends.
            "descr" => descr = Some(one_line(&shorten(string(value).map_or(value, |(inner, _)| inner)))),
            "fortran_order" => {
                fortran_order = Some(match value {
                    "True" => true,
                    "False" => false,
                    _ => return Err("fortran_order: expected True or False".into()),
                });
            }
            "shape" => shape = Some(tuple(value)?),
            _ => return Err(format!("the key {:?} is not one of descr, fortran_order, shape", shorten(key))),
        }
        rest = after.trim_start();
        rest = match rest.strip_prefix(',') {
            Some(after) => after.trim_start(),
            None if rest.starts_with('}') => rest,
            None => return Err("expected a comma or the closing brace".into()),
        };
    }
    Ok((
        descr.ok_or("descr is missing")?,
        fortran_order.ok_or("fortran_order is missing")?,
        shape.ok_or("shape is missing")?,
    ))
}

/// Content of the quoted string at the start of `text`, and the text after it. Keys and plain types have no escapes.
fn string(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    text[1..].split_once(quote)
}

/// A value up to the next comma or brace, and the text after it. Brackets and quotes are skipped as a whole.
fn value(text: &str) -> Option<(&str, &str)> {
    let mut depth = 0usize;
    let mut quote = None;
    for (i, c) in text.char_indices() {
        match (quote, c) {
            (Some(q), c) if q == c => quote = None,
            (Some(_), _) => {}
            (None, '\'' | '"') => quote = Some(c),
            (None, ',' | '}') if depth == 0 => return Some((text[..i].trim_end(), &text[i..])),
            (None, '(' | '[' | '{') => depth += 1,
            (None, ')' | ']' | '}') => depth = depth.checked_sub(1)?,
            (None, _) => {}
        }
    }
    None
}

/// Parses a tuple such as `(3, 4, 5)`, `(3,)`, `()`. Python 2 wrote long numbers with an L at the end.
fn tuple(text: &str) -> std::result::Result<Vec<u64>, String> {
    let inner =
        text.strip_prefix('(').and_then(|t| t.strip_suffix(')')).ok_or("the shape is not a tuple")?.trim();
    let inner = inner.strip_suffix(',').unwrap_or(inner);
    if inner.is_empty() {
        return Ok(Vec::new());
    }
    let mut sizes = Vec::new();
    for word in inner.split(',') {
        let word = word.trim().trim_end_matches('L');
        let size = word
            .parse()
            .map_err(|_| format!("the size {:?}: expected a whole number ≥ 0 of 64 bits", shorten(word)))?;
        if sizes.len() == MAX_AXES {
            return Err(format!("the shape has more than {MAX_AXES} axes"));
        }
        sizes.push(size);
    }
    Ok(sizes)
}
