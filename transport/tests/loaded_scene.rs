//! A loaded scene is validated as a whole; edits are applied all or none; copies on another film keep the needs of that film's scene.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../../scene/tests/common/mod.rs"]
mod common;

use std::sync::Arc;

use common::full_scene;
use pumice_core::{
    CompressedVolume, CompressionLevel, Job, LabelBuffer, LabelType, MeshData, VolumeInfo, compress_labels,
};
use pumice_scene::{Film, Needs, Part, PartSet, Passes, Scene, SceneEdit, Show, Sun};
use pumice_transport::{LoadedEdit, LoadedScene};

fn volume() -> Arc<CompressedVolume> {
    let labels = LabelBuffer::U64(vec![3, 17, u64::MAX, 3, 5, 5]);
    Arc::new(compress_labels(VolumeInfo::new([6, 1, 1], LabelType::U64), labels).unwrap())
}

fn mesh() -> Arc<MeshData> {
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    Arc::new(MeshData::new(corners, vec![[0, 1, 2]], vec![]).unwrap())
}

fn smooth_mesh() -> Arc<MeshData> {
    let flat = MeshData::clone(&mesh());
    Arc::new(flat.with_corner_normals(&[[0.0, 0.6, 0.8]; 3]).unwrap())
}

fn loaded() -> LoadedScene {
    LoadedScene::new(full_scene(), vec![volume(); 2], vec![mesh(); 2]).unwrap()
}

#[test]
fn what_is_not_valid_as_a_whole_is_refused_by_name() {
    let refused =
        |scene: Scene, volumes, meshes| LoadedScene::new(scene, volumes, meshes).unwrap_err().to_string();
    let after = |edit: fn(&mut Scene)| {
        let mut scene = full_scene();
        edit(&mut scene);
        scene
    };
    let (volumes, meshes) = (vec![volume(); 2], vec![mesh(); 2]);
    assert_eq!(
        refused(full_scene(), vec![volume()], meshes.clone()),
        "instances: expected one volume for each of 2, got 1"
    );
    assert_eq!(
        refused(full_scene(), volumes.clone(), vec![mesh(); 3]),
        "meshes: expected one mesh for each of 2, got 3"
    );
    let text = refused(after(|s| s.camera.clip = [2.0, 1.0]), volumes.clone(), meshes.clone());
    assert_eq!(text, "camera.clip: expected 0 ≤ near < far, got 2 and 1");
    let text = refused(after(|s| s.instances[1].style.show = Show::Only(vec![3, 4])), volumes, meshes);
    assert!(text.starts_with("instances[1].style.show.only[1]: the volume has no label 4"), "{text}");
}

/// Labels that a file contains, but that were not read, cannot be shown.
#[test]
fn labels_that_were_not_read_are_refused_and_those_that_were_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pumice");
    volume().save(&path, CompressionLevel::Fast, &Job::new()).unwrap();
    // Dense indices: labels 3, 17 and the last, without 5.
    let part = CompressedVolume::open_labels(&path, |_| vec![true, false, true, true], &Job::new()).unwrap();
    let part = Arc::new(part);
    assert!(!part.is_whole());
    let load = |show: Show| {
        let mut scene = full_scene();
        scene.instances.iter_mut().for_each(|i| i.style.show = show.clone());
        LoadedScene::new(scene, vec![Arc::clone(&part); 2], vec![mesh(); 2])
    };
    assert_eq!(load(Show::Except(vec![5])).unwrap().visible(0), [true, false, true, true]);
    assert_eq!(
        load(Show::All).unwrap_err().to_string(),
        "instances[0].style.show: label 5 was not read from the volume's file; open it with this label too"
    );
}

#[test]
fn what_is_added_comes_with_its_data_and_the_rest_keeps_its_own() {
    let (scene, other, triangles) = (loaded(), volume(), smooth_mesh());
    let mut third = scene.scene().instances[0].clone();
    third.id = 9;
    let add = |instance, volume: &Arc<_>| LoadedEdit::Add {
        instance: Box::new(instance),
        volume: Arc::clone(volume),
    };
    // (One of the scene's cuts names the instance that is removed.)
    let uncut = SceneEdit::Cuts { cuts: vec![] }.into();
    let gone = SceneEdit::Remove { id: 7 }.into();
    let edited = scene.edited(vec![add(third.clone(), &other), uncut, gone]).unwrap();
    assert_eq!(edited.scene().instances.iter().map(|i| i.id).collect::<Vec<_>>(), [8, 9]);
    assert!(
        Arc::ptr_eq(&edited.volumes()[0], &scene.volumes()[1]) && Arc::ptr_eq(&edited.volumes()[1], &other)
    );
    assert!(Arc::ptr_eq(edited.volume(9).unwrap(), &other) && edited.volume(7).is_none());

    // Replaces the instance with the same id; removes one and adds it again in one call.
    let again = scene.scene().instances[1].clone();
    let edited = scene.edited(vec![add(again.clone(), &other)]).unwrap();
    assert!(Arc::ptr_eq(&edited.volumes()[1], &other) && edited.volumes().len() == 2);
    let edited = edited.edited(vec![SceneEdit::Remove { id: 8 }.into(), add(again, &volume())]).unwrap();
    assert!(!Arc::ptr_eq(&edited.volumes()[1], &other) && edited.volumes().len() == 2);

    let mut fifth = scene.scene().meshes[0].clone();
    fifth.id = 5;
    let added = LoadedEdit::AddMesh { mesh: Box::new(fifth), data: Arc::clone(&triangles) };
    let edited = scene.edited(vec![added]).unwrap();
    assert!(Arc::ptr_eq(&edited.meshes()[2], &triangles) && edited.meshes().len() == 3);
    assert!(edited.needs().smooth_meshes && !scene.needs().smooth_meshes);
}

#[test]
fn edits_are_applied_all_or_none_and_errors_name_the_edit() {
    let scene = loaded();
    let sun = Sun { strength: f32::NAN, ..scene.scene().suns[0] };
    let edits: [(Vec<SceneEdit>, &str); 2] = [
        (
            vec![SceneEdit::Lights { lights: vec![] }, SceneEdit::Suns { suns: vec![sun] }],
            "suns[0].strength: ",
        ),
        (
            vec![SceneEdit::Lights { lights: vec![] }, SceneEdit::Remove { id: 4 }],
            "edits[1].remove.id: the scene has no instance 4; its instances are [7, 8]",
        ),
    ];
    for (edits, expected) in edits {
        let error = scene.edited(edits.into_iter().map(LoadedEdit::from).collect()).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
    assert_eq!(scene.scene(), &full_scene());
}

#[test]
fn another_film_is_checked_and_needs_what_the_scene_on_it_does() {
    let scene = loaded();
    let film =
        Film { passes: Passes::NONE, transparent: false, background: None, width: 7, ..scene.scene().film };
    let other = scene.with_film(film).unwrap();
    assert_eq!(other.scene(), &Scene { film, ..full_scene() });
    let ids = volume();
    let ids = [ids.labels().ids(); 2];
    assert_eq!(other.needs(), &Needs::of(other.scene(), &ids, false));
    assert!(scene.with_film(Film { width: 0, ..film }).is_err());
    // Parts that were built in addition stay.
    let more = scene.with_parts(PartSet::NONE.with(Part::HiddenLabels)).with_film(film).unwrap();
    assert!(more.needs().parts().has(Part::HiddenLabels) && !other.needs().parts().has(Part::HiddenLabels));
}
