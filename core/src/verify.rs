//! Verifies that compression was lossless: reads every voxel's id again from a source and compares it with the compressed volume.

use rayon::prelude::*;

use crate::{BlockSource, CompressedVolume, Error, Job, LabelBlock, LabelBuffer, Result};

/// Result of a comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verification {
    /// Every voxel has the same id.
    Same {
        /// Number of voxels that were compared.
        voxels: u64,
    },
    /// The volumes differ in size.
    OtherDims {
        /// Size of the source.
        expected: [u32; 3],
        /// Size of the compressed volume.
        got: [u32; 3],
    },
    /// The first voxel found to differ.
    OtherLabel {
        /// Coordinates of the voxel.
        voxel: [u32; 3],
        /// Id in the source.
        expected: u64,
        /// Id in the compressed volume.
        got: u64,
    },
}

impl std::fmt::Display for Verification {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Same { voxels } => write!(f, "all {voxels} voxels are the same"),
            Self::OtherDims { expected, got } => {
                write!(f, "expected {} × {} × {} voxels, ", expected[0], expected[1], expected[2])?;
                write!(f, "got {} × {} × {}", got[0], got[1], got[2])
            }
            Self::OtherLabel { voxel: [x, y, z], expected, got } => {
                write!(f, "at voxel ({x}, {y}, {z}) expected label {expected}, got {got}")
            }
        }
    }
}

/// Compares a volume with a source; reads the source to its end or to the first difference.
///
/// # Errors
/// Those of the source, [`Error::Cancelled`], and [`Error::Caller`] when the source does not deliver every voxel.
pub fn verify(volume: &CompressedVolume, source: &mut dyn BlockSource, job: &Job) -> Result<Verification> {
    let (expected, got) = (source.info().dims, volume.info().dims);
    if expected != got {
        return Ok(Verification::OtherDims { expected, got });
    }
    job.begin(source.info().voxels());
    let mut voxels = 0u64;
    while let Some(block) = source.next_block()? {
        job.check()?;
        if let Some(difference) = compare(volume, &block, job)? {
            return Ok(difference);
        }
        voxels += block.dims.iter().map(|&d| u64::from(d)).product::<u64>();
    }
    if voxels != volume.info().voxels() {
        return Err(Error::Caller(format!(
            "the source's blocks: got {voxels} voxels in all, expected {}",
            volume.info().voxels()
        )));
    }
    Ok(Verification::Same { voxels })
}

/// Largest number of voxels that a task decodes at once: 1 MiB of labels.
const TASK_VOXELS: u64 = 1 << 18;

fn compare(volume: &CompressedVolume, block: &LabelBlock, job: &Job) -> Result<Option<Verification>> {
    // Bands of whole x lines, or of pieces of them; their depth is a multiple of 16 where possible.
    let [dx, dy, dz] = block.dims.map(u64::from);
    let x_step = dx.clamp(1, TASK_VOXELS);
    let y_step = (TASK_VOXELS / x_step).clamp(1, 64).min(dy.max(1));
    let z_step = (TASK_VOXELS / (x_step * y_step)).clamp(1, 64).min(dz.max(1));
    let bands: Vec<[u32; 3]> = (0..dz.div_ceil(z_step))
        .flat_map(|z| {
            (0..dy.div_ceil(y_step)).flat_map(move |y| {
                (0..dx.div_ceil(x_step)).map(move |x| [x * x_step, y * y_step, z * z_step].map(|v| v as u32))
            })
        })
        .collect();
    let step = [x_step, y_step, z_step].map(|v| v as u32);
    let found = bands
        .par_iter()
        .map(|&low| {
            job.check()?;
            let dims = [0, 1, 2].map(|a| step[a].min(block.dims[a] - low[a]));
            let found = compare_band(volume, block, low, dims)?;
            job.advance(dims.iter().map(|&d| u64::from(d)).product());
            Ok(found)
        })
        .find_first(|r| !matches!(r, Ok(None)));
    found.unwrap_or(Ok(None))
}

fn compare_band(
    volume: &CompressedVolume,
    block: &LabelBlock,
    low: [u32; 3],
    dims: [u32; 3],
) -> Result<Option<Verification>> {
    let origin = [0, 1, 2].map(|a| block.origin[a] + low[a]);
    let dense = volume.decode_block(origin, dims)?;
    // The label type is resolved once here, so that comparing a voxel takes just a load and a comparison.
    let first = match &block.labels {
        LabelBuffer::U8(v) => first_difference(volume, block, low, dims, &dense, v),
        LabelBuffer::U16(v) => first_difference(volume, block, low, dims, &dense, v),
        LabelBuffer::U32(v) => first_difference(volume, block, low, dims, &dense, v),
        LabelBuffer::U64(v) => first_difference(volume, block, low, dims, &dense, v),
    };
    Ok(first.map(|(p, expected, got)| Verification::OtherLabel {
        voxel: [0, 1, 2].map(|a| origin[a] + p[a]),
        expected,
        got,
    }))
}

fn first_difference<T: Copy + Into<u64>>(
    volume: &CompressedVolume,
    block: &LabelBlock,
    low: [u32; 3],
    dims: [u32; 3],
    dense: &[u32],
    labels: &[T],
) -> Option<([u32; 3], u64, u64)> {
    let ids = volume.labels().ids();
    let mut decoded = dense.iter();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            let mut at: usize = [low[0], low[1] + y, low[2] + z]
                .iter()
                .zip(block.strides)
                .map(|(&p, s)| p as usize * s)
                .sum();
            for (x, &d) in (0..dims[0]).zip(&mut decoded) {
                let expected: u64 = labels[at].into();
                let got = if d == 0 { 0 } else { ids[d as usize - 1] };
                if expected != got {
                    return Some(([x, y, z], expected, got));
                }
                at += block.strides[0];
            }
        }
    }
    None
}
