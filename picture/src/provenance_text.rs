//! Writes provenance as the text that picture files carry, and reads it from OpenEXR and PNG files.

use std::io::{BufReader, Read, Seek};
use std::path::Path;

use pumice_core::open_input;
use serde::Serialize;

use crate::exr_read::{self, Failure};
use crate::png_file;
use crate::provenance_paths::from_file;
use crate::{PictureError, Provenance};

/// Name of the EXR attribute and keyword of the PNG text that hold the provenance.
pub(crate) const PROVENANCE_KEY: &str = "pumice";

/// Reads the provenance of the picture at `path`, which is an OpenEXR or PNG file by its content; `None` if it has none. Relative paths in
/// it are taken from the picture's folder and become absolute.
///
/// # Errors
/// [`PictureError::Io`] for an error of the system, [`PictureError::File`] when the file is of another kind or damaged, or when its
/// provenance is not one that this version knows.
pub fn read_provenance(path: &Path) -> Result<Option<Provenance>, PictureError> {
    let read = || {
        let mut file = BufReader::new(open_input(path).map_err(Failure::Io)?);
        let mut signature = Vec::new();
        file.by_ref().take(8).read_to_end(&mut signature).map_err(Failure::Io)?;
        file.rewind().map_err(Failure::Io)?;
        // Magic number 20000630 (OpenEXR file layout); PNG signature (ISO/IEC 15948 §5.2).
        if signature.starts_with(&[0x76, 0x2F, 0x31, 0x01]) {
            exr_read::read_provenance_from(file)
        } else if signature == *b"\x89PNG\r\n\x1A\n" {
            png_file::read_provenance_from(file)
        } else {
            Err(Failure::File("expected an OpenEXR or PNG file".into()))
        }
    };
    let made = read().map_err(|failure: Failure| failure.at(path))?;
    Ok(made.map(|made| from_file(made, path)))
}

/// The provenance as JSON in pure ASCII.
pub(crate) fn provenance_to_ascii(provenance: &Provenance) -> Result<String, String> {
    json_in_ascii(provenance).map_err(|e| format!("provenance: {e}"))
}

/// A value as JSON in pure ASCII.
pub(crate) fn json_in_ascii(value: &impl Serialize) -> Result<String, serde_json::Error> {
    let json = serde_json::to_string(value)?;
    let mut ascii = String::with_capacity(json.len());
    for c in json.chars() {
        if c.is_ascii() {
            ascii.push(c);
        } else {
            // JSON escapes characters beyond the first 65,536 as two surrogates (RFC 8259 §7).
            for unit in c.encode_utf16(&mut [0; 2]) {
                ascii.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    Ok(ascii)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Passes, sample_pictures, write_exr, write_png};

    #[test]
    fn both_kinds_of_file_give_it_back_whatever_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let mut picture = sample_pictures::picture(5, 4);
        let (exr, png) = (folder.path().join("a.png"), folder.path().join("b.exr"));
        write_exr(&exr, &picture, &Passes::NONE).unwrap();
        write_png(&png, &picture).unwrap();
        // The sample's source is relative, so it is taken from the picture's folder.
        let mut expected = sample_pictures::provenance();
        let source = &mut expected.scene.instances[0].source;
        *source = folder.path().canonicalize().unwrap().join(&*source);
        for path in [&exr, &png] {
            assert_eq!(read_provenance(path).unwrap(), Some(expected.clone()));
        }
        picture.provenance = None;
        write_exr(&exr, &picture, &Passes::NONE).unwrap();
        write_png(&png, &picture).unwrap();
        for path in [&exr, &png] {
            assert_eq!(read_provenance(path).unwrap(), None);
        }
    }

    #[test]
    fn damage_and_other_files_are_refused_or_have_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let missing = read_provenance(&path).unwrap_err();
        assert!(matches!(missing, PictureError::Io { .. }), "{missing}");
        std::fs::write(&path, "GIF89a").unwrap();
        let error = read_provenance(&path).unwrap_err().to_string();
        assert!(error.ends_with("a: expected an OpenEXR or PNG file"), "{error}");

        let expected = sample_pictures::provenance();
        let picture = sample_pictures::picture(5, 4);
        write_exr(&path, &picture, &Passes::NONE).unwrap();
        let exr = std::fs::read(&path).unwrap();
        write_png(&path, &picture).unwrap();
        let png = std::fs::read(&path).unwrap();
        type Read = fn(std::io::Cursor<Vec<u8>>) -> Result<Option<Provenance>, Failure>;
        let kinds: [(_, Read); 2] =
            [(&exr, exr_read::read_provenance_from), (&png, png_file::read_provenance_from)];
        for (bytes, read) in kinds {
            assert_eq!(read(std::io::Cursor::new(bytes.clone())).ok().flatten().as_ref(), Some(&expected));
            for length in 0..bytes.len() {
                // What is cut off may still hold all of it, or none, but never another.
                let got = read(std::io::Cursor::new(bytes[..length].to_vec())).ok().flatten();
                assert!(got.is_none() || got.as_ref() == Some(&expected), "{length} bytes");
            }
            for i in 0..bytes.len() * 8 {
                let mut damaged = bytes.clone();
                damaged[i / 8] ^= 1 << (i % 8);
                let _ = read(std::io::Cursor::new(damaged));
            }
        }
    }

    #[test]
    fn the_text_is_ascii_and_means_the_same() {
        let text = provenance_to_ascii(&sample_pictures::provenance()).unwrap();
        assert!(text.is_ascii() && text.contains("gehirn \\u00df\\u6f22\\ud83e\\udde0"), "{text}");
        assert_eq!(serde_json::from_str::<Provenance>(&text).unwrap(), sample_pictures::provenance());
    }
}
