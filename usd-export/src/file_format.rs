//! The formats of files that can be written, by the endings of their names.

use std::path::Path;

use pumice_core::Error;

use crate::scene_gltf::MOST_GLB_BYTES;
use crate::{FaceBytes, Form, Result};

/// A format of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FileFormat {
    /// USD as text.
    Usda,
    /// USD as a crate file.
    Usdc,
    /// A package of a crate file and the pictures that it refers to.
    Usdz,
    /// glTF as text, with a `.bin` beside it.
    Gltf,
    /// glTF in one binary file.
    Glb,
    /// PLY, binary.
    Ply,
    /// Wavefront OBJ, with an `.mtl` beside it.
    Obj,
    /// STL, binary.
    Stl,
}

impl FileFormat {
    /// All formats.
    pub const ALL: [Self; 8] =
        [Self::Usda, Self::Usdc, Self::Usdz, Self::Gltf, Self::Glb, Self::Ply, Self::Obj, Self::Stl];

    /// The ending of its files' names.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Usda => "usda",
            Self::Usdc => "usdc",
            Self::Usdz => "usdz",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
            Self::Ply => "ply",
            Self::Obj => "obj",
            Self::Stl => "stl",
        }
    }

    /// Bytes of its faces and boxes, of the exact surface of a connectome: long coordinates as text take more than short ones. Those of glTF
    /// are the least that they take, 24 more for each face of the material that has the most; the whole is checked before it is written.
    pub fn face_bytes(self) -> FaceBytes {
        match self {
            Self::Usda => FaceBytes { a_face: 125, a_smooth_face: 141, a_box: 70 },
            Self::Usdc | Self::Usdz => FaceBytes { a_face: 49, a_smooth_face: 38, a_box: 26 },
            Self::Gltf | Self::Glb => FaceBytes { a_face: 64, a_smooth_face: 54, a_box: 28 },
            Self::Ply => FaceBytes { a_face: 85, a_smooth_face: 57, a_box: 0 },
            Self::Obj => FaceBytes { a_face: 165, a_smooth_face: 125, a_box: 0 },
            Self::Stl => FaceBytes { a_face: 100, a_smooth_face: 100, a_box: 0 },
        }
    }

    /// Whether it is one of USD's formats.
    pub fn is_usd(self) -> bool {
        matches!(self, Self::Usda | Self::Usdc | Self::Usdz)
    }

    /// Checks that a file of this format holds all these forms.
    ///
    /// # Errors
    /// [`Error::Caller`] for no form, for several in a format that has no variants to switch between, and for instances in one that has none.
    pub fn check_forms(self, forms: &[Form]) -> Result<()> {
        let has_variants = self.is_usd();
        let has_instances = has_variants || matches!(self, Self::Gltf | Self::Glb);
        let refused =
            |what: String| Err(Error::Caller(format!("form: a .{} file {what}", self.ending())).into());
        if forms.is_empty() {
            return refused("needs one of instances, boxes, cells4, voxels, smooth".into());
        }
        if forms.len() > 1 && !has_variants {
            let names: Vec<&str> = forms.iter().map(|form| form.name()).collect();
            return refused(format!("holds one, got {}; write a file for each", names.join(", ")));
        }
        if forms.contains(&Form::Instances) && !has_instances {
            return refused("has no instances; expected voxels, cells4, boxes or smooth".into());
        }
        Ok(())
    }

    /// Most bytes that a file of this format can have.
    pub fn most_bytes(self) -> u64 {
        match self {
            // Offsets in packages have 32 bits.
            Self::Usdz => u32::MAX.into(),
            Self::Glb => MOST_GLB_BYTES,
            _ => u64::MAX,
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
        for format in FileFormat::ALL {
            assert!(format.check_forms(&[Form::Voxels]).is_ok() && format.check_forms(&[]).is_err());
            let has_variants = format.ending().starts_with("usd");
            assert_eq!(format.check_forms(&[Form::Boxes, Form::Voxels]).is_ok(), has_variants);
        }
        assert!(refused(&folder.path().join("missing/a.usda")).contains("missing: No such file"));
    }
}
