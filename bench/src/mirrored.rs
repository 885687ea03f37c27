//! A large volume made of copies of a small one, each mirrored so that neighbours meet at equal voxels.

use std::collections::VecDeque;

use cpu_time::ThreadTime;
use pumice_core::{BlockSource, CompressedVolume, LabelBlock, LabelBuffer, LabelType, Result, VolumeInfo};

/// Slices of voxels that are made at once: few, because they are held beside what is measured.
const THICK: u32 = 16;

/// See the module.
pub(crate) struct Mirrored<'a> {
    volume: &'a CompressedVolume,
    info: VolumeInfo,
    /// Copies and their lowest slices that are still to be made.
    left: VecDeque<([u32; 3], u32)>,
    /// Copies along each axis, where each has labels of its own.
    own_labels: Option<[u32; 3]>,
    solid_voxels: u64,
    cpu_seconds: f64,
}

impl<'a> Mirrored<'a> {
    /// So many copies along each axis, each with labels of its own.
    pub(crate) fn copies(volume: &'a CompressedVolume, copies: [u32; 3]) -> Self {
        let dims = [0, 1, 2].map(|a| volume.info().dims[a] * copies[a]);
        Self { own_labels: Some(copies), ..Self::cut(volume, dims) }
    }

    /// As many copies as this size takes, all with the same labels; the last ones are cut off.
    pub(crate) fn cut(volume: &'a CompressedVolume, dims: [u32; 3]) -> Self {
        let mut info = VolumeInfo::new(dims, LabelType::U32);
        info.world_from_index.matrix3 = volume.info().world_from_index.matrix3;
        let side = volume.info().dims;
        let copies = [0, 1, 2].map(|a| dims[a].div_ceil(side[a]));
        let mut left = VecDeque::new();
        for k in 0..copies[2] {
            for z in (0..side[2].min(dims[2] - k * side[2])).step_by(THICK as usize) {
                for j in 0..copies[1] {
                    left.extend((0..copies[0]).map(|i| ([i, j, k], z)));
                }
            }
        }
        Self { volume, info, left, own_labels: None, solid_voxels: 0, cpu_seconds: 0.0 }
    }

    /// Voxels of labels that were made so far.
    pub(crate) fn solid_voxels(&self) -> u64 {
        self.solid_voxels
    }

    /// CPU seconds that making them took, of the threads that asked for them.
    pub(crate) fn cpu_seconds(&self) -> f64 {
        self.cpu_seconds
    }
}

impl BlockSource for Mirrored<'_> {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let Some((copy, z)) = self.left.pop_front() else { return Ok(None) };
        let clock = ThreadTime::now();
        let side = self.volume.info().dims;
        // What of the copy is made, before it is mirrored.
        let low = [0, 0, z];
        let origin = [0, 1, 2].map(|a| copy[a] * side[a] + low[a]);
        let most = [side[0], side[1], THICK.min(side[2] - z)];
        let size = [0, 1, 2].map(|a| most[a].min(self.info.dims[a] - origin[a]));
        let is_mirrored = copy.map(|at| at % 2 == 1);
        let from = [0, 1, 2].map(|a| if is_mirrored[a] { side[a] - low[a] - size[a] } else { low[a] });
        let mut labels = self.volume.decode_block(from, size)?;
        let [width, height, thick] = size.map(|n| n as usize);
        if is_mirrored[0] {
            labels.chunks_exact_mut(width).for_each(<[u32]>::reverse);
        }
        if is_mirrored[1] {
            labels.chunks_exact_mut(width * height).for_each(|slice| reverse_rows(slice, width));
        }
        if is_mirrored[2] {
            reverse_rows(&mut labels, width * height);
        }
        debug_assert_eq!(labels.len(), width * height * thick);
        self.solid_voxels += labels.iter().filter(|&&label| label != 0).count() as u64;
        if let Some([across, along, _]) = self.own_labels {
            let number = copy[0] + across * (copy[1] + along * copy[2]);
            let first = number * self.volume.labels().len() as u32;
            labels.iter_mut().filter(|label| **label != 0).for_each(|label| *label += first);
        }
        self.cpu_seconds += clock.elapsed().as_secs_f64();
        Ok(Some(LabelBlock::x_fastest(origin, size, LabelBuffer::U32(labels))))
    }
}

/// Swaps the first row with the last, and so on.
fn reverse_rows(labels: &mut [u32], row: usize) {
    let rows = labels.len() / row;
    for at in 0..rows / 2 {
        let (before, after) = labels.split_at_mut((rows - 1 - at) * row);
        before[at * row..][..row].swap_with_slice(&mut after[..row]);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use pumice_core::{CompressOptions, Job, compress, compress_labels};

    use super::*;

    /// Each voxel is that of the mirrored copy, with the copy's labels or those of the volume.
    #[test]
    fn copies_are_mirrored() {
        let dims = [5u32, 4, 70];
        let label = |[x, y, z]: [u32; 3]| (x + 3 * y + 7 * z) % 4;
        let voxels = |dims: [u32; 3]| {
            (0..dims[2])
                .flat_map(move |z| (0..dims[1]).flat_map(move |y| (0..dims[0]).map(move |x| [x, y, z])))
        };
        let small = VolumeInfo::new(dims, LabelType::U32);
        let volume = compress_labels(small, LabelBuffer::U32(voxels(dims).map(label).collect())).unwrap();
        let within = |at: [u32; 3]| {
            [0, 1, 2].map(|a| {
                let v = at[a] % dims[a];
                if at[a] / dims[a] % 2 == 1 { dims[a] - 1 - v } else { v }
            })
        };
        let ids_of = |source: &mut Mirrored<'_>, large: [u32; 3]| {
            let whole = compress(source, &CompressOptions::default(), &Job::new()).unwrap();
            assert_eq!(whole.info().dims, large);
            let ids = whole.decode_ids([0; 3], large).unwrap();
            assert_eq!(source.solid_voxels(), ids.iter().filter(|id| **id != 0).count() as u64);
            (ids, whole.labels().len())
        };

        let large = [15, 8, 140];
        let (ids, labels) = ids_of(&mut Mirrored::copies(&volume, [3, 2, 2]), large);
        assert_eq!(labels, 36);
        for (at, id) in voxels(large).zip(ids) {
            let copy = [0, 1, 2].map(|a| at[a] / dims[a]);
            let (own, number) = (label(within(at)), copy[0] + 3 * (copy[1] + 2 * copy[2]));
            assert_eq!(id, u64::from(if own == 0 { 0 } else { own + 3 * number }), "{at:?}");
        }

        // Cut off within a copy, before and after slices that are made at once.
        for large in [[13, 8, 75], [2, 3, 90], [6, 9, 140], [5, 4, 3]] {
            let (ids, labels) = ids_of(&mut Mirrored::cut(&volume, large), large);
            assert_eq!(labels, 3);
            for (at, id) in voxels(large).zip(ids) {
                assert_eq!(id, u64::from(label(within(at))), "{large:?} {at:?}");
            }
        }
    }

    /// Where other threads hold the cores, making the voxels takes no more CPU time than the thread had; its wall time would be longer.
    #[test]
    fn waiting_for_a_core_is_not_counted() {
        let dims = [64; 3];
        let labels = LabelBuffer::U32((0..64 * 64 * 64).map(|i| i / 5 % 3).collect());
        let volume = compress_labels(VolumeInfo::new(dims, LabelType::U32), labels).unwrap();
        let is_done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            for _ in 0..4 * std::thread::available_parallelism().map_or(1, Into::into) {
                scope.spawn(|| {
                    while !is_done.load(Ordering::Relaxed) {
                        std::hint::spin_loop()
                    }
                });
            }
            let mut source = Mirrored::cut(&volume, [256, 256, 64]);
            let clock = ThreadTime::now();
            while source.next_block().unwrap().is_some() {}
            let took = clock.elapsed().as_secs_f64();
            is_done.store(true, Ordering::Relaxed);
            assert!(
                0.0 < source.cpu_seconds() && source.cpu_seconds() <= took,
                "{} {took}",
                source.cpu_seconds()
            );
        });
    }
}
