//! The needs of a scene follow from what it draws, tested one edit at a time.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::full_scene;
use pumice_scene::{
    Cut, Environment, LAMPS_OF_A_TREE, LabelCount, LabelGroup, LabelGroups, LabelMaterials, LabelStyle, Lod,
    Material, Mesh, Mode, Needs, Part, PartSet, Pass, Passes, Scene, Show,
};

const IDS: [u64; 4] = [3, 5, 17, u64::MAX];
const MATTE: Material = Material { base_color: [0.5; 3], roughness: 1.0, specular: 0.0, ..Material::DEFAULT };

/// A scene that needs as little as possible: one instance of four matte labels under a constant sky.
fn plain() -> Scene {
    let mut scene = full_scene();
    scene.instances.truncate(1);
    scene.instances[0].style = LabelStyle { material: MATTE, ..LabelStyle::default() };
    scene.world.environment = Environment::Constant { radiance: [1.0; 3] };
    scene.suns.clear();
    scene.camera.aperture = None;
    (scene.lights, scene.meshes, scene.cuts) = Default::default();
    (scene.film.transparent, scene.film.background, scene.film.passes) = (false, None, Passes::NONE);
    (scene.settings.clamp_direct, scene.settings.clamp_indirect) = (0.0, 0.0);
    scene.settings.mode = Mode::Path;
    scene.settings.bounces = 4;
    scene.settings.lod = Lod::Voxels;
    scene.settings.smooth_voxels = false;
    scene
}

fn needs(scene: &Scene) -> Needs {
    Needs::of(scene, &vec![&IDS[..]; scene.instances.len()], false)
}

fn least() -> Needs {
    Needs {
        labels: vec![LabelCount { instance: 7, visible: 4, all: 4 }],
        lighting: true,
        diffuse: true,
        specular: false,
        metal: false,
        glass: false,
        coat: false,
        transparent: false,
        sheen: false,
        lens: false,
        emission: false,
        sky_table: false,
        suns: 0,
        lamps: 0,
        meshes: 0,
        instance_tree: false,
        catchers: 0,
        mis: false,
        bounces: true,
        roulette: false,
        cuts: 0,
        sorted: false,
        mattes: false,
        smooth_voxels: false,
        smooth_meshes: false,
        levels: vec![1],
        besides: PartSet::NONE,
    }
}

#[track_caller]
fn after(edit: impl FnOnce(&mut Scene)) -> Needs {
    let mut scene = plain();
    assert_eq!(needs(&scene), least());
    edit(&mut scene);
    scene.validate().unwrap();
    needs(&scene)
}

#[test]
fn each_edit_needs_only_what_it_brings() {
    let style = |edit: fn(&mut LabelStyle)| after(|s| edit(&mut s.instances[0].style));
    assert_eq!(style(|s| s.material.specular = 0.5), Needs { specular: true, ..least() });
    assert_eq!(style(|s| s.material.metallic = 0.5), Needs { metal: true, ..least() });
    assert_eq!(style(|s| s.material.metallic = 1.0), Needs { metal: true, diffuse: false, ..least() });
    assert_eq!(style(|s| s.material.emission[2] = 0.1), Needs { emission: true, mis: true, ..least() });
    assert_eq!(style(|s| s.material.transmission = 0.5), Needs { glass: true, ..least() });
    assert_eq!(style(|s| s.material.coat = 0.5), Needs { coat: true, ..least() });
    assert_eq!(style(|s| s.material.alpha = 0.5), Needs { transparent: true, ..least() });
    assert_eq!(style(|s| s.material.sheen = 0.5), Needs { sheen: true, ..least() });
    assert_eq!(style(|s| s.material.base_color = [0.0; 3]), Needs { diffuse: false, ..least() });
    // A black base colour that automatic colours replace still needs the diffuse lobe.
    assert_eq!(style(|s| (s.material.base_color, s.auto_color) = ([0.0; 3], true)), least());
    // A group needs what its material needs, if one of its labels is drawn and has no material of its own.
    let glass = Material { transmission: 0.5, base_color: [0.0; 3], ..MATTE };
    let group = |ids: &[u64], colors: &[[f32; 3]]| {
        LabelGroups::new(vec![LabelGroup::new(glass, ids.to_vec(), colors.to_vec()).unwrap()]).unwrap()
    };
    let grouped = |groups: LabelGroups, show: Show, own: LabelMaterials| {
        after(|s| {
            let style = &mut s.instances[0].style;
            (style.groups, style.show, style.materials) = (groups, show, own);
        })
    };
    let none = LabelMaterials::default;
    assert_eq!(grouped(group(&[5, 17], &[]), Show::All, none()), Needs { glass: true, ..least() });
    let all = group(&IDS, &[]);
    assert_eq!(grouped(all, Show::All, none()), Needs { glass: true, diffuse: false, ..least() });
    assert_eq!(grouped(group(&IDS, &[[0.5; 3]; 4]), Show::All, none()), Needs { glass: true, ..least() });
    assert_eq!(grouped(group(&[5], &[]), Show::All, [(5, MATTE)].into()), least());
    assert_eq!(grouped(group(&[6], &[]), Show::All, none()), least(), "a label that the volume lacks");
    let three = vec![LabelCount { instance: 7, visible: 3, all: 4 }];
    let hidden = grouped(group(&[5], &[]), Show::Except(vec![5]), none());
    assert_eq!(hidden, Needs { labels: three.clone(), ..least() });
    // A group of all labels is looked at as a whole, unless some label has a material of its own.
    let whole = |show, own| grouped(group(&IDS, &[]), show, own);
    let seen = Needs { glass: true, diffuse: false, ..least() };
    assert_eq!(whole(Show::Except(vec![5]), none()), Needs { labels: three, ..seen });
    let nothing = vec![LabelCount { instance: 7, visible: 0, all: 4 }];
    assert_eq!(whole(Show::Only(vec![]), none()), Needs { labels: nothing, diffuse: false, ..least() });
    assert_eq!(whole(Show::All, [(5, MATTE)].into()), Needs { glass: true, ..least() });
    // With an index of refraction of 1 there is no dielectric layer, whatever `specular` is.
    assert_eq!(style(|s| (s.material.specular, s.material.ior) = (1.0, 1.0)), least());

    let sky = Environment::Image { path: "a.exr".into(), rotation_rad: 0.0, strength: 1.0 };
    assert_eq!(after(|s| s.world.environment = sky), Needs { sky_table: true, mis: true, ..least() });
    let suns = full_scene().suns;
    assert_eq!(after(|s| s.suns = vec![suns[1]]), Needs { suns: 1, ..least() });
    assert_eq!(after(|s| s.suns = suns.clone()), Needs { suns: 2, mis: true, ..least() });
    let dark = pumice_scene::Sun { strength: 0.0, ..suns[0] };
    let black = pumice_scene::Sun { color: [0.0; 3], ..suns[0] };
    assert_eq!(after(|s| s.suns = vec![dark, black]), least());

    let cuts = full_scene().cuts;
    assert_eq!(
        after(|s| s.cuts = vec![Cut { instances: None, ..cuts[0].clone() }]),
        Needs { cuts: 1, ..least() }
    );
    assert_eq!(after(|s| s.cuts = vec![Cut { instances: Some(vec![]), ..cuts[0].clone() }]), least());

    let mut mesh = full_scene().meshes.swap_remove(0);
    mesh.materials = vec![MATTE, Material { metallic: 1.0, ..MATTE }];
    mesh.shadow_catcher = false;
    assert_eq!(after(|s| s.meshes = vec![mesh.clone()]), Needs { meshes: 1, metal: true, ..least() });
    // Three meshes and the instance make four, the least for a hierarchy.
    let tree = after(|s| s.meshes = (0..3).map(|i| Mesh { id: 90 + i, ..mesh.clone() }).collect());
    assert_eq!(tree, Needs { meshes: 3, metal: true, instance_tree: true, ..least() });
    mesh.shadow_catcher = true;
    assert_eq!(
        after(|s| s.meshes = vec![mesh.clone()]),
        Needs { meshes: 1, catchers: 1, metal: true, sorted: true, ..least() }
    );

    let lamps = full_scene().lights;
    assert_eq!(after(|s| s.lights = vec![lamps[1]]), Needs { lamps: 1, mis: true, ..least() });
    let unlit = pumice_scene::Light { power_w: 0.0, ..lamps[0] };
    assert_eq!(after(|s| s.lights = vec![unlit]), least());

    let settings = |edit: fn(&mut pumice_scene::Settings)| after(|s| edit(&mut s.settings));
    assert_eq!(settings(|s| s.russian_roulette = true), Needs { roulette: true, ..least() });
    assert_eq!(settings(|s| s.bounces = 0), Needs { bounces: false, ..least() });
    assert_eq!(settings(|s| s.smooth_voxels = true), Needs { smooth_voxels: true, ..least() });
    assert_eq!(settings(|s| s.clamp_indirect = 1.0), Needs { sorted: true, ..least() });
    let film = |edit: fn(&mut pumice_scene::Film)| after(|s| edit(&mut s.film));
    assert_eq!(film(|f| f.transparent = true), Needs { sorted: true, ..least() });
    assert_eq!(film(|f| f.passes = Passes::NONE.with(Pass::Emission)), Needs { sorted: true, ..least() });
    let by_type = film(|f| f.passes = Passes::NONE.with(Pass::CryptomatteType));
    assert_eq!(by_type, Needs { sorted: true, mattes: true, ..least() });
    assert_eq!(film(|f| f.passes = Passes::NONE.with(Pass::Depth)), least());
    assert_eq!(
        settings(|s| (s.mode, s.russian_roulette) = (Mode::OneBounce, true)),
        Needs { bounces: false, ..least() }
    );
    assert_eq!(settings(|s| s.lod = Lod::Cells), Needs { levels: vec![4], ..least() });
    assert_eq!(settings(|s| s.lod = Lod::Boxes), Needs { levels: vec![16], ..least() });
    assert_eq!(
        settings(|s| s.lod = Lod::Distance { pixels: 1.0 }),
        Needs { levels: vec![1, 4, 16], ..least() }
    );
}

/// Materials and lights are prepared, and reported as needed, in every mode; MIS weights, bounces and roulette only where there are paths.
#[test]
fn ambient_occlusion_leaves_out_work_along_paths_alone() {
    let mut scene = full_scene();
    scene.settings.mode = Mode::Path;
    scene.settings.russian_roulette = true;
    let in_full = needs(&scene);
    assert!(in_full.mis && in_full.bounces && in_full.roulette);
    scene.settings.mode = Mode::AmbientOcclusion;
    let ambient = needs(&scene);
    let expected = Needs { lighting: false, mis: false, bounces: false, roulette: false, ..in_full.clone() };
    assert_eq!(ambient, expected);
    assert_eq!(ambient.parts(), in_full.parts(), "the same is built");
    let told = ambient.explain();
    assert!(told.contains(&"needed: materials".to_owned()) && told.contains(&"needed: 3 lamps".to_owned()));
    let weights =
        "left out: weights of multiple importance sampling (MIS) (ambient occlusion samples no lights)";
    assert!(told.contains(&weights.to_owned()), "{told:?}");
}

/// The parts built are those needed, plus each part that is added to measure its cost.
#[test]
fn what_is_built_is_what_is_needed_and_more_where_it_is_asked_for() {
    let needed = PartSet::ALL.without(least().unneeded()).without(PartSet::NONE.with(Part::HiddenLabels));
    assert_eq!(least().parts(), needed);
    for part in Part::ALL {
        assert!(!least().parts().has(part), "{part:?}");
        let more = least().with(part);
        assert_eq!(more.parts(), needed.with(part));
        assert_eq!(
            (more.unneeded(), more.explain()),
            (least().unneeded(), least().explain()),
            "a scene needs no more for it"
        );
    }
    assert_eq!((least().least_of_a_tree(), least().with(Part::InstanceTree).least_of_a_tree()), (4, 1));
    // Hidden labels are never built, whether there are any or not.
    let hidden = after(|s| s.instances[0].style.show = Show::Only(vec![5]));
    assert!(!hidden.parts().has(Part::HiddenLabels));
    let smooth = Needs { smooth_meshes: true, ..least() };
    assert!(smooth.parts().has(Part::SmoothNormals) && !least().parts().has(Part::SmoothNormals));
}

/// `on_film` gives the same needs as evaluating the scene with the new film from scratch.
#[test]
fn another_film_needs_what_the_scene_on_it_does() {
    for passes in [Passes::NONE, Passes::ALL] {
        let mut scene = plain();
        scene.film.passes = passes;
        assert_eq!(least().on_film(&scene), needs(&scene));
    }
}

#[test]
fn hidden_labels_ask_for_nothing() {
    let glow = Material { emission: [1.0; 3], ..MATTE };
    let with = |show: Show| {
        after(|s| {
            s.instances[0].style.show = show;
            s.instances[0].style.materials = [(5, glow), (99, Material { metallic: 1.0, ..MATTE })].into();
        })
    };
    let seen = |visible| vec![LabelCount { instance: 7, visible, all: 4 }];
    // The volume has no label 99.
    assert_eq!(with(Show::All), Needs { emission: true, mis: true, ..least() });
    assert_eq!(with(Show::Except(vec![5])), Needs { labels: seen(3), ..least() });
    assert_eq!(with(Show::Only(vec![3, 3])), Needs { labels: seen(1), ..least() });
    assert_eq!(
        with(Show::Only(vec![5, 17])),
        Needs { emission: true, mis: true, labels: seen(2), ..least() }
    );
    // The common material is not needed where all visible labels have materials of their own.
    let own = after(|s| {
        s.instances[0].style.show = Show::Only(vec![5]);
        s.instances[0].style.material.metallic = 1.0;
        s.instances[0].style.materials = [(5, glow)].into();
    });
    assert_eq!(own, Needs { emission: true, mis: true, labels: seen(1), ..least() });
    assert_eq!(with(Show::Only(vec![])), Needs { diffuse: false, labels: seen(0), ..least() });
}

/// What is not needed is spare, and each edit takes its own part out of that.
#[test]
fn what_is_not_needed_is_spare() {
    let all = PartSet::ALL.without(PartSet::NONE.with(Part::HiddenLabels));
    assert_eq!(least().unneeded(), all);
    let without = |parts: &[Part]| parts.iter().fold(all, |s, &p| s.without(PartSet::NONE.with(p)));
    let style = |edit: fn(&mut LabelStyle)| after(|s| edit(&mut s.instances[0].style)).unneeded();
    assert_eq!(style(|s| s.show = Show::Only(vec![5])), PartSet::ALL);
    assert_eq!(style(|s| s.material.metallic = 1.0), without(&[Part::Microfacets]));
    assert_eq!(style(|s| s.material.transmission = 1.0), without(&[Part::Microfacets, Part::Glass]));
    assert_eq!(style(|s| s.material.coat = 1.0), without(&[Part::Coats]));
    assert_eq!(style(|s| s.material.sheen = 1.0), without(&[Part::Sheen]));
    assert_eq!(style(|s| s.material.alpha = 0.5), without(&[Part::Transparent]));
    let full = full_scene();
    assert_eq!(after(|s| s.suns = full.suns).unneeded(), without(&[Part::LightSampling]));
    assert_eq!(after(|s| s.lights = full.lights).unneeded(), without(&[Part::LightSampling, Part::Lamps]));
    let crowd = |count| after(|s| s.lights = vec![full_scene().lights[0]; count]);
    assert_eq!(
        crowd(LAMPS_OF_A_TREE).unneeded(),
        without(&[Part::LightSampling, Part::Lamps, Part::LampTree])
    );
    assert_eq!(crowd(LAMPS_OF_A_TREE - 1).unneeded(), without(&[Part::LightSampling, Part::Lamps]));
    let explained = |count| crowd(count).explain().iter().any(|line| line.contains("lamps with a tree"));
    assert!(explained(LAMPS_OF_A_TREE) && !explained(LAMPS_OF_A_TREE - 1));
    assert!(!after(|s| s.meshes = full.meshes[..1].to_vec()).unneeded().has(Part::Meshes));
    assert!(!Needs { smooth_meshes: true, ..least() }.unneeded().has(Part::SmoothNormals));
    assert_eq!(after(|s| s.film.transparent = true).unneeded(), without(&[Part::Sorting]));
    assert_eq!(after(|s| s.settings.lod = Lod::Boxes).unneeded(), without(&[Part::Levels]));
    assert_eq!(after(|s| s.settings.smooth_voxels = true).unneeded(), without(&[Part::SmoothNormals]));
}

#[test]
fn each_line_says_needed_or_left_out_and_why() {
    let text = least().explain().join("\n");
    let expected = "\
needed: boxes of 4 of 4 labels of instance 7
needed: materials
left out: dielectric layer (no visible label has one)
left out: sampling of suns (no sun gives light)
left out: lamps (no lamp gives light)
left out: sampling of emissive surfaces (no visible label or mesh emits light)
left out: sampling table of the sky (the sky is equally bright everywhere: scattered rays find it as well)
left out: weights of multiple importance sampling (MIS) (each light is sampled in one way only)
needed: indirect light
left out: Russian roulette (the settings switch it off)
left out: cuts (no cut applies to an instance)
left out: separate sums of light (no pass over samples, transparent film, clamp or shadow catcher needs it)
left out: Cryptomatte (no Cryptomatte pass is requested)
left out: a hierarchy over instances (so few are tested one by one)
left out: shadow catchers (no mesh is one)
needed: elements of 1³ voxels
left out: elements of 4³ voxels (the level of detail does not use them)
left out: elements of 16³ voxels (the level of detail does not use them)
needed: diffuse";
    assert_eq!(text, expected);

    let all = needs(&full_scene());
    for line in all.explain() {
        let reason = line.starts_with("left out: ") && line.contains(" (") && line.ends_with(')');
        assert!(line.starts_with("needed: ") || reason, "{line}");
    }
    assert!(all.explain().contains(&"left out: boxes of 1 labels of instance 8 (not shown)".to_owned()));
    assert!(all.explain().contains(&"needed: sampling of 2 suns".to_owned()));
}
