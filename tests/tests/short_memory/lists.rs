//! Lists whose length comes from a volume, a mesh or a film: where there is no memory for one, it is an error, and with a little more it is made.

use std::sync::Arc;
use std::time::Duration;

use glam::DAffine3;
use pumice_core::cell::{Cell, sort_and_or};
use pumice_core::reserve::sort_by_key;
use pumice_core::{
    BlockSource, BoxGrid, CompressOptions, CompressedVolume, Job, LabelBlock, LabelBuffer, LabelType,
    MeshData, NoMemory, SortedCells, VolumeInfo, compress, compress_labels,
};
use pumice_cpu::traverse::{TracedInstance, VolumeTracer};
use pumice_oracle::volumes::Random;
use pumice_picture::{FilmBuffer, PassSums, Passes};
use pumice_scene::Adaptive;
use pumice_transport::geometry::visible_boxes::visible_items;
use pumice_transport::geometry::{LodChoice, visible_boxes};
use pumice_transport::{RenderError, Renderer, Tracer as _};
use pumice_vulkan::VulkanRenderer;
use pumice_vulkan::device::{Backend, Instance, InstanceOptions, survey};
use pumice_vulkan::pack::{PackedBoxes, PackedMesh, PackedNodes};

use super::{loaded, measured, one_after_the_other, refusing, renderer, sky};

/// Checks that an error is a line that begins so and ends with what the system refuses.
fn assert_refused(error: &dyn std::fmt::Display, begins: &str) {
    let text = error.to_string();
    let is_line = text.ends_with(" of memory, which the system refuses") && !text.contains('\n');
    assert!(text.starts_with(begins) && is_line, "{text}");
}

/// 64³ voxels, each with a label of its own: as many boxes as voxels.
fn compressed() -> pumice_core::Result<CompressedVolume> {
    compress_labels(VolumeInfo::new([64; 3], LabelType::U32), LabelBuffer::U32((1..=64 * 64 * 64).collect()))
}

/// Boxes pass by while a volume is finished: no list holds all of them with their contents, 48 bytes each.
#[test]
fn no_list_holds_all_boxes_while_a_volume_is_finished() {
    let _turn = one_after_the_other();
    let made = refusing(48 * 64 * 64 * 64 - 1, compressed).map(|volume| volume.labels().len());
    assert_eq!(made.unwrap(), 64 * 64 * 64);
}

/// Noise of 128³ voxels, layer by layer, so that no block is as large as the lists of the whole.
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
        let mut labels = || (0..128 * 128 * 4).map(|_| u8::from(self.random.unit() < 0.5)).collect();
        Ok((z < 128).then(|| LabelBlock::x_fastest([0, 0, z], [128, 128, 4], LabelBuffer::U8(labels()))))
    }
}

/// Noise has no two equal cells of 4³ voxels, so the list of distinct ones, of 24 bytes each, is longer than that of the cells.
#[test]
fn leaves_without_memory_are_an_error() {
    let _turn = one_after_the_other();
    let options = CompressOptions { threads: 1, ..CompressOptions::default() };
    let made = || {
        let info = VolumeInfo::new([128; 3], LabelType::U8);
        compress(&mut Layers { info, random: Random(7), next: 0 }, &options, &Job::new())
    };
    // 32³ cells.
    let refused = refusing(786_431, made).unwrap_err();
    assert_refused(&refused, "a list of the distinct fields of a volume needs 786.4 kB");
    let whole = refusing(2 << 20, made).unwrap();
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

/// Boxes that are listed by number alone take 4 bytes each, and 32 with their label and bounds, from which their neighbours are found.
#[test]
fn neighbors_without_memory_are_an_error() {
    let _turn = one_after_the_other();
    let volume = Arc::new(compressed().unwrap());
    let visible = vec![true; volume.labels().len()];
    let refused = refusing(1_048_575, || visible_items(&volume, &visible)).unwrap_err();
    assert_refused(&refused, "a list of the boxes that are shown needs 1.0 MB");
    assert_eq!(refusing(1_048_576, || visible_items(&volume, &visible)).unwrap().len(), 64 * 64 * 64);

    let traced =
        TracedInstance { volume, world_from_index: DAffine3::IDENTITY, visible, lod: LodChoice::Voxels };
    let smooth = |most| {
        let tracer = VolumeTracer::new(0, &traced).unwrap();
        refusing(most, || tracer.shaded_smooth(true))
    };
    assert_refused(&smooth(8_388_607).unwrap_err(), "the neighbours of boxes needs 8.4 MB");
    // With the list, there is no memory for the map of the cells that boxes reach into, which is larger.
    assert_refused(&smooth(8_388_608).unwrap_err(), "the neighbours of boxes needs 9.6 MB");
    assert!(smooth(16 << 20).unwrap().is_smooth());
}

/// Each of 64³ voxels has a label of its own, so each of the 774,144 faces between two voxels is a pair of labels.
#[test]
fn labels_that_touch_without_memory_are_an_error() {
    let _turn = one_after_the_other();
    let volume = compressed().unwrap();
    let found = || volume.find_contacts(&Job::new());
    assert_refused(&refusing(9_000_000, found).unwrap_err(), "a list of the labels that touch needs 8.3 MB");
    assert_eq!(refusing(16 << 20, found).unwrap().len(), 774_144);
}

/// Two parts of 131,072 cells of 16 bytes.
#[test]
fn merged_parts_without_memory_are_an_error() {
    let _turn = one_after_the_other();
    let part = |z| {
        let labels = LabelBuffer::U8(vec![1; 256 * 256 * 128]);
        SortedCells::from_block(&LabelBlock::x_fastest([0, 0, z], [256, 256, 128], labels), [256; 3]).unwrap()
    };
    let parts = [part(0), part(128)];
    let merged = |most| refusing(most, || SortedCells::merge(&parts));
    assert_refused(&merged(4_194_303).unwrap_err(), "a part of the volume, merged from several needs 4.2 MB");
    assert_eq!(merged(4_194_304).unwrap().voxels(), 1 << 24);
}

/// Two runs of 50,000 records of 16 bytes, of which each second cell is in both.
#[test]
fn records_without_memory_to_sort_them_are_an_error() {
    let _turn = one_after_the_other();
    let run = |step| (0..50_000).map(move |i| Cell { key: step * i, mask: step });
    let sorted = |most| {
        let mut cells: Vec<Cell> = run(1).chain(run(2)).collect();
        refusing(most, || sort_and_or(&mut cells)).map(|()| cells)
    };
    assert_refused(
        &sorted(799_999).unwrap_err(),
        "the cells of a label, while they are sorted, needs 800.0 kB",
    );
    let cells = sorted(800_000).unwrap();
    assert!(cells.len() == 75_000 && cells.is_sorted_by(|a, b| a.key < b.key));
    assert_eq!(cells[3].mask | cells[4].mask << 4, 0x31);
}

/// One box touches one brick, as all of these do, and takes 16 bytes while the index is built.
#[test]
fn an_index_of_boxes_without_memory_is_an_error() {
    const PAIRS: usize = 16 * 64 * 64 * 64;
    const TEXT: &str = "the index of a volume's boxes by place needs 4.2 MB";
    let _turn = one_after_the_other();
    let volume = compressed().unwrap();
    assert_refused(&refusing(PAIRS - 1, || volume.grid().map(BoxGrid::bytes)).unwrap_err(), TEXT);
    assert_refused(&refusing(PAIRS - 1, || volume.label_at([1, 2, 3])).unwrap_err(), TEXT);
    assert_refused(&refusing(PAIRS - 1, || volume.decode_block([0; 3], [1; 3])).unwrap_err(), TEXT);
    assert_refused(&refusing(PAIRS - 1, || volume.find_contacts(&Job::new())).unwrap_err(), TEXT);
    // A volume without an index tries again, and with the memory it has one.
    assert_eq!(refusing(PAIRS, || volume.label_at([1, 2, 3])).unwrap(), Some(1 + 64 * (2 + 64 * 3)));
    // The list of the boxes of a block doubles while it grows.
    let block = |most| refusing(most, || volume.decode_block([0; 3], [64; 3]));
    let refused = block(64 * 64 * 64 * 4 - 1).unwrap_err();
    assert_refused(&refused, "a block of labels needs 1.0 MB");
    assert_eq!(block(2 << 20).unwrap()[64], 65);
}

/// What the device finds of the first surface of a pixel takes 12 bytes a label, and 44 in a picture.
#[test]
fn what_a_device_finds_without_memory_is_an_error() {
    let _turn = one_after_the_other();
    let instance = Instance::new(&InstanceOptions::default()).unwrap();
    let candidates = survey(&instance).unwrap();
    let candidate = candidates.iter().find(|c| c.can(Backend::Compute)).expect("a device that computes");
    let none = |_: &std::path::Path| Err("no pictures here".into());
    let mut renderer = VulkanRenderer::open(&instance, candidate, Backend::Compute, None, none).unwrap();
    renderer.set_scene(&loaded(&sky([400, 300]))).unwrap();
    renderer.advance(Duration::from_secs(3600), 4, &Job::new()).unwrap();
    let text = "film: the picture needs ";
    let refused = refusing(1_919_999, || renderer.seen_surfaces(&Job::new())).unwrap_err();
    assert_refused(&refused, &format!("{text}1.9 MB"));
    let refused = refusing(5_759_999, || renderer.picture()).unwrap_err();
    assert_refused(&refused, &format!("{text}5.8 MB"));
    // The renderer is not given up for it. With the memory, also for the records of a launch, both are there.
    assert_eq!(refusing(16 << 20, || renderer.seen_surfaces(&Job::new())).unwrap().len(), 400 * 300);
    assert_eq!(refusing(16 << 20, || renderer.picture()).unwrap().color.width, 400);
}

/// Every pass of a film of 400 × 300 pixels: three numbers a pixel are 1.44 MB, one is 0.48 MB.
#[test]
fn passes_without_memory_are_an_error() {
    const TRIPLE: usize = 1_440_000;
    let _turn = one_after_the_other();
    let mut scene = sky([400, 300]);
    (scene.film.passes, scene.film.transparent) = (Passes::ALL, true);
    let mut film = FilmBuffer::with_passes(400, 300, PassSums::of(&scene.film, false)).unwrap();
    film.sums_mut(4);
    let all = scene.film.passes;
    let refused = |most, made: &dyn Fn() -> Option<NoMemory>, megabytes: &str| {
        let error = refusing(most - 1, made).expect("less memory than it takes");
        assert_refused(&error, &format!("film: the picture needs {megabytes}B"));
        assert_eq!(refusing(most, made), None);
    };
    refused(TRIPLE, &|| film.mean().err(), "1.4 M");
    refused(TRIPLE, &|| film.variance().err(), "1.4 M");
    refused(TRIPLE, &|| film.features().err(), "1.4 M");
    refused(TRIPLE, &|| film.light(all).err(), "1.4 M");
    refused(TRIPLE / 3, &|| film.alpha().err(), "480.0 k");
    // A layer has four numbers a pixel. Beside the three layers of each of two mattes, ranking takes nothing: neither a list of all pixels
    // nor one of each.
    refused(TRIPLE * 4 / 3, &|| film.mattes().err(), "1.9 M");
    let (mattes, counted) = measured(|| film.mattes().unwrap());
    assert!(counted.peak < 6 * 1_920_000 + 65_536 && mattes.len() == 2, "{counted:?}");
    // With shadow catchers, pixels are composited.
    let mut caught = FilmBuffer::with_passes(400, 300, PassSums::of(&scene.film, true)).unwrap();
    caught.sums_mut(4);
    refused(TRIPLE, &|| caught.mean().err(), "1.4 M");
    refused(TRIPLE / 3, &|| caught.alpha().err(), "480.0 k");
}

/// What is found of the first surface of a pixel takes 48 bytes.
#[test]
fn a_picture_without_memory_is_an_error() {
    let _turn = one_after_the_other();
    let mut renderer = renderer();
    renderer.set_scene(&loaded(&sky([400, 300]))).unwrap();
    renderer.advance(Duration::from_secs(3600), 4, &Job::new()).unwrap();
    let refused = refusing(5_759_999, || renderer.picture()).unwrap_err();
    assert_refused(&refused, "film: the picture needs 5.8 MB");
    assert_eq!(refusing(5_760_000, || renderer.picture()).unwrap().color.width, 400);
    let refused = refusing(1_439_999, || renderer.color()).unwrap_err();
    assert_refused(&refused, "film: the picture needs 1.4 MB");
    assert_refused(
        &refusing(1_439_999, || renderer.variance()).unwrap_err(),
        "film: the picture needs 1.4 MB",
    );
}

/// Files of meshes have their faces sorted by material, in the order of the volume within each.
#[test]
fn sorting_without_memory_is_an_error_and_changes_nothing() {
    let _turn = one_after_the_other();
    let backwards: Vec<u32> = (0..100_000).rev().collect();
    let sorted = |most| {
        let mut list = backwards.clone();
        let sorted = refusing(most, || sort_by_key(&mut list, |&value| value, "a list of faces"));
        (sorted, list)
    };
    // A key and a place take 16 bytes.
    let (refused, unchanged) = sorted(1_599_999);
    assert_refused(&refused.unwrap_err(), "a list of faces needs 1.6 MB");
    assert_eq!(unchanged, backwards);
    let (made, list) = sorted(1_600_000);
    made.unwrap();
    assert!(list.iter().copied().eq(0..100_000));
}
