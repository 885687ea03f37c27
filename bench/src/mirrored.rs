//! A large volume made of copies of a small one: each copy mirrored so that neighbours meet at equal voxels, and with labels of its own.

use std::collections::VecDeque;

use pumice_core::{BlockSource, CompressedVolume, LabelBlock, LabelBuffer, LabelType, Result, VolumeInfo};

/// Slices of voxels that are made at once: few, because they are held beside what is measured.
const THICK: u32 = 16;

/// See the module.
pub(crate) struct Mirrored<'a> {
    volume: &'a CompressedVolume,
    info: VolumeInfo,
    /// Copies and their lowest slices that are still to be made.
    left: VecDeque<([u32; 3], u32)>,
    copies: [u32; 3],
}

impl<'a> Mirrored<'a> {
    /// So many copies along each axis.
    pub(crate) fn new(volume: &'a CompressedVolume, copies: [u32; 3]) -> Self {
        let dims = [0, 1, 2].map(|a| volume.info().dims[a] * copies[a]);
        let mut info = VolumeInfo::new(dims, LabelType::U32);
        info.world_from_index.matrix3 = volume.info().world_from_index.matrix3;
        let mut left = VecDeque::new();
        for k in 0..copies[2] {
            for z in (0..volume.info().dims[2]).step_by(THICK as usize) {
                for j in 0..copies[1] {
                    left.extend((0..copies[0]).map(|i| ([i, j, k], z)));
                }
            }
        }
        Self { volume, info, left, copies }
    }
}

impl BlockSource for Mirrored<'_> {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> Result<Option<LabelBlock>> {
        let Some((copy, z)) = self.left.pop_front() else { return Ok(None) };
        let [width, height, depth] = self.volume.info().dims;
        let thick = THICK.min(depth - z);
        let is_mirrored = copy.map(|at| at % 2 == 1);
        let from = if is_mirrored[2] { depth - z - thick } else { z };
        let mut labels = self.volume.decode_block([0, 0, from], [width, height, thick])?;
        let (row, slice) = (width as usize, (width * height) as usize);
        if is_mirrored[0] {
            labels.chunks_exact_mut(row).for_each(<[u32]>::reverse);
        }
        if is_mirrored[1] {
            for slice in labels.chunks_exact_mut(slice) {
                let rows = height as usize;
                for y in 0..rows / 2 {
                    let (above, below) = slice.split_at_mut((rows - 1 - y) * row);
                    above[y * row..][..row].swap_with_slice(&mut below[..row]);
                }
            }
        }
        if is_mirrored[2] {
            let slices = thick as usize;
            for z in 0..slices / 2 {
                let (above, below) = labels.split_at_mut((slices - 1 - z) * slice);
                above[z * slice..][..slice].swap_with_slice(&mut below[..slice]);
            }
        }
        let number = copy[0] + self.copies[0] * (copy[1] + self.copies[1] * copy[2]);
        let first = number * self.volume.labels().len() as u32;
        labels.iter_mut().filter(|label| **label != 0).for_each(|label| *label += first);
        let origin = [copy[0] * width, copy[1] * height, copy[2] * depth + z];
        Ok(Some(LabelBlock::x_fastest(origin, [width, height, thick], LabelBuffer::U32(labels))))
    }
}

#[cfg(test)]
mod tests {
    use pumice_core::{CompressOptions, Job, compress, compress_labels};

    use super::*;

    /// Each voxel is that of the mirrored copy, with the copy's labels.
    #[test]
    fn copies_are_mirrored_and_have_labels_of_their_own() {
        let dims = [5u32, 4, 70];
        let label = |[x, y, z]: [u32; 3]| (x + 3 * y + 7 * z) % 4;
        let voxels = |dims: [u32; 3]| {
            (0..dims[2])
                .flat_map(move |z| (0..dims[1]).flat_map(move |y| (0..dims[0]).map(move |x| [x, y, z])))
        };
        let small = VolumeInfo::new(dims, LabelType::U32);
        let volume = compress_labels(small, LabelBuffer::U32(voxels(dims).map(label).collect())).unwrap();
        let mut source = Mirrored::new(&volume, [3, 2, 2]);
        let large = source.info().dims;
        let whole = compress(&mut source, &CompressOptions::default(), &Job::new()).unwrap();
        assert_eq!((large, whole.labels().len()), ([15, 8, 140], 36));
        let ids = whole.decode_ids([0; 3], large).unwrap();
        for (at, id) in voxels(large).zip(ids) {
            let copy = [0, 1, 2].map(|a| at[a] / dims[a]);
            let within = [0, 1, 2].map(|a| {
                let v = at[a] % dims[a];
                if copy[a] % 2 == 1 { dims[a] - 1 - v } else { v }
            });
            let (own, number) = (label(within), copy[0] + 3 * (copy[1] + 2 * copy[2]));
            assert_eq!(id, u64::from(if own == 0 { 0 } else { own + 3 * number }), "{at:?}");
        }
    }
}
