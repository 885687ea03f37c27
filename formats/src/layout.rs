//! Maps stored elements to voxels: the axes of a file from fastest to slowest, and the meaning of each.
//!
//! ```text
//! Slicer, two overlapping layers:  list(2) x(128) y(128) z(34)      layer 1 → fixed(1) X Y Z
//! ImageJ hyperstack:               x y c(3) z t(5)                  → X Y fixed(c) Z fixed(t)
//! NumPy, C order, a[x, y, z]:      z y x                            → Z Y X
//! ```

use std::path::Path;

use pumice_core::MAX_DIM;

use crate::error::{FormatError, Result};

/// Meaning of an axis of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Axis x, y or z (0, 1, 2) of the volume.
    Space(usize),
    /// Not an axis of the volume; only this index of it is read.
    Fixed(u64),
}

/// One axis of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FileAxis {
    pub(crate) size: u64,
    pub(crate) role: Role,
}

/// All axes, fastest first; each of x, y and z occurs exactly once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    axes: Vec<FileAxis>,
    element_bytes: u64,
}

impl Layout {
    /// Checks the sizes, and adds those of x, y, z that are missing as slowest axes of size 1.
    pub(crate) fn new(path: &Path, mut axes: Vec<FileAxis>, element_bytes: usize) -> Result<Self> {
        for space in 0..3 {
            if !axes.iter().any(|a| a.role == Role::Space(space)) {
                axes.push(FileAxis { size: 1, role: Role::Space(space) });
            }
        }
        let mut total = element_bytes as u64;
        for axis in &axes {
            if axis.size == 0 {
                return Err(FormatError::damaged(path, "a size is 0: the volume has no voxels"));
            }
            if let Role::Space(space) = axis.role
                && axis.size > u64::from(MAX_DIM)
            {
                return Err(FormatError::Limit {
                    path: path.to_owned(),
                    what: format!("the size along {}", ["x", "y", "z"][space]),
                    got: format!("{} voxels", axis.size),
                    limit: MAX_DIM.into(),
                });
            }
            total = total.checked_mul(axis.size).ok_or_else(|| FormatError::Limit {
                path: path.to_owned(),
                what: format!(
                    "the product of the sizes {}",
                    axes.iter().map(|a| a.size.to_string()).collect::<Vec<_>>().join(" × ")
                ),
                got: "more than 2^64 bytes".into(),
                limit: u64::MAX,
            })?;
        }
        Ok(Self { axes, element_bytes: element_bytes as u64 })
    }

    /// A layout of axes x, y, z with these sizes, x fastest.
    pub(crate) fn x_fastest(path: &Path, dims: [u64; 3], element_bytes: usize) -> Result<Self> {
        let axes = [0, 1, 2].map(|a| FileAxis { size: dims[a], role: Role::Space(a) });
        Self::new(path, axes.to_vec(), element_bytes)
    }

    /// The axes, fastest first.
    pub(crate) fn axes(&self) -> &[FileAxis] {
        &self.axes
    }

    /// Size of the volume in voxels along x, y, z.
    pub(crate) fn dims(&self) -> [u32; 3] {
        let mut dims = [1; 3];
        for axis in &self.axes {
            if let Role::Space(space) = axis.role {
                // At most MAX_DIM, checked in `new`.
                dims[space] = axis.size as u32;
            }
        }
        dims
    }

    /// Bytes of all elements of the file, including those that are not read.
    pub(crate) fn total_bytes(&self) -> u64 {
        self.stride_bytes(self.axes.len())
    }

    /// Distance in bytes between neighbours along file axis `axis`.
    pub(crate) fn stride_bytes(&self, axis: usize) -> u64 {
        self.axes[..axis].iter().map(|a| a.size).product::<u64>() * self.element_bytes
    }

    /// Size of one element in bytes.
    pub(crate) fn element_bytes(&self) -> usize {
        self.element_bytes as usize
    }
}
