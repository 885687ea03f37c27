//! Tests that inputs which ask for much memory get a line of text and not the end of the process, and that what is refused for lack of memory
//! really needs it.
//!
//! An allocator that refuses large requests serves the whole process, so these tests run one after the other.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail by panicking, in its helpers too")]

#[path = "counting_allocator/mod.rs"]
mod counting_allocator;
#[path = "short_memory/files.rs"]
mod files;
#[path = "short_memory/lists.rs"]
mod lists;

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use counting_allocator::{measured, refusing};
use pumice_core::{CompressedVolume, Job, NoMemory};
use pumice_cpu::CpuRenderer;
use pumice_export::{
    Corners, ExportOptions, Form, Interfaces, Merging, QuadMesh, Reader, SmoothMesh, export_scene,
};
use pumice_oracle::volumes::noise;
use pumice_picture::annotate::{Ink, Mark};
use pumice_picture::{
    Image, PassSums, Passes, Picture, film_memory, read_exr, read_provenance, write_exr, write_png,
};
use pumice_scene::{Adaptive, Scene};
use pumice_transport::{LoadedScene, RenderError, Renderer};

fn one_after_the_other() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

const EMPTY_SCENE: &str = r#"{
  "version": 1,
  "instances": [],
  "camera": {
    "world_from_camera": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 10],
    "projection": { "perspective": { "fov_rad": 0.7 } }
  },
  "film": { "width": 5, "height": 4, "filter": { "blackman_harris": { "width": 3.0 } } },
  "world": { "environment": { "constant": { "radiance": [0.1, 0.2, 0.3] } } }
}"#;

fn sky(size: [u32; 2]) -> Scene {
    let mut scene = Scene::from_json(EMPTY_SCENE).unwrap();
    [scene.film.width, scene.film.height] = size;
    scene
}

fn loaded(scene: &Scene) -> LoadedScene {
    LoadedScene::new(scene.clone(), vec![], vec![]).unwrap()
}

fn renderer() -> CpuRenderer {
    CpuRenderer::new(|_| Err("no pictures here".into()))
}

#[test]
fn a_film_without_memory_is_an_error_and_the_former_picture_stays() {
    let _turn = one_after_the_other();
    let (small, large) = (loaded(&sky([40, 30])), loaded(&sky([400, 300])));
    let mut renderer = renderer();
    renderer.set_scene(&small).unwrap();
    renderer.advance(Duration::ZERO, 4, &Job::new()).unwrap();

    // 400 × 300 pixels of 12 floats.
    let refused = refusing(5_000_000, || renderer.set_scene(&large)).unwrap_err();
    let expected = "film: 400 × 300 pixels needs 5.8 MB of memory, which the system refuses";
    assert_eq!(refused.to_string(), expected);
    assert!(matches!(refused, RenderError::Memory(NoMemory::Refused { needed_bytes: 5_760_000, .. })));
    assert_eq!(renderer.picture().unwrap().color.width, 40);

    // A control: with a little more memory the same film is made.
    refusing(6_000_000, || renderer.set_scene(&large)).unwrap();
    renderer.advance(Duration::ZERO, 4, &Job::new()).unwrap();
    assert_eq!(renderer.picture().unwrap().color.width, 400);
}

/// One number a pixel is kept where pixels rest. A film that has none of them yet stays as it is, and so does the picture.
#[test]
fn a_film_without_memory_for_pixels_that_rest_keeps_its_picture() {
    let _turn = one_after_the_other();
    let plain = loaded(&sky([400, 300]));
    let mut resting = sky([400, 300]);
    resting.settings.adaptive = Some(Adaptive { threshold: 0.01, min_spp: 4 });
    let resting = loaded(&resting);
    let mut renderer = renderer();
    renderer.set_scene(&plain).unwrap();
    renderer.advance(Duration::ZERO, 4, &Job::new()).unwrap();
    let before = renderer.picture().unwrap();

    let refused = refusing(400_000, || renderer.set_scene(&resting)).unwrap_err().to_string();
    assert_eq!(refused, "film: which pixels rest needs 480.0 kB of memory, which the system refuses");
    assert_eq!(renderer.picture().unwrap().color, before.color);

    // A control: with a little more memory pixels rest.
    refusing(500_000, || renderer.set_scene(&resting)).unwrap();
    renderer.advance(Duration::ZERO, 8, &Job::new()).unwrap();
    assert!(renderer.picture().unwrap().color.width == 400);
}

#[test]
fn pictures_without_memory_for_their_files_leave_no_file() {
    let _turn = one_after_the_other();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut picture = Picture::of(Image::new(400, 300, vec![[0.5; 3]; 400 * 300]));
    let mark = Mark { left: 3, top: 4, width: 2, ink: Ink::Color([1.0; 3]), coverage: vec![1.0; 4] };

    let png = refusing(300_000, || write_png(&path("a.png"), &picture)).unwrap_err().to_string();
    let expected =
        "a.png: the display values of a picture needs 360.0 kB of memory, which the system refuses";
    assert!(png.ends_with(expected), "{png}");
    picture.marks = vec![mark];
    let exr =
        refusing(1_000_000, || write_exr(&path("a.exr"), &picture, &Passes::NONE)).unwrap_err().to_string();
    let expected =
        "a.exr: a picture with what is drawn over it needs 1.4 MB of memory, which the system refuses";
    assert!(exr.ends_with(expected), "{exr}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);

    // A control: with a little more memory both are written, and without marks an EXR needs no copy.
    refusing(1_500_000, || write_png(&path("a.png"), &picture)).unwrap();
    refusing(1_500_000, || write_exr(&path("a.exr"), &picture, &Passes::NONE)).unwrap();
    assert_eq!(read_exr(&path("a.exr")).unwrap().color.pixels[4 * 400 + 3], [1.0; 3]);
    picture.marks.clear();
    refusing(1_000_000, || write_exr(&path("b.exr"), &picture, &Passes::NONE)).unwrap();
}

/// A third of 16 × 16 × 4096 voxels of noise has more than a million faces, of which each list takes 16 MB and more. What is held of one block
/// of voxels, a thirty-second of them, takes less than 4.
#[test]
fn surfaces_without_memory_are_errors_and_leave_no_file() {
    const MOST: usize = 4 << 20;
    let _turn = one_after_the_other();
    let (_, volume) = noise([16, 16, 4096], 0.3, 6, 2);
    let (visible, job) = (vec![true; volume.labels().len()], Job::new());
    let quads =
        refusing(MOST, || QuadMesh::new(&volume, &visible, Interfaces::All, Corners::Own, &job)).unwrap_err();
    let smooth = refusing(MOST, || SmoothMesh::new(&volume, &visible, None, &job, |_| Ok(()))).unwrap_err();

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let mut scene = sky([5, 4]);
    scene.instances = serde_json::from_str(
        r#"[{ "id": 1, "source": "memory", "world_from_index": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], "style": {} }]"#,
    )
    .unwrap();
    let scene = LoadedScene::new(scene, vec![volume], vec![]).unwrap();
    let options = ExportOptions {
        forms: vec![Form::Voxels],
        merging: Merging::Plain,
        limit_bytes: 1 << 30,
        surroundings: false,
        reader: Reader::Specification,
        region: None,
    };
    let export = || export_scene(&scene, &options, &path, &mut |_| (), &job);
    let file = refusing(MOST, export).unwrap_err();
    for (text, what) in [
        (quads.to_string(), "a mesh of the faces needs "),
        (smooth.to_string(), "a list of the parts of a smoothed surface needs "),
        (file.to_string(), "a list of the faces of a surface needs "),
    ] {
        let is_line = text.ends_with(" of memory, which the system refuses") && !text.contains('\n');
        assert!(text.contains(what) && is_line, "{text}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    // A control: with the memory the file is written.
    refusing(512 << 20, export).unwrap();
    assert!(path.exists());
}

#[test]
fn nodes_for_a_device_without_memory_are_an_error() {
    let _turn = one_after_the_other();
    let (_, volume) = noise([64; 3], 0.3, 6, 2);
    let nodes = pumice_vulkan::pack::PackedNodes::new(&volume, &vec![true; volume.labels().len()]);
    let most = nodes.len_bytes() as usize - 1;
    let text = refusing(most, || nodes.packed(&volume)).unwrap_err().to_string();
    assert!(text.starts_with("the nodes of a volume for the device needs "), "{text}");
    assert_eq!(refusing(most + 1, || nodes.packed(&volume)).unwrap().len(), most.div_ceil(2));
}

/// The film of 2³⁰ pixels that a scene may ask for; no machine that runs this test has the memory of its picture.
#[test]
fn the_largest_film_is_refused_before_it_is_made() {
    let _turn = one_after_the_other();
    let mut scene = sky([65_536, 16_384]);
    scene.film.passes = Passes::ALL;
    let kept = PassSums::of(&scene.film, false);
    let (refused, counted) = measured(|| film_memory::check(&scene.film, kept, None, 0));
    let text = refused.unwrap_err().to_string();
    assert!(text.starts_with("film: a picture of 65536 × 16384 pixels with 21 passes needs "), "{text}");
    assert!(counted.peak < 1 << 16, "{counted:?}");
}

/// What a film and its picture are said to need is allocated in fact, and not much more: so nothing is refused that would fit.
#[test]
fn a_picture_takes_the_memory_that_it_is_said_to_need() {
    let _turn = one_after_the_other();
    let rule = Adaptive { threshold: 0.01, min_spp: 4 };
    for (passes, transparent, adaptive) in
        [(Passes::NONE, false, None), (Passes::ALL, true, None), (Passes::ALL, false, Some(rule))]
    {
        let mut scene = sky([300, 200]);
        (scene.film.passes, scene.film.transparent, scene.settings.adaptive) =
            (passes, transparent, adaptive);
        let scene = loaded(&scene);
        let mut renderer = renderer();
        let (picture, counted) = measured(|| {
            renderer.set_scene(&scene).unwrap();
            renderer.advance(Duration::ZERO, 4, &Job::new()).unwrap();
            renderer.picture().unwrap()
        });
        let film = &scene.scene().film;
        let needed = film_memory::bytes_of(film, PassSums::of(film, false), adaptive) as f64;
        let ratio = counted.peak as f64 / needed;
        println!("{} passes: {ratio:.3} of what is said to be needed", passes.iter().count());
        // Above 1: never refused wrongly. At most 1.25: the variance, with 12 bytes a pixel, and lists that grow while they are collected are
        // not counted.
        assert!((1.0..=1.25).contains(&ratio), "{passes:?}: {counted:?}, {needed} said to be needed");
        drop(picture);
    }
}

#[test]
fn a_file_that_decodes_to_gigabytes_is_refused() {
    let _turn = one_after_the_other();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.pumice");
    // Two volumes: one of so few voxels that it cannot have so many labels, and one of so many that it can.
    for (side, most, expected) in
        [(16, usize::MAX, "decoded size: expected at most 266240 "), (2048, 8 << 20, "memory")]
    {
        let bytes = files::pumice_with_labels(side, 256 << 20);
        assert!(bytes.len() < 100_000, "{}", bytes.len());
        std::fs::write(&path, bytes).unwrap();
        let (opened, counted) = measured(|| refusing(most, || CompressedVolume::open(&path, &Job::new())));
        let text = opened.unwrap_err().to_string();
        assert!(text.contains(expected) && !text.contains('\n'), "{text}");
        assert!(counted.peak < 32 << 20, "{counted:?}");
    }
}

#[test]
fn a_compressed_text_of_a_picture_is_inflated_up_to_its_limit() {
    let _turn = one_after_the_other();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    // 80 MB of spaces before the JSON.
    std::fs::write(&path, files::png_with_text(&vec![b' '; 80 << 20])).unwrap();
    let (read, counted) = measured(|| read_provenance(&path));
    let text = read.unwrap_err().to_string();
    assert!(
        text.ends_with("text pumice: expected at most 67.1 MB of UTF-8, got more or damaged text"),
        "{text}"
    );
    assert!(counted.peak < 160 << 20, "{counted:?}");
    // A control: a compressed text within the limit is read, and its fault is another.
    std::fs::write(&path, files::png_with_text(b"{\"version\": 1}")).unwrap();
    let text = read_provenance(&path).unwrap_err().to_string();
    assert!(text.contains("text pumice: invalid type: integer `1`"), "{text}");
}

/// Each word of a field was kept as a text of its own, some thirty times its length.
#[test]
fn a_header_of_volumes_takes_a_few_times_its_length() {
    let _turn = one_after_the_other();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nrrd");
    let head = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 3 2\nencoding: raw\n";
    let words = "a ".repeat(2 << 20);
    let lines = "a:=b\n".repeat((1 << 20) + 1);
    let fields: String = (0..300).map(|i| format!("field{i}: 1\n")).collect();
    for (header, expected) in [
        (
            format!("{head}kinds: {words}\n\n"),
            "the field \"kinds\" has 4194303 bytes, expected at most 1048576",
        ),
        (format!("{head}space units: {words}\n\n"), "the field \"space units\" has 4194303 bytes"),
        (format!("{head}{lines}\n"), "the header's number of lines"),
        (format!("{head}{fields}\n"), "expected at most 256 fields in the header, got more"),
        (format!("{head}data file: %032d 1 8000000 1\n\n"), "the data file pattern"),
    ] {
        std::fs::write(&path, &header).unwrap();
        let read = || pumice_formats::open(&path, &pumice_formats::OpenOptions::default()).map(|_| ());
        let (opened, counted) = measured(read);
        let text = opened.unwrap_err().to_string();
        assert!(text.contains(expected) && !text.contains('\n'), "{text}");
        // A line of five bytes takes some 40 more.
        assert!(counted.peak < (1 << 20) + 16 * header.len() as isize, "{expected}: {counted:?}");
    }
    // A control: keeping the words costs far more than is allowed.
    let (_, control) = measured(|| words.split_whitespace().map(str::to_owned).collect::<Vec<_>>());
    assert!(control.peak > 12 * words.len() as isize, "{control:?}");
}
