//! Paths through transparent surfaces: into a label from outside, through its inside, and out of it.
//!
//! ```text
//!            outside      label A      label B      outside
//! ─────────────►│────────────►│────────────►│────────────►
//!         A's front      A's back,     B's back
//!                       then B's front
//! ```
//! A tracer reports where a ray leaves the label that it starts in ([`Hit::from_inside`]). Where labels touch, the ray that leaves one
//! label starts inside the next, and the tracer reports the back of that one. This module inserts the missing front of the next label, at
//! the face that the ray just left.

use glam::DVec3;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Surface, SurfaceKind, Tracer};

use crate::path::Surroundings;

/// Largest number of surfaces that a path, or a shadow ray, passes straight through: the maximum of Cycles' *Transparent Max Bounces*.
pub const MAX_TRANSPARENT_SURFACES: u32 = 1024;

/// Whether a ray that continues from the surface `left` may be inside another label at once: it leaves outward from the back of a label, or
/// from a front that lies against such a back (marked by t = 0, which no tracer returns).
#[inline]
pub fn may_touch(direction: DVec3, left: &Hit) -> bool {
    (left.from_inside || left.t == 0.0)
        && left.surface.kind == SurfaceKind::Face
        && direction.dot(left.normal_in_world) > 0.0
}

/// The first surface along a ray that starts on the surface `left`, with t below `t_max`.
#[inline]
pub fn next_hit<T: Tracer + ?Sized>(tracer: &T, ray: &RayInWorld, left: &Hit, t_max: f64) -> Option<Hit> {
    let from = PathOrigin::Face(left.surface);
    if may_touch(ray.direction, left) {
        let next = tracer.first_hit(ray, from, f64::INFINITY)?;
        if next.is_seen_from_within() && next.surface.instance == left.surface.instance {
            return Some(front_of(&next, left));
        }
        return (next.t < t_max).then_some(next);
    }
    tracer.first_hit(ray, from, t_max)
}

/// The front of the label whose back is `back`, where that label touches the face `left`.
#[cold]
fn front_of(back: &Hit, left: &Hit) -> Hit {
    let Surface { kind, axis, positive, plane, mut voxel, .. } = left.surface;
    voxel[usize::from(axis.min(2))] = if positive { plane } else { plane.saturating_sub(1) };
    let surface = Surface { kind, voxel, positive: !positive, axis, plane, ..back.surface };
    Hit { t: 0.0, surface, normal_in_world: -left.normal_in_world, from_inside: false }
}

/// Transmitted share of the light along a ray from the surface `left` to `t_max`: surfaces with alpha below 1 let part of it straight
/// through; all others, glass too, block it, as in Cycles.
#[inline]
pub fn visibility<T: Tracer + ?Sized>(
    tracer: &T,
    around: &Surroundings,
    ray: &RayInWorld,
    left: &Hit,
    t_max: f64,
) -> f32 {
    if around.materials.has_transparent() {
        return visibility_through(tracer, around, ray, left, t_max);
    }
    f32::from(u8::from(!tracer.occluded(ray, PathOrigin::Face(left.surface), t_max)))
}

#[inline(never)]
fn visibility_through<T: Tracer + ?Sized>(
    tracer: &T,
    around: &Surroundings,
    ray: &RayInWorld,
    left: &Hit,
    mut t_max: f64,
) -> f32 {
    let (mut ray, mut left, mut part) = (*ray, *left, 1.0);
    let mut passed = 0;
    loop {
        let Some(hit) = next_hit(tracer, &ray, &left, t_max) else { return part };
        let alpha = around.materials[hit.surface.instance as usize].material(hit.surface.label).alpha;
        if alpha >= 1.0 || passed == MAX_TRANSPARENT_SURFACES {
            return 0.0;
        }
        passed += 1;
        part *= 1.0 - alpha;
        ray.origin += ray.direction * hit.t;
        t_max -= hit.t;
        left = hit;
    }
}
