//! Test meshes.

use std::sync::Arc;

use glam::DVec3;
use pumice_core::MeshData;

/// Random numbers in [0, 1) (Steele et al. 2014, *SplitMix*).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A whole number from −`most` to `most`.
    pub(crate) fn whole(&mut self, most: i64) -> i64 {
        (self.next() * (2 * most + 1) as f64) as i64 - most
    }

    /// A uniform random direction.
    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let d = DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            if (1e-3..1.0).contains(&d.length_squared()) {
                return d.normalize();
            }
        }
    }
}

/// The surface of the cube from 0 to `side`, facing outward, each face divided into `parts`² squares of two triangles.
pub(crate) fn cube(side: f64, parts: usize) -> Arc<MeshData> {
    cube_of(side, parts, |_| 0)
}

/// The same; `material` returns the material of each face by its number: lower x, upper x, lower y, …
pub(crate) fn cube_of(side: f64, parts: usize, material: fn(usize) -> u32) -> Arc<MeshData> {
    let (mut positions, mut triangles, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    for face in 0..6 {
        let (axis, upper) = (face / 2, face % 2 == 1);
        let first = positions.len() as u32;
        for j in 0..=parts {
            for i in 0..=parts {
                let mut p = [0.0; 3];
                p[axis] = if upper { side } else { 0.0 };
                p[(axis + 1) % 3] = side * i as f64 / parts as f64;
                p[(axis + 2) % 3] = side * j as f64 / parts as f64;
                positions.push(p);
            }
        }
        let corner = |i: usize, j: usize| first + (j * (parts + 1) + i) as u32;
        for j in 0..parts {
            for i in 0..parts {
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                let both = if upper { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] };
                triangles.extend(both);
                materials.extend([material(face); 2]);
            }
        }
    }
    Arc::new(MeshData::new(positions, triangles, materials).unwrap())
}

/// A bumpy closed surface around the origin, at distances of 0.7 to 1: an octahedron whose triangles are divided in four, `times` times.
pub(crate) fn bumpy_ball(times: usize, random: &mut Random) -> Arc<MeshData> {
    let mut positions: Vec<DVec3> =
        [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]).collect();
    let mut triangles: Vec<[u32; 3]> = (0..8u32)
        .map(|octant| {
            let [x, y, z] = [octant & 1, 2 + (octant >> 1 & 1), 4 + (octant >> 2)];
            if octant.count_ones() % 2 == 0 { [x, y, z] } else { [x, z, y] }
        })
        .collect();
    for _ in 0..times {
        let mut middles = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let p = (positions[a as usize] + positions[b as usize]).normalize();
                positions.push(p);
                positions.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let positions = positions.iter().map(|p| (p * (0.7 + 0.3 * random.next())).to_array()).collect();
    Arc::new(MeshData::new(positions, triangles, Vec::new()).unwrap())
}
