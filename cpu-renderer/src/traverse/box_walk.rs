//! The walk through one box: 4³ cells, then 4³ voxels in the cells that are neither empty nor solid.
//!
//! **Mirrored coordinates.** Along an axis on which the ray moves down, voxels are counted from the top: `m = 15 − v`. Then every step goes
//! up, and a mirrored cell or voxel number is the real one XOR a constant. Plane j (0 to 16) of axis a is met at
//!
//! ```text
//! T(a, j) = first[a] + (j − j0[a])·width[a]         first, width in f32; j − j0 a whole number ≥ 0
//! ```
//! with j0 the first plane ahead of the entry, `first` its distance from the entry (computed in f64 by the caller's ray, then rounded) and
//! `width = |1/d|`. Both terms are positive: nothing cancels, so T has a relative error of at most 3·2⁻²⁴, and planes come from integers,
//! never from the previous plane. Cells and voxels use the same T, bit for bit.
//!
//! **Ties** step all tied axes: the ray passes through the edge, and voxels that it only touches are not visited. (`VolumeTracer` decides
//! which of the planes is the reported face: one with nothing in front of it.) Planes within rounding of a tie may be treated as tied: t ≤
//! 16 in a box, so the order of two planes is right except within 2·16·3·2⁻²⁴ ([`TIE`]), and the direction is at most 2√3 long. At most a
//! chord of 2·10⁻⁵ voxels can be skipped.
//!
//! The code uses products and sums only, in f32 and integers (f64 only at the entry, where a GPU uses two f32), so that it can be
//! transcribed line by line into a shader.

use pumice_core::BoxView;
use pumice_transport::geometry::lod::DetailLevel;
use pumice_transport::geometry::{TIE, each_axis};

use super::IndexRay;

/// The end of a walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crossing {
    /// Scaled t of the plane ([`IndexRay::t_of`]).
    pub(crate) t: f64,
    /// Axis of the plane that was crossed last. Where several were crossed at once, the lowest axis, until `VolumeTracer` has found out
    /// which of their faces is open.
    pub(crate) axis: usize,
    /// Coordinate of that plane along the axis.
    pub(crate) plane: u32,
    /// The voxel behind it.
    pub(crate) voxel: [u32; 3],
    /// Bit a is set if axis a was crossed at the same t.
    pub(crate) tied: u8,
}

impl Crossing {
    /// The voxel before the planes that were crossed.
    pub(crate) fn voxel_before(&self, ray: &IndexRay) -> [u32; 3] {
        each_axis(|a| match (self.tied >> a & 1, ray.is_down(a)) {
            (0, _) => self.voxel[a],
            (_, true) => self.voxel[a].wrapping_add(1),
            (_, false) => self.voxel[a].wrapping_sub(1),
        })
    }

    /// Whether the ray entered the voxel through another plane at about the same t.
    #[inline(always)]
    pub(crate) fn is_near_edge(&self, ray: &IndexRay) -> bool {
        (0..3).any(|a| a != self.axis && self.through(a, ray).t >= self.t - TIE)
    }

    /// The same crossing, through the plane of another axis by which the ray enters the voxel.
    pub(crate) fn through(&self, axis: usize, ray: &IndexRay) -> Self {
        let plane = if ray.is_down(axis) { self.voxel[axis].wrapping_add(1) } else { self.voxel[axis] };
        Self { t: ray.t_of(axis, f64::from(plane)), axis, plane, ..*self }
    }
}

/// The result of a walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Found {
    /// Nothing.
    Nothing,
    /// The walk began in a solid voxel: the ray's start is inside.
    Inside([u32; 3]),
    /// The walk entered a solid element through this face.
    Face(Crossing),
}

/// State of a walk within one box (see the module).
pub(crate) struct Walk {
    lo: [u32; 3],
    /// 15 for each mirrored axis, else 0.
    mirror: [u32; 3],
    /// XOR that mirrors cell and voxel numbers (x + 4y + 16z).
    flip: u32,
    /// Mirrored voxel.
    m: [u32; 3],
    /// Mirrored voxel of the entry: planes up to it are behind.
    m0: [u32; 3],
    /// Mirrored plane through which the ray leaves the box.
    end: [u32; 3],
    first: [f32; 3],
    width: [f32; 3],
    /// Axis that was crossed last; 3 if none was.
    axis: usize,
    tied: u8,
}

/// So far that no walk reaches it, but near enough that sums stay finite.
const FAR: f32 = 1e30;

impl Walk {
    /// Begins at the ray's position at scaled t = `enter`, which lies within the box `lo..hi`.
    #[inline(always)]
    pub(crate) fn begin(ray: &IndexRay, lo: [u32; 3], hi: [u32; 3], enter: f64) -> Self {
        Self::begin_in(ray, lo, hi, enter, None)
    }

    /// Like [`Walk::begin`], in a voxel that the caller knows to contain the ray.
    #[inline(always)]
    pub(crate) fn begin_in(
        ray: &IndexRay,
        lo: [u32; 3],
        hi: [u32; 3],
        enter: f64,
        voxel: Option<[u32; 3]>,
    ) -> Self {
        let mut walk = Self {
            lo,
            mirror: [0; 3],
            flip: 0,
            m: [0; 3],
            m0: [0; 3],
            end: [16; 3],
            first: [0.0; 3],
            width: [0.0; 3],
            axis: 3,
            tied: 0,
        };
        for a in 0..3 {
            let down = ray.is_down(a);
            let (base, sign) = if down { (f64::from(lo[a]) + 16.0, -1.0) } else { (f64::from(lo[a]), 1.0) };
            walk.mirror[a] = if down { 15 } else { 0 };
            walk.flip |= if down { 3 << (2 * a) } else { 0 };
            walk.end[a] = if down { 16 } else { hi[a] - lo[a] };
            // First an estimate, then the rule: plane j is crossed when T(j) ≤ enter.
            let at = (ray.origin[a] - base) * sign + enter * ray.direction[a].abs();
            let mut m = at.clamp(0.0, 15.0) as u32;
            let plane_t = |j: u32| ray.t_of(a, base + sign * f64::from(j));
            while m > 0 && plane_t(m) > enter {
                m -= 1;
            }
            let mut ahead = plane_t(m + 1);
            while m < 15 && ahead <= enter {
                m += 1;
                ahead = plane_t(m + 1);
            }
            if let Some(v) = voxel {
                m = (v[a] - lo[a]) ^ walk.mirror[a];
                ahead = plane_t(m + 1).max(enter);
            }
            walk.m[a] = m;
            walk.first[a] = clamp_far(ahead - enter);
            walk.width[a] = clamp_far(ray.inverse[a].abs());
            // The axis of entry is the one whose plane lies exactly at the entry.
            if plane_t(m) == enter && ray.direction[a] != 0.0 {
                walk.tied |= 1 << a;
            }
        }
        walk.m0 = walk.m;
        walk.axis = walk.tied.trailing_zeros().min(3) as usize;
        walk
    }

    /// Distance from the entry to plane j > m0 of axis a.
    #[inline(always)]
    fn plane_t(&self, a: usize, j: u32) -> f32 {
        self.first[a] + (j - self.m0[a] - 1) as i32 as f32 * self.width[a]
    }

    /// Steps to the next multiple of 2^shift: crosses the nearest of the three planes and all that tie with it. Coordinates of the axes
    /// that were not crossed stay as they are. Returns the distance.
    #[inline(always)]
    fn step(&mut self, shift: u32) -> f32 {
        // A voxel step may pass the end of a box that the volume clips in the middle of a cell: nothing is there.
        let next = each_axis(|a| {
            let next = ((self.m[a] >> shift) + 1) << shift;
            if shift == 0 { next } else { next.min(self.end[a]) }
        });
        let t = [self.plane_t(0, next[0]), self.plane_t(1, next[1]), self.plane_t(2, next[2])];
        let nearest = if t[0] < t[1] { t[0] } else { t[1] };
        let nearest = if t[2] < nearest { t[2] } else { nearest };
        self.tied = 0;
        for a in 0..3 {
            if t[a] == nearest {
                self.m[a] = next[a];
                self.tied |= 1 << a;
            }
        }
        self.axis = self.tied.trailing_zeros() as usize;
        nearest
    }

    /// After a step of 4 voxels to `t`: moves the axes that were not crossed to the voxel that contains the ray.
    #[inline(always)]
    fn refine(&mut self, t: f32) {
        for a in 0..3 {
            if self.tied >> a & 1 == 0 {
                let end = (self.m[a] | 3) + 1;
                while self.m[a] + 1 < end && self.plane_t(a, self.m[a] + 1) <= t {
                    self.m[a] += 1;
                }
            }
        }
    }

    #[inline(always)]
    fn left(&self) -> bool {
        self.m[0] >= self.end[0] || self.m[1] >= self.end[1] || self.m[2] >= self.end[2]
    }

    #[inline(always)]
    fn cell(&self) -> u32 {
        ((self.m[0] >> 2) | (self.m[1] >> 2) << 2 | (self.m[2] >> 2) << 4) ^ self.flip
    }

    #[inline(always)]
    fn voxel_in_cell(&self) -> u32 {
        ((self.m[0] & 3) | (self.m[1] & 3) << 2 | (self.m[2] & 3) << 4) ^ self.flip
    }

    /// The face through which the walk entered its current voxel.
    pub(crate) fn face(&self, ray: &IndexRay) -> Crossing {
        let a = self.axis;
        let plane = if self.mirror[a] != 0 { self.lo[a] + 16 - self.m[a] } else { self.lo[a] + self.m[a] };
        Crossing { t: ray.t_of(a, f64::from(plane)), axis: a, plane, voxel: self.voxel(), tied: self.tied }
    }

    /// The current voxel; after the walk has left the box, it may lie outside.
    pub(crate) fn voxel(&self) -> [u32; 3] {
        // A mirrored coordinate of 16 is voxel −1: it wraps, and the caller checks it.
        each_axis(|a| {
            if self.mirror[a] != 0 {
                (self.lo[a] + 15).wrapping_sub(self.m[a])
            } else {
                self.lo[a] + self.m[a]
            }
        })
    }

    /// The result at the current voxel: inside if the walk has not moved and the ray began there, otherwise the face of entry.
    #[inline(always)]
    fn found(&self, ray: &IndexRay, began_inside: bool) -> Found {
        if self.axis == 3 || (began_inside && self.m == self.m0) {
            Found::Inside(self.voxel())
        } else {
            Found::Face(self.face(ray))
        }
    }

    /// The result for a box that is drawn whole: its hit is where the walk begins.
    #[inline(always)]
    pub(crate) fn whole_box(&self, ray: &IndexRay, began_inside: bool) -> Found {
        self.found(ray, began_inside)
    }

    /// The first voxel, or the first cell that holds a voxel.
    #[inline(always)]
    pub(crate) fn first_solid(
        mut self,
        ray: &IndexRay,
        b: &BoxView,
        level: DetailLevel,
        began_inside: bool,
    ) -> Found {
        loop {
            let cell = self.cell();
            if b.node.occupied >> cell & 1 != 0 {
                if level == DetailLevel::Cells {
                    return self.found(ray, began_inside);
                }
                let (field, flip) = b.node.flipped_field(cell);
                loop {
                    if field >> (self.voxel_in_cell() ^ flip) & 1 != 0 {
                        return self.found(ray, began_inside);
                    }
                    let before = self.m;
                    self.step(0);
                    if (0..3).any(|a| (self.m[a] ^ before[a]) & !3 != 0) {
                        break;
                    }
                }
            } else {
                let t = self.step(2);
                self.refine(t);
            }
            if self.left() {
                return Found::Nothing;
            }
        }
    }

    /// Continues while the elements of `level` hold voxels. Returns the face through which the ray leaves them, and whether it also left
    /// the box there (this box then does not know the next voxel).
    pub(crate) fn last_solid(mut self, ray: &IndexRay, b: &BoxView, level: DetailLevel) -> (Crossing, bool) {
        loop {
            match level {
                DetailLevel::Voxels => _ = self.step(0),
                DetailLevel::Cells | DetailLevel::Boxes => {
                    let t = self.step(2);
                    self.refine(t);
                }
            }
            if self.left() {
                return (self.face(ray), true);
            }
            let cell = self.cell();
            let solid = match level {
                DetailLevel::Boxes => true,
                DetailLevel::Cells => b.node.occupied >> cell & 1 != 0,
                DetailLevel::Voxels => b.node.has(cell, self.voxel_in_cell()),
            };
            if !solid {
                return (self.face(ray), false);
            }
        }
    }
}

/// To f32, within ±[`FAR`].
#[inline(always)]
fn clamp_far(t: f64) -> f32 {
    let t = t as f32;
    if t > FAR { FAR } else { t }
}
