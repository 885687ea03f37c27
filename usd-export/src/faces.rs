//! Finds the faces of voxels, block by block.
//!
//! ```text
//!            y                 block of 64³ voxels, decoded with a margin of one voxel,
//!            │ 3 ─── 2         because a face depends on the voxel beyond it
//!            │ │  +x │
//!            │ 0 ─── 1         corners run counter-clockwise as seen from outside,
//!            └──────── z       so the flat normal points out of the label (in a frame that is not mirrored)
//! ```
//! Each block is decoded separately, so memory holds a few blocks and not the volume. Blocks without boxes cost nothing.

use pumice_core::{CompressedVolume, Error, Job, Result, grid::BRICK_VOXELS, morton};
use rayon::prelude::*;

/// Side of a block in voxels. With the margin, 66³ voxels are decoded, 10 % more than needed; bricks of 16³ would decode 42 % more.
const BLOCK_VOXELS: u32 = 64;
/// Number of bits by which a brick's Morton code is longer than its block's: 64 / 16 = 2², on three axes.
const BLOCK_FROM_BRICK_BITS: u32 = 3 * (BLOCK_VOXELS / BRICK_VOXELS).ilog2();
/// Number of blocks per thread that are processed at a time. It bounds the memory, and keeps threads busy while a slow block is finished.
const BLOCKS_A_THREAD: usize = 4;

/// Which faces of a visible label to return.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interfaces {
    /// Faces to voxels that are not visible: all faces that a ray from outside can hit.
    #[default]
    Outside,
    /// Also faces between visible labels, so that each label's surface is closed. At such a place both labels have a face, facing each
    /// other.
    All,
}

/// Faces of one block.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FaceBlock {
    /// Corners of each face in index space: whole numbers, 0 to the volume's extent.
    pub quads: Vec<[[u32; 3]; 4]>,
    /// Dense label index of each face.
    pub labels: Vec<u32>,
}

/// Visits the faces of the labels that are `visible` (by dense index), block by block in Morton order, independently of the number of
/// threads. Within a block, voxels come x fastest; the faces of a voxel come in the order −x, +x, −y, +y, −z, +z.
///
/// # Errors
/// [`Error::Caller`] where `visible` does not have one value per label; [`Error::Cancelled`]; any error of `visit`.
pub fn for_each_face_block(
    volume: &CompressedVolume,
    visible: &[bool],
    interfaces: Interfaces,
    job: &Job,
    mut visit: impl FnMut(FaceBlock) -> Result<()>,
) -> Result<()> {
    let labels = volume.labels().len();
    if visible.len() != labels {
        return Err(Error::Caller(format!(
            "visible: expected {labels} values, one a label, got {}",
            visible.len()
        )));
    }
    // Bricks rise in Morton order, so those of one block are consecutive.
    let mut blocks: Vec<u64> = volume.grid()?.bricks().iter().map(|&b| b >> BLOCK_FROM_BRICK_BITS).collect();
    blocks.dedup();
    job.begin(blocks.len() as u64);
    for group in blocks.chunks(BLOCKS_A_THREAD * rayon::current_num_threads()) {
        let found: Vec<FaceBlock> = group
            .par_iter()
            .map(|&block| {
                job.check()?;
                let faces =
                    faces_of(volume, visible, interfaces, morton::decode(block).map(|b| b * BLOCK_VOXELS));
                job.advance(1);
                faces
            })
            .collect::<Result<_>>()?;
        found.into_iter().filter(|faces| !faces.labels.is_empty()).try_for_each(&mut visit)?;
    }
    Ok(())
}

/// Faces of the block whose lowest voxel is `origin`.
fn faces_of(
    volume: &CompressedVolume,
    visible: &[bool],
    interfaces: Interfaces,
    origin: [u32; 3],
) -> Result<FaceBlock> {
    let dims = volume.info().dims;
    let end = [0, 1, 2].map(|a| (origin[a] + BLOCK_VOXELS).min(dims[a]));
    let low = origin.map(|o| o.saturating_sub(1));
    let size = [0, 1, 2].map(|a| (end[a] + 1).min(dims[a]) - low[a]);

    // Labels as dense index + 1; hidden labels count as background.
    let mut shown = volume.decode_block(low, size)?;
    for label in &mut shown {
        if *label != 0 && !visible[*label as usize - 1] {
            *label = 0;
        }
    }
    let at = |v: [u32; 3]| {
        let [x, y, z] = [0, 1, 2].map(|a| (v[a] - low[a]) as usize);
        shown[(z * size[1] as usize + y) * size[0] as usize + x]
    };

    let mut faces = FaceBlock::default();
    for z in origin[2]..end[2] {
        for y in origin[1]..end[1] {
            for x in origin[0]..end[0] {
                let voxel = [x, y, z];
                let label = at(voxel);
                if label == 0 {
                    continue;
                }
                for axis in 0..3 {
                    for up in [false, true] {
                        let beyond = neighbour(voxel, axis, up, dims).map_or(0, at);
                        let wanted = match interfaces {
                            Interfaces::Outside => beyond == 0,
                            Interfaces::All => beyond != label,
                        };
                        if wanted {
                            faces.quads.push(corners(voxel, axis, up));
                            faces.labels.push(label - 1);
                        }
                    }
                }
            }
        }
    }
    Ok(faces)
}

/// The voxel beyond a face; `None` beyond the volume's end.
#[inline]
fn neighbour(mut voxel: [u32; 3], axis: usize, up: bool, dims: [u32; 3]) -> Option<[u32; 3]> {
    voxel[axis] = if up { voxel[axis] + 1 } else { voxel[axis].checked_sub(1)? };
    (voxel[axis] < dims[axis]).then_some(voxel)
}

/// Corners of a voxel's face, counter-clockwise as seen from outside.
#[inline]
fn corners(voxel: [u32; 3], axis: usize, up: bool) -> [[u32; 3]; 4] {
    let (across, along) = ((axis + 1) % 3, (axis + 2) % 3);
    let ring = if up { [[0, 0], [1, 0], [1, 1], [0, 1]] } else { [[0, 1], [1, 1], [1, 0], [0, 0]] };
    ring.map(|[a, b]| {
        let mut corner = voxel;
        corner[axis] += u32::from(up);
        corner[across] += a;
        corner[along] += b;
        corner
    })
}
