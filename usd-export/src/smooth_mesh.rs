//! The smoothed surface of a volume as one mesh.
//!
//! ```text
//!           points            vertices                       quads
//!           position          point, label, normal           four vertices
//!
//!     label 1 │ label 2       ●  one point for each label    where labels touch, both have a face of the same corners,
//!     ────────●────────       ●● one vertex for each kind    turned around
//!       nothing                  of face: outside, common
//! ```
//! It is *not exact*: the voxels' corners move by up to 0.4 of a voxel along each axis, and what is round loses volume (of a ball of radius
//! 10, 3 %; of a single voxel, most). What stays is which labels touch. Each label's surface is closed: leave the others out, and nothing is
//! open. Points of labels that touch are the same numbers. Normals are smooth on the outside, across labels, and sharp where a label leaves it.
//!
//! Crates that make surface nets (`fast-surface-nets`, `isosurface`) take signed distances of one label; borders of labels that were made
//! one by one do not meet. How it is smoothed stands in the module `surface_net`.

use pumice_core::reserve::make_room;
use pumice_core::{CompressedVolume, Error, Job};
use pumice_transport::geometry::DetailLevel;
use rustc_hash::FxHashMap;

use crate::surface::{BLOCK, Surface};
use crate::surface_net::NetBlock;
use crate::{Merging, Result, VoxelRegion};

/// What the memory is for, in errors.
const PARTS: &str = "a list of the parts of a smoothed surface";

/// What files say about it.
pub(crate) const NOT_EXACT: &str = "smoothed: corners of voxels moved by up to 0.4 of a voxel";

/// A smoothed surface in index space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SmoothMesh {
    /// Positions in voxels: one for each corner and label.
    pub points: Vec<[f32; 3]>,
    /// What faces have at their corners.
    pub vertices: Vec<SmoothVertex>,
    /// Numbers of the vertices of each face, counter-clockwise as seen from outside its label; to be divided from the first to the third.
    pub quads: Vec<[u32; 4]>,
}

/// A corner of faces of one label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothVertex {
    /// Number of its point.
    pub point: u32,
    /// Dense index of the label.
    pub label: u32,
    /// Length 1, in index space, away from the label.
    pub normal: [f32; 3],
}

impl SmoothMesh {
    /// The smoothed surface of the labels that are `visible` (by dense index), within a region if there is one. `found` hears of each block's
    /// number of faces before they are kept. The same mesh whatever the number of threads.
    ///
    /// # Errors
    /// [`Error::Caller`] where `visible` does not have one value per label; [`Error::Limit`] for 2³² points or vertices;
    /// [`Error::Memory`]; [`Error::Cancelled`]; errors of `found`.
    pub fn new(
        volume: &CompressedVolume,
        visible: &[bool],
        region: Option<VoxelRegion>,
        job: &Job,
        mut found: impl FnMut(u64) -> Result<()>,
    ) -> Result<Self> {
        let surface = Surface::new(volume, visible, DetailLevel::Voxels, Merging::Plain)?.within(region);
        let mut mesh = Self::default();
        let mut shared = Shared::default();
        surface.for_each_block(
            job,
            |origin| NetBlock::new(&surface, origin, BLOCK),
            |block| {
                found(block.quads.len() as u64)?;
                mesh.append(&block, &mut shared)
            },
        )?;
        Ok(mesh)
    }

    /// Dense index of the label of a face.
    pub fn label(&self, quad: &[u32; 4]) -> u32 {
        self.vertices[quad[0] as usize].label
    }

    /// Position of a vertex in voxels.
    pub fn position(&self, vertex: u32) -> [f32; 3] {
        self.points[self.vertices[vertex as usize].point as usize]
    }

    /// Appends a block's faces; what blocks have in common is there once.
    fn append(&mut self, block: &NetBlock, shared: &mut Shared) -> Result<()> {
        // At most as many as the block has: those that blocks share are there once.
        make_room(&mut self.points, block.points.len(), PARTS).map_err(Error::from)?;
        make_room(&mut self.vertices, block.vertices.len(), PARTS).map_err(Error::from)?;
        make_room(&mut self.quads, block.quads.len(), PARTS).map_err(Error::from)?;
        let mut point_of = Vec::with_capacity(block.points.len());
        for point in &block.points {
            let next = number("points", self.points.len())?;
            let number = match point.is_shared {
                true => *shared.points.entry((point.corner, point.label)).or_insert(next),
                false => next,
            };
            if number == next {
                self.points.push(point.position);
            }
            point_of.push(number);
        }
        let mut vertex_of = Vec::with_capacity(block.vertices.len());
        for vertex in &block.vertices {
            let of_block = &block.points[vertex.point as usize];
            let point = point_of[vertex.point as usize];
            let next = number("vertices", self.vertices.len())?;
            let number = match of_block.is_shared {
                true => *shared.vertices.entry((point, vertex.beyond)).or_insert(next),
                false => next,
            };
            if number == next {
                self.vertices.push(SmoothVertex { point, label: of_block.label, normal: vertex.normal });
            }
            vertex_of.push(number);
        }
        self.quads.extend(block.quads.iter().map(|quad| quad.map(|vertex| vertex_of[vertex as usize])));
        Ok(())
    }
}

/// What blocks have in common: numbers of points by corner and label, of vertices by point and what is beyond.
#[derive(Default)]
struct Shared {
    points: FxHashMap<([u32; 3], u32), u32>,
    vertices: FxHashMap<(u32, u32), u32>,
}

fn number(what: &str, count: usize) -> Result<u32> {
    u32::try_from(count).map_err(|_| {
        let what = format!("{what} of a smoothed surface");
        Error::Limit { what, limit: 1 << 32, got: count as u64 + 1 }.into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_beyond_32_bits_are_refused() {
        assert_eq!(number("points", u32::MAX as usize).unwrap(), u32::MAX);
        let error = number("points", 1 << 32).unwrap_err().to_string();
        assert_eq!(error, "points of a smoothed surface: 4294967297 is more than the limit of 4294967296");
    }
}
