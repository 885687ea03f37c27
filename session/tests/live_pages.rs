//! A live picture of a volume that is drawn from disk: the bits of the same volume in memory, also after edits, and errors in the status.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use pumice_core::{CompressedVolume, CompressionLevel, Job, Residency};
use pumice_formats::OpenOptions;
use pumice_oracle::volumes::volume;
use pumice_scene::{Material, Scene, SceneEdit, Show};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::live::{Live, LiveOptions, LiveState, Status};
use pumice_session::render_file::render_scene;
use pumice_session::{Residence, Stop, open_volume};
use pumice_transport::LoadedScene;

const SPP: u32 = 9;

/// Small bodies of 200 labels in many pages.
fn bodies() -> Arc<CompressedVolume> {
    volume([256, 192, 128], |x, y, z| {
        let hash = (x / 3).wrapping_mul(0x9E37).wrapping_add((y / 4).wrapping_mul(0x85EB)) ^ (z / 5 * 0xC2B3);
        if hash % 13 < 2 { 1 + hash % 200 } else { 0 }
    })
    .1
}

/// A folder with the volume in a file.
fn saved(volume: &CompressedVolume) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    volume.save(&folder.path().join("bodies.pumice"), CompressionLevel::Default, &Job::new()).unwrap();
    folder
}

fn paged(folder: &Path, limit: u64) -> (Arc<CompressedVolume>, Arc<Residency>) {
    let memory = Arc::new(Residency::new(limit));
    let path = folder.join("bodies.pumice");
    let opened = open_volume(&path, &OpenOptions::default(), Residence::paged(&memory), &Job::new());
    (opened.unwrap(), memory)
}

fn scene(volume: &CompressedVolume) -> Scene {
    compose(volume, "memory".into(), &FigureOptions { size: [60, 40], ..FigureOptions::default() })
}

fn started(volume: &Arc<CompressedVolume>, backend: &str) -> pumice_session::error::Result<Live> {
    let stop = Stop { spp: Some(SPP), ..Stop::default() };
    let options = LiveOptions { backend: backend.into(), stop, ..LiveOptions::default() };
    Live::start(LoadedScene::new(scene(volume), vec![Arc::clone(volume)], vec![]).unwrap(), options)
}

/// Waits for the status of a revision that is done.
fn settled(live: &Live, revision: u64) -> Status {
    let start = Instant::now();
    loop {
        let status = live.status();
        let is_shown = live.latest(0).is_some_and(|f| f.revision == revision && f.converged);
        if status.state != LiveState::Rendering && (is_shown || status.error.is_some()) {
            return status;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "{status:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The picture of a plain render of the volume in memory, in the layout of a frame.
fn plain(scene: &Scene, volume: &Arc<CompressedVolume>) -> Vec<f32> {
    let loaded = LoadedScene::new(scene.clone(), vec![Arc::clone(volume)], vec![]).unwrap();
    let stop = Stop { spp: Some(SPP), ..Stop::default() };
    let color = render_scene(&loaded, "cpu", &stop, &Job::new(), &mut |_| ()).unwrap().picture.color;
    let rows: Vec<&[[f32; 3]]> = color.pixels.chunks(color.width).collect();
    rows.iter().rev().flat_map(|row| row.iter().flat_map(|&[r, g, b]| [r, g, b, 1.0])).collect()
}

/// The least limit, which depends on the number of threads, as the refusal of a lower one says it.
fn least(folder: &Path) -> u64 {
    let line = settled(&started(&paged(folder, 1000).0, "cpu").unwrap(), 1).error.unwrap();
    assert!(line.starts_with("memory limit: 1000 bytes are too few, "), "{line}");
    line.split([',', ' ']).filter_map(|word| word.parse().ok()).nth(1).unwrap()
}

/// First picture, another look, other labels, another camera: each has the bits of everything in memory, though pages come and go.
#[test]
fn each_revision_has_the_bits_of_a_volume_in_memory() {
    let whole = bodies();
    let folder = saved(&whole);
    let (volume, memory) = paged(folder.path(), u64::MAX);
    let unlimited = started(&volume, "cpu").unwrap();
    settled(&unlimited, 1);
    let counts = memory.counts();
    let limit = (counts.kept_bytes + (counts.held_bytes - counts.kept_bytes) / 2).max(least(folder.path()));
    drop((unlimited, volume));

    let (volume, memory) = paged(folder.path(), limit);
    // Nothing of the file is read from now on.
    std::fs::remove_file(folder.path().join("bodies.pumice")).unwrap();
    let live = started(&volume, "auto").unwrap();
    let id = live.scene().instances[0].id;
    let some: Vec<u64> = whole.labels().ids().iter().copied().filter(|id| id % 3 != 0).collect();
    let mut camera = scene(&whole).camera;
    camera.shift = [0.1, 0.0];
    let edits = [
        SceneEdit::Material { id, material: Material { roughness: 0.2, ..Material::default() } },
        SceneEdit::Show { id, show: Show::Only(some) },
        SceneEdit::Camera { camera },
        SceneEdit::Show { id, show: Show::All },
    ];
    let mut pictures = Vec::new();
    for (revision, edit) in (1..).zip([None].into_iter().chain(edits.map(Some))) {
        if let Some(edit) = edit {
            assert_eq!(live.edit(vec![edit]).unwrap(), revision);
        }
        let status = settled(&live, revision);
        assert_eq!((status.state, status.error.as_deref()), (LiveState::Converged, None));
        assert_eq!(status.backend, "cpu");
        let frame = live.latest(0).unwrap();
        assert!(frame.rgba == plain(&live.scene(), &whole), "revision {revision}");
        pictures.push(frame);
    }
    // Control: the edits changed the picture.
    assert!(pictures.windows(2).all(|two| two[0].rgba != two[1].rgba));
    let pages = live.status().pages.unwrap();
    assert!(pages.loads > pages.pages, "pages were loaded again: {pages:?}");
    let counts = memory.counts();
    assert!(counts.held_bytes <= limit, "{counts:?}");

    // Labels under pixels are those of the volume in memory.
    let in_memory = started(&whole, "cpu").unwrap();
    let edited = vec![SceneEdit::Camera { camera }];
    let revision = in_memory.edit(edited).unwrap();
    settled(&in_memory, revision);
    let film = |live: &Live| loop {
        if let Some(film) = live.label_film() {
            return film.pixels.clone();
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let (ours, theirs) = (film(&live), film(&in_memory));
    assert!(ours == theirs && ours.iter().any(|pixel| pixel[1] > 0));
    for (x, y) in [(30, 20), (10, 30), (0, 0)] {
        assert_eq!(live.pick(x, y).unwrap(), in_memory.pick(x, y).unwrap());
    }
    assert!(in_memory.status().pages.is_none());
}

/// What cannot be drawn is one line of the status, and the picture goes on where that is taken back.
#[test]
fn what_needs_everything_is_one_line_and_ends_nothing() {
    let whole = bodies();
    let folder = saved(&whole);
    let (volume, _) = paged(folder.path(), u64::MAX);
    let live = started(&volume, "cpu").unwrap();
    assert_eq!(settled(&live, 1).error, None);
    let settings = live.scene().settings;
    let smooth = pumice_scene::Settings { smooth_voxels: true, ..settings };
    live.edit(vec![SceneEdit::Settings { settings: smooth }]).unwrap();
    let status = settled(&live, 2);
    assert_eq!(status.state, LiveState::Converged);
    assert!(status.error.unwrap().starts_with("memory limit: smooth shading of voxels"));
    live.edit(vec![SceneEdit::Settings { settings }]).unwrap();
    assert_eq!(settled(&live, 3).error, None);
    assert!(live.latest(0).unwrap().rgba == plain(&live.scene(), &whole));

    // What a refusal says suffices; a byte less does not.
    let needed = least(folder.path());
    let (volume, _) = paged(folder.path(), needed);
    assert_eq!(settled(&started(&volume, "cpu").unwrap(), 1).error, None);
    let (fewer, _) = paged(folder.path(), needed - 1);
    assert!(settled(&started(&fewer, "cpu").unwrap(), 1).error.is_some());
}
