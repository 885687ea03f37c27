//! Forms in which a volume is written.

use pumice_transport::geometry::DetailLevel;

/// A form in which volumes are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Form {
    /// Every box, as a scaled cube.
    Instances,
    /// The visible surface of the boxes: level of detail 16.
    Boxes,
    /// The visible surface of cells of 4³ voxels: level of detail 4.
    Cells,
    /// The visible surface of the voxels: exact.
    Voxels,
    /// The surface of each label, smoothed: not exact ([`SmoothMesh`](crate::SmoothMesh)).
    Smooth,
}

impl Form {
    /// All forms, from the coarsest on; the smoothed one last.
    pub const ALL: [Self; 5] = [Self::Instances, Self::Boxes, Self::Cells, Self::Voxels, Self::Smooth];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Instances => "instances",
            Self::Boxes => "boxes",
            Self::Cells => "cells4",
            Self::Voxels => "voxels",
            Self::Smooth => "smooth",
        }
    }

    /// The level of detail whose surface it is; none for instances and for the smoothed surface, which no renderer draws.
    pub fn level(self) -> Option<DetailLevel> {
        match self {
            Self::Instances | Self::Smooth => None,
            Self::Boxes => Some(DetailLevel::Boxes),
            Self::Cells => Some(DetailLevel::Cells),
            Self::Voxels => Some(DetailLevel::Voxels),
        }
    }
}
