//! Rays through [`Bricks`]: a step from block to block in f64, and within a block, brick or cell the AND of two masks: the parts that the
//! ray passes through ([`super::ray_box_mask`]) and the parts that are occupied.
//!
//! A ray passes through the parts of a mask in ascending order once the axes along which it moves down are mirrored, because its
//! coordinates never decrease then. The first occupied part is therefore the lowest bit. The occupancy mask is the one that is mirrored:
//! this runs in parallel with computing the ray's mask, which takes longer.
//!
//! **Exactness.** The planes' t in f64 ([`IndexRay::t_of`]) decide everything: planes at the same t are crossed at once, and a block,
//! brick, cell or voxel is hit where clipping the ray against it leaves a chord. (A walk through a box may skip a chord of 2·10⁻⁵ voxels.)

use std::ops::Deref;

use pumice_transport::geometry::bricks::{BLOCK, BRICK, Brick, Bricks};
use pumice_transport::geometry::each_axis;

use super::IndexRay;
use super::box_walk::{Crossing, Found};
use super::f64x4::{F64x4, Lanes};
use super::mirrored::Octant;
use super::ray_box_mask::RayBoxMask;

/// The first hit in bricks, and the brick that contains it.
pub(super) struct InBricks {
    pub(super) found: Found,
    pub(super) brick: usize,
}

/// Bricks of a volume, all in one place or in parts that are fetched one by one.
pub(super) trait BrickStore {
    /// Bricks that are in memory while this is.
    type Held<'a>: Deref<Target = Bricks>
    where
        Self: 'a;

    /// Blocks and bounds of the whole volume; the bricks themselves may be elsewhere.
    fn grid(&self) -> &Bricks;

    /// The bricks of the block of the grid at this index, whose lowest corner is at `corner`, and its index among their blocks; `None` where
    /// they could not be fetched.
    fn hold(&self, block: usize, corner: &Lanes) -> Option<(Self::Held<'_>, usize)>;
}

impl BrickStore for Bricks {
    type Held<'a> = &'a Self;

    #[inline(always)]
    fn grid(&self) -> &Bricks {
        self
    }

    #[inline(always)]
    fn hold(&self, block: usize, _: &Lanes) -> Option<(&Self, usize)> {
        Some((self, block))
    }
}

/// Subtracting this turns rounding to nearest into rounding down, except for numbers just below a whole number; the result is an estimate
/// that is checked.
const ALMOST_HALF: f64 = 0.499_999_999;
/// Voxels along the side of a block.
const SIDE: f64 = BLOCK as f64;
/// 1.5·2⁵²: adding it to a small number rounds that number to an integer.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

/// The current block, and the planes through which the ray leaves it.
struct BlockWalk {
    /// Index of the block.
    index: usize,
    /// Lowest corner of the block.
    corner: Lanes,
    plane_t: Lanes,
}

impl BlockWalk {
    #[inline(always)]
    fn begin<P: RayBoxMask>(by: P, bricks: &Bricks, ray: &IndexRay, enter: f64) -> Self {
        let at = by.f64x4(&ray.origin).plus(by.all(enter).times(by.f64x4(&ray.direction)));
        let at = at.times(by.all(1.0 / SIDE)).minus(by.all(ALMOST_HALF));
        let at = at.max(by.all(0.0)).min(by.f64x4(&bricks.last_block)).plus(by.all(ROUNDING));
        let corner = at.minus(by.all(ROUNDING)).times(by.all(SIDE));
        let low = ray.t_of_each(by, corner);
        let high = ray.t_of_each(by, corner.plus(by.all(SIDE)));
        let (behind, ahead) = (low.min(high), low.max(high));
        let is_right = ((by.all(enter).below(behind)) | !by.all(enter).below(ahead)) & 0b111 == 0;
        let mut walk = Self { index: 0, corner: corner.array(), plane_t: ahead.array() };
        let mut at = at.array();
        if !is_right {
            walk.correct(bricks, ray, enter);
            at = walk.corner.map(|v| v / SIDE + ROUNDING);
        }
        let at = |a: usize| at[a].to_bits() as u32 as usize;
        walk.index = at(0) + bricks.strides[1] * at(1) + bricks.strides[2] * at(2);
        walk
    }

    /// Corrects the estimate where rounding made it one too large or too small: planes met at t ≤ `enter` are behind.
    #[cold]
    fn correct(&mut self, bricks: &Bricks, ray: &IndexRay, enter: f64) {
        for a in 0..3 {
            let last = bricks.last_block[a];
            let t = |plane: f64| ray.t_of(a, SIDE * plane);
            let mut at = self.corner[a] / SIDE;
            if ray.is_down(a) {
                while at > 0.0 && t(at) <= enter {
                    at -= 1.0;
                }
                while at < last && t(at + 1.0) > enter {
                    at += 1.0;
                }
            } else {
                while at < last && t(at + 1.0) <= enter {
                    at += 1.0;
                }
                while at > 0.0 && t(at) > enter {
                    at -= 1.0;
                }
            }
            self.corner[a] = SIDE * at;
            self.plane_t[a] = t(if ray.is_down(a) { at } else { at + 1.0 });
        }
    }

    /// Steps to the next block and returns its t, unless that is not before `end`.
    #[inline(always)]
    fn step(&mut self, bricks: &Bricks, ray: &IndexRay, end: f64) -> Option<f64> {
        let [x, y, z, _] = self.plane_t;
        let t = if x < y { x } else { y };
        let t = if z < t { z } else { t };
        if t >= end {
            return None;
        }
        for a in 0..3 {
            if self.plane_t[a] == t {
                let (side, ahead) = if ray.is_down(a) { (-SIDE, -SIDE) } else { (SIDE, 2.0 * SIDE) };
                let plane = self.corner[a] + ahead;
                self.corner[a] += side;
                if !(self.corner[a] >= 0.0 && self.corner[a] <= SIDE * bricks.last_block[a]) {
                    return None;
                }
                let stride = bricks.strides[a];
                self.index = if ray.is_down(a) { self.index - stride } else { self.index + stride };
                self.plane_t[a] = ray.t_of(a, plane);
            }
        }
        Some(t)
    }
}

/// The first voxel with scaled t in (`start`, `t_max`), or at `start`.
#[inline(always)]
pub(super) fn first_voxel<'a, P: RayBoxMask, S: BrickStore>(
    by: P,
    store: &'a S,
    ray: &IndexRay,
    start: f64,
    t_max: f64,
) -> Option<(InBricks, S::Held<'a>)> {
    let bricks = store.grid();
    let [low, high] = &bricks.bounds;
    let (mut enter, leave) = ray.clip_by(by, by.f64x4(low), by.f64x4(high), start);
    if enter >= leave || enter >= t_max {
        return None;
    }
    let end = if leave < t_max { leave } else { t_max };
    let search = BrickSearch { by, ray, octant: Octant::new(|a| ray.is_down(a)), start };
    let octant = search.octant;
    let mut walk = BlockWalk::begin(by, bricks, ray, enter);
    loop {
        let occupied = bricks.occupied(walk.index);
        if occupied != 0 {
            let met = by.ray_box_mask(ray, by.f64x4(&walk.corner), &[0.0; 4], f64::from(BRICK), enter);
            let mut met = met & by.mirrored(occupied, octant);
            if met != 0
                && let Some((held, block)) = store.hold(walk.index, &walk.corner)
            {
                while met != 0 {
                    let place = met.trailing_zeros() ^ octant.mirror();
                    met &= met - 1;
                    let (number, brick) = held.brick(block, place);
                    let step = &STEPS_OF_BRICKS[place as usize & 63];
                    match search.first_of_brick(&held, brick, by.f64x4(&walk.corner), step, enter) {
                        Found::Nothing => {}
                        Found::Face(step) if step.t >= t_max => return None,
                        found => return Some((InBricks { found, brick: number }, held)),
                    }
                }
            }
        }
        enter = walk.step(bricks, ray, end)?;
    }
}

/// Calls `visit` with the bricks that a ray passes between `start` and `t_max`, from near to far; it returns up to which t further ones
/// are wanted.
pub(super) fn for_each_brick_along<P: RayBoxMask, S: BrickStore>(
    by: P,
    store: &S,
    ray: &IndexRay,
    start: f64,
    t_max: f64,
    mut visit: impl FnMut(&S::Held<'_>, usize) -> f64,
) {
    let bricks = store.grid();
    let [low, high] = &bricks.bounds;
    let (mut enter, leave) = ray.clip_by(by, by.f64x4(low), by.f64x4(high), start);
    if enter >= leave || enter >= t_max {
        return;
    }
    let mut end = leave.min(t_max);
    let octant = Octant::new(|a| ray.is_down(a));
    let mut walk = BlockWalk::begin(by, bricks, ray, enter);
    loop {
        let met = by.ray_box_mask(ray, by.f64x4(&walk.corner), &[0.0; 4], f64::from(BRICK), enter);
        let mut met = met & by.mirrored(bricks.occupied(walk.index), octant);
        if met != 0
            && let Some((held, block)) = store.hold(walk.index, &walk.corner)
        {
            while met != 0 {
                let place = met.trailing_zeros() ^ octant.mirror();
                met &= met - 1;
                end = end.min(visit(&held, held.brick(block, place).0));
            }
        }
        // (`end` may be a t at which a hit is as near: what begins there is still wanted.)
        match walk.step(bricks, ray, end.next_up()) {
            Some(t) => enter = t,
            None => return,
        }
    }
}

/// State that the searches through all bricks share.
#[derive(Clone, Copy)]
struct BrickSearch<'a, P> {
    by: P,
    ray: &'a IndexRay,
    octant: Octant,
    /// Only voxels at or after this scaled t count.
    start: f64,
}

impl<P: RayBoxMask> BrickSearch<'_, P> {
    /// The first voxel of a brick whose lowest corner is at `corner + step`. `from` is any t before the ray enters the brick.
    #[inline(always)]
    fn first_of_brick(
        &self,
        bricks: &Bricks,
        brick: &Brick,
        corner: P::F64x4,
        step: &Lanes,
        from: f64,
    ) -> Found {
        let Self { by, ray, octant, start } = *self;
        let mut met = by.ray_box_mask(ray, corner, step, 4.0, from) & by.mirrored(brick.occupied, octant);
        let lo = corner.plus(by.f64x4(step));
        while met != 0 {
            let cell = met.trailing_zeros() ^ octant.mirror();
            met &= met - 1;
            let step = &STEPS_OF_CELLS[cell as usize & 63];
            let field = by.mirrored(bricks.field(brick, cell), octant);
            let voxels = by.ray_box_mask(ray, lo, step, 1.0, from) & field;
            if voxels != 0 {
                let first = voxels.trailing_zeros() ^ octant.mirror();
                let corner = lo.plus(by.f64x4(step)).plus(by.f64x4(&STEPS_OF_VOXELS[first as usize & 63]));
                return face_of(by, ray, corner, start);
            }
        }
        Found::Nothing
    }
}

/// Offsets of 4 × 4 × 4 parts with this side from their common lowest corner.
const fn steps_of(side: u32) -> [Lanes; 64] {
    let (mut steps, mut place) = ([[0.0; 4]; 64], 0);
    while place < 64 {
        let [x, y, z] = [place & 3, place >> 2 & 3, place >> 4];
        steps[place as usize] = [(side * x) as f64, (side * y) as f64, (side * z) as f64, 0.0];
        place += 1;
    }
    steps
}

static STEPS_OF_BRICKS: [Lanes; 64] = steps_of(BRICK);
static STEPS_OF_CELLS: [Lanes; 64] = steps_of(4);
static STEPS_OF_VOXELS: [Lanes; 64] = steps_of(1);

/// The face through which a ray enters the voxel at `corner`.
#[inline(always)]
fn face_of<P: RayBoxMask>(by: P, ray: &IndexRay, corner: P::F64x4, start: f64) -> Found {
    let (low, high) = (ray.t_of_each(by, corner), ray.t_of_each(by, corner.plus(by.all(1.0))));
    let t = low.min(high).array();
    let last = if t[0] > t[1] { t[0] } else { t[1] };
    let last = if t[2] > last { t[2] } else { last };
    let corner = corner.array();
    let voxel = each_axis(|a| corner[a] as u32);
    if last <= start {
        return Found::Inside(voxel);
    }
    let tied: u8 = (0..3).map(|a| u8::from(t[a] == last) << a).sum();
    let axis = tied.trailing_zeros() as usize;
    Found::Face(Crossing { t: t[axis], axis, plane: voxel[axis] + u32::from(ray.is_down(axis)), voxel, tied })
}
