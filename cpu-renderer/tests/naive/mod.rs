//! The oracle of light tests: a march through a dense array of labels, one voxel at a time, in f64.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its part")]

use glam::DVec3;
use pumice_transport::{Hit, PathOrigin, RayInWorld, Surface, SurfaceKind, Tracer};

/// Labels by voxel, 0 is empty; index space is world space.
#[derive(Clone, Debug)]
pub struct Dense {
    pub dims: [i64; 3],
    pub labels: Vec<u32>,
}

impl Dense {
    pub fn new(dims: [i64; 3], label: impl Fn([i64; 3]) -> u32) -> Self {
        let mut labels = Vec::new();
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    labels.push(label([x, y, z]));
                }
            }
        }
        Self { dims, labels }
    }

    fn at(&self, v: [i64; 3]) -> u32 {
        if (0..3).any(|a| v[a] < 0 || v[a] >= self.dims[a]) {
            return 0;
        }
        self.labels[((v[2] * self.dims[1] + v[1]) * self.dims[0] + v[0]) as usize]
    }
}

impl Tracer for Dense {
    /// Amanatides and Woo 1987 from the origin on, including empty space outside; origins lie in empty space.
    fn first_hit(&self, ray: &RayInWorld, from: PathOrigin, t_max: f64) -> Option<Hit> {
        let (mut o, d) = (ray.origin, ray.direction);
        let mut voxel = [0i64; 3];
        if let PathOrigin::Face(s) = from {
            o[s.axis as usize] = f64::from(s.plane);
        }
        for a in 0..3 {
            voxel[a] = o[a].floor() as i64;
        }
        if let PathOrigin::Face(s) = from {
            // The empty voxel in front of the face: rounding must not move it along the face.
            voxel = s.voxel.map(i64::from);
            voxel[s.axis as usize] += if s.positive { 1 } else { -1 };
        }
        let step = [0, 1, 2].map(|a| if d[a] > 0.0 { 1i64 } else { -1 });
        loop {
            let t = |a: usize| {
                let plane = voxel[a] + i64::from(step[a] > 0);
                if d[a] == 0.0 { f64::INFINITY } else { (plane as f64 - o[a]) / d[a] }
            };
            let axis = (0..3).min_by(|&a, &b| t(a).total_cmp(&t(b)))?;
            let t = t(axis).max(0.0);
            if t >= t_max || !t.is_finite() {
                return None;
            }
            voxel[axis] += step[axis];
            if (0..3).any(|a| voxel[a] < 0 && step[a] < 0 || voxel[a] >= self.dims[a] && step[a] > 0) {
                return None;
            }
            let label = self.at(voxel);
            if label != 0 {
                let positive = step[axis] < 0;
                let mut normal = DVec3::ZERO;
                normal[axis] = -step[axis] as f64;
                let surface = Surface {
                    instance: 0,
                    kind: SurfaceKind::Face,
                    voxel: voxel.map(|v| v as u32),
                    axis: axis as u8,
                    positive,
                    plane: (voxel[axis] + i64::from(positive)) as u32,
                    label: label - 1,
                };
                return Some(Hit { t, surface, normal_in_world: normal, from_inside: false });
            }
        }
    }
}
