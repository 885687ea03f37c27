//! A box of voxels that an export is limited to: what lies outside is not shown, so surfaces are closed where they leave it.
//!
//! ```text
//!   ┌───────────────┐ volume          voxels              those within
//!   │   ┌─────┐     │                 cells of 4³         whole cells that overlap it
//!   │   │     │ high (not included)   boxes, instances    whole boxes that overlap it
//!   │   └─────┘     │
//!   │  low          │                 so the coarse forms may reach beyond it, by up to 3 and 15 voxels
//!   └───────────────┘
//! ```

use pumice_core::Error;

use crate::Result;

/// A box of voxels in index space, with at least one voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct VoxelRegion {
    low: [u32; 3],
    high: [u32; 3],
}

impl VoxelRegion {
    /// The voxels from `low` up to, and without, `high`, both x, y, z.
    ///
    /// # Errors
    /// [`Error::Caller`] where `low` is not below `high` on each axis.
    pub fn new(low: [u32; 3], high: [u32; 3]) -> Result<Self> {
        if (0..3).all(|a| low[a] < high[a]) {
            return Ok(Self { low, high });
        }
        let ([x0, y0, z0], [x1, y1, z1]) = (low, high);
        let what = "region: expected X0,Y0,Z0,X1,Y1,Z1 with X0 below X1, Y0 below Y1, Z0 below Z1";
        Err(Error::Caller(format!("{what}, got {x0},{y0},{z0},{x1},{y1},{z1}")).into())
    }

    /// All voxels of a volume.
    pub(crate) fn whole(dims: [u32; 3]) -> Self {
        Self { low: [0; 3], high: dims }
    }

    /// Its lowest voxel.
    pub fn low(&self) -> [u32; 3] {
        self.low
    }

    /// The voxel beyond its highest one, on each axis.
    pub fn high(&self) -> [u32; 3] {
        self.high
    }

    /// Checks that it lies within a volume, which errors call `name`.
    ///
    /// # Errors
    /// [`Error::Caller`].
    pub(crate) fn check_within(&self, dims: [u32; 3], name: &str) -> Result<()> {
        if (0..3).all(|a| self.high[a] <= dims[a]) {
            return Ok(());
        }
        let ([x, y, z], [x1, y1, z1]) = (dims, self.high);
        let what = format!("region: expected X1,Y1,Z1 of at most {x},{y},{z}, the voxels of {name}");
        Err(Error::Caller(format!("{what}, got {x1},{y1},{z1}")).into())
    }

    /// Whether it has a voxel of the box of `extent` voxels whose lowest is `low`.
    pub(crate) fn overlaps(&self, low: [u32; 3], extent: [u32; 3]) -> bool {
        (0..3).all(|a| low[a] < self.high[a] && low[a] + extent[a] > self.low[a])
    }
}

/// Why a file would have nothing in it.
pub(crate) fn nothing_shown(region: Option<VoxelRegion>) -> Error {
    let within = region.map_or("", |_| " within the region");
    Error::Caller(format!(
        "nothing of the scene's volumes is left: no label is shown{within}, or cuts remove them all"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_has_voxels_and_lies_within_the_volume() {
        let region = VoxelRegion::new([1, 2, 3], [4, 5, 6]).unwrap();
        assert!(region.check_within([4, 5, 6], "volume_1").is_ok());
        let error = region.check_within([4, 4, 6], "volume_1").unwrap_err().to_string();
        assert_eq!(error, "region: expected X1,Y1,Z1 of at most 4,4,6, the voxels of volume_1, got 4,5,6");
        for high in [[4, 2, 6], [4, 1, 6]] {
            let error = VoxelRegion::new([1, 2, 3], high).unwrap_err().to_string();
            assert!(error.ends_with(&format!("Z0 below Z1, got 1,2,3,4,{},6", high[1])), "{error}");
        }
    }

    #[test]
    fn boxes_that_only_touch_do_not_overlap() {
        let region = VoxelRegion::new([4, 4, 4], [8, 8, 8]).unwrap();
        assert!(region.overlaps([0, 0, 0], [5, 5, 5]) && region.overlaps([7, 7, 7], [1, 1, 1]));
        assert!(!region.overlaps([0, 0, 0], [4, 16, 16]) && !region.overlaps([8, 4, 4], [4, 4, 4]));
    }
}
