//! Decodes the voxels of a compressed volume to an array.

use pumice_core::{CompressedVolume, Job, LabelBuffer};
use pumice_session::error::Result;

/// Number of z layers that are decoded at once.
const LAYERS: u32 = 16;

/// The ids of all voxels, x varying fastest, as 32-bit numbers, or as 64-bit numbers if an id needs them.
pub(crate) fn decoded(volume: &CompressedVolume, job: &Job) -> Result<LabelBuffer> {
    let is_wide = volume.labels().ids().iter().any(|&id| id > u64::from(u32::MAX));
    let (mut wide, mut narrow) = (Vec::new(), Vec::new());
    each_slab(volume, job, |ids| match is_wide {
        true => wide.extend(ids),
        false => narrow.extend(ids.into_iter().map(|id| id as u32)),
    })?;
    Ok(if is_wide { LabelBuffer::U64(wide) } else { LabelBuffer::U32(narrow) })
}

/// Decodes a volume in slabs of z layers, in order, and calls `visit` with the ids of each.
pub(crate) fn each_slab(volume: &CompressedVolume, job: &Job, mut visit: impl FnMut(Vec<u64>)) -> Result<()> {
    let [x, y, z] = volume.info().dims;
    for low in (0..z).step_by(LAYERS as usize) {
        job.check()?;
        visit(volume.decode_ids([0, 0, low], [x, y, LAYERS.min(z - low)])?);
    }
    Ok(())
}
