//! An orthonormal frame around a normal.

use glam::DVec3;

/// Local z is the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingFrame {
    /// Local z in the world; a unit vector.
    pub normal: DVec3,
    tangent: DVec3,
    bitangent: DVec3,
}

impl ShadingFrame {
    /// Around a unit vector, without a branch on it: Duff et al. 2017, JCGT 6(1), listing 3.
    #[inline]
    pub fn new(normal: DVec3) -> Self {
        let n = normal;
        let sign = 1f64.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            normal,
            tangent: DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            bitangent: DVec3::new(b, sign + n.y * n.y * a, -n.y),
        }
    }

    /// From the frame to the world.
    #[inline]
    pub fn world_from_local(&self, v: DVec3) -> DVec3 {
        self.tangent * v.x + self.bitangent * v.y + self.normal * v.z
    }

    /// From the world to the frame.
    #[inline]
    pub fn local_from_world(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.dot(self.tangent), v.dot(self.bitangent), v.dot(self.normal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed_at_the_poles_too() {
        let normals = [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::new(1e-9, -1e-9, -1.0).normalize(), DVec3::ONE.normalize()];
        for n in normals {
            let f = ShadingFrame::new(n);
            assert!((f.tangent.cross(f.bitangent) - n).length() < 1e-12, "{n}");
            let v = DVec3::new(0.3, -0.5, 0.7);
            assert!((f.local_from_world(f.world_from_local(v)) - v).length() < 1e-12, "{n}");
        }
    }
}
