//! A renderer as its users call it, on small volumes whose pictures have closed forms. `super::renderer()` returns the renderer under test;
//! tests of other renderers include this file.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{Job, MeshData};
use pumice_picture::{Image, Picture};
use pumice_scene::{
    Cut, CutShape, Environment, Instance, Light, LightShape, Lod, Material, Mesh, Mode, Projection, Scene,
    Show, Sun,
};
use pumice_transport::{LoadedScene, Rebuilt, RenderError, Renderer};

use super::floor::{lambert, looking_down, volume};

const BLACK: Environment = Environment::Constant { radiance: [0.0; 3] };

fn lamp() -> Light {
    let shape = LightShape::Point { position: [1.0, 2.0, 30.0], radius: 0.5, soft_falloff: false };
    Light { shape, power_w: 5.0, color: [1.0; 3], visible_to_camera: false }
}

fn render(scene: &Scene, spp: u32) -> Image {
    let mut renderer = super::renderer();
    let volumes = vec![volume(); scene.instances.len()];
    renderer.set_scene(&LoadedScene::new(scene.clone(), volumes.clone(), vec![]).unwrap()).unwrap();
    let job = Job::new();
    while renderer.advance(Duration::from_millis(20), spp, &job).unwrap().spp < spp {}
    renderer.picture().unwrap().color
}

fn mean(image: &Image) -> f64 {
    let sum: f64 = image.pixels.iter().flatten().map(|&v| f64::from(v)).sum();
    sum / (3 * image.pixels.len()) as f64
}

#[test]
fn a_point_sun_gives_albedo_over_pi_times_strength_times_cosine() {
    for tilt in [0.0f64, 0.5, 1.2] {
        // From the side away from the tower, so that nothing shades the floor.
        let direction = [tilt.sin(), 0.0, -tilt.cos()];
        let sun = Sun { direction, strength: 3.0, color: [1.0; 3], angle_rad: 0.0 };
        let mut scene = looking_down(BLACK, vec![sun], lambert(0.6));
        scene.settings.mode = Mode::OneBounce;
        let expected = 0.6 * FRAC_1_PI * 3.0 * tilt.cos() as f32;
        for pixel in render(&scene, 2).pixels {
            // One light, one direction, no noise: only f32 rounding of a handful of factors.
            assert!(
                pixel.iter().all(|v| (v - expected).abs() <= 4e-6 * expected),
                "{pixel:?}, expected {expected}"
            );
        }
    }
}

/// Cuts away the part above a slope of 3 in 4 through the tower's middle at height z.
fn slope(z: f64) -> Cut {
    let shape = CutShape::Plane { point: [14.0, 14.0, z], normal: [3.0, 0.0, 4.0] };
    Cut { shape, instances: None }
}

#[test]
fn a_cap_is_lit_as_its_plane_lies() {
    let sun = Sun { direction: [0.0, 0.0, -1.0], strength: 3.0, color: [1.0; 3], angle_rad: 0.0 };
    let mut scene = looking_down(BLACK, vec![sun], lambert(0.6));
    scene.settings.mode = Mode::OneBounce;
    scene.camera.world_from_camera.translation = DVec3::new(14.0, 14.0, 20.0);
    // The top of the tower, then its cap, with a cosine of 4/5.
    for (cuts, cosine) in [(vec![], 1.0), (vec![slope(5.0)], 0.8)] {
        scene.cuts = cuts;
        let mut renderer = super::renderer();
        renderer.set_scene(&LoadedScene::new(scene.clone(), vec![volume()], vec![]).unwrap()).unwrap();
        while renderer.advance(Duration::ZERO, 2, &Job::new()).unwrap().spp < 2 {}
        let picture = renderer.picture().unwrap();
        let expected = 0.6 * FRAC_1_PI * 3.0 * cosine;
        for pixel in picture.color.pixels {
            assert!(
                pixel.iter().all(|v| (v - expected).abs() <= 4e-6 * expected),
                "{pixel:?}, expected {expected}"
            );
        }
        // The camera sees label 9, the second of the table, at the height of the slope in the middle of each pixel.
        assert!(picture.label.unwrap().iter().all(|&l| l == 2));
        for (i, depth) in picture.depth.unwrap().into_iter().enumerate() {
            let x = 12.5 + 3.0 / 8.0 * ((i % 8) as f32 + 0.5);
            let height = if scene.cuts.is_empty() { 8.0 } else { 5.0 - 0.75 * (x - 14.0) };
            assert!((depth - (20.0 - height)).abs() < 1e-5, "{depth} at {x}");
        }
    }
}

/// A plate that is visible, then one outside of the picture whose shadow is visible, then one that transmits half of the sun, then none.
#[test]
fn a_mesh_is_seen_and_shades_and_an_edit_makes_anew_what_it_changes_alone() {
    let corners = vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let plate = [Arc::new(MeshData::new(corners, vec![[0, 1, 2], [0, 2, 3]], vec![]).unwrap())];
    let tilt = 0.5f64;
    let sun =
        Sun { direction: [tilt.sin(), 0.0, -tilt.cos()], strength: 3.0, color: [1.0; 3], angle_rad: 0.0 };
    let mut scene = looking_down(BLACK, vec![sun], lambert(0.6));
    scene.settings.mode = Mode::OneBounce;
    let at = |x: f64, z: f64| DAffine3 {
        matrix3: DMat3::from_diagonal(DVec3::new(2.2, 2.2, 1.0)),
        translation: DVec3::new(x, 3.0, z),
    };
    scene.meshes = vec![Mesh {
        id: 4,
        source: "memory".into(),
        world_from_mesh: at(3.0, 10.0),
        materials: vec![lambert(0.3)],
        shadow_catcher: false,
    }];
    let mut renderer = super::renderer();
    let job = Job::new();
    let mut expect = |what: &str, scene: &Scene, meshes: &[_], made: [u64; 2], albedo: f32| {
        let before = renderer.rebuilt();
        renderer
            .set_scene(&LoadedScene::new(scene.clone(), vec![volume()], meshes.to_vec()).unwrap())
            .unwrap();
        while renderer.advance(Duration::from_millis(20), 2, &job).unwrap().spp < 2 {}
        let after = renderer.rebuilt();
        // Each time the volume is a different one: one hierarchy and one table belong to it.
        let of_mesh = [after.acceleration - before.acceleration - 1, after.materials - before.materials - 1];
        assert_eq!(of_mesh, made, "{what}");
        let expected = albedo * FRAC_1_PI * 3.0 * tilt.cos() as f32;
        for pixel in renderer.color().unwrap().pixels {
            // As for a sun without meshes.
            let close = pixel.iter().all(|v| (v - expected).abs() <= 4e-6 * expected);
            assert!(close, "{what}: {pixel:?}, expected {expected}");
        }
    };
    expect("the plate", &scene, &plate, [1, 1], 0.3);
    // 10 above the floor, shifted by the slant of the light: outside of the picture.
    scene.meshes[0].world_from_mesh = at(3.0 - 10.0 * tilt.tan(), 12.0);
    expect("its shadow", &scene, &plate, [0, 0], 0.0);
    scene.meshes[0].materials[0].alpha = 0.5;
    expect("half of it", &scene, &plate, [0, 1], 0.3);
    scene.meshes.clear();
    expect("none", &scene, &[], [0, 0], 0.6);
}

#[test]
fn a_wide_sun_gives_what_a_point_of_the_same_strength_does_from_above() {
    // The irradiance of a cone of uniform radiance around the normal is its strength, for every angle.
    let sun = Sun { direction: [0.0, 0.0, -1.0], strength: 2.0, color: [1.0; 3], angle_rad: 0.6 };
    let mut scene = looking_down(BLACK, vec![sun], lambert(0.5));
    scene.settings.mode = Mode::OneBounce;
    // The tower's shadow does not reach the corner at 0.3 rad: it is 9 voxels away, and the tower 6 high.
    let got = mean(&render(&scene, 256));
    let expected = 0.5 / std::f64::consts::PI * 2.0;
    // 64 pixels × 256 stratified samples of an integrand that varies by 5 %: 1e-3 is far above their noise.
    assert!((got / expected - 1.0).abs() < 1e-3, "{got}, expected {expected}");
}

#[test]
fn a_hidden_sun_gives_nothing() {
    let sun = Sun { direction: [0.0, 0.0, 1.0], strength: 3.0, color: [1.0; 3], angle_rad: 0.0 };
    assert_eq!(mean(&render(&looking_down(BLACK, vec![sun], lambert(0.6)), 4)), 0.0);
}

#[test]
fn one_bounce_counts_the_sky_once() {
    // The floor alone under a uniform sky: albedo × radiance, and nothing else to bounce off.
    let mut scene = looking_down(Environment::Constant { radiance: [0.7; 3] }, vec![], lambert(0.5));
    scene.instances[0].style.show = Show::Only(vec![5]);
    scene.settings.mode = Mode::OneBounce;
    let image = render(&scene, 4);
    assert!(image.pixels.iter().flatten().all(|v| (v - 0.35).abs() < 1e-6), "{:?}", image.pixels[0]);
}

#[test]
fn ambient_occlusion_is_one_in_the_open_and_less_beside_the_tower() {
    let mut scene = looking_down(BLACK, vec![], lambert(0.5));
    scene.settings.mode = Mode::AmbientOcclusion;
    let mut open = scene.clone();
    open.instances[0].style.show = Show::Only(vec![5]);
    assert_eq!(mean(&render(&open, 4)), 1.0);
    // Near the tower's corner, half a voxel from its face.
    let mut near = scene.clone();
    near.camera.world_from_camera.translation = DVec3::new(11.5, 14.0, 20.0);
    near.camera.projection = Projection::Orthographic { scale: 0.5 };
    let close = mean(&render(&near, 64));
    assert!((0.4..0.8).contains(&close), "{close}");
    // Beyond the occlusion distance, the tower hides nothing.
    near.settings.ao_distance = 0.2;
    assert_eq!(mean(&render(&near, 16)), 1.0);
}

#[test]
fn a_cancelled_picture_goes_on_as_if_nothing_had_happened() {
    let scene = looking_down(Environment::Constant { radiance: [1.0; 3] }, vec![], lambert(0.8));
    let expected = render(&scene, 8);
    let mut renderer = super::renderer();
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![volume()], vec![]).unwrap()).unwrap();
    let job = Job::new();
    renderer.advance(Duration::ZERO, 3, &job).unwrap();
    let cancelled = Job::new();
    cancelled.cancel();
    assert!(matches!(renderer.advance(Duration::from_secs(1), 8, &cancelled), Err(RenderError::Cancelled)));
    while renderer.advance(Duration::from_millis(5), 8, &job).unwrap().spp < 8 {}
    assert_eq!(renderer.picture().unwrap().color, expected);
}

#[test]
fn a_faulty_scene_leaves_the_former_one() {
    let scene = looking_down(Environment::Constant { radiance: [1.0; 3] }, vec![], lambert(0.8));
    let mut renderer = super::renderer();
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![volume()], vec![]).unwrap()).unwrap();
    renderer.advance(Duration::ZERO, 1, &Job::new()).unwrap();
    let before = renderer.picture().unwrap();
    let mut no_such_label = scene.clone();
    no_such_label.instances[0].style.show = Show::Only(vec![6]);
    let mut not_a_number = scene.clone();
    not_a_number.camera.shift[0] = f64::NAN;
    let mut no_picture = scene;
    no_picture.world.environment =
        Environment::Image { path: "absent.exr".into(), rotation_rad: 0.0, strength: 1.0 };
    for (bad, named) in
        [(no_such_label, "label 6"), (not_a_number, "camera.shift"), (no_picture, "absent.exr")]
    {
        let loaded = LoadedScene::new(bad, vec![volume()], vec![]);
        let error = loaded.and_then(|bad| renderer.set_scene(&bad)).unwrap_err().to_string();
        assert!(error.contains(named) && !error.contains('\n'), "{error}");
        assert_eq!(renderer.picture().unwrap(), before);
    }
}

#[test]
fn seeds_and_levels_of_detail_change_the_picture_and_nothing_else_does() {
    let mut scene = looking_down(Environment::Constant { radiance: [1.0; 3] }, vec![], lambert(0.8));
    scene.camera.projection = Projection::Orthographic { scale: 18.0 };
    scene.camera.world_from_camera.translation = DVec3::new(8.0, 8.0, 20.0);
    let image = render(&scene, 4);
    assert_eq!(image, render(&scene, 4));
    let mut other = scene.clone();
    other.settings.seed = 1;
    assert_ne!(image, render(&other, 4));
    for lod in [Lod::Cells, Lod::Boxes, Lod::Distance { pixels: 1.0 }, Lod::Distance { pixels: 100.0 }] {
        let mut coarse = scene.clone();
        coarse.settings.lod = lod;
        assert!(mean(&render(&coarse, 4)) > 0.0, "{lod:?}");
    }
}

#[test]
fn two_instances_of_a_volume_are_both_seen() {
    let mut scene = looking_down(Environment::Constant { radiance: [1.0; 3] }, vec![], lambert(0.5));
    scene.settings.mode = Mode::OneBounce;
    scene.instances[0].style.show = Show::Only(vec![5]);
    let mut second = scene.instances[0].clone();
    second.id = 2;
    second.world_from_index = DAffine3::from_translation(DVec3::new(0.0, 0.0, 5.0));
    second.style.material = lambert(0.25);
    scene.instances.push(second);
    // The second instance lies above the first, and the camera looks from above.
    let image = render(&scene, 4);
    assert!(image.pixels.iter().flatten().all(|v| (v - 0.25).abs() < 1e-6), "{:?}", image.pixels[0]);
}

/// A camera a millionth of a voxel above the floor that looks along it towards the tower.
fn along_the_floor(scene: &mut Scene, fov_rad: f64) {
    scene.camera.world_from_camera = DAffine3 {
        matrix3: DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X),
        translation: DVec3::new(0.5, 13.0, 2.000_001),
    };
    scene.camera.projection = Projection::Perspective { fov_rad };
}

/// What the middles of pixels see: (floor, tower, nothing), and the least cosine at which the floor is hit.
fn seen_along_the_floor(scene: &Scene, picture: Picture) -> ([usize; 3], f64) {
    let (labels, depths, normals) =
        (picture.label.unwrap(), picture.depth.unwrap(), picture.normal.unwrap().pixels);
    let height = scene.camera.world_from_camera.translation.z - 2.0;
    let (mut seen, mut least) = ([0; 3], 1.0f64);
    for ((label, depth), normal) in labels.into_iter().zip(depths).zip(normals) {
        match (label, normal) {
            (0, _) => seen[2] += 1,
            (1, [0.0, 0.0, 1.0]) => {
                seen[0] += 1;
                least = least.min(height / f64::from(depth));
            }
            (2, [-1.0, 0.0, 0.0]) => seen[1] += 1,
            other => panic!("a surface that cannot be seen from there: {other:?}"),
        }
    }
    (seen, least)
}

fn no_extreme_material_puts_anything_but_numbers_on_the_film() {
    let sun = |angle_rad| Sun { direction: [0.3, 0.2, -1.0], strength: 1e8, color: [1.0; 3], angle_rad };
    let sky = Environment::Constant { radiance: [1e6, 0.0, 1.0] };
    let (mut renderer, shared) = (super::renderer(), volume());
    // At a field of view of 10⁻⁶ rad, the floor is hit at cosines from 1.9·10⁻⁷ on, three halves of the resolution of f32 near 1.
    for (fov_rad, grazing) in [(1.0, 0.1), (1e-3, 1e-4), (1e-6, 2e-7)] {
        for roughness in [0.0, 1e-4, 1e-2, 1.0] {
            for (metallic, ior, specular) in
                [(0.0, 1.0, 0.5), (0.0, 1.0001, 0.5), (0.0, 3.0, 2.0), (1.0, 1.5, 0.5), (0.5, 1.5, 0.0)]
            {
                for angle_rad in [0.0, 1e-7, 0.01, std::f64::consts::PI] {
                    let material = Material {
                        base_color: [1.0, 0.0, 1e-30],
                        metallic,
                        roughness,
                        specular,
                        ior,
                        emission: [0.0, 1e6, 0.0],
                        ..Material::DEFAULT
                    };
                    let mut scene = looking_down(sky.clone(), vec![sun(angle_rad)], material);
                    along_the_floor(&mut scene, fov_rad);
                    renderer
                        .set_scene(
                            &LoadedScene::new(scene.clone(), vec![Arc::clone(&shared)], vec![]).unwrap(),
                        )
                        .unwrap();
                    while renderer.advance(Duration::ZERO, 4, &Job::new()).unwrap().spp < 4 {}
                    let ([floor, tower, nothing], least) =
                        seen_along_the_floor(&scene, renderer.picture().unwrap());
                    assert!(floor >= 24 && tower + floor + nothing == 64, "{floor} {tower} {nothing}");
                    assert!(tower >= 8, "{tower} pixels of tower at {fov_rad}");
                    assert!(least < grazing, "the floor is met at cosine {least}");
                    let image = renderer.color().unwrap();
                    let bad = image.pixels.iter().flatten().filter(|v| !v.is_finite() || **v < 0.0).count();
                    let lit = image.pixels.iter().filter(|p| p[1] > 0.0).count();
                    let what =
                        format!("roughness {roughness}, metallic {metallic}, ior {ior}, angle {angle_rad}");
                    assert_eq!(bad, 0, "{what}");
                    // The visible parts of the volume emit green light.
                    assert!(lit >= floor, "{what}: {lit} of {floor}");
                }
            }
        }
    }
}

/// A camera move rebuilds camera rays, and a colour edit materials; only a change of what is drawn, or of its level of detail, rebuilds a
/// hierarchy, and where somewhat fewer labels are drawn not even that.
fn only_what_differs_is_made_again() {
    type Edit = fn(&mut Scene);
    let base = looking_down(Environment::Constant { radiance: [1.0; 3] }, vec![], lambert(0.8));
    let mut renderer = super::renderer();
    let shared = volume();
    let none = Rebuilt::default();
    // With levels by distance, a device has a hierarchy over boxes, which it does not need where all boxes have one level.
    let by_distance = u64::from(renderer.name() != "cpu");
    let cases: Vec<(&str, Edit, Rebuilt)> = vec![
        (
            "all",
            |_| (),
            Rebuilt { camera: 1, film: 1, lights: 1, materials: 1, acceleration: 1, top_level: 0 },
        ),
        ("nothing", |_| (), none),
        ("camera", |s| s.camera.world_from_camera.translation.x += 0.5, Rebuilt { camera: 1, ..none }),
        ("film", |s| s.film.width += 3, Rebuilt { camera: 1, film: 1, ..none }),
        ("world", |s| s.world.backdrop = Some([[0.5; 3]; 2]), Rebuilt { lights: 1, ..none }),
        ("a lamp", |s| s.lights = vec![lamp()], Rebuilt { lights: 1, ..none }),
        ("its power", |s| s.lights[0].power_w = 9.0, Rebuilt { lights: 1, ..none }),
        ("seed", |s| s.settings.seed += 1, none),
        ("bounces", |s| s.settings.bounces = 1, none),
        ("material", |s| s.instances[0].style.material.metallic = 0.5, Rebuilt { materials: 1, ..none }),
        ("place", |s| s.instances[0].world_from_index.translation.x += 0.25, none),
        ("show", |s| s.instances[0].style.show = Show::Except(vec![5]), Rebuilt { materials: 1, ..none }),
        ("detail", |s| s.settings.lod = Lod::Cells, Rebuilt { acceleration: 1, ..none }),
        (
            "by distance",
            |s| s.settings.lod = Lod::Distance { pixels: 4.0 },
            Rebuilt { acceleration: by_distance, ..none },
        ),
        (
            "camera, by distance",
            |s| s.camera.world_from_camera.translation.z += 40.0,
            Rebuilt { camera: 1, ..none },
        ),
        ("film, by distance", |s| s.film.width += 2, Rebuilt { camera: 1, film: 1, ..none }),
        ("place, by distance", |s| s.instances[0].world_from_index.matrix3 *= 1.25, none),
        ("a cut", |s| s.cuts = vec![slope(3.5)], none),
        ("the cut moved", |s| s.cuts = vec![slope(1.25)], none),
        ("place, cut", |s| s.instances[0].world_from_index.matrix3 *= 0.8, none),
        ("no cut", |s| s.cuts.clear(), none),
        ("all voxels", |s| s.settings.lod = Lod::Voxels, Rebuilt { acceleration: 1, ..none }),
        // Emitters are gathered again where their emission, their placement or their cuts change.
        (
            "labels shine",
            |s| s.instances[0].style.material.emission = [2.0, 1.0, 0.5],
            Rebuilt { lights: 1, materials: 1, ..none },
        ),
        (
            "their colour",
            |s| s.instances[0].style.material.base_color = [0.1, 0.2, 0.3],
            Rebuilt { materials: 1, ..none },
        ),
        (
            "camera, shining",
            |s| s.camera.world_from_camera.translation.x -= 0.25,
            Rebuilt { camera: 1, ..none },
        ),
        (
            "place, shining",
            |s| s.instances[0].world_from_index.translation.x -= 0.5,
            Rebuilt { lights: 1, ..none },
        ),
        ("lamp, shining", |s| s.lights.clear(), Rebuilt { lights: 1, ..none }),
        ("a cut, shining", |s| s.cuts = vec![slope(3.5)], Rebuilt { lights: 1, ..none }),
        (
            "no longer",
            |s| s.instances[0].style.material.emission = [0.0; 3],
            Rebuilt { materials: 1, ..none },
        ),
    ];
    let (mut scene, mut drawn) = (base, Vec::new());
    for (name, edit, expected) in cases {
        let before = renderer.rebuilt();
        edit(&mut scene);
        renderer
            .set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&shared)], vec![]).unwrap())
            .unwrap();
        let after = renderer.rebuilt();
        let made = Rebuilt {
            camera: after.camera - before.camera,
            film: after.film - before.film,
            lights: after.lights - before.lights,
            materials: after.materials - before.materials,
            acceleration: after.acceleration - before.acceleration,
            top_level: after.top_level - before.top_level,
        };
        assert_eq!(made, expected, "{name}");
        renderer.advance(Duration::ZERO, 4, &Job::new()).unwrap();
        while renderer.advance(Duration::ZERO, 4, &Job::new()).unwrap().spp < 4 {}
        drawn.push((name, scene.clone(), renderer.color().unwrap()));
    }
    // The parts that were kept give the same picture as new ones.
    drop(renderer);
    for (name, scene, image) in drawn {
        assert_eq!(image, render(&scene, 4), "{name}");
    }
}

/// Instances of one volume share its hierarchy where they show the same labels, and materials where these are equal. The hierarchy over all
/// instances is rebuilt where one moves, and for nothing else. Whatever is kept, the picture is that of a new renderer.
fn many_instances_share_what_is_alike() {
    type Edit = fn(&mut Scene);
    let mut scene = looking_down(Environment::Constant { radiance: [1.0; 3] }, vec![], lambert(0.8));
    let shared = volume();
    let at = |i: u32| {
        DAffine3::from_translation(DVec3::new(f64::from(i % 3), f64::from(i / 3), -3.0 * f64::from(i)))
    };
    let first = scene.instances[0].clone();
    scene.instances = (0..7)
        .map(|i| Instance { id: i + 1, world_from_index: at(i) * first.world_from_index, ..first.clone() })
        .collect();
    let none = Rebuilt::default();
    let mut renderer = super::renderer();
    // The intersection shader of a ray tracing pipeline identifies an instance by its hierarchy, so each has its own there.
    let acceleration = if renderer.name() == "vulkan-rt" { 7 } else { 1 };
    let cases: Vec<(&str, Edit, Rebuilt)> = vec![
        ("all", |_| (), Rebuilt { camera: 1, film: 1, lights: 1, materials: 1, acceleration, top_level: 1 }),
        ("nothing", |_| (), none),
        ("camera", |s| s.camera.world_from_camera.translation.x += 0.5, Rebuilt { camera: 1, ..none }),
        (
            "one place",
            |s| s.instances[3].world_from_index.translation.x += 0.25,
            Rebuilt { top_level: 1, ..none },
        ),
        ("one colour", |s| s.instances[5].style.material.metallic = 0.5, Rebuilt { materials: 1, ..none }),
        (
            "what one shows",
            |s| s.instances[4].style.show = Show::Except(vec![5]),
            Rebuilt { materials: 1, top_level: 1, ..none },
        ),
        ("a cut", |s| s.cuts = vec![slope(3.5)], none),
        ("one fewer", |s| drop(s.instances.pop()), Rebuilt { top_level: 1, ..none }),
        ("few", |s| s.instances.truncate(3), none),
    ];
    let mut drawn = Vec::new();
    for (name, edit, expected) in cases {
        let before = renderer.rebuilt();
        edit(&mut scene);
        let volumes = vec![Arc::clone(&shared); scene.instances.len()];
        renderer.set_scene(&LoadedScene::new(scene.clone(), volumes.clone(), vec![]).unwrap()).unwrap();
        let after = renderer.rebuilt();
        let made = Rebuilt {
            camera: after.camera - before.camera,
            film: after.film - before.film,
            lights: after.lights - before.lights,
            materials: after.materials - before.materials,
            acceleration: after.acceleration - before.acceleration,
            top_level: after.top_level - before.top_level,
        };
        assert_eq!(made, expected, "{name}");
        while renderer.advance(Duration::ZERO, 2, &Job::new()).unwrap().spp < 2 {}
        drawn.push((name, scene.clone(), renderer.color().unwrap()));
    }
    drop(renderer);
    for (name, scene, image) in drawn {
        let mut anew = super::renderer();
        anew.set_scene(
            &LoadedScene::new(scene.clone(), vec![Arc::clone(&shared); scene.instances.len()], vec![])
                .unwrap(),
        )
        .unwrap();
        while anew.advance(Duration::ZERO, 2, &Job::new()).unwrap().spp < 2 {}
        assert_eq!(image, anew.color().unwrap(), "{name}");
    }
}

/// Scenes that need many parts of a renderer. Compiling these for a device that computes on a CPU takes a minute each, so `super::of_today`
/// chooses.
#[test]
fn scenes_that_need_many_parts() {
    let all: [fn(); 3] = [
        no_extreme_material_puts_anything_but_numbers_on_the_film,
        only_what_differs_is_made_again,
        many_instances_share_what_is_alike,
    ];
    super::of_today(&all).into_iter().for_each(|check| check());
}
