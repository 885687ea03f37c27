//! The two files of glTF.
//!
//! ```text
//! .glb, little-endian                                .gltf                JSON, whose buffer names the .bin
//!  0  magic "glTF"                                   NAME.CONTENT.bin     the binary part: the name of the .gltf, and a hash
//!  4  version 2, u32
//!  8  bytes of the file, u32
//! 12  bytes of the JSON, u32
//! 16  "JSON"
//! 20  JSON, and spaces up to a multiple of 4
//!  …  bytes of the binary part, u32
//!  …  "BIN" and a zero
//!  …  binary part
//! ```

use std::io::Write;
use std::path::Path;

use gltf_json::Buffer;
use gltf_json::validation::USize64;
use pumice_core::{Error, Job};

use super::Gltf;
use crate::Result;
use crate::whole_file::{write_whole, write_with_beside};

/// Most bytes of a `.glb`, whose lengths have 32 bits.
pub(crate) const MOST_GLB_BYTES: u64 = u32::MAX as u64;

impl Gltf<'_> {
    /// Writes a `.glb`. Returns its bytes.
    ///
    /// # Errors
    /// [`Error::Limit`] for a file beyond 4 GiB, before anything is written; [`Error::Io`]; [`Error::Cancelled`].
    pub(crate) fn write_glb(&self, path: &Path, job: &Job) -> Result<u64> {
        let mut json = self.json(None)?;
        json.resize(json.len().next_multiple_of(4), b' ');
        let bytes = 28 + json.len() as u64 + self.binary.bytes();
        let [whole, json_bytes, binary_bytes] =
            [lengths(bytes)?, json.len() as u32, self.binary.bytes() as u32];
        write_whole(path, job, |out| {
            let mut put = |numbers: &[u32], name: &[u8; 4]| {
                numbers.iter().try_for_each(|number| out.write_all(&number.to_le_bytes()))?;
                out.write_all(name)
            };
            put(&[], b"glTF")?;
            put(&[2, whole, json_bytes], b"JSON")?;
            out.write_all(&json)?;
            out.write_all(&binary_bytes.to_le_bytes())?;
            out.write_all(b"BIN\0")?;
            Ok(self.binary.write(out)?)
        })
    }

    /// Writes a `.gltf` and its `.bin`: both, or neither. Returns the bytes of both.
    ///
    /// # Errors
    /// [`Error::Caller`] for a name that is not in UTF-8; [`Error::Io`]; [`Error::Cancelled`].
    pub(crate) fn write_gltf(&self, path: &Path, job: &Job) -> Result<u64> {
        let binary = |out: &mut dyn Write| Ok(self.binary.write(out)?);
        let json = |beside: &str, out: &mut dyn Write| Ok(out.write_all(&self.json(Some(beside))?)?);
        write_with_beside(path, "bin", job, binary, json)
    }

    /// The JSON, for a buffer in this file, or in the same file where there is none.
    fn json(&self, buffer_in: Option<&str>) -> Result<Vec<u8>> {
        let mut root = self.root.clone();
        root.push(Buffer {
            byte_length: USize64(self.binary.bytes()),
            name: None,
            uri: buffer_in.map(uri),
            extensions: None,
            extras: None,
        });
        Ok(root.to_vec().map_err(|e| Error::Caller(format!("a scene cannot be written as JSON: {e}")))?)
    }
}

/// A length of a `.glb`.
fn lengths(bytes: u64) -> Result<u32> {
    u32::try_from(bytes).map_err(|_| {
        let what = "bytes of a .glb, whose lengths have 32 bits (a .gltf may have more)".into();
        Error::Limit { what, limit: MOST_GLB_BYTES, got: bytes }.into()
    })
}

/// The name of a file as a relative URI: every byte but letters, digits and `-._~` as `%` and two digits (RFC 3986, §2.3).
fn uri(name: &str) -> String {
    let coded = name.bytes().map(|byte| match byte {
        b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => char::from(byte).to_string(),
        _ => format!("%{byte:02X}"),
    });
    coded.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_beyond_32_bits_are_refused() {
        assert_eq!(lengths(u64::from(u32::MAX)).unwrap(), u32::MAX);
        let error = lengths(1 << 32).unwrap_err().to_string();
        assert_eq!(
            error,
            "bytes of a .glb, whose lengths have 32 bits (a .gltf may have more): 4294967296 is more than the limit of 4294967295"
        );
    }

    #[test]
    fn names_become_uris() {
        assert_eq!(uri("my figure 3µ.bin"), "my%20figure%203%C2%B5.bin");
    }
}
