//! The formats of files that can be written, by the endings of their names.

use std::path::Path;

use pumice_core::Error;

use crate::{FaceBytes, Result};

/// A format of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FileFormat {
    /// USD as text.
    Usda,
    /// USD as a crate file.
    Usdc,
    /// A package of a crate file and the pictures that it refers to.
    Usdz,
}

impl FileFormat {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Usda, Self::Usdc, Self::Usdz];

    /// The ending of its files' names.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Usda => "usda",
            Self::Usdc => "usdc",
            Self::Usdz => "usdz",
        }
    }

    /// Bytes of its faces and boxes, of the exact surface of a connectome: long coordinates as text take more than short ones.
    pub fn face_bytes(self) -> FaceBytes {
        match self {
            Self::Usda => FaceBytes { a_face: 125, a_box: 70 },
            Self::Usdc | Self::Usdz => FaceBytes { a_face: 49, a_box: 26 },
        }
    }

    /// Largest size of its files: offsets in packages have 32 bits.
    pub fn most_bytes(self) -> u64 {
        match self {
            Self::Usda | Self::Usdc => u64::MAX,
            Self::Usdz => u32::MAX.into(),
        }
    }

    /// The format that a file's name asks for, where its folder exists: so that a wrong name shows before the work is done.
    ///
    /// # Errors
    /// [`Error::Caller`] for another ending; [`Error::Io`] for a folder that does not exist.
    pub fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let known = Self::ALL.into_iter().find(|known| ending.eq_ignore_ascii_case(known.ending()));
        let known = known.ok_or_else(|| {
            let (path, endings) = (path.display(), Self::ALL.map(Self::ending).join(", ."));
            Error::Caller(format!("{path}: expected a name that ends in .{endings}"))
        })?;
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::metadata(folder).map_err(|source| Error::Io { path: folder.to_owned(), source })?;
        }
        Ok(known)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_chooses_the_format() {
        let folder = tempfile::tempdir().unwrap();
        for format in FileFormat::ALL {
            let name = folder.path().join(format!("a.b.{}", format.ending().to_uppercase()));
            assert_eq!(FileFormat::of(&name).unwrap(), format);
        }
        let refused = |path: &Path| FileFormat::of(path).unwrap_err().to_string();
        assert!(refused(&folder.path().join("a.usd")).contains("a.usd: expected a name that ends in .usda"));
        assert!(refused(&folder.path().join("missing/a.usda")).contains("missing: No such file"));
    }
}
