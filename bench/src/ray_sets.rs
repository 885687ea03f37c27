//! Rays for benches: those of a camera, and diffuse rays from their hits. They are the same on every machine and for every program.

use glam::{DAffine3, DVec3};
use pumice_transport::{Hit, RayInWorld};

/// 64 well-mixed bits of a counter (SplitMix64).
pub fn mix(i: u64) -> u64 {
    let z = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn unit(i: u64) -> f64 {
    (mix(i) >> 11) as f64 / (1u64 << 53) as f64
}

/// A pseudorandom choice of about `percent` per cent of the labels, as a mask by dense index.
pub fn some_labels(labels: usize, percent: u32) -> Vec<bool> {
    (0..labels as u64).map(|l| mix(l) % 100 < u64::from(percent)).collect()
}

/// Rays of a camera of `side` × `side` pixels (`side` is a multiple of 8) that sees the whole volume from above a corner. They are ordered
/// in tiles of 8 × 8 pixels, as a renderer traces them.
pub fn camera_rays(world_from_index: &DAffine3, dims: [u32; 3], side: u64) -> Vec<RayInWorld> {
    let dims = DVec3::from(dims.map(f64::from));
    let middle = world_from_index.transform_point3(dims / 2.0);
    let size = world_from_index.transform_vector3(dims);
    let forward = DVec3::new(-1.0, -0.8, -0.6).normalize();
    let origin = middle - forward * size.length() * 1.2;
    let right = forward.cross(DVec3::Z).normalize();
    let up = right.cross(forward);
    let ray = |i: u64| {
        let (tile, inner) = (i / 64, i % 64);
        let (x, y) = (tile % (side / 8) * 8 + inner % 8, tile / (side / 8) * 8 + inner / 8);
        let s = |v: u64| ((v as f64 + 0.5) / side as f64 - 0.5) * 0.75;
        RayInWorld { origin, direction: (forward + right * s(x) + up * s(y)).normalize() }
    };
    (0..side * side).map(ray).collect()
}

/// A ray from each hit, cosine-distributed about the hit's normal.
pub fn diffuse_rays(hits: &[(RayInWorld, Hit)]) -> Vec<RayInWorld> {
    let ray = |((ray, hit), i): (&(RayInWorld, Hit), u64)| {
        let (z, phi) = (1.0 - 2.0 * unit(2 * i), std::f64::consts::TAU * unit(2 * i + 1));
        let r = (1.0 - z * z).sqrt();
        let direction = hit.normal_in_world + DVec3::new(r * phi.cos(), r * phi.sin(), z);
        RayInWorld { origin: ray.origin + hit.t * ray.direction, direction }
    };
    hits.iter().zip(0..).map(ray).collect()
}

/// Length of the shortest side of a voxel in world units.
pub fn voxel_side(world_from_index: &DAffine3) -> f64 {
    (0..3).map(|a| world_from_index.matrix3.col(a).length()).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pixel_has_a_ray_and_all_see_the_volume_in_the_middle() {
        let place = DAffine3::from_scale(DVec3::new(2.0, 1.0, 0.5));
        let rays = camera_rays(&place, [10, 20, 40], 16);
        assert_eq!(rays.len(), 256);
        let mut directions: Vec<_> = rays.iter().map(|r| r.direction.to_array().map(f64::to_bits)).collect();
        directions.sort_unstable();
        directions.dedup();
        assert_eq!(directions.len(), 256);
        // The mean direction points at the middle of the volume.
        let mean: DVec3 = rays.iter().map(|r| r.direction).sum();
        let to_middle = DVec3::splat(10.0) - rays[0].origin;
        assert!(mean.normalize().dot(to_middle.normalize()) > 1.0 - 1e-9);
        let shown = some_labels(10_000, 15).into_iter().filter(|&s| s).count();
        assert!((1_300..1_700).contains(&shown), "{shown}");
    }
}
