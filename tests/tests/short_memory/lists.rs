//! Lists whose length comes from a volume, a mesh or a film: where there is no memory for one, it is an error, and with a little more it is made.

use std::time::Duration;

use pumice_core::{
    BlockSource, CompressOptions, CompressedVolume, Job, LabelBlock, LabelBuffer, LabelType, MeshData,
    NoMemory, VolumeInfo, compress, compress_labels,
};
use pumice_oracle::volumes::Random;
use pumice_scene::Adaptive;
use pumice_transport::geometry::visible_boxes;
use pumice_transport::{RenderError, Renderer};
use pumice_vulkan::pack::{PackedBoxes, PackedMesh, PackedNodes};

use super::{loaded, one_after_the_other, refusing, renderer, sky};

/// Checks that an error is a line that begins so and ends with what the system refuses.
fn assert_refused(error: &dyn std::fmt::Display, begins: &str) {
    let text = error.to_string();
    let is_line = text.ends_with(" of memory, which the system refuses") && !text.contains('\n');
    assert!(text.starts_with(begins) && is_line, "{text}");
}

/// 64³ voxels, each with a label of its own: as many boxes as voxels, of 48 bytes each while they are made, and a third of that for what they
/// are made from.
fn compressed() -> pumice_core::Result<CompressedVolume> {
    compress_labels(VolumeInfo::new([64; 3], LabelType::U32), LabelBuffer::U32((1..=64 * 64 * 64).collect()))
}

#[test]
fn boxes_without_memory_are_an_error() {
    let _turn = one_after_the_other();
    let refused = refusing(12_582_911, compressed).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "a list of the boxes of the volume needs 12.6 MB of memory, which the system refuses"
    );
    // A control: with one byte more the list is made, and with enough the volume.
    assert!(
        !refusing(12_582_912, || compressed().map_err(|e| e.to_string()))
            .is_err_and(|text| text.contains("12.6 MB"))
    );
    assert_eq!(refusing(64 << 20, compressed).unwrap().labels().len(), 64 * 64 * 64);
}

/// Noise of 64³ voxels, layer by layer, so that no block is as large as the lists of the whole.
struct Layers {
    info: VolumeInfo,
    random: Random,
    next: u32,
}

impl BlockSource for Layers {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> pumice_core::Result<Option<LabelBlock>> {
        let z = self.next;
        self.next += 4;
        let mut labels = || (0..64 * 64 * 4).map(|_| u8::from(self.random.unit() < 0.5)).collect();
        Ok((z < 64).then(|| LabelBlock::x_fastest([0, 0, z], [64, 64, 4], LabelBuffer::U8(labels()))))
    }
}

/// Noise has no two equal cells of 4³ voxels, so the list of distinct ones, of 24 bytes each, is longer than that of the cells.
#[test]
fn leaves_without_memory_are_an_error() {
    let _turn = one_after_the_other();
    let options = CompressOptions { threads: 1, ..CompressOptions::default() };
    let made = || {
        let info = VolumeInfo::new([64; 3], LabelType::U8);
        compress(&mut Layers { info, random: Random(7), next: 0 }, &options, &Job::new())
    };
    // 16³ cells.
    let refused = refusing(98_303, made).unwrap_err();
    assert_refused(&refused, "a list of the distinct fields of a volume needs 98.3 kB");
    let whole = refusing(1 << 20, made).unwrap();
    assert_eq!(whole.labels().voxels(), refusing(usize::MAX, made).unwrap().labels().voxels());
}

#[test]
fn shown_boxes_without_memory_are_an_error() {
    let _turn = one_after_the_other();
    let volume = compressed().unwrap();
    let visible = vec![true; volume.labels().len()];
    // 28 bytes a box.
    let most = 28 * 64 * 64 * 64;
    let refused = refusing(most - 1, || visible_boxes(&volume, &visible, true)).unwrap_err();
    assert_refused(&refused, "a list of the boxes that are shown needs 7.3 MB");
    assert_eq!(refusing(most, || visible_boxes(&volume, &visible, true)).unwrap().len(), 64 * 64 * 64);
    let nodes = PackedNodes::new(&volume, &visible);
    let packed = || PackedBoxes::new(&volume, &nodes, &visible, true);
    let refused = refusing(most - 1, packed).unwrap_err();
    assert!(matches!(refused, RenderError::Memory(NoMemory::Refused { .. })), "{refused}");
    assert_eq!(refusing(most, packed).unwrap().items.len(), 64 * 64 * 64);
}

/// A strip of triangles, which has as many corners as triangles, and two more.
#[test]
fn a_mesh_without_memory_is_an_error() {
    const TRIANGLES: u32 = 100_000;
    let _turn = one_after_the_other();
    let positions = (0..TRIANGLES + 2).map(|i| [f64::from(i / 2), f64::from(i % 2), 0.0]).collect();
    let triangles = (0..TRIANGLES).map(|i| [i, i + 1, i + 2]).collect();
    let mesh = MeshData::new(positions, triangles, Vec::new()).unwrap();
    // Corners take 12 bytes each, bounds 28, materials 4.
    let packed = || PackedMesh::new(0, &mesh);
    assert_refused(&refusing(1_200_000, packed).unwrap_err(), "the corners of a mesh needs 1.2 MB");
    assert_refused(
        &refusing(2_799_999, packed).unwrap_err(),
        "the bounds of a mesh's triangles needs 2.8 MB",
    );
    assert_eq!(refusing(2_800_000, packed).unwrap().materials.len(), TRIANGLES as usize);
}

/// Whether pixels rest is decided from one number a pixel.
#[test]
fn a_film_without_memory_to_decide_which_pixels_rest_is_an_error() {
    let _turn = one_after_the_other();
    let mut scene = sky([400, 300]);
    scene.settings.adaptive = Some(Adaptive { threshold: 0.01, min_spp: 4 });
    let scene = loaded(&scene);
    let mut renderer = renderer();
    renderer.set_scene(&scene).unwrap();
    let mut drawn = |most| refusing(most, || renderer.advance(Duration::from_secs(3600), 8, &Job::new()));
    for _ in 0..2 {
        assert_refused(&drawn(479_999).unwrap_err(), "film: which pixels rest needs 480.0 kB");
    }
    // The samples stay, and with the memory the film goes on. An even sky has no noise, so all pixels rest.
    let progress = drawn(480_000).unwrap();
    assert!(progress.all_rest && progress.spp == 4, "{progress:?}");
}
