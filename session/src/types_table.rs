//! The table of types: a CSV file with the columns id,type.

use std::path::Path;

use crate::error::{Result, SessionError, io};

/// Largest table that is read: 10⁷ labels with names of some 90 bytes.
const LIMIT_BYTES: u64 = 1 << 30;

/// Reads (label id, type name) pairs. The first line may be a header; blank lines and lines that begin with # are left out.
///
/// # Errors
/// The line at fault, by its number.
pub fn read_types(path: &Path) -> Result<Vec<(u64, String)>> {
    let bytes = std::fs::metadata(path).map_err(io(path))?.len();
    let fault = |what: String| SessionError::Caller(format!("{}: {what}", path.display()));
    if bytes > LIMIT_BYTES {
        return Err(fault(format!("a table of types of {bytes} bytes is more than the limit of {LIMIT_BYTES}")));
    }
    let text = std::fs::read_to_string(path).map_err(io(path))?;
    let mut types = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (id, name) = line
            .split_once([',', '\t', ';'])
            .ok_or_else(|| fault(format!("line {}: expected id,type, got \"{line}\"", i + 1)))?;
        match id.trim().trim_matches('"').parse() {
            Ok(id) => types.push((id, name.trim().trim_matches('"').to_string())),
            Err(_) if types.is_empty() && i == 0 => {}
            Err(_) => {
                let id = id.trim();
                return Err(fault(format!("line {}: expected a whole number as id, got \"{id}\"", i + 1)));
            }
        }
    }
    Ok(types)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<(u64, String)>> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        read_types(file.path())
    }

    #[test]
    fn tables_are_read_with_and_without_header() {
        let wanted = vec![(1, "axon".to_string()), (u64::MAX, "dendrite, spiny".to_string())];
        for text in ["id,type\n1,axon\n18446744073709551615,dendrite, spiny\n", "# c\n1 , axon\n\n18446744073709551615,\"dendrite, spiny\""] {
            assert_eq!(read(text).unwrap(), wanted);
        }
    }

    #[test]
    fn faults_name_the_line() {
        for (text, line) in [("id,type\n1,a\nx,b", "line 3"), ("1,a\n2", "line 2"), ("id,type\n-1,a", "line 2")] {
            assert!(read(text).unwrap_err().to_string().contains(line), "{text}");
        }
    }
}
