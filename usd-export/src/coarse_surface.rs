//! A surface of some labels with few faces, which represents them where only a mesh can be drawn: coarse, and *not exact*.
//!
//! ```text
//!   shown share of each cell        inside or not          a vertex among each 2³ cells that differ, in the middle of where the
//!   ┌───┬───┬───┐                   ┌───┬───┬───┐          surface crosses the lines between their middles; a quad across each line
//!   │1.0│ .6│ 0 │                   │ ■ │ ■ │   │              that it crosses, with the label of the cell inside
//!   ├───┼───┼───┤        ─►         ├───┼───┼───┤    ─►      ╲
//!   │1.0│1.0│ .2│                   │ ■ │ ■ │   │             │
//!   └───┴───┴───┘                   └───┴───┴───┘            ╱
//! ```
//! (Gibson 1998, *Constrained Elastic Surface Nets*, with vertices placed once, as in the naive surface nets of M. Lysenko, 2012.) Shares say
//! where the surface is to a small part of a cell. The crate `fast-surface-nets` makes the same vertices, but tells for no face which cell it belongs to, and so not its label.
//!
//! Cells are about cubes in the volume's own units; their size is the smallest that gives no more faces than allowed. Faces between shown
//! labels are left out. Where parts touch along an edge, more than two faces share it.

use pumice_core::{CompressedVolume, Error, Job};

use crate::Result;
use crate::cell_grid::CellGrid;

/// Most cells, with the margin: 24 bytes each while the surface is made, 100 MB together.
const MOST_CELLS: f64 = 4e6;

/// Cells with which the search for their size begins: few, so that they cost little, and enough to foresee the faces of finer ones.
const FIRST_CELLS: f64 = 1e5;

/// Fewest faces that may be allowed: those of one cell.
const FEWEST_FACES: usize = 6;

/// Sizes of cells that are tried for each doubling.
const SIZES_A_DOUBLING: i32 = 8;

const NONE: u32 = u32::MAX;

/// A coarse surface in index space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoarseSurface {
    /// Positions in voxels, within the volume.
    pub vertices: Vec<[f32; 3]>,
    /// Vertex indices, counter-clockwise as seen from outside.
    pub quads: Vec<[u32; 4]>,
    /// Dense label index of each quad.
    pub labels: Vec<u32>,
    /// Voxels of a cell along each axis; 0 where nothing is shown.
    pub cell: [u32; 3],
}

impl CoarseSurface {
    /// The surface of the labels that are `visible` (by dense index) with at most `most_faces` quads; none where nothing is shown.
    ///
    /// # Errors
    /// [`Error::Caller`] where `visible` does not have one value per label, or for fewer than six faces; [`Error::Cancelled`].
    pub fn new(volume: &CompressedVolume, visible: &[bool], most_faces: usize, job: &Job) -> Result<Self> {
        let labels = volume.labels().len();
        if visible.len() != labels {
            let what = format!("visible: expected {labels} values, one a label, got {}", visible.len());
            return Err(Error::Caller(what).into());
        }
        if most_faces < FEWEST_FACES {
            let what = format!("faces: expected at least {FEWEST_FACES}, got {most_faces}");
            return Err(Error::Caller(what).into());
        }
        let Some(bounds) = bounds_of_boxes(volume, visible) else {
            return Ok(Self::default());
        };
        let extent = [0, 1, 2].map(|a| bounds[1][a] - bounds[0][a]);
        let sizes = sizes(volume.info().spacing(), extent);

        // Begin with cells that are quickly counted, and foresee from the faces of each size that is tried which one fits. The last size
        // always does: it has one cell.
        let mut at =
            sizes.iter().position(|&side| cells(extent, side) <= FIRST_CELLS).unwrap_or(sizes.len() - 1);
        // Sizes before `finest` have too many faces, and that at `end` is the finest that was found to fit.
        let (mut finest, mut end) = (0, sizes.len());
        let mut best = Self::default();
        while at < end {
            let net = Net::new(CellGrid::new(volume, visible, bounds, sizes[at], job)?);
            let faces = net.count_faces();
            if faces <= most_faces {
                best = net.surface(volume.info().dims);
                end = at;
            } else {
                finest = at + 1;
            }
            let whole = faces as f64 * coarseness(sizes[at]);
            let foreseen = sizes.iter().position(|&side| whole <= most_faces as f64 * coarseness(side));
            at = foreseen.unwrap_or(sizes.len() - 1).max(finest);
            // What is foreseen may be off by a fifth: with half of the faces unused, the next finer size is worth a try.
            if at >= end && end > finest && 2 * best.quads.len() <= most_faces {
                at = end - 1;
            }
        }
        Ok(best)
    }
}

/// Lowest and highest corner of the boxes of the visible labels.
fn bounds_of_boxes(volume: &CompressedVolume, visible: &[bool]) -> Option<[[u32; 3]; 2]> {
    let mut bounds: Option<[[u32; 3]; 2]> = None;
    volume.for_each_box(|label, view| {
        if visible[label as usize] {
            let end = [0, 1, 2].map(|a| view.origin[a] + view.extent[a]);
            let [low, high] = bounds.unwrap_or([view.origin, end]);
            bounds =
                Some([[0, 1, 2].map(|a| low[a].min(view.origin[a])), [0, 1, 2].map(|a| high[a].max(end[a]))]);
        }
    });
    bounds
}

/// Sizes of cells in voxels, from the finest that memory allows to a single cell.
fn sizes(spacing: [f64; 3], extent: [u32; 3]) -> Vec<[u32; 3]> {
    let least = spacing.iter().copied().fold(f64::INFINITY, f64::min);
    let mut sizes: Vec<[u32; 3]> = Vec::new();
    for step in 0.. {
        let width = least * (f64::from(step) / f64::from(SIZES_A_DOUBLING)).exp2();
        let side = [0, 1, 2].map(|a| (width / spacing[a]).round().clamp(1.0, f64::from(extent[a])) as u32);
        if sizes.last() != Some(&side) && cells(extent, side) <= MOST_CELLS {
            sizes.push(side);
        }
        if side == extent {
            break;
        }
    }
    sizes
}

/// Number of cells of this size, with the margin.
fn cells(extent: [u32; 3], side: [u32; 3]) -> f64 {
    (0..3).map(|a| f64::from(extent[a].div_ceil(side[a]) + 2)).product()
}

/// Area of a face of a cell, to which the number of faces is inverse.
fn coarseness(side: [u32; 3]) -> f64 {
    side.map(f64::from).iter().product::<f64>().powf(2.0 / 3.0)
}

/// Cells of which it is known whether they are inside.
struct Net {
    grid: CellGrid,
    excess: Vec<f32>,
    inside: Vec<bool>,
    /// Numbers of cells from the lowest of 2³ cells to each: bit a of the place is set for those above it on axis a.
    around: [usize; 8],
}

impl Net {
    fn new(grid: CellGrid) -> Self {
        let excess = grid.excess();
        let inside = excess.iter().map(|&excess| excess > 0.0).collect();
        let steps = grid.steps();
        let around = [0, 1, 2, 3, 4, 5, 6, 7]
            .map(|bits: usize| (0..3).map(|a| (bits >> a & 1) * steps[a]).sum::<usize>());
        Self { grid, excess, inside, around }
    }

    fn count_faces(&self) -> usize {
        let differ =
            |step: usize| self.inside.iter().zip(&self.inside[step..]).filter(|(a, b)| a != b).count();
        self.grid.steps().into_iter().map(differ).sum()
    }

    fn surface(&self, dims: [u32; 3]) -> CoarseSurface {
        let steps = self.grid.steps();
        let mut surface = CoarseSurface { cell: self.grid.side, ..CoarseSurface::default() };

        // A vertex for each 2³ cells that differ, by the lowest of them.
        let mut vertex_at = vec![NONE; self.inside.len()];
        for (cell, number) in vertex_at.iter_mut().enumerate().take(self.inside.len() - self.around[7]) {
            if let Some(vertex) = self.vertex(cell) {
                *number = surface.vertices.len() as u32;
                surface.vertices.push([0, 1, 2].map(|a| vertex[a].clamp(0.0, dims[a] as f32)));
            }
        }

        // A quad across each line between middles of cells that differ.
        for cell in 0..self.inside.len() {
            for axis in 0..3 {
                let Some(&beyond) = self.inside.get(cell + steps[axis]) else { continue };
                if beyond == self.inside[cell] {
                    continue;
                }
                let (across, along) = (steps[(axis + 1) % 3], steps[(axis + 2) % 3]);
                let [a, b, c, d] =
                    [cell - across - along, cell - along, cell, cell - across].map(|at| vertex_at[at]);
                surface.quads.push(if beyond { [a, d, c, b] } else { [a, b, c, d] });
                surface.labels.push(self.grid.labels[if beyond { cell + steps[axis] } else { cell }]);
            }
        }
        surface
    }

    /// The vertex among the 2³ cells of which `lowest` is one: the mean of the places where the surface crosses lines between them.
    fn vertex(&self, lowest: usize) -> Option<[f32; 3]> {
        let steps = self.grid.steps();
        let is_inside = self.inside[lowest];
        if self.around.iter().all(|step| self.inside[lowest + step] == is_inside) {
            return None;
        }
        let cells = self.around.map(|step| lowest + step);
        let (mut sum, mut count) = ([0.0f32; 3], 0.0);
        for (bits, &from) in cells.iter().enumerate() {
            for axis in (0..3).filter(|axis| bits >> axis & 1 == 0) {
                let to = cells[bits | 1 << axis];
                if self.inside[from] == self.inside[to] {
                    continue;
                }
                // One is above zero and the other below, so the difference is not zero.
                let way = self.excess[from] / (self.excess[from] - self.excess[to]);
                for (a, sum) in sum.iter_mut().enumerate() {
                    *sum += if a == axis { way } else { (bits >> a & 1) as f32 };
                }
                count += 1.0;
            }
        }
        let at = [0, 1, 2].map(|a| lowest / steps[a] % self.grid.size[a]);
        let middle = self.grid.middle(at);
        Some([0, 1, 2].map(|a| middle[a] + sum[a] / count * self.grid.side[a] as f32))
    }
}
