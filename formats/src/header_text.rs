//! Reads the lines of a text header without trusting its length.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::error::{FormatError, Result};
use crate::stream::open_file;

/// Longest header that is read, in bytes. A Slicer file with ten thousand named segments has some 10 MB.
const MAX_HEADER_BYTES: u64 = 64 << 20;

/// Most lines of a header. A Slicer file has seven a segment; each line costs some 100 bytes of memory more than it is long.
const MAX_HEADER_LINES: usize = 1 << 20;

/// Lines of a header, and its end.
pub(crate) struct HeaderText {
    pub(crate) lines: Vec<String>,
    /// Offset of the first byte after the header.
    pub(crate) end: u64,
    /// Whether the header ended because the file did.
    pub(crate) at_file_end: bool,
}

/// Reads lines up to and including the first that `is_last` accepts, or to the end of the file. Bytes that are not UTF-8 become `\u{FFFD}`.
pub(crate) fn read_lines(path: &Path, mut is_last: impl FnMut(&str) -> bool) -> Result<HeaderText> {
    let mut reader = BufReader::new(open_file(path)?.take(MAX_HEADER_BYTES));
    let mut header = HeaderText { lines: Vec::new(), end: 0, at_file_end: false };
    let mut bytes = Vec::new();
    loop {
        bytes.clear();
        let n = reader.read_until(b'\n', &mut bytes).map_err(FormatError::io(path))?;
        header.end += n as u64;
        if n == 0 {
            if header.end >= MAX_HEADER_BYTES {
                return Err(FormatError::Limit {
                    path: path.to_owned(),
                    what: "the header's length".into(),
                    got: "more".into(),
                    limit: MAX_HEADER_BYTES,
                });
            }
            header.at_file_end = true;
            return Ok(header);
        }
        if header.lines.len() == MAX_HEADER_LINES {
            return Err(FormatError::Limit {
                path: path.to_owned(),
                what: "the header's number of lines".into(),
                got: "more".into(),
                limit: MAX_HEADER_LINES as u64,
            });
        }
        let line = String::from_utf8_lossy(&bytes);
        let line = line.trim_end_matches(['\n', '\r']);
        header.lines.push(line.to_owned());
        if is_last(line) {
            return Ok(header);
        }
    }
}

/// Parses numbers separated by white space; `None` if one of the words is not a number.
pub(crate) fn numbers<T: std::str::FromStr>(text: &str) -> Option<Vec<T>> {
    text.split_whitespace().map(|word| word.parse().ok()).collect()
}

/// Formats a number as printf does, with a pattern that has exactly one `%d`, `%3d` or `%03d`.
pub(crate) fn format_number(pattern: &str, number: i64) -> Option<String> {
    let (before, after) = pattern.split_once('%')?;
    let (width, after) = after.split_once(['d', 'i', 'u'])?;
    if after.contains('%') {
        return None;
    }
    let digits = if width.is_empty() { 0 } else { width.parse::<usize>().ok().filter(|&w| w <= 32)? };
    Some(if width.starts_with('0') {
        format!("{before}{number:0digits$}{after}")
    } else {
        format!("{before}{number:digits$}{after}")
    })
}

/// The first 60 characters of a text, for messages.
pub(crate) fn shorten(text: &str) -> String {
    let mut short: String = text.chars().take(60).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}
