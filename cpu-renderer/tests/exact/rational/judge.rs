//! Judges a first hit in any placement.
//!
//! The renderer's ray in index space is rounded. Where the exact ray comes closer to a plane than that rounding may move it, either side of
//! the plane is accepted; everywhere else the voxel, the label and the face must be the exact ones. The distance is derived, not fitted
//! ([`super::ExactPlace::rounding`]), and typically 10⁻¹⁴ voxels; the walk within a box adds the chord of 2·10⁻⁵ voxels that it documents.

use pumice_transport::Hit;

use super::super::{Dense, Verdict};
use super::{RationalRay, WALK_CHORD};

/// Judges a first hit (see `pumice_cpu::traverse` for the definition of a first hit).
pub fn judge(volume: &Dense, ray: &RationalRay, hit: Option<&Hit>) -> Verdict {
    let until = hit.map_or(f64::INFINITY, |h| h.t);
    let own = hit.filter(|h| h.from_inside).map_or(0, |h| h.surface.label + 1);
    if let Some(hit) = hit
        && let Err(why) = check_surface(volume, ray, hit)
    {
        return Verdict::Wrong(why);
    }
    // March to the hit: only empty voxels (or voxels of the label that the ray starts in) may certainly lie before it.
    let mut started = 0;
    let (mut skipped, mut certain) = (0.0f64, 0.0f64);
    let (mut exact, mut seam) = (hit.is_none(), false);
    ray.march(volume.dims, |v, enter, leave| {
        let here = volume.at(v);
        if let Some(h) = hit
            && h.from_inside
            && exact
        {
            seam = here == own && ray.certain_chord(v, f64::INFINITY) > WALK_CHORD;
            return false;
        }
        if enter.value == 0.0 && ray.starts_in(v) && ray.certain_chord(v, f64::INFINITY) > WALK_CHORD {
            started = here;
        }
        if let Some(h) = hit
            && h.surface.voxel.map(i64::from) == v
        {
            let a = usize::from(h.surface.axis);
            let face = (ray.component(a) != 0.0).then(|| ray.plane(a, i64::from(h.surface.plane)));
            let at = if h.from_inside { leave } else { enter };
            exact = face.is_some_and(|face| !at.less(&face) && !face.less(at));
            if !h.from_inside {
                return false;
            }
        }
        // The reported t may be slightly less than the voxel's own: voxels after it are checked but not counted as skipped.
        let end = leave.value.min(until);
        if here != own && end > enter.value {
            skipped = skipped.max((end - enter.value) * ray.length);
            certain = certain.max(ray.certain_chord(v, until));
        }
        leave.value <= until * (1.0 + 1e-6)
    });
    match hit {
        _ if certain > WALK_CHORD => Verdict::Wrong("another surface lies before it"),
        _ if seam => Verdict::Wrong("a seam is no surface"),
        Some(h) if !h.from_inside && started != 0 => Verdict::Wrong("the ray starts inside"),
        None if started != 0 => Verdict::Wrong("the ray starts inside"),
        _ if exact && skipped == 0.0 => Verdict::Exact,
        _ => Verdict::Touch(skipped),
    }
}

/// Checks that the surface is valid: a face of a voxel of its label, turned to the ray, and hit at the reported t.
fn check_surface(volume: &Dense, ray: &RationalRay, hit: &Hit) -> Result<(), &'static str> {
    let s = &hit.surface;
    let a = usize::from(s.axis);
    let voxel = s.voxel.map(i64::from);
    if volume.at(voxel) != s.label + 1 {
        return Err("the voxel does not have the label");
    }
    if i64::from(s.plane) != voxel[a] + i64::from(s.positive) {
        return Err("the plane is not the voxel's face");
    }
    let d = ray.component(a);
    if d.abs() > ray.direction_error[a] && (d < 0.0) != (s.positive != hit.from_inside) {
        return Err("the face is turned away from the ray");
    }
    if ray.above(a, i64::from(s.plane), hit.t).abs() > ray.error(a, hit.t) {
        return Err("t is not the plane's");
    }
    for b in (0..3).filter(|&b| b != a) {
        let below = -ray.above(b, voxel[b], hit.t);
        let outside = below.max(ray.above(b, voxel[b] + 1, hit.t));
        if outside > ray.error(b, hit.t) + WALK_CHORD {
            return Err("the ray does not meet the face");
        }
    }
    Ok(())
}
