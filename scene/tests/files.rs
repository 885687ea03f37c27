//! Scene files: how the paths within them are resolved, and that a file appears complete or not at all.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use std::path::{Path, PathBuf};

use common::full_scene;
use pumice_scene::{Environment, Scene, SceneError};

fn paths(scene: &Scene) -> Vec<PathBuf> {
    let Environment::Image { path, .. } = &scene.world.environment else { unreachable!() };
    scene.instances.iter().map(|i| i.source.clone()).chain([path.clone()]).collect()
}

#[test]
fn relative_paths_are_taken_from_the_files_folder() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.json");
    let mut scene = full_scene();
    let elsewhere = std::path::absolute("/elsewhere/b.nrrd").unwrap();
    scene.instances[1].source = elsewhere.clone();
    scene.save(&file).unwrap();
    let loaded = Scene::load(&file).unwrap();
    let expected =
        [folder.path().join("volume-7.pumice"), elsewhere.clone(), folder.path().join("sky/dawn.exr")];
    assert_eq!(paths(&loaded), expected);

    // Saved to the same folder, the text is as before; saved to another folder, it names the same files.
    let copy = folder.path().join("copy.json");
    loaded.save(&copy).unwrap();
    assert_eq!(std::fs::read_to_string(&copy).unwrap(), std::fs::read_to_string(&file).unwrap());
    let other = tempfile::tempdir().unwrap();
    loaded.save(&other.path().join("scene.json")).unwrap();
    assert_eq!(paths(&Scene::load(&other.path().join("scene.json")).unwrap()), expected);
}

#[test]
fn a_built_in_mesh_is_no_path() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.json");
    let mut scene = full_scene();
    scene.meshes[0].source = "builtin:plane".into();
    scene.save(&file).unwrap();
    let loaded = Scene::load(&file).unwrap();
    assert_eq!(loaded.meshes[0].source, Path::new("builtin:plane"));
    assert!(loaded.meshes[0].is_built_in() && !loaded.meshes[1].is_built_in());
    assert_eq!(loaded.meshes[1].source, folder.path().join(&scene.meshes[1].source));
}

#[test]
fn a_scene_that_is_not_valid_leaves_the_file_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.json");
    std::fs::write(&file, "before").unwrap();
    let mut scene = full_scene();
    scene.camera.shift[0] = f64::NAN;
    assert!(matches!(scene.save(&file), Err(SceneError::Field { field, .. }) if field == "camera.shift[0]"));
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "before");
    full_scene().save(&file).unwrap();
    assert_ne!(std::fs::read_to_string(&file).unwrap(), "before");
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["scene.json"]);
}

#[test]
fn what_cannot_be_read_or_written_is_told_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing").join("scene.json");
    let line = |error: SceneError| {
        let text = error.to_string();
        assert!(!text.contains('\n') && !text.contains(".pumice-"), "{text}");
        text
    };
    let kind = |error: SceneError| match error {
        SceneError::Io(error) => error.kind(),
        other => panic!("expected an error of the system, got {other}"),
    };
    assert_eq!(kind(Scene::load(&missing).unwrap_err()), std::io::ErrorKind::NotFound);
    assert_eq!(kind(full_scene().save(&missing).unwrap_err()), std::io::ErrorKind::NotFound);
    line(full_scene().save(&missing).unwrap_err());
    let no_file = "expected an ordinary file, got a folder";
    assert_eq!(line(Scene::load(folder.path()).unwrap_err()), no_file);
    assert_eq!(line(full_scene().save(folder.path()).unwrap_err()), format!("file: {no_file}"));
    let binary = folder.path().join("binary.json");
    std::fs::write(&binary, [0xff, 0xfe, 0]).unwrap();
    assert_eq!(kind(Scene::load(&binary).unwrap_err()), std::io::ErrorKind::InvalidData);
}

#[cfg(unix)]
#[test]
fn a_path_that_is_no_unicode_is_named() {
    use std::os::unix::ffi::OsStrExt as _;
    let mut scene = full_scene();
    scene.instances[1].source = Path::new(std::ffi::OsStr::from_bytes(b"a\xff")).to_owned();
    let error = scene.to_json().unwrap_err().to_string();
    assert!(error.starts_with("instances[1].source: expected a path in Unicode"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_saved_scene_has_the_permissions_of_any_new_file() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let mode = |name: &str| std::fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
    full_scene().save(&folder.path().join("scene.json")).unwrap();
    std::fs::write(folder.path().join("plain"), "").unwrap();
    assert_eq!(mode("scene.json"), mode("plain"));
}
