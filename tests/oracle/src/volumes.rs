//! Test volumes, each as a dense array and compressed.

use std::sync::Arc;

use pumice_core::{CompressedVolume, LabelBuffer, LabelType, VolumeInfo, compress_labels};

use super::Dense;

/// A small pseudorandom number generator (a linear congruential generator with PCG's multiplier, and mixed high bits).
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// 32 random bits.
    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = self.0 ^ (self.0 >> 33);
        (x.wrapping_mul(0xff51_afd7_ed55_8ccd) >> 32) as u32
    }
    /// A whole number below `n`.
    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.bits()) * u64::from(n)) >> 32) as u32
    }
    /// A number within [0, 1).
    pub fn unit(&mut self) -> f64 {
        f64::from(self.bits()) / 4_294_967_296.0
    }
}

/// A volume with the id `label(x, y, z)` at each voxel, 0 for empty ones. The dense array gets dense labels.
#[expect(clippy::expect_used, reason = "labels that were just counted, in dims that hold them")]
pub fn volume(dims: [u32; 3], mut label: impl FnMut(u32, u32, u32) -> u32) -> (Dense, Arc<CompressedVolume>) {
    let mut ids = Vec::with_capacity(dims.iter().map(|&d| d as usize).product());
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                ids.push(label(x, y, z));
            }
        }
    }
    let mut used: Vec<u32> = ids.iter().copied().filter(|&i| i != 0).collect();
    used.sort_unstable();
    used.dedup();
    let labels = ids.iter().map(|i| used.binary_search(i).map_or(0, |p| p as u32 + 1)).collect();
    let info = VolumeInfo::new(dims, LabelType::U32);
    let compressed = compress_labels(info, LabelBuffer::U32(ids)).expect("as many labels as voxels");
    (Dense { dims, labels }, Arc::new(compressed))
}

/// Independent random voxels, of which a share `density` has one of `labels` labels.
pub fn noise(dims: [u32; 3], density: f64, labels: u32, seed: u64) -> (Dense, Arc<CompressedVolume>) {
    let mut random = Random(seed);
    volume(dims, |_, _, _| if random.unit() < density { 1 + random.below(labels) } else { 0 })
}

/// A checkerboard of solid and empty voxels, with three labels.
pub fn checkerboard(dims: [u32; 3]) -> (Dense, Arc<CompressedVolume>) {
    volume(dims, |x, y, z| if (x + y + z) % 2 == 0 { 1 + (x / 5 + y / 7) % 3 } else { 0 })
}

/// Sheets one voxel thick, in three orientations.
pub fn sheets(dims: [u32; 3]) -> (Dense, Arc<CompressedVolume>) {
    volume(dims, |x, y, z| {
        if x % 11 == 3 && (y + z) % 9 < 6 {
            1
        } else if (x + y) % 13 == 5 && z % 5 != 0 {
            2
        } else if z % 17 == 16 {
            3
        } else {
            0
        }
    })
}

/// Voronoi cells of `seeds` random points, of which `shown` are kept: round bodies that touch, as in tissue.
pub fn blobs(dims: [u32; 3], seeds: u32, shown: u32, seed: u64) -> (Dense, Arc<CompressedVolume>) {
    let mut random = Random(seed);
    let points: Vec<[f64; 3]> = (0..seeds).map(|_| dims.map(|d| random.unit() * f64::from(d))).collect();
    volume(dims, |x, y, z| {
        let p = [x, y, z].map(|v| f64::from(v) + 0.5);
        let distance = |q: &[f64; 3]| (0..3).map(|a| (p[a] - q[a]).powi(2)).sum::<f64>();
        let nearest = (0..points.len())
            .min_by(|&i, &j| distance(&points[i]).total_cmp(&distance(&points[j])))
            .unwrap_or(0) as u32;
        if nearest % seeds < shown { nearest + 1 } else { 0 }
    })
}
