//! Reads label volumes of other formats to their end, or to a cap.

use std::path::Path;

use pumice_core::BlockSource;
use pumice_formats::{ArrayAxes, FormatError, OpenOptions, open, probe};

/// Voxels after which reading stops: a few kB may inflate to many MB, all alike.
const MOST_VOXELS: u64 = 1 << 22;

/// Reads the header, then the voxels; layer, time step and channel are chosen when the file asks for that.
pub fn read_all(path: &Path, mut options: OpenOptions) {
    if let Err(error) = probe(path, &options) {
        one_line(&error.to_string());
    }
    for _ in 0..4 {
        match open(path, &options) {
            Ok(mut source) => return drain(source.as_mut()),
            Err(FormatError::Choose { option, .. }) => match option {
                "--layer" => options.layer = Some(0),
                "--time" => options.time = Some(0),
                "--channel" => options.channel = Some(0),
                _ => return,
            },
            Err(error) => return one_line(&error.to_string()),
        }
    }
    panic!("asks again for what was chosen: {options:?}");
}

/// The same for both meanings of an array's axes.
pub fn read_array_both_ways(path: &Path) {
    for axes in [ArrayAxes::Xyz, ArrayAxes::Zyx] {
        read_all(path, OpenOptions { axes, ..OpenOptions::default() });
    }
}

fn one_line(text: &str) {
    assert!(!text.contains('\n') && !text.is_empty(), "not one line: {text:?}");
}

/// Blocks must lie in the volume, have all their labels, and cover as many voxels as the volume has.
fn drain(source: &mut dyn BlockSource) {
    let info = source.info().clone();
    let mut voxels = 0;
    loop {
        match source.next_block() {
            Ok(Some(block)) => {
                assert!((0..3).all(|a| block.dims[a] > 0), "empty block {:?}", block.dims);
                let inside = (0..3).all(|a| {
                    u64::from(block.origin[a]) + u64::from(block.dims[a]) <= u64::from(info.dims[a])
                });
                assert!(inside, "{:?} {:?} in {:?}", block.origin, block.dims, info.dims);
                // The far corner is the highest index.
                let _ = block.get(block.dims.map(|d| d - 1));
                voxels += block.dims.iter().map(|&d| u64::from(d)).product::<u64>();
                if voxels > MOST_VOXELS {
                    return;
                }
            }
            Ok(None) => return assert_eq!(voxels, info.voxels(), "voxels handed out"),
            Err(error) => return one_line(&error.to_string()),
        }
    }
}
