//! The text of a table: a file of bounded length in UTF-8, with or without its byte order mark.

use std::path::Path;

use super::wrong_cell;
use crate::error::{FormatError, Result};
use crate::store_files;

/// Longest table that is read: 10⁷ labels with a hundred bytes each.
const MOST_BYTES: u64 = 1 << 30;

/// Most rows of a table: each takes some hundred bytes of memory, however few the file has of it.
pub(super) const MOST_ROWS: usize = 1 << 24;

/// Reads a file as text.
///
/// # Errors
/// When it is no file, is too long, or is not UTF-8; then the line is named.
pub(super) fn read(path: &Path) -> Result<String> {
    let mut bytes = store_files::read(path, MOST_BYTES).map_err(FormatError::io(path))?;
    let wide = bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF");
    if wide || bytes.iter().take(1000).any(|&b| b == 0) {
        let what = match wide {
            true => "expected text in UTF-8, got UTF-16: save the table as UTF-8",
            false => "expected a table of labels, got a binary file",
        };
        return Err(FormatError::damaged(path, what));
    }
    let start = if bytes.starts_with("\u{FEFF}".as_bytes()) { 3 } else { 0 };
    bytes.drain(..start);
    String::from_utf8(bytes).map_err(|error| {
        let (at, bytes) = (error.utf8_error().valid_up_to(), error.as_bytes());
        let line = 1 + bytes[..at].iter().filter(|&&b| b == b'\n').count() as u64;
        let column = at - bytes[..at].iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1) + 1;
        let what = format!("expected text in UTF-8, got byte {:02x}: save the table as UTF-8", bytes[at]);
        wrong_cell(path, line, column, what)
    })
}

/// Lines with their numbers from 1, without those that are empty or begin with `#`.
pub(super) fn data_lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    let numbered = text.lines().enumerate().map(|(i, line)| (i as u64 + 1, line.trim()));
    numbered.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Checks that a table may have one row more.
pub(super) fn check_rows(path: &Path, rows: usize) -> Result<()> {
    if rows < MOST_ROWS {
        return Ok(());
    }
    Err(FormatError::Limit {
        path: path.to_owned(),
        what: "the table's number of rows".into(),
        got: "more".into(),
        limit: MOST_ROWS as u64,
    })
}
