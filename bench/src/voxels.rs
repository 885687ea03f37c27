//! The voxels of a compressed volume as an array again, for what takes arrays.

use pumice_core::{CompressedVolume, Job, LabelBuffer};
use pumice_session::error::Result;

/// Slabs of a volume that is decoded, in z layers.
const LAYERS: u32 = 16;

/// All voxels' ids, x fastest, in 32 bits or, where ids need them, 64.
pub(crate) fn decoded(volume: &CompressedVolume, job: &Job) -> Result<LabelBuffer> {
    let is_wide = volume.labels().ids().iter().any(|&id| id > u64::from(u32::MAX));
    let (mut wide, mut narrow) = (Vec::new(), Vec::new());
    each_slab(volume, job, |ids| match is_wide {
        true => wide.extend(ids),
        false => narrow.extend(ids.into_iter().map(|id| id as u32)),
    })?;
    Ok(if is_wide { LabelBuffer::U64(wide) } else { LabelBuffer::U32(narrow) })
}

/// Decodes a volume by z layers, in their order.
pub(crate) fn each_slab(volume: &CompressedVolume, job: &Job, mut visit: impl FnMut(Vec<u64>)) -> Result<()> {
    let [x, y, z] = volume.info().dims;
    for low in (0..z).step_by(LAYERS as usize) {
        job.check()?;
        visit(volume.decode_ids([0, 0, low], [x, y, LAYERS.min(z - low)])?);
    }
    Ok(())
}
