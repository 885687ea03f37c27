//! Reads label volumes of other formats to their end, or to a limit.

use std::path::Path;

use pumice_core::BlockSource;
use pumice_formats::{ArrayAxes, FormatError, OpenOptions, open, probe};

/// Number of voxels after which reading stops, because a few kB may decompress to many MB of equal voxels.
const MOST_VOXELS: u64 = 1 << 22;

/// Number of blocks after which reading stops, because a forged store may have millions of chunks of a voxel each.
const MOST_BLOCKS: u64 = 1 << 8;

/// Reads the header, then the voxels. Chooses the first layer, time step or channel if the file has several.
pub fn read_all(path: &Path, mut options: OpenOptions) {
    if let Err(error) = probe(path, &options) {
        one_line(&error.to_string());
    }
    for _ in 0..4 {
        match open(path, &options) {
            Ok(mut source) => return drain(source.as_mut()),
            Err(FormatError::Choose { option, .. }) => match option {
                "--layer" => options.layer = Some(0),
                "--time-step" => options.time = Some(0),
                "--channel" => options.channel = Some(0),
                _ => return,
            },
            Err(error) => return one_line(&error.to_string()),
        }
    }
    panic!("the reader asks again for an option that is set: {options:?}");
}

/// [`read_all`] with both orders of an array's axes.
pub fn read_array_both_ways(path: &Path) {
    for axes in [ArrayAxes::Xyz, ArrayAxes::Zyx] {
        read_all(path, OpenOptions { axes: Some(axes), ..OpenOptions::default() });
    }
}

fn one_line(text: &str) {
    assert!(!text.contains('\n') && !text.is_empty(), "not one line: {text:?}");
}

/// Reads all blocks. They must lie within the volume, have all their labels, and have as many voxels together as the volume.
fn drain(source: &mut dyn BlockSource) {
    let info = source.info().clone();
    let (mut voxels, mut blocks) = (0, 0);
    loop {
        match source.next_block() {
            Ok(Some(block)) => {
                assert!((0..3).all(|a| block.dims[a] > 0), "empty block {:?}", block.dims);
                let inside = (0..3).all(|a| {
                    u64::from(block.origin[a]) + u64::from(block.dims[a]) <= u64::from(info.dims[a])
                });
                assert!(inside, "{:?} {:?} in {:?}", block.origin, block.dims, info.dims);
                // The far corner has the highest index, so this checks the number of labels.
                let _ = block.get(block.dims.map(|d| d - 1));
                voxels += block.dims.iter().map(|&d| u64::from(d)).product::<u64>();
                blocks += 1;
                if voxels > MOST_VOXELS || blocks > MOST_BLOCKS {
                    return;
                }
            }
            Ok(None) => return assert_eq!(voxels, info.voxels(), "voxels of all blocks"),
            Err(error) => return one_line(&error.to_string()),
        }
    }
}
