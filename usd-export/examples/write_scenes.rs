//! Writes scenes of generated volumes as stages, in both forms and with every form of volumes, for tests that open them with other programs;
//! and scenes that have everything around a volume.
//!
//! ```text
//! cargo run -p pumice-export --example write_scenes -- FOLDER
//!     FOLDER/NAME.usda, NAME.usdc    the stage
//!     FOLDER/NAME.labels             dims as 3 u32; whether each label is shown, and its dense index + 1 at each voxel (u32), x fastest
//!     FOLDER/{everything,wide,parallel}.{json,usda,usdc,usdz}    the scene in Pumice's own form, and its stages
//!     FOLDER/everything_for_blender.usdc, …
//! ```
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_export::usd::{write_usda, write_usdc};
use pumice_export::{
    Budget, ExportOptions, FaceBytes, Form, Merging, Reader, VoxelRegion, export_scene, stage_of_scene,
};
use pumice_oracle::{Dense, volumes};
use pumice_scene::{
    Aperture, Environment, LabelStyle, Light, LightShape, Material, Mesh, Outline, Projection, Scene,
    SensorFit, Show, Sun,
};
use pumice_transport::LoadedScene;

#[path = "generated/mod.rs"]
mod generated;

use generated::{Outcome, write_labels};

/// A scene seen from far above.
fn scene(style: LabelStyle, world_from_index: DAffine3) -> Scene {
    generated::scene(style, world_from_index, DAffine3::from_translation(DVec3::new(0.0, 0.0, 100.0)))
}

fn write(
    folder: &Path,
    name: &str,
    (dense, volume): (Dense, Arc<CompressedVolume>),
    scene: Scene,
    (merging, region): (Merging, Option<VoxelRegion>),
) -> Outcome {
    let loaded = LoadedScene::new(scene, vec![volume], vec![])?;
    write_labels(folder, name, &dense, &loaded)?;
    let options = ExportOptions {
        forms: Form::ALL.to_vec(),
        merging,
        limit_bytes: 1 << 30,
        surroundings: false,
        reader: Reader::Specification,
        region,
    };
    let mut budget = Budget::new(options.limit_bytes, FaceBytes { a_face: 1, a_smooth_face: 1, a_box: 1 });
    let stage = stage_of_scene(&loaded, &options, None, &mut budget, &Job::new())?;
    let file = |form: &str| File::create(folder.join(format!("{name}.{form}"))).map(BufWriter::new);
    write_usda(&stage, &mut file("usda")?)?;
    write_usdc(&stage, &mut file("usdc")?)?;
    Ok(())
}

/// A light square that emits along −z of the world, from above, with sides of 3 and 8.
fn area(outline: Outline, spread_rad: f64) -> LightShape {
    let turned = DMat3::from_rotation_z(0.3) * DMat3::from_diagonal(DVec3::new(2.0, 4.0, 0.5));
    let world_from_light = DAffine3::from_mat3_translation(turned, DVec3::new(3.0, 4.0, 60.0));
    LightShape::Area { world_from_light, outline, size: [1.5, 2.0], spread_rad }
}

fn lights() -> Vec<Light> {
    let (position, direction) = ([10.0, -20.0, 30.0], [-1.0, 2.0, -3.0]);
    let spot = |angle_rad, blend| LightShape::Spot {
        position,
        direction,
        radius: 0.25,
        angle_rad,
        blend,
        soft_falloff: false,
    };
    [
        LightShape::Point { position, radius: 0.5, soft_falloff: true },
        LightShape::Point { position, radius: 0.0, soft_falloff: false },
        spot(1.2, 0.15),
        spot(3.0, 0.5),
        area(Outline::Rectangle, 1.0),
        area(Outline::Ellipse, std::f64::consts::PI),
    ]
    .into_iter()
    .zip(1..)
    .map(|(shape, number)| Light {
        shape,
        power_w: 1000.0 * number as f32,
        color: [1.0, 0.5, 0.1 * number as f32],
        visible_to_camera: number == 1,
    })
    .collect()
}

/// A floor of two triangles with two materials, mirrored and sheared, and a ball whose corners are shaded smooth but for one triangle.
fn meshes() -> Outcome<Vec<(Mesh, MeshData)>> {
    let corners = vec![[0.0; 3], [4.0, 0.0, 0.0], [4.0, 3.0, 1.0], [0.0, 3.0, 1.0]];
    let floor = MeshData::new(corners, vec![[0, 1, 2], [0, 2, 3]], vec![0, 9])?;
    let ends = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]];
    let ends: Vec<[f64; 3]> = ends.into_iter().chain([[0.0, 0.0, -1.0]]).collect();
    let triangles =
        vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    let mut normals: Vec<[f32; 3]> =
        triangles.iter().flatten().map(|&c: &u32| ends[c as usize].map(|v| 2.0 * v as f32)).collect();
    normals[..3].fill([0.0; 3]);
    let ball = MeshData::new(ends, triangles, vec![])?.with_triangle_normals(&normals)?;
    let red = Material { base_color: [0.8, 0.1, 0.1], ..Material::DEFAULT };
    let metal = Material { metallic: 1.0, ..Material::DEFAULT };
    let sheared = DMat3::from_cols(DVec3::new(-2.0, 0.0, 0.0), DVec3::new(0.5, 1.0, 0.0), DVec3::Z);
    let of = |id, matrix, materials, shadow_catcher| Mesh {
        id,
        source: format!("/somewhere/else/mesh {id}.ply").into(),
        world_from_mesh: DAffine3::from_mat3_translation(matrix, DVec3::new(1.0, 2.0, -5.0)),
        materials,
        shadow_catcher,
    };
    let empty = of(1, DMat3::IDENTITY, vec![red], false);
    Ok(vec![
        (of(3, sheared, vec![red, metal], false), floor),
        (of(8, DMat3::IDENTITY, vec![metal], true), ball),
        (empty, MeshData::default()),
    ])
}

/// The three scenes that have everything around a volume: their names and what differs.
fn surrounded(folder: &Path) -> Outcome<[(&'static str, Scene); 3]> {
    let picture = folder.join("a sky @home @@@.exr");
    let shade = |x: usize, y: usize| (0.1 + x as f32 / 64.0, y as f32 / 32.0, 0.5);
    exr::prelude::write_rgb_file(&picture, 64, 32, shade)?;
    let mut scene = scene(LabelStyle::default(), DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0)));
    scene.instances[0].source = "/somewhere/else/generated.nrrd".into();
    let pose =
        DMat3::from_euler(glam::EulerRot::XYZ, 0.9, -0.2, 0.4) * DMat3::from_diagonal(DVec3::splat(3.0));
    scene.camera.world_from_camera = DAffine3::from_mat3_translation(pose, DVec3::new(20.0, -60.0, 45.0));
    scene.camera.shift = [0.1, -0.05];
    let opening = Aperture { radius: 0.05, focus_distance: 70.0, blades: 6, rotation_rad: 0.2, ratio: 1.5 };
    scene.camera.aperture = Some(opening);
    let sun = |angle_rad, strength| Sun {
        direction: [0.2, 0.3, -2.0],
        strength,
        color: [1.0, 0.9, 0.8],
        angle_rad,
    };
    scene.suns = vec![sun(0.1, 3.5), sun(0.0, 2.0)];
    scene.lights = lights();
    scene.meshes = meshes()?.into_iter().map(|(mesh, _)| mesh).collect();
    scene.world.environment = Environment::Image { path: picture, rotation_rad: 0.7, strength: 2.0 };
    let mut wide = scene.clone();
    wide.camera.fit = SensorFit::Vertical;
    wide.camera.clip = [0.5, 1000.0];
    wide.camera.aperture = None;
    wide.camera.world_from_camera.matrix3.x_axis *= -1.0;
    (wide.film.width, wide.film.height, wide.film.pixel_aspect) = (64, 100, 2.0);
    wide.world.environment = Environment::Constant { radiance: [0.5, 2.5, 1.0] };
    wide.world.backdrop = Some([[0.0; 3], [1.0, 0.5, 0.25]]);
    let mut parallel = scene.clone();
    parallel.camera.projection = Projection::Orthographic { scale: 25.0 };
    (parallel.film.width, parallel.film.height) = (30, 70);
    parallel.world.environment = Environment::Constant { radiance: [0.0; 3] };
    Ok([("everything", scene), ("wide", wide), ("parallel", parallel)])
}

fn write_surrounded(folder: &Path) -> Outcome {
    let volume = volumes::noise([17, 9, 5], 0.3, 6, 2).1;
    let data: Vec<Arc<MeshData>> = meshes()?.into_iter().map(|(_, data)| Arc::new(data)).collect();
    for (name, scene) in surrounded(folder)? {
        scene.save(&folder.join(format!("{name}.json")))?;
        let loaded = LoadedScene::new(scene, vec![Arc::clone(&volume)], data.clone())?;
        for (file, reader) in [
            (format!("{name}.usda"), Reader::Specification),
            (format!("{name}.usdc"), Reader::Specification),
            (format!("{name}.usdz"), Reader::Specification),
            (format!("{name}_for_blender.usdc"), Reader::Blender),
        ] {
            let options = ExportOptions {
                forms: vec![Form::Voxels],
                merging: Merging::Merged,
                limit_bytes: 1 << 30,
                surroundings: true,
                reader,
                region: None,
            };
            export_scene(&loaded, &options, &folder.join(file), &mut |_| (), &Job::new())?;
        }
    }
    Ok(())
}

fn main() -> Outcome {
    let folder = std::env::args().nth(1).ok_or("expected a folder")?;
    let folder = Path::new(&folder);
    let auto = LabelStyle { auto_color: true, ..LabelStyle::default() };
    let turned = DAffine3::from_mat3_translation(
        DMat3::from_rotation_z(0.5) * DMat3::from_diagonal(DVec3::new(4.0, -4.0, 40.0)),
        DVec3::new(1e4, -0.1, 3.0),
    );
    let region = VoxelRegion::new([5, 0, 9], [66, 41, 30])?;
    for (name, region) in [("blobs", None), ("part", Some(region))] {
        let blobs = volumes::blobs([70, 64, 33], 40, 30, 4);
        write(folder, name, blobs, scene(auto.clone(), turned), (Merging::Merged, region))?;
    }
    let glass = Material { transmission: 1.0, roughness: 0.1, ..Material::DEFAULT };
    let glow = Material { emission: [5.0, 4.0, 3.0], coat: 0.5, alpha: 0.25, ..Material::DEFAULT };
    let some = LabelStyle {
        show: Show::Except(vec![2]),
        materials: [(1, glass), (3, glow), (5, glass)].into(),
        ..LabelStyle::default()
    };
    let noise = volumes::noise([17, 9, 5], 0.3, 6, 2);
    write(folder, "noise", noise, scene(some, DAffine3::IDENTITY), (Merging::Plain, None))?;
    write_surrounded(folder)
}
