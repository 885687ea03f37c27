//! Pictures of meshes: a cube of triangles must look like a voxel of the same size and place, for every material, on voxels or on
//! triangles, and with anything standing on it.

use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{CompressedVolume, Job, LabelBuffer, LabelType, MeshData, VolumeInfo, compress_labels};
use pumice_picture::{Image, Picture};
use pumice_scene::{
    Camera, Environment, Film, Filter, Instance, LabelStyle, Light, LightShape, Material, Mesh, Mode,
    Projection, Reading, SCENE_VERSION, Scene, Settings, Sun, World,
};
use pumice_transport::{LoadedScene, Renderer};

use crate::shapes::{cube, cube_of};

/// A part of a scene: a voxel, or the same cube as triangles.
#[derive(Clone)]
struct Block {
    world_from_unit: DAffine3,
    material: Material,
}

fn voxels(edge: u32) -> Arc<CompressedVolume> {
    let labels = LabelBuffer::U8(vec![1; (edge * edge * edge) as usize]);
    Arc::new(compress_labels(VolumeInfo::new([edge; 3], LabelType::U8), labels).unwrap())
}

/// Slanted, so that no normal has a component of 0, whose sign would select a face's tangents, and with them other random directions.
fn at(scale: [f64; 3], turn: f64, translation: [f64; 3]) -> DAffine3 {
    let slant = DMat3::from_rotation_x(0.07) * DMat3::from_rotation_y(-0.11);
    let matrix3 = slant * DMat3::from_rotation_z(turn) * DMat3::from_diagonal(scale.into());
    DAffine3 { matrix3, translation: slant * DVec3::from(translation) }
}

fn lambert(color: [f32; 3]) -> Material {
    Material { base_color: color, specular: 0.0, roughness: 1.0, ..Material::default() }
}

fn glass(roughness: f32) -> Material {
    Material { transmission: 1.0, roughness, ior: 1.4, base_color: [1.0, 0.9, 0.8], ..Material::default() }
}

/// A floor, and a box above it.
fn floor_and_box(material: Material) -> [Block; 2] {
    [
        Block {
            world_from_unit: at([12.0, 12.0, 1.0], 0.1, [-6.0, -6.0, -1.0]),
            material: lambert([0.8, 0.7, 0.6]),
        },
        Block { world_from_unit: at([2.0, 1.5, 2.5], 0.2, [-0.7, -1.0, 0.7]), material },
    ]
}

/// Which of the blocks are triangles.
type AsMesh<'a> = &'a [bool];

fn scene_of(blocks: &[Block], as_mesh: AsMesh) -> (Scene, Vec<Arc<CompressedVolume>>, Vec<Arc<MeshData>>) {
    let eye = DVec3::new(5.0, -7.0, 6.0);
    let back = (eye - DVec3::new(0.0, 0.0, 0.8)).normalize();
    let right = DVec3::Z.cross(back).normalize();
    let world_from_camera =
        DAffine3 { matrix3: DMat3::from_cols(right, back.cross(right), back), translation: eye };
    let lamp = LightShape::Point { position: [-3.0, -2.0, 4.0], radius: 0.3, soft_falloff: false };
    let mut scene = Scene {
        version: SCENE_VERSION,
        instances: Vec::new(),
        camera: Camera::new(world_from_camera, Projection::Perspective { fov_rad: 0.7 }),
        film: Film::new(32, 32, Filter::Box { width: 1.0 }),
        world: World { environment: Environment::Constant { radiance: [0.3, 0.4, 0.5] }, backdrop: None },
        suns: vec![Sun { direction: [-0.5, 0.6, -1.0], strength: 2.0, color: [1.0; 3], angle_rad: 0.1 }],
        lights: vec![Light { shape: lamp, power_w: 60.0, color: [1.0, 0.5, 0.5], visible_to_camera: true }],
        meshes: Vec::new(),
        cuts: Vec::new(),
        settings: Settings { bounces: 6, ..Settings::default() },
    };
    let (mut volumes, mut meshes) = (Vec::new(), Vec::new());
    for ((block, &as_mesh), id) in blocks.iter().zip(as_mesh).zip(1..) {
        if as_mesh {
            meshes.push(cube(1.0, 3));
            scene.meshes.push(Mesh {
                id,
                source: "memory".into(),
                world_from_mesh: block.world_from_unit,
                materials: vec![block.material],
                shadow_catcher: false,
            });
        } else {
            volumes.push(voxels(1));
            scene.instances.push(Instance {
                id,
                source: "memory".into(),
                reading: Reading::default(),
                world_from_index: block.world_from_unit,
                style: LabelStyle { material: block.material, ..LabelStyle::default() },
            });
        }
    }
    (scene, volumes, meshes)
}

fn loaded(scene: &Scene, volumes: &[Arc<CompressedVolume>], meshes: &[Arc<MeshData>]) -> LoadedScene {
    LoadedScene::new(scene.clone(), volumes.to_vec(), meshes.to_vec()).unwrap()
}

fn draw(scene: &Scene, volumes: &[Arc<CompressedVolume>], meshes: &[Arc<MeshData>], spp: u32) -> Picture {
    let mut renderer = crate::renderer();
    renderer.set_scene(&loaded(scene, volumes, meshes)).unwrap();
    let job = Job::new();
    while renderer.advance(Duration::from_secs(5), spp, &job).unwrap().spp < spp {}
    renderer.picture().unwrap()
}

fn picture(blocks: &[Block], as_mesh: AsMesh, mode: Mode) -> Picture {
    let (mut scene, volumes, meshes) = scene_of(blocks, as_mesh);
    scene.settings.mode = mode;
    draw(&scene, &volumes, &meshes, 8)
}

fn close(x: f32, y: f32) -> bool {
    x == y || (x - y).abs() <= 1e-4 * (1.0 + x.abs())
}

fn all(x: &[f32; 3], y: &[f32; 3]) -> bool {
    (0..3).all(|c| close(x[c], y[c]))
}

/// Number of pixels that differ: in colour by more than a ten-thousandth of its value, or in depth, base colour or normal.
fn unlike(a: &Picture, b: &Picture) -> usize {
    let (albedo, normal, depth) = (
        [a.albedo.as_ref().unwrap(), b.albedo.as_ref().unwrap()],
        [a.normal.as_ref().unwrap(), b.normal.as_ref().unwrap()],
        [a.depth.as_ref().unwrap(), b.depth.as_ref().unwrap()],
    );
    (0..a.color.pixels.len())
        .filter(|&i| {
            !(all(&a.color.pixels[i], &b.color.pixels[i])
                && all(&albedo[0].pixels[i], &albedo[1].pixels[i])
                && all(&normal[0].pixels[i], &normal[1].pixels[i])
                && close(depth[0][i], depth[1][i]))
        })
        .count()
}

/// Random numbers are the same, and positions differ by f64 rounding alone; decisions that compare two numbers may rarely go the other way:
/// in one pixel of two hundred.
const UNLIKE_AT_MOST: usize = 32 * 32 / 200;

#[test]
fn a_cube_of_triangles_looks_as_a_voxel_does() {
    let plastic = Material { base_color: [0.2, 0.5, 0.8], roughness: 0.3, ..Material::default() };
    for (what, material) in [
        ("lambert", lambert([0.3, 0.6, 0.9])),
        ("plastic", plastic),
        ("metal", Material { metallic: 1.0, ..plastic }),
        ("coat", Material { coat: 1.0, coat_tint: [0.9, 0.5, 0.5], ..plastic }),
        ("rough glass", glass(0.3)),
        ("clear glass", glass(0.0)),
        ("half there", Material { alpha: 0.4, ..plastic }),
    ] {
        let blocks = floor_and_box(material);
        let by_voxels = picture(&blocks, &[false, false], Mode::Path);
        assert!(by_voxels.color.pixels.iter().flatten().all(|v| v.is_finite()));
        for as_mesh in [[false, true], [true, false], [true, true]] {
            let count = unlike(&by_voxels, &picture(&blocks, &as_mesh, Mode::Path));
            assert!(count <= UNLIKE_AT_MOST, "{what}, meshes {as_mesh:?}: {count} pixels differ");
        }
        // Negative control: a box that is a twentieth longer.
        let mut longer = blocks.clone();
        longer[1].world_from_unit.matrix3.z_axis *= 1.05;
        let count = unlike(&by_voxels, &picture(&longer, &[true, true], Mode::Path));
        assert!(count > 4 * UNLIKE_AT_MOST, "{what}: {count} pixels tell a longer box");
    }
}

/// A face of a voxel and two triangles are sampled in different ways: the same light, different noise. Means of whole pictures differ by
/// less than four standard errors, and a box that is a tenth longer does not pass.
#[test]
fn a_cube_of_triangles_shines_as_a_voxel_does() {
    let shines = Material { emission: [2.0, 1.0, 0.5], ..lambert([0.3, 0.6, 0.9]) };
    let blocks = floor_and_box(shines);
    let drawn = |blocks: &[Block], as_mesh: AsMesh| {
        let (mut scene, volumes, meshes) = scene_of(blocks, as_mesh);
        scene.settings.mode = Mode::Path;
        let picture = draw(&scene, &volumes, &meshes, 64);
        let sum = |image: &Image| image.pixels.iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
        (sum(&picture.color), sum(picture.variance.as_ref().unwrap()))
    };
    let by_voxels = drawn(&blocks, &[false, false]);
    let apart = |other: (f64, f64)| (by_voxels.0 - other.0).abs() / (by_voxels.1 + other.1).sqrt();
    for as_mesh in [[false, true], [true, false], [true, true]] {
        let apart = apart(drawn(&blocks, &as_mesh));
        assert!(apart < 4.0, "meshes {as_mesh:?}: {apart} standard errors");
    }
    let mut longer = blocks.clone();
    longer[1].world_from_unit.matrix3.z_axis *= 1.1;
    assert!(apart(drawn(&longer, &[true, true])) > 4.0);
}

#[test]
fn direct_light_and_ambient_occlusion_are_those_of_voxels() {
    let mut blocks = floor_and_box(lambert([0.3, 0.6, 0.9]));
    // The box stands half in the floor.
    blocks[1].world_from_unit.translation.z -= 1.5;
    for mode in [Mode::OneBounce, Mode::AmbientOcclusion] {
        let by_voxels = picture(&blocks, &[false, false], mode);
        for as_mesh in [[false, true], [true, false], [true, true]] {
            let count = unlike(&by_voxels, &picture(&blocks, &as_mesh, mode));
            assert!(count <= UNLIKE_AT_MOST, "{mode:?}, meshes {as_mesh:?}: {count} pixels differ");
        }
    }
}

#[test]
fn a_mesh_stands_in_a_glass_label_as_in_glass_of_triangles() {
    let mut blocks = floor_and_box(glass(0.0)).to_vec();
    blocks.push(Block {
        world_from_unit: at([0.6, 0.5, 0.9], 0.2, [-0.6, 0.0, 1.0]),
        material: lambert([0.9, 0.2, 0.1]),
    });
    let of_triangles = picture(&blocks, &[true, true, true], Mode::Path);
    let count = unlike(&of_triangles, &picture(&blocks, &[true, false, true], Mode::Path));
    assert!(count <= UNLIKE_AT_MOST, "{count} pixels differ");
    let without = picture(&blocks[..2], &[true, false], Mode::Path);
    let count = unlike(&of_triangles, &without);
    assert!(count > 5 * UNLIKE_AT_MOST, "{count} pixels tell whether it is there");
}

#[test]
fn a_lamp_inside_of_a_label_lights_a_mesh_that_is_inside_too() {
    // Many boxes make the label: the seams between them cast no shadows.
    let (mut scene, _, meshes) = scene_of(&floor_and_box(lambert([0.5; 3])), &[true, true]);
    scene.settings.mode = Mode::OneBounce;
    scene.suns.clear();
    scene.world.environment = Environment::Constant { radiance: [0.0; 3] };
    let in_the_open = draw(&scene, &[], &meshes, 2);
    scene.instances = vec![Instance {
        id: 9,
        source: "memory".into(),
        reading: Reading::default(),
        world_from_index: at([0.5; 3], 0.0, [-10.0, -10.0, -10.0]),
        style: LabelStyle { material: lambert([0.0; 3]), ..LabelStyle::default() },
    }];
    let inside = draw(&scene, &[voxels(40)], &meshes, 2);
    let dark = inside.color.pixels.iter().filter(|p| p[0] == 0.0).count();
    assert!(dark < 900, "{dark} of 1,024 pixels are dark");
    let unlike = in_the_open.color.pixels.iter().zip(&inside.color.pixels).filter(|(a, b)| !all(a, b));
    assert_eq!(unlike.count(), 0);
}

#[test]
fn each_face_has_its_own_material_and_the_last_stands_for_those_past_the_end() {
    let (mut scene, _, _) = scene_of(&floor_and_box(lambert([0.5; 3])), &[true, true]);
    scene.meshes.remove(0);
    let colors = [[0.9, 0.0, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, 0.9]];
    scene.meshes[0].materials = colors.map(lambert).to_vec();
    let mesh = cube_of(1.0, 2, |face| face as u32);
    let drawn = draw(&scene, &[], &[mesh], 1);
    let seen = drawn.albedo.unwrap();
    let world_from_unit = scene.meshes[0].world_from_mesh;
    let normals = drawn.normal.unwrap();
    let mut faces = [0; 6];
    for (albedo, normal) in seen.pixels.iter().zip(&normals.pixels) {
        let n = DVec3::from(normal.map(f64::from));
        if n == DVec3::ZERO {
            assert_eq!(*albedo, [0.0; 3]);
            continue;
        }
        // Covectors are transformed back by the transpose.
        let n = (world_from_unit.matrix3.transpose() * n).to_array();
        let axis = (0..3).max_by(|&a, &b| n[a].abs().total_cmp(&n[b].abs())).unwrap();
        let face = 2 * axis + usize::from(n[axis] > 0.0);
        faces[face] += 1;
        assert_eq!(*albedo, colors[face.min(2)], "face {face}");
    }
    assert!(faces.iter().filter(|&&n| n > 10).count() == 3, "three faces are seen: {faces:?}");
    assert!(drawn.label.unwrap().iter().all(|&l| l == 0), "a mesh has no label");
}

#[test]
fn an_edit_makes_anew_what_it_changes_alone() {
    let (scene, volumes, meshes) = scene_of(&floor_and_box(lambert([0.5; 3])), &[false, true]);
    let mut renderer = crate::renderer();
    renderer.set_scene(&loaded(&scene, &volumes, &meshes)).unwrap();
    let job = Job::new();
    let mut picture_of = |scene: &Scene, volumes: &[_], meshes: &[_]| {
        let before = renderer.rebuilt();
        renderer.set_scene(&loaded(scene, volumes, meshes)).unwrap();
        renderer.advance(Duration::ZERO, 1, &job).unwrap();
        let after = renderer.rebuilt();
        let made = (after.acceleration - before.acceleration, after.materials - before.materials);
        (made, renderer.picture().unwrap())
    };
    let check = |what: &str, expected: (u64, u64), got: ((u64, u64), Picture), anew: Picture| {
        assert_eq!(got.0, expected, "{what}");
        assert_eq!(unlike(&got.1, &anew), 0, "{what}");
    };
    let mut moved = scene.clone();
    moved.meshes[0].world_from_mesh.translation.x += 1.0;
    let got = picture_of(&moved, &volumes, &meshes);
    check("moved", (0, 0), got, draw(&moved, &volumes, &meshes, 1));
    moved.meshes[0].materials[0].base_color = [0.1, 0.2, 0.3];
    let got = picture_of(&moved, &volumes, &meshes);
    check("coloured", (0, 1), got, draw(&moved, &volumes, &meshes, 1));
    // Other triangles under the same name.
    let others = [cube(0.5, 1)];
    let got = picture_of(&moved, &volumes, &others);
    check("other triangles", (1, 1), got, draw(&moved, &volumes, &others, 1));
    // With one more volume before it, the mesh has another index. The second volume is the first one's data, with the same materials.
    let mut more = moved.clone();
    more.instances.push(Instance { id: 7, ..more.instances[0].clone() });
    more.instances[1].world_from_index.translation.z += 5.0;
    let two = [Arc::clone(&volumes[0]), Arc::clone(&volumes[0])];
    let got = picture_of(&more, &two, &others);
    check("another volume", (0, 0), got, draw(&more, &two, &others, 1));
}

#[test]
fn what_is_not_drawn_of_a_mesh_is_refused_by_name() {
    let (scene, volumes, _) = scene_of(&floor_and_box(lambert([0.5; 3])), &[false, true]);
    let refusal = |scene: &Scene, meshes: &[Arc<MeshData>]| {
        let loaded = LoadedScene::new(scene.clone(), volumes.clone(), meshes.to_vec());
        loaded.and_then(|scene| crate::renderer().set_scene(&scene)).unwrap_err().to_string()
    };
    assert_eq!(refusal(&scene, &[]), "meshes: expected one mesh for each of 1, got 0");
    let huge = [cube(1e300, 1)];
    let told = refusal(&scene, &huge);
    assert!(told.starts_with("meshes[0]: expected a longest side from 1e-270 to 1e270, got 1e300"), "{told}");
    // A mesh without triangles draws nothing.
    let nothing = [Arc::new(MeshData::default())];
    let loaded = LoadedScene::new(scene, volumes, nothing.to_vec()).unwrap();
    assert!(crate::renderer().set_scene(&loaded).is_ok());
}
