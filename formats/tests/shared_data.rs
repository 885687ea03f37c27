//! Tests on volumes that may not be shipped: a NIfTI atlas that is placed by its qform alone.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

use std::path::PathBuf;

use pumice_core::{LabelType, WorldFrame};
use pumice_formats::{OpenOptions, open};

fn shared_data() -> PathBuf {
    let folder = std::env::var_os("PUMICE_SHARED_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")),
        PathBuf::from,
    );
    assert!(
        folder.is_dir(),
        "{}: expected a folder with the shared data, got none; set PUMICE_SHARED_DATA",
        folder.display()
    );
    folder
}

#[test]
fn reads_the_mouse_brain_atlas() {
    let path = shared_data().join("gubra_mouse_brain_atlas.nii.gz");
    let mut source = open(&path, &OpenOptions::default()).unwrap();
    let info = source.info().clone();
    assert_eq!((info.dims, info.label_type, info.frame), ([461, 621, 323], LabelType::U32, WorldFrame::Ras));
    let (mut voxels, mut seen) = (0u64, std::collections::BTreeSet::new());
    while let Some(block) = source.next_block().unwrap() {
        voxels += block.labels.len() as u64;
        let mut last = u64::MAX;
        for z in 0..block.dims[2] {
            for y in 0..block.dims[1] {
                for x in 0..block.dims[0] {
                    let label = block.get([x, y, z]);
                    if label != last {
                        seen.insert(label);
                        last = label;
                    }
                }
            }
        }
    }
    assert_eq!(voxels, 461 * 621 * 323);
    // Counted with nibabel and numpy.unique, background included.
    assert_eq!(seen.len(), 322);
}
