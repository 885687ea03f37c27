//! A ray in a volume's index space, with the precomputed values that the walks need.
//!
//! The direction is scaled by a power of two so that its largest component is within [1, 2). The scaling is exact, and a distance along the
//! ray is then at most one voxel off per unit. It is undone once, when a hit is reported.
//!
//! **Planes.** The ray meets the integer plane p of axis a at `t = (p − o) / d`. Internally the product `(p − o)·(1/d)` is used throughout:
//! it depends on ray, axis and plane alone and is monotone in p, so two boxes that share a plane agree to the bit and nothing accumulates.
//! Its error is two roundings *relative to t*, whatever the angle, so grazing rays lose no accuracy.
//!
//! **Voxels are half-open.** A plane met at t ≤ start counts as crossed. A ray that lies in a plane (d = 0) belongs to the voxel above it,
//! and its coordinate is moved to the middle of that voxel: no plane then lies at the coordinate of a direction of 0, and the product is
//! ±huge, never 0 or NaN.

use glam::DVec3;
use pumice_transport::geometry::TIE;
use pumice_transport::geometry::placement::Placement;
use pumice_transport::geometry::power_of_two::{MODERATE, SMALLEST, exp2, exponent, scaled_extreme};
use pumice_transport::{PathOrigin, RayInWorld, Surface};

use super::f64x4::{F64x4, Instructions, Lanes, Plain, lanes};

/// 2⁻⁴⁸: more than the five roundings by which the product for a plane and its reported distance may differ.
const AS_NEAR: f64 = 16.0 * f64::EPSILON;

/// A ray prepared for the walks (see the module).
#[derive(Clone, Copy, Debug)]
pub(crate) struct IndexRay {
    /// Position at t = 0, in voxels; the spare is 0.
    pub(crate) origin: Lanes,
    /// Scaled direction: its largest component is within [1, 2) in absolute value; the spare is 1.
    pub(crate) direction: Lanes,
    /// 1 / direction, finite.
    pub(crate) inverse: Lanes,
    /// Scaled t for each t of the world's ray: a power of two.
    pub(crate) scaled_from_world: f64,
}

/// The start of a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Start {
    /// Any point.
    Free,
    /// On a face; the second value is one past the highest voxel of its element.
    Face(Surface, [u32; 3]),
    /// On the plane of an axis, which a cap lies in.
    Plane(usize, f64),
}

/// A ray in index space, scaled by 2⁻ᵏ⁰ in the world and by 2⁻ᵏ¹ here.
struct Moved<F> {
    origin: F,
    direction: F,
    d_world: DVec3,
    k0: i32,
    k1: i32,
}

/// Transforms a vector from the world to index space.
#[inline(always)]
fn f64x4_from_world<I: Instructions>(by: I, placement: &Placement, v: DVec3) -> I::F64x4 {
    let [x, y, z] = placement.columns.each_ref().map(|column| by.f64x4(column));
    let sum = x.times(by.all(v.x)).plus(y.times(by.all(v.y))).plus(z.times(by.all(v.z)));
    sum.over(by.all(placement.determinant))
}

impl<F: F64x4> Moved<F> {
    /// The ray in index space with a scaled direction; `None` where it is not finite or has no direction.
    #[inline(always)]
    fn new<I: Instructions<F64x4 = F>>(by: I, placement: &Placement, ray: &RayInWorld) -> Option<Self> {
        // 1. Scale in the world first, so that a tiny direction does not lose bits in the product. (A direction of usual size does not:
        // powers of two pass through the product unchanged, so the whole scale is found after it, with the same bits and sooner.)
        let RayInWorld { origin: o, direction: d } = ray;
        let size = d.x.abs() + d.y.abs() + d.z.abs();
        let (d_world, k0) = if USUAL.contains(&size) {
            (*d, 0)
        } else {
            let (d_world, k0) = scaled_f64x4(by, by.f64x4(&[d.x, d.y, d.z, 0.0]))?;
            (DVec3::from_slice(&d_world.array()), k0)
        };
        let (direction, k1) = scaled_f64x4(by, f64x4_from_world(by, placement, d_world))?;
        // 2. Subtract the translation before the product, because volumes may lie far from the world's origin.
        let origin = f64x4_from_world(by, placement, *o - placement.world_from_index.translation);
        let is_finite = origin.size().below(by.all(f64::INFINITY)) == 0b1111;
        is_finite.then_some(Self { origin, direction, d_world, k0, k1 })
    }

    /// Scaled t for each t of the world's ray.
    #[inline(always)]
    fn scaled_from_world(&self) -> f64 {
        exp2(self.k0) * exp2(self.k1)
    }

    /// The origin moved onto `surface`'s plane, and the direction corrected where rounding turned it inward along the plane.
    #[inline(always)]
    fn start_on_face<I: Instructions<F64x4 = F>>(
        &self,
        by: I,
        placement: &Placement,
        surface: Surface,
        upper: [u32; 3],
    ) -> (F, F) {
        let axis = usize::from(surface.axis.min(2));
        let plane = f64::from(surface.plane);
        // Inset from the rectangle's edges, where the next column begins; 2⁻²⁸ is representable at 2²³ voxels.
        let inset = 1.0 / 268_435_456.0;
        let within = |end: [u32; 3], inset: f64| {
            let end = |a: usize| end.get(a).map_or(0.0, |&end| f64::from(end) + inset);
            by.f64x4(&lanes(|a| if a == axis { plane } else { end(a) }))
        };
        let (lowest, highest) = (within(surface.voxel, inset), within(upper, -inset));
        let origin = self.origin.max(lowest).min(highest);
        let along = self.direction.array()[axis];
        let outward = if surface.positive { along } else { -along };
        if outward <= 0.0 {
            return self.start_along_face(by, placement, surface, origin, outward);
        }
        (origin, self.direction)
    }

    #[cold]
    fn start_along_face<I: Instructions<F64x4 = F>>(
        &self,
        by: I,
        placement: &Placement,
        surface: Surface,
        origin: F,
        outward: f64,
    ) -> (F, F) {
        let axis = usize::from(surface.axis.min(2));
        // Largest error of this component from the three products and two sums of the change of space.
        let row = placement.adjugate[axis].abs().dot(self.d_world.abs()) / placement.determinant;
        if -outward > row * exp2(-self.k1) * f64::EPSILON * 4.0 {
            return (origin, self.direction);
        }
        let (mut origin, mut direction) = (origin.array(), self.direction.array());
        direction[axis] = 0.0;
        // A ray in the plane belongs to the voxel above it; from a lower face, the outer side is below.
        if !surface.positive {
            origin[axis] -= 0.5;
        }
        (by.f64x4(&origin), by.f64x4(&direction))
    }
}

impl IndexRay {
    /// The ray in the index space of an instance; `None` where it is not finite or has no direction.
    ///
    /// A ray from a face starts exactly on the face's plane and within the face's rectangle, on its outer side. Without that correction,
    /// rounding could place its start inside a neighbour.
    #[inline(always)]
    pub(super) fn new<I: Instructions>(
        by: I,
        placement: &Placement,
        ray: &RayInWorld,
        start: Start,
    ) -> Option<Self> {
        let mut moved = Moved::new(by, placement, ray)?;
        // The spare of a direction is 1. (All operations on a ray use whole fours: a four that was stored lane by lane is not ready when it
        // is read as a four.)
        moved.direction = moved.direction.plus(by.f64x4(&[0.0, 0.0, 0.0, 1.0]));
        let (origin, direction) = match start {
            Start::Free => (moved.origin, moved.direction),
            Start::Face(surface, upper) => moved.start_on_face(by, placement, surface, upper),
            Start::Plane(axis, plane) => {
                let origin = moved.origin.array();
                (by.f64x4(&lanes(|a| if a == axis { plane } else { origin[a] })), moved.direction)
            }
        };
        let [origin, direction, inverse] = match direction.size().below(by.all(SMALLEST)) {
            0 => [origin, direction, by.all(1.0).over(direction)],
            _ => turned_finite(by, origin, direction),
        };
        let [origin, direction, inverse] = [origin.array(), direction.array(), inverse.array()];
        Some(Self { origin, direction, inverse, scaled_from_world: moved.scaled_from_world() })
    }

    /// The ray in the grid of a mesh. Its points are used as they are and belong to no cell.
    pub(crate) fn in_mesh_grid(placement: &Placement, ray: &RayInWorld) -> Option<Self> {
        let moved = Moved::new(Plain, placement, ray)?;
        let mut direction = moved.direction;
        direction[3] = 1.0;
        let inverse = lanes(|a| 1.0 / direction[a].abs().max(SMALLEST).copysign(direction[a]));
        Some(Self { origin: moved.origin, direction, inverse, scaled_from_world: moved.scaled_from_world() })
    }

    /// Scaled t where the ray meets plane `p` of axis `a` (see the module).
    #[inline(always)]
    pub(crate) fn t_of(&self, a: usize, p: f64) -> f64 {
        (p - self.origin[a]) * self.inverse[a]
    }

    /// The reported distance of plane `p` of axis `a`, in the world ray's t; correctly rounded except for the subtraction.
    pub(crate) fn world_t(&self, a: usize, p: u32) -> f64 {
        (f64::from(p) - self.origin[a]) / self.direction[a] / self.scaled_from_world
    }

    /// The scaled t for a t of the world's ray.
    pub(crate) fn scaled_t(&self, world_t: f64) -> f64 {
        world_t * self.scaled_from_world
    }

    /// The scaled t below which to look for hits, where a hit at `best` in the world's t is known: every hit that would be reported at that
    /// distance or nearer is found. A reported distance has two roundings of its own, and may belong to another face of the voxel, within
    /// [`TIE`].
    pub(crate) fn reach(&self, t_max: f64, best: f64) -> f64 {
        let best = self.scaled_t(best);
        let reach = best + best * AS_NEAR + 2.0 * TIE;
        let t_max = self.scaled_t(t_max);
        if reach < t_max { reach } else { t_max }
    }

    /// Whether the ray moves down along axis `a`.
    #[inline(always)]
    pub(crate) fn is_down(&self, a: usize) -> bool {
        self.inverse[a] < 0.0
    }

    /// The part of the ray within `lo ≤ x < hi` and t ≥ `start`: (enter, leave), empty unless enter < leave.
    #[inline(always)]
    pub(crate) fn clip(&self, lo: [u32; 3], hi: [u32; 3], start: f64) -> (f64, f64) {
        let [lo, hi] = [lo, hi].map(|p| [f64::from(p[0]), f64::from(p[1]), f64::from(p[2]), 0.0]);
        self.clip_by(Plain, lo, hi, start)
    }

    /// [`IndexRay::clip`] for whole numbers in lanes.
    #[inline(always)]
    pub(super) fn clip_by<I: Instructions>(
        &self,
        by: I,
        lo: I::F64x4,
        hi: I::F64x4,
        start: f64,
    ) -> (f64, f64) {
        let (at_lo, at_hi) = (self.t_of_each(by, lo), self.t_of_each(by, hi));
        // (Products are monotone: of the two planes of an axis, the nearer one has the lesser t, whichever way the ray goes.)
        let (near, far) = (at_lo.min(at_hi).array(), at_lo.max(at_hi).array());
        let enter = if near[0] > start { near[0] } else { start };
        let last = if near[1] > near[2] { near[1] } else { near[2] };
        let leave = if far[0] < far[1] { far[0] } else { far[1] };
        (if last > enter { last } else { enter }, if far[2] < leave { far[2] } else { leave })
    }

    /// [`IndexRay::t_of`] of one plane for each axis.
    #[inline(always)]
    pub(super) fn t_of_each<I: Instructions>(&self, by: I, planes: I::F64x4) -> I::F64x4 {
        planes.minus(by.f64x4(&self.origin)).times(by.f64x4(&self.inverse))
    }
}

/// Origin, direction and inverse for directions with components that are 0, or so small that 1/d overflows.
#[cold]
fn turned_finite<I: Instructions>(by: I, origin: I::F64x4, direction: I::F64x4) -> [I::F64x4; 3] {
    let (mut origin, mut direction, mut inverse) = (origin.array(), direction.array(), [1.0; 4]);
    for a in 0..3 {
        if direction[a] == 0.0 {
            direction[a] = 0.0; // −0 becomes 0
            // Elsewhere in the voxel the coordinate stays as it is, because a cut may pass through the voxel.
            origin[a] = if origin[a] == origin[a].floor() { origin[a] + 0.5 } else { origin[a] };
            inverse[a] = 1.0 / SMALLEST;
        } else {
            inverse[a] = 1.0 / direction[a].abs().max(SMALLEST).copysign(direction[a]);
        }
    }
    [by.f64x4(&origin), by.f64x4(&direction), by.f64x4(&inverse)]
}

/// Sums of absolute direction components that are not scaled before the change of space: 2⁻³² to 2³².
const USUAL: std::ops::Range<f64> = f64::from_bits((1023 - 32) << 52)..f64::from_bits((1023 + 32) << 52);

/// `pumice_transport::geometry::power_of_two::scaled` for lanes whose spare is 0.
#[inline(always)]
fn scaled_f64x4<I: Instructions>(by: I, v: I::F64x4) -> Option<(I::F64x4, i32)> {
    let size = v.size().array();
    let largest = if size[0] > size[1] { size[0] } else { size[1] };
    let largest = if size[2] > largest { size[2] } else { largest };
    // (NaN is in no range.)
    if !(largest >= MODERATE.start && size[0] + size[1] + size[2] < MODERATE.end) {
        let (v, k) = scaled_extreme(DVec3::from_slice(&v.array()))?;
        return Some((by.f64x4(&[v.x, v.y, v.z, 0.0]), k));
    }
    let k = exponent(largest);
    Some((v.times(by.all(f64::from_bits(((1023 - k) as u64) << 52))), k))
}

/// The surface that a path leaves, if it belongs to `instance`.
pub(crate) fn surface_of(from: PathOrigin, instance: u32) -> Option<Surface> {
    match from {
        PathOrigin::Face(surface) if surface.instance == instance => Some(surface),
        _ => None,
    }
}
