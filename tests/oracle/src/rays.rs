//! Generates rays by class, on the oracle's grid of 2⁻⁴⁶.

use super::volumes::Random;

/// Classes of rays, by the difficulty that they pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Random rays.
    Random,
    /// Directions of whole numbers and origins on a coarse grid, as in isometric views, which meet edges and corners exactly.
    Lattice,
    /// In a plane between voxels.
    InFace,
    /// Along an edge of voxels.
    AlongEdge,
    /// Through corners of voxels.
    ThroughCorner,
    /// Parallel to an axis.
    AxisParallel,
    /// 10⁻⁷ rad off a plane between voxels, close to it.
    Grazing,
    /// From 10⁶ voxels away.
    Far1e6,
    /// From 10⁹ voxels away.
    Far1e9,
    /// Starting inside the volume, often inside a solid voxel.
    Inside,
}

/// All classes.
pub const CLASSES: [Class; 10] = [
    Class::Random,
    Class::Lattice,
    Class::InFace,
    Class::AlongEdge,
    Class::ThroughCorner,
    Class::AxisParallel,
    Class::Grazing,
    Class::Far1e6,
    Class::Far1e9,
    Class::Inside,
];

/// Rounds to a multiple of 2^(−bits).
pub fn snap(x: f64, bits: u32) -> f64 {
    let scale = f64::from(bits).exp2();
    (x * scale).round() / scale
}

fn direction(random: &mut Random) -> [f64; 3] {
    loop {
        let d = [0; 3].map(|_| random.unit() * 2.0 - 1.0);
        let l: f64 = d.iter().map(|x| x * x).sum();
        if (0.01..1.0).contains(&l) {
            return d.map(|x| snap(x, 20));
        }
    }
}

fn sign(random: &mut Random) -> f64 {
    if random.bits() & 1 == 0 { 1.0 } else { -1.0 }
}

/// A random ray of a class as (origin, direction); `fine` is the number of fraction bits that origins may have.
pub fn ray(class: Class, dims: [u32; 3], fine: u32, random: &mut Random) -> ([f64; 3], [f64; 3]) {
    let point = |random: &mut Random| dims.map(|d| snap(random.unit() * f64::from(d), fine));
    let lattice_point = |random: &mut Random| dims.map(|d| f64::from(random.below(d + 1)));
    let away = |p: [f64; 3], d: [f64; 3], t: f64| [0, 1, 2].map(|a| p[a] - t * d[a]);
    match class {
        Class::Random => {
            let (p, d) = (point(random), direction(random));
            let d = d.map(|x| snap(x, fine));
            (away(p, d, 2.0 * f64::from(dims[0])), d)
        }
        Class::Inside => (point(random), direction(random)),
        Class::Lattice => {
            let d = [0; 3].map(|_| f64::from(random.below(7)) - 3.0);
            if d == [0.0; 3] {
                return ray(class, dims, fine, random);
            }
            let grid = random.below(4); // halves, quarters, eighths too
            let p =
                lattice_point(random).map(|x| x + f64::from(random.below(1 << grid)) / f64::from(1 << grid));
            (away(p, d, 100.0), d)
        }
        Class::InFace => {
            let (mut p, mut d) = (point(random), direction(random));
            let a = random.below(3) as usize;
            p[a] = p[a].round();
            d[a] = if random.bits() & 1 == 0 { 0.0 } else { -0.0 };
            (away(p, d, 128.0), d)
        }
        Class::AlongEdge => {
            let a = random.below(3) as usize;
            let mut d = [0.0; 3];
            d[a] = sign(random);
            (away(lattice_point(random), d, 300.0), d)
        }
        Class::ThroughCorner => {
            let (p, d) = (lattice_point(random), direction(random).map(|x| snap(x, 12)));
            if d == [0.0; 3] {
                return ray(class, dims, fine, random);
            }
            (away(p, d, 256.0), d)
        }
        Class::AxisParallel => {
            let a = random.below(3) as usize;
            let mut d = [0.0; 3];
            d[a] = sign(random) * (1.0 + f64::from(random.below(8)));
            (away(point(random), d, 300.0), d)
        }
        Class::Grazing => {
            let a = random.below(3) as usize;
            let (mut p, mut d) = (point(random), direction(random));
            d[a] = snap(1e-7 * (0.5 + random.unit()), 46) * sign(random);
            // Starts so close to the plane that the ray crosses it within the volume.
            p[a] = p[a].round() + snap(1e-5 * (random.unit() - 0.5), 36);
            (p, d)
        }
        Class::Far1e6 | Class::Far1e9 => {
            let p = dims.map(|d| snap(random.unit() * f64::from(d), 16));
            let d = direction(random).map(|x| snap(x, 10));
            if d == [0.0; 3] {
                return ray(class, dims, fine, random);
            }
            let t = if class == Class::Far1e6 { 1_048_576.0 } else { 900_000_000.0 };
            (away(p, d, t), d)
        }
    }
}
