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
//!
//! **Several instances** that touch ([`pumice_transport::geometry::Contacts`]) are passed in the same order, whatever rounding says of their
//! faces: first the back of the one, then the front of the other, at t = 0. Where both are one label of one body, neither face is a
//! surface, and the ray goes on. Which front begins in a place, a short ray through the place tells:
//!
//! ```text
//!                 A         │         B
//!                      ├────┼────┤
//!                  −near    0    near       asks all instances but A
//! ```
//! Where instances overlap, each surface counts as if its instance were alone, in the order along the ray, as in Cycles.

use glam::DVec3;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Surface, SurfaceKind, Tracer};

use crate::path::Surroundings;

/// Largest number of surfaces that a path, or a shadow ray, passes straight through: the maximum of Cycles' *Transparent Max Bounces*.
pub const MAX_TRANSPARENT_SURFACES: u32 = 1024;

/// Whether a ray that continues from the surface `left` leaves a label: outward from its back, or from a front that lies against such a
/// back (marked by t = 0, which no tracer returns).
#[inline]
fn leaves_label(direction: DVec3, left: &Hit) -> bool {
    (left.from_inside || left.t == 0.0)
        && left.surface.kind != SurfaceKind::Triangle
        && direction.dot(left.normal_in_world) > 0.0
}

/// Whether a ray that continues from the surface `left` may be inside another label of the same instance at once.
#[inline]
pub fn may_touch(direction: DVec3, left: &Hit) -> bool {
    left.surface.kind == SurfaceKind::Face && leaves_label(direction, left)
}

/// The first surface along a ray from a free point, with t below `t_max`.
#[inline]
pub fn first_hit<T: Tracer + ?Sized>(tracer: &T, ray: &RayInWorld, t_max: f64) -> Option<Hit> {
    if tracer.contact_distance() > 0.0 {
        return next_hit_in_contact(tracer, ray, None, t_max);
    }
    tracer.first_hit(ray, PathOrigin::Free, t_max)
}

/// The first surface along a ray that starts on the surface `left`, with t below `t_max`.
#[inline]
pub fn next_hit<T: Tracer + ?Sized>(tracer: &T, ray: &RayInWorld, left: &Hit, t_max: f64) -> Option<Hit> {
    if tracer.contact_distance() > 0.0 {
        return next_hit_in_contact(tracer, ray, Some(*left), t_max);
    }
    next_hit_alone(tracer, ray, left, t_max)
}

/// [`next_hit`] where instances of volumes may touch; `left` is `None` where the ray starts from a free point.
#[inline(never)]
fn next_hit_in_contact<T: Tracer + ?Sized>(
    tracer: &T,
    ray: &RayInWorld,
    mut left: Option<Hit>,
    t_max: f64,
) -> Option<Hit> {
    let near = tracer.contact_distance() / ray.direction.length();
    let mut here = *ray;
    let mut gone = 0.0;
    if let Some(left) = &left
        && leaves_label(ray.direction, left)
        && let Some(front) = front_at(tracer, &here, near, left)
    {
        return Some(front);
    }
    // (The limit ends rays that pass from part to part along an edge without coming forward.)
    for _ in 0..MAX_TRANSPARENT_SURFACES {
        let hit = match &left {
            Some(left) => next_hit_alone(tracer, &here, left, t_max - gone),
            None => tracer.first_hit(&here, PathOrigin::Free, t_max - gone),
        }?;
        here.origin += ray.direction * hit.t;
        gone += hit.t;
        let hit = Hit { t: gone, ..hit };
        if !hit.is_seen_from_within() {
            return Some(hit);
        }
        // Straight on where another part of the same body begins.
        left =
            front_at(tracer, &here, near, &hit).filter(|front| tracer.are_one(&front.surface, &hit.surface));
        if left.is_none() {
            return Some(hit);
        }
    }
    None
}

/// The front of a label of another instance that begins where a ray starts from the face `left`.
fn front_at<T: Tracer + ?Sized>(tracer: &T, ray: &RayInWorld, near: f64, left: &Hit) -> Option<Hit> {
    let before = RayInWorld { origin: ray.origin - ray.direction * near, ..*ray };
    let front = tracer.first_volume_besides(&before, 2.0 * near, left.surface.instance)?;
    (!front.from_inside).then_some(Hit { t: 0.0, ..front })
}

/// [`next_hit`] where each instance is by itself.
#[inline]
fn next_hit_alone<T: Tracer + ?Sized>(tracer: &T, ray: &RayInWorld, left: &Hit, t_max: f64) -> Option<Hit> {
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
