//! Volumes for the tests of this folder.

use pumice_core::{CompressedVolume, LabelBuffer, LabelNote, LabelType, VolumeInfo, compress_labels};

/// Label 7 at x 0 to 1, 3 at x 4, 9 at x 5, in 6 × 1 × 1 voxels; 3 and 9 have names, 3 is red.
pub(super) fn named() -> CompressedVolume {
    let mut info = VolumeInfo::new([6, 1, 1], LabelType::U8);
    let note = |id, name: &str, color_srgb| LabelNote { id, name: Some(name.into()), color_srgb };
    info.notes = vec![note(3, "thin axon", Some([1.0, 0.0, 0.0])), note(9, "Axon, thick", None)];
    compress_labels(info, LabelBuffer::U8(vec![7, 7, 0, 0, 3, 9])).unwrap()
}

/// One label, 5, that fills a volume of this size.
pub(super) fn block(dims: [u32; 3]) -> CompressedVolume {
    let voxels = dims.iter().product::<u32>() as usize;
    compress_labels(VolumeInfo::new(dims, LabelType::U8), LabelBuffer::U8(vec![5; voxels])).unwrap()
}

/// Labels 1 to `count`, blocks of this size in a row along x.
pub(super) fn many(count: u8, block: [u32; 3]) -> CompressedVolume {
    let width = block[0] * u32::from(count);
    let rows = block[1] * block[2];
    let voxels = (0..rows).flat_map(|_| (0..width).map(|x| (x / block[0]) as u8 + 1)).collect();
    let info = VolumeInfo::new([width, block[1], block[2]], LabelType::U8);
    compress_labels(info, LabelBuffer::U8(voxels)).unwrap()
}
