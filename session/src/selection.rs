//! Choosing labels for a figure when nobody has: long thin things rather than lumps that fill the view.
//!
//! In a packed volume a cell body that fills a corner hides all else and looks like a wall. What reads well are labels that
//! reach far with little volume: neurites, vessels. So: leave out what holds more than [`GIANT_SHARE`] of the volume or less than
//! [`SPECK_SHARE`], and take those whose bounding box has the longest diagonal.

use pumice_core::CompressedVolume;

/// Share of all voxels above which a label is a wall, not a thing. On the shipped cortex volume five labels are above it (27 %
/// and 6 % are cell bodies cut by the border, three of 1 % are thick trunks); the next has 0.93 %.
pub const GIANT_SHARE: f64 = 0.01;

/// Share of all voxels below which a label is too thin to be seen in a figure of the whole: on a picture of 10⁶ pixels it covers
/// some hundreds.
pub const SPECK_SHARE: f64 = 2e-4;

/// The `count` labels that make the best figure, by dense index, best first; fewer where the volume has fewer.
pub fn select_labels(volume: &CompressedVolume, count: usize) -> Vec<u32> {
    let bounds = volume.label_bounds();
    let all = volume.info().voxels() as f64;
    let spacing = volume.info().spacing();
    let reach = |label: u32| -> f64 {
        let b = bounds[label as usize];
        (0..3).map(|a| (f64::from(b.high[a] + 1 - b.low[a]) * spacing[a]).powi(2)).sum::<f64>().sqrt()
    };
    let share = |label: u32| volume.labels().voxels()[label as usize] as f64 / all;
    let everything = 0..volume.labels().len() as u32;
    let mut labels: Vec<u32> =
        everything.clone().filter(|&l| (SPECK_SHARE..GIANT_SHARE).contains(&share(l))).collect();
    if labels.is_empty() {
        // Nothing but giants (an organ atlas, a single object): then they are what there is to see.
        labels = everything.collect();
    }
    labels.sort_by(|&a, &b| reach(b).total_cmp(&reach(a)).then(a.cmp(&b)));
    labels.truncate(count);
    labels
}
