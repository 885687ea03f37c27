//! A hierarchy over the instances and meshes of a scene. It lists those that a ray may meet, roughly front to back.
//!
//! ```text
//! world       bounds of what each instance draws, in f64
//!     │  (x − lowest corner) · 2ᵏ + 2        k such that the longest side of all has 2²¹ to 2²² cells
//!     ▼
//! grid        the same hierarchy as over boxes of voxels and over triangles; its items are numbers of instances
//! ```
//! The hierarchy only leaves out instances that the ray cannot hit. Each instance still computes its own hit and t, exactly as if it had
//! been asked in turn. A scene of a few instances has no hierarchy and asks each in turn (`pumice_scene::INSTANCES_OF_A_TREE`).
//!
//! # Why no instance is lost
//! An instance takes a ray to its own space by the adjugate A and the determinant of its matrix M, each step rounded. The result for a
//! point x is another point of the instance, whose error in the world is less than K·ε·C·(|x| + |M|·|corner| + |T|). C is the largest row
//! of |M|·|A|/det (1 without shear and rotation), T the translation; |·| takes absolute values. K is below 32: two roundings of each of A's
//! entries, six of a row's sum and the division, and the same again for the direction. Every plane is moved outward by that bound with
//! `ROUNDINGS` for K, the largest C, the largest corner and the ray's own origin, in addition to what [`crate::geometry::bvh`] moves it by.
//! In its own space an instance's bounds are taken `MARGIN` wider, because a surface may be reported up to a tie before its voxel.
//!
//! A ray that continues from a surface starts on that surface in the instance's own space, whatever rounding did to its position in the
//! world: that instance is always asked first. A ray whose origin overflows the grid meets nothing.

use crate::geometry::bvh::LARGEST_INVERSE;
use crate::{BoxBounds, Bvh, BvhRay, RayInWorld, RenderError};
use glam::DVec3;

use super::TIE;
use super::placement::Placement;
use super::power_of_two::{SMALLEST, exp2, scaled};

/// Deepest hierarchy that is used, because the shaders' stack has as many entries. A hierarchy over 2²⁰ instances side by side has 8
/// levels.
const MAX_DEPTH: usize = 32;

/// Stands for K of the module's bound.
const ROUNDINGS: f64 = 256.0;

/// Widening of an instance's bounds in its own space, in voxels or in cells of a mesh's grid (see the module).
const MARGIN: f64 = 64.0 * TIE;

/// Cells from the grid's lowest plane to the lowest instance.
const FIRST_CELL: f64 = 2.0;

/// Largest distance, in cells, that planes are moved and that origins lie outside the grid: far beyond the grid, and its product with any
/// inverse fits f32.
const FARTHEST: f64 = (1u64 << 40) as f64;

/// World bounds of an instance, with the sizes that the module's error bound needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldBounds {
    lo: DVec3,
    hi: DVec3,
    /// Largest component of |M|·|corner| + |T|.
    size: f64,
    /// C of the module's bound.
    condition: f64,
}

/// The hierarchy over instances (see the module).
#[derive(Debug)]
pub struct InstanceTree {
    bvh: Bvh,
    /// World position of the grid's origin.
    pub translation: DVec3,
    /// Scale from the world to the grid, a power of two.
    pub cells_a_unit: f64,
    /// How far planes are moved outward, in cells for each unit of the ray origin's distance from the world's origin.
    pub slack_a_unit: f64,
    /// How far planes are moved outward in addition, in cells.
    pub slack: f64,
}

/// A ray in the grid's space.
struct GridRay {
    moved: BvhRay,
    /// Scaled t where the ray reaches the grid.
    enter: f64,
    /// Scaled t for each t of the world's ray.
    scale: f64,
}

impl WorldBounds {
    /// World bounds of these bounds, which are in the placement's own space.
    pub fn new(bounds: BoxBounds, placement: &Placement) -> Self {
        let m = placement.world_from_index.matrix3;
        let columns = [m.x_axis, m.y_axis, m.z_axis];
        let translation = placement.world_from_index.translation;
        let (mut lo, mut hi, mut size) = (translation, translation, translation.abs());
        for (a, column) in columns.into_iter().enumerate() {
            let [first, last] =
                [f64::from(bounds.lo[a]) - MARGIN, f64::from(bounds.hi[a]) + MARGIN].map(|at| column * at);
            lo += first.min(last);
            hi += first.max(last);
            size += last.abs();
        }
        // The adjugate of absolute values: nothing cancels.
        let [x, y, z] = columns.map(DVec3::abs);
        let cross = |a: DVec3, b: DVec3| {
            DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x)
        };
        let rows = [cross(y, z), cross(z, x), cross(x, y)];
        let sums = [x, y, z].into_iter().zip(rows).map(|(column, row)| column * row.element_sum());
        let condition = sums.fold(DVec3::ZERO, |all, s| all + s).max_element() / placement.determinant;
        Self { lo, hi, size: size.max_element(), condition }
    }

    /// Whether a ray certainly meets nothing within these bounds up to `t`: it starts beyond one of their planes, and is beyond it there.
    ///
    /// A surface is reported on the ray within the error bound of the module, so planes are moved outward by that bound. (At an infinite
    /// `t` a component of 0 is not a number, which excludes nothing.)
    #[inline]
    pub fn are_missed(&self, ray: &RayInWorld, t: f64) -> bool {
        let (from, to) = (ray.origin, ray.origin + ray.direction * t);
        let slack = ROUNDINGS * f64::EPSILON * self.condition * (self.size + from.abs().max_element());
        let (lo, hi) = (self.lo - slack, self.hi + slack);
        (from.cmpgt(hi) & to.cmpgt(hi) | from.cmplt(lo) & to.cmplt(lo)).any()
    }

    /// Whether the line of a ray certainly passes these bounds by: a plane through the line, parallel to an axis, has all of them on one side.
    ///
    /// With the bounds moved outward as in [`WorldBounds::are_missed`]. Products that are too small or too large to be compared exclude
    /// nothing.
    #[inline]
    pub fn are_passed_by(&self, ray: &RayInWorld) -> bool {
        let slack = ROUNDINGS * f64::EPSILON * self.condition * (self.size + ray.origin.abs().max_element());
        let middle = 0.5 * (self.lo + self.hi);
        let half = self.hi - middle + slack;
        let d = ray.direction.abs();
        let reach =
            DVec3::new(half.y * d.z + half.z * d.y, half.z * d.x + half.x * d.z, half.x * d.y + half.y * d.x);
        let away = (ray.origin - middle).cross(ray.direction).abs();
        away.cmpgt(reach + f64::MIN_POSITIVE).any()
    }
}

impl InstanceTree {
    /// Builds over instances by their index; an instance that draws nothing is `None`. Returns `None` where there are fewer than `least`,
    /// or where f64 cannot span their sizes.
    ///
    /// # Errors
    /// As [`Bvh::build`].
    pub fn new(
        instances: impl Iterator<Item = Option<WorldBounds>>,
        least: usize,
    ) -> Result<Option<Self>, RenderError> {
        let instances: Vec<(WorldBounds, u32)> =
            instances.zip(0..).filter_map(|(bounds, number)| Some((bounds?, number))).collect();
        if instances.is_empty() || instances.len() < least {
            return Ok(None);
        }
        let all = |of: fn(&WorldBounds) -> DVec3, take: fn(DVec3, DVec3) -> DVec3| {
            instances.iter().map(|(b, _)| of(b)).reduce(take).unwrap_or_default()
        };
        let most = |of: fn(&WorldBounds) -> f64| instances.iter().map(|(b, _)| of(b)).fold(0.0, f64::max);
        let (lo, hi) = (all(|b| b.lo, DVec3::min), all(|b| b.hi, DVec3::max));
        let side = (hi - lo).max_element();
        let (size, condition) = (most(|b| b.size), most(|b| b.condition));
        // 2ᵏ, its inverse and all products are normal numbers.
        if !(1e-200..1e200).contains(&side) || !(0.0..1e250).contains(&(size * condition)) {
            return Ok(None);
        }
        let cells_a_unit = exp2(21 - ((side.to_bits() >> 52) as i32 - 1023));
        let translation = lo - FIRST_CELL / cells_a_unit;
        let cells = |(b, number): &(WorldBounds, u32)| {
            let [lo, hi] = [b.lo, b.hi].map(|x| (x - translation) * cells_a_unit);
            let lo = lo.floor().max(DVec3::ZERO).to_array().map(|v| v as u32);
            let hi = hi.ceil().to_array().map(|v| v as u32);
            let bounds = BoxBounds { lo, hi: [0, 1, 2].map(|a| hi[a].max(lo[a] + 1)) };
            (bounds, *number)
        };
        let bvh = Bvh::build_within(instances.iter().map(cells).collect(), MAX_DEPTH)?;
        let slack_a_unit = ROUNDINGS * f64::EPSILON * condition * cells_a_unit;
        Ok(Some(Self { bvh, translation, cells_a_unit, slack_a_unit, slack: slack_a_unit * size }))
    }

    /// The hierarchy, in cells of the grid.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        self.bvh.bytes()
    }

    /// Calls `visit` with the index of each instance that the ray may meet before `t_max`, in the world's t. `visit` returns the new limit;
    /// −∞ ends the traversal.
    #[inline]
    pub fn along_ray(&self, ray: &RayInWorld, t_max: f64, mut visit: impl FnMut(u32) -> f64) {
        let Some(GridRay { moved, enter, scale }) = self.grid_ray(ray, t_max) else { return };
        let limit = |t: f64| (t * scale - enter) as f32 * 1.000_001 + moved.pad;
        self.bvh.along_ray(&moved, limit(t_max), |number| limit(visit(number)));
    }

    /// The ray moved to the grid; `None` where it misses everything or is not finite.
    #[inline]
    fn grid_ray(&self, ray: &RayInWorld, t_max: f64) -> Option<GridRay> {
        let bounds = self.bvh.bounds()?;
        let (direction, k) = scaled(ray.direction)?;
        let origin = (ray.origin - self.translation) * self.cells_a_unit;
        if !origin.is_finite() {
            return None;
        }
        let pad = self.slack_a_unit * ray.origin.abs().max_element() + self.slack;
        let (mut enter, mut leave, mut inverse) = (0.0, f64::INFINITY, [0.0; 3]);
        for a in 0..3 {
            inverse[a] = 1.0 / direction[a].abs().max(SMALLEST).copysign(direction[a]);
            let (lo, hi) = (f64::from(bounds.lo[a]) - pad, f64::from(bounds.hi[a]) + pad);
            let (near, far) = if inverse[a] < 0.0 { (hi, lo) } else { (lo, hi) };
            let (t_near, t_far) = ((near - origin[a]) * inverse[a], (far - origin[a]) * inverse[a]);
            enter = if t_near > enter { t_near } else { enter };
            leave = if t_far < leave { t_far } else { leave };
        }
        let scale = exp2(k) * self.cells_a_unit;
        if enter > leave || enter > t_max * scale {
            return None;
        }
        let mut moved = BvhRay { origin: [0.0; 3], inverse: [0.0; 3], pad: 0.0 };
        let beside = pad.min(FARTHEST);
        for a in 0..3 {
            let at = origin[a] + enter * direction[a];
            let (lo, hi) = (f64::from(bounds.lo[a]) - beside, f64::from(bounds.hi[a]) + beside);
            moved.origin[a] = at.clamp(lo, hi) as f32;
            moved.inverse[a] = inverse[a].clamp(-LARGEST_INVERSE, LARGEST_INVERSE) as f32;
        }
        // Twice, because the hierarchy's own rounding of an origin outside its bounds is a small part of its distance from them.
        moved.pad = self.bvh.pad() + (2.0 * beside) as f32;
        Some(GridRay { moved, enter, scale })
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DMat3};

    use super::*;

    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        fn point(&mut self) -> DVec3 {
            DVec3::new(self.next(), self.next(), self.next())
        }
    }

    /// Places instances, sheared if `squeeze` is given, about `at`.
    fn places(random: &mut Random, at: f64, squeeze: Option<f64>) -> Vec<Placement> {
        let mut place = |_| {
            let mut column = || 1e-3 * (random.point() - 0.5);
            let m = match squeeze {
                Some(squeeze) => DMat3::from_cols(column(), squeeze * column(), column()),
                // (Long enough that f64 rounds it down far away.)
                None => DMat3::from_diagonal(DVec3::splat(1.02e-3)),
            };
            let at = DVec3::splat(at) + random.point();
            Placement::new(DAffine3::from_mat3_translation(m, at)).unwrap()
        };
        (0..300).map(&mut place).collect()
    }

    /// Bounds of each instance in its own space.
    const BOUNDS: BoxBounds = BoxBounds { lo: [0; 3], hi: [64; 3] };

    /// Calls `each` with rays from nearby and from afar that meet an instance in its own space, its number, and t where a ray is within it.
    fn each_ray_that_meets(
        random: &mut Random,
        at: f64,
        places: &[Placement],
        mut each: impl FnMut(&RayInWorld, u32, f64),
    ) {
        for (number, place) in (0u32..).zip(places) {
            for reach in [1.0, 1e3, 1e6] {
                // Close to an edge of its bounds.
                let origin = DVec3::splat(at) + (random.point() - 0.5) * reach;
                let corner = DVec3::new(63.7, 63.7, 64.0 * random.next());
                // (To where the world position lies between two f64 values.)
                let from = place.index_from_world(origin - place.world_from_index.translation);
                let ray = RayInWorld { origin, direction: place.world_from_index.matrix3 * (corner - from) };
                // As the instance sees the ray, which rounding may have moved past it.
                let own = place.index_from_world(ray.direction);
                let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
                for a in 0..3 {
                    let t = |plane: u32| (f64::from(plane) - from[a]) / own[a];
                    let (lo, hi) = (t(BOUNDS.lo[a]), t(BOUNDS.hi[a]));
                    (enter, leave) = (enter.max(lo.min(hi)), leave.min(lo.max(hi)));
                }
                if enter < leave {
                    each(&ray, number, enter);
                }
            }
        }
    }

    /// Aims rays at instances, in each instance's own space, and counts the instances that the hierarchy does not find. The instances are
    /// sheared if `squeeze` is given, lie about `at`, and are seen from nearby and from afar.
    fn lost(at: f64, squeeze: Option<f64>, change: impl Fn(&mut InstanceTree)) -> usize {
        let mut random = Random(9);
        let places = places(&mut random, at, squeeze);
        let all = places.iter().map(|p| Some(WorldBounds::new(BOUNDS, p)));
        let mut tree = InstanceTree::new(all, 1).unwrap().unwrap();
        change(&mut tree);
        let mut lost = 0;
        each_ray_that_meets(&mut random, at, &places, |ray, number, _| {
            let mut found = false;
            tree.along_ray(ray, f64::INFINITY, |i| {
                found |= i == number;
                f64::INFINITY
            });
            lost += usize::from(!found);
        });
        lost
    }

    /// Rays that meet an instance whose bounds count as missed: up to any t, and up to where the ray enters them.
    fn missed(at: f64, squeeze: Option<f64>, change: impl Fn(&mut WorldBounds)) -> usize {
        let mut random = Random(9);
        let places = places(&mut random, at, squeeze);
        let mut missed = 0;
        each_ray_that_meets(&mut random, at, &places, |ray, number, enter| {
            let mut bounds = WorldBounds::new(BOUNDS, &places[number as usize]);
            change(&mut bounds);
            let beyond = bounds.are_missed(ray, f64::INFINITY) || bounds.are_missed(ray, enter);
            missed += usize::from(beyond || bounds.are_passed_by(ray));
        });
        missed
    }

    #[test]
    fn what_a_ray_meets_is_not_missed() {
        let mut without = 0;
        for at in [0.0, 1e3, -1e9, 1e13] {
            for squeeze in [None, Some(1.0), Some(1e-3), Some(1e-8), Some(1e6)] {
                assert_eq!(missed(at, squeeze, |_| {}), 0, "at {at}, squeezed {squeeze:?}");
                without += missed(at, squeeze, |bounds| bounds.condition = 0.0);
            }
        }
        // Negative control: with planes left where f64 puts them, rays count as missed that are not.
        assert!(without > 10, "{without} of 18,000");
    }

    /// A ray that turns its back, passes beside, or ends before the bounds misses them; one that starts within them does not.
    #[test]
    fn rays_beside_behind_and_short_of_bounds_miss_them() {
        let place = Placement::new(DAffine3::from_scale(DVec3::splat(0.5))).unwrap();
        let bounds = WorldBounds::new(BOUNDS, &place);
        let missed = |origin: [f64; 3], direction: [f64; 3], t: f64| {
            bounds.are_missed(&RayInWorld { origin: origin.into(), direction: direction.into() }, t)
        };
        assert!(missed([16.0, 16.0, 40.0], [0.1, 0.2, 1.0], f64::INFINITY));
        assert!(missed([16.0, -1.0, 40.0], [0.0, 0.0, -1.0], 100.0));
        assert!(missed([16.0, 16.0, 40.0], [0.0, 0.0, -1.0], 7.9));
        assert!(!missed([16.0, 16.0, 40.0], [0.0, 0.0, -1.0], 8.1));
        assert!(!missed([16.0, 16.0, 40.0], [0.0, 0.0, -1.0], f64::INFINITY));
        assert!(!missed([16.0, 16.0, 31.0], [0.1, 0.2, 1.0], f64::INFINITY));
        assert!(!missed([16.0, 16.0, 40.0], [f64::NAN; 3], 1.0));
    }

    /// Against clipping the line in f64 against bounds that are a thousandth larger and smaller: what passes the larger ones by is passed by,
    /// what meets the smaller ones is not.
    #[test]
    fn lines_that_pass_bounds_by_are_those_that_clipping_leaves_nothing_of() {
        let place = Placement::new(DAffine3::from_scale(DVec3::splat(0.5))).unwrap();
        let bounds = WorldBounds::new(BOUNDS, &place);
        let meets = |ray: &RayInWorld, scale: f64| {
            let (middle, half) = (0.5 * (bounds.lo + bounds.hi), 0.5 * scale * (bounds.hi - bounds.lo));
            let (a, b) =
                ((middle - half - ray.origin) / ray.direction, (middle + half - ray.origin) / ray.direction);
            a.min(b).max_element() <= a.max(b).min_element()
        };
        let mut random = Random(4);
        let (mut passed, mut met) = (0, 0);
        for _ in 0..4000 {
            let mut point = |size: f64| size * (random.point() - 0.5);
            let (origin, direction) = (point(200.0), point(2.0));
            // Sizes of directions for which products overflow or underflow in part exclude less, never more.
            for size in [1.0, 1e-290, 1e290, 1e-310] {
                let ray = RayInWorld { origin, direction: direction * size };
                let unit = RayInWorld { origin, direction };
                if bounds.are_passed_by(&ray) {
                    assert!(!meets(&unit, 0.999), "{unit:?} · {size:e}");
                } else {
                    assert!(meets(&unit, 1.001) || size < 1e-300, "{unit:?} · {size:e}");
                }
                passed += usize::from(bounds.are_passed_by(&ray));
                met += usize::from(meets(&unit, 1.0));
            }
        }
        assert!(passed > 8000 && met > 800, "{passed}, {met}");
        assert!(!bounds.are_passed_by(&RayInWorld { origin: DVec3::splat(1e3), direction: DVec3::NAN }));
        assert!(!bounds.are_passed_by(&RayInWorld { origin: DVec3::splat(1e3), direction: DVec3::ZERO }));
    }

    #[test]
    fn what_an_instance_meets_is_found() {
        for at in [0.0, 1e3, -1e9, 1e13] {
            assert_eq!(lost(at, None, |_| {}), 0, "at {at}");
            for squeeze in [1.0, 1e-3, 1e-8, 1e6] {
                assert_eq!(lost(at, Some(squeeze), |_| {}), 0, "at {at}, squeezed {squeeze}");
            }
        }
    }

    /// Negative control: with planes left where f64 puts them, rays are lost far away.
    #[test]
    fn without_the_slack_rays_are_lost() {
        let without = |tree: &mut InstanceTree| (tree.slack, tree.slack_a_unit) = (0.0, 0.0);
        let far = lost(1e13, None, without);
        assert!(far > 10, "{far} of 900");
    }

    /// The condition of matrices whose inverse is known.
    #[test]
    fn conditions_are_those_of_the_matrix() {
        let unit = BoxBounds { lo: [0; 3], hi: [1; 3] };
        let condition = |m: DMat3| {
            let place = Placement::new(DAffine3::from_mat3_translation(m, DVec3::ZERO)).unwrap();
            WorldBounds::new(unit, &place).condition
        };
        assert_eq!(condition(DMat3::from_diagonal(DVec3::new(0.5, -4.0, 1024.0))), 1.0);
        // |M| = [[1, s], [0, 1]], and its inverse has the same absolute values: the rows of the product sum to 1 + 2 s.
        let sheared = DMat3::from_cols(DVec3::X, DVec3::new(1000.0, 1.0, 0.0), DVec3::Z);
        assert_eq!(condition(sheared), 2001.0);
    }
}
