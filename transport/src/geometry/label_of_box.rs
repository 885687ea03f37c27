//! The label of a box, in fewer steps than [`CompressedVolume::label_of_box`] takes: every ray that hits something asks for it.
//!
//! ```text
//! boxes    0 1 2 … 15 │ 16 17 … 31 │ 32 …       in groups of 16
//! runs     a a a … a    a  b  … b    b  …       the run, of one label in one chunk, that each box belongs to
//! first    run of box 0, run of box 16, run of box 32 …
//! starts   first box of each run, rising
//! ```
//! From the run of a group's first box it is a step for each run that begins in the group before the box: less than one in dense tissue,
//! where a label has some fifty boxes in a chunk. A table of labels by box would take eight times the bytes there.

use pumice_core::CompressedVolume;

/// log₂ of the boxes of a group.
const GROUP_BITS: u32 = 4;

/// Finds the labels of boxes of one volume (see the module).
#[derive(Debug, Default)]
pub struct LabelOfBox {
    pub(super) first: Vec<u32>,
    pub(super) starts: Vec<u32>,
}

impl LabelOfBox {
    /// Of all boxes of a volume; `None` where one of its numbers would not fit 32 bits.
    pub fn new(volume: &CompressedVolume) -> Option<Self> {
        let (runs, boxes) = (volume.runs(), u32::try_from(volume.boxes().len()).ok()?);
        u32::try_from(runs.len()).ok()?;
        let mut starts = Vec::with_capacity(runs.len() + 1);
        for (c, chunk) in volume.chunks().iter().enumerate() {
            let end = volume.chunks().get(c + 1).map_or(runs.len(), |next| next.first_run as usize);
            let of_chunk = &runs[chunk.first_run as usize..end];
            starts.extend(of_chunk.iter().map(|run| chunk.first_box as u32 + run.first_box));
        }
        let groups = (0..boxes).step_by(1 << GROUP_BITS);
        let first = groups.map(|item| starts.partition_point(|&start| start <= item) as u32 - 1).collect();
        // No box reaches it, so the last run needs no end of its own.
        starts.push(u32::MAX);
        Some(Self { first, starts })
    }

    /// Dense label of a box of the volume that this was made of.
    #[inline(always)]
    pub fn of(&self, volume: &CompressedVolume, item: u32) -> u32 {
        let mut run = self.first[(item >> GROUP_BITS) as usize] as usize;
        while self.starts[run + 1] <= item {
            run += 1;
        }
        volume.runs()[run].label
    }

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        (self.first.capacity() * size_of::<u32>() + self.starts.capacity() * size_of::<u32>()) as u64
    }
}

#[cfg(test)]
mod tests {
    use pumice_oracle::volumes::{blobs, noise};

    use super::*;

    /// The labels are those of the volume's own walk over its runs, with many labels and with few, in one chunk and in two.
    #[test]
    fn each_box_has_the_label_of_its_run() {
        let volumes = [
            blobs([90, 70, 150], 60, 9, 8).1,
            noise([50, 41, 37], 0.2, 600, 21).1,
            blobs([1100, 20, 20], 40, 9, 8).1,
        ];
        for volume in volumes {
            let labels = LabelOfBox::new(&volume).unwrap();
            let mut next = 0;
            volume.for_each_box(|label, _| {
                assert_eq!(labels.of(&volume, next), label, "box {next}");
                next += 1;
            });
            assert!(next as usize == volume.boxes().len() && next > 40);
            assert_eq!(labels.bytes(), 4 * (u64::from(next).div_ceil(16) + volume.runs().len() as u64 + 1));
        }
    }
}
