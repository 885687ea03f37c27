//! Chooses labels for a figure: long, thin labels rather than lumps that fill the view.
//!
//! In a packed volume a cell body that fills a corner hides everything else and looks like a wall. Labels that reach far with little
//! volume are easy to recognize: neurites, vessels. So labels with more than [`GIANT_SHARE`] or less than [`SPECK_SHARE`] of the volume
//! come last, and the others are ordered by the diagonal of their bounding box, longest first.

use pumice_core::CompressedVolume;

/// Share of all voxels above which a label hides the others. In the shipped cortex volume five labels are above it (27 % and 6 % are
/// cell bodies cut by the border, three of 1 % are thick trunks); the next has 0.93 %.
pub const GIANT_SHARE: f64 = 0.01;

/// Share of all voxels below which a label is too small to be seen in a figure of the whole volume: in a picture of 10⁶ pixels it
/// covers a few hundred.
pub const SPECK_SHARE: f64 = 2e-4;

/// The `count` labels that make the best figure, by dense index, best first, of those that were read from the file; fewer if there are
/// fewer.
pub fn select_labels(volume: &CompressedVolume, count: usize) -> Vec<u32> {
    let held = (0..volume.labels().len() as u32).filter(|&label| volume.holds(label));
    select_among(volume, held.collect(), count)
}

/// The `count` of these labels that make the best figure, by dense index, best first; all of them if there are fewer.
pub fn select_among(volume: &CompressedVolume, mut labels: Vec<u32>, count: usize) -> Vec<u32> {
    let bounds = volume.label_bounds();
    // At one time step of a series, labels of others have no voxel.
    labels.retain(|&label| bounds[label as usize].low[0] <= bounds[label as usize].high[0]);
    let all = volume.info().voxels() as f64;
    let spacing = volume.info().spacing();
    let reach = |label: u32| -> f64 {
        let b = bounds[label as usize];
        (0..3).map(|a| (f64::from(b.high[a] + 1 - b.low[a]) * spacing[a]).powi(2)).sum::<f64>().sqrt()
    };
    let share = |label: u32| volume.labels().voxels()[label as usize] as f64 / all;
    // Giants and specks come last but are not dropped: an organ atlas or a handful of cells has nothing else, and a request for n labels
    // gets n.
    let thing = |label: u32| (SPECK_SHARE..GIANT_SHARE).contains(&share(label));
    labels.sort_by(|&a, &b| thing(b).cmp(&thing(a)).then(reach(b).total_cmp(&reach(a))).then(a.cmp(&b)));
    labels.truncate(count);
    labels
}

#[cfg(test)]
mod tests {
    use super::*;
    use pumice_core::{LabelBuffer, LabelType, VolumeInfo, compress_labels};

    #[test]
    fn long_thin_labels_first_then_whatever_there_is() {
        // A wall of 1 over half the volume, a long rod of 2, a short one of 3, a speck of 4.
        let labels: Vec<u8> = (0..64 * 32 * 32u32)
            .map(|i| match (i % 64, i / 64 % 32, i / 2048) {
                (0..32, _, _) => 1,
                (32..64, 3..5, 3) => 2,
                (40..60, 20, 20) => 3,
                (63, 31, 31) => 4,
                _ => 0,
            })
            .collect();
        let info = VolumeInfo::new([64, 32, 32], LabelType::U8);
        let volume = compress_labels(info, LabelBuffer::U8(labels)).unwrap();
        let ids = |count| {
            let chosen = select_labels(&volume, count);
            chosen.iter().map(|&l| volume.labels().ids()[l as usize]).collect::<Vec<u64>>()
        };
        assert_eq!(ids(2), [2, 3]);
        assert_eq!(ids(9), [2, 3, 1, 4]);
    }
}
