//! Choosing labels for a figure when nobody has: long thin things rather than lumps that fill the view.
//!
//! In a packed volume a cell body that fills a corner hides all else and looks like a wall. What reads well are labels that
//! reach far with little volume: neurites, vessels. So: leave out what holds more than [`GIANT_SHARE`] of the volume, and rank
//! the others by reach times the cube root of volume (of two equally long ones the thicker is easier to see).

use pumice_core::CompressedVolume;

/// Share of all voxels above which a label is a wall, not a thing. On the shipped cortex volume two labels are above it (27 %
/// and 6 %, both cell bodies cut by the volume's border); the next has 1.4 %.
pub const GIANT_SHARE: f64 = 0.03;

/// Smallest and one past largest voxel of each label, by dense index; from the boxes, so exact to 4 voxels.
pub fn label_bounds(volume: &CompressedVolume) -> Vec<[[u32; 3]; 2]> {
    let mut bounds = vec![[[u32::MAX; 3], [0; 3]]; volume.labels().len()];
    let dims = volume.info().dims;
    for i in 0..volume.boxes().len() {
        let b = volume.get_box(i);
        let [lo, hi] = &mut bounds[volume.label_of_box(i) as usize];
        for a in 0..3 {
            lo[a] = lo[a].min(b.origin[a]);
            hi[a] = hi[a].max((b.origin[a] + b.extent[a]).min(dims[a]));
        }
    }
    bounds
}

/// The `count` labels that make the best figure, by dense index, best first; fewer where the volume has fewer.
pub fn select_labels(volume: &CompressedVolume, count: usize) -> Vec<u32> {
    let bounds = label_bounds(volume);
    let all = volume.info().voxels() as f64;
    let spacing = volume.info().spacing();
    let score = |label: u32| -> f64 {
        let [lo, hi] = bounds[label as usize];
        let reach = (0..3).map(|a| (f64::from(hi[a] - lo[a]) * spacing[a]).powi(2)).sum::<f64>().sqrt();
        reach * (volume.labels().voxels()[label as usize] as f64).cbrt()
    };
    let mut labels: Vec<u32> = (0..volume.labels().len() as u32)
        .filter(|&l| (volume.labels().voxels()[l as usize] as f64) < GIANT_SHARE * all)
        .collect();
    if labels.is_empty() {
        // Nothing but giants (an organ atlas, a single object): then they are what there is to see.
        labels = (0..volume.labels().len() as u32).collect();
    }
    labels.sort_by(|&a, &b| score(b).total_cmp(&score(a)).then(a.cmp(&b)));
    labels.truncate(count);
    labels
}
