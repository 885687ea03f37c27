//! Writes scenes of generated volumes as glTF, PLY, OBJ and STL, for tests that read them with other programs.
//!
//! ```text
//! cargo run -p pumice-export --example write_mesh_scenes -- FOLDER
//!     FOLDER/NAME.FORM.gltf, .glb          the scene, with its volume in each form; a .bin beside the .gltf
//!     FOLDER/NAME.{voxels,smooth}.{ply,obj,stl}   its exact and its smoothed surface; of "part", within a region; an .mtl beside the .obj
//!     FOLDER/NAME.json                     the scene itself
//!     FOLDER/NAME.labels                   dims as 3 u32; whether each label is shown, dense index + 1 at each voxel (u32), x fastest
//! ```
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_export::{ExportOptions, Form, Merging, Reader, VoxelRegion, export_scene};
use pumice_oracle::{Dense, volumes};
use pumice_scene::{
    LabelStyle, Light, LightShape, Material, Mesh, Outline, Projection, Scene, SensorFit, Show, Sun,
};
use pumice_transport::LoadedScene;

#[path = "generated/mod.rs"]
mod generated;

use generated::{Outcome, write_labels};

/// A scene with a sun alone, seen by a camera that is tilted.
fn scene(style: LabelStyle, world_from_index: DAffine3) -> Scene {
    let tilted = DAffine3::from_mat3_translation(DMat3::from_rotation_x(0.4), DVec3::new(1.0, -40.0, 100.0));
    let sun = Sun { direction: [1.0, 2.0, -2.0], strength: 3.0, color: [1.0, 0.9, 0.5], angle_rad: 0.01 };
    Scene { suns: vec![sun], ..generated::scene(style, world_from_index, tilted) }
}

fn lamp(shape: LightShape, power_w: f32, color: [f32; 3]) -> Light {
    Light { shape, power_w, color, visible_to_camera: false }
}

fn lamps() -> Vec<Light> {
    let (position, radius, soft_falloff) = ([3.0, -2.0, 50.0], 0.5, true);
    let direction = [0.0, 1.0, -3.0];
    let area = LightShape::Area {
        world_from_light: DAffine3::IDENTITY,
        outline: Outline::Rectangle,
        size: [1.0, 2.0],
        spread_rad: 3.0,
    };
    let spot =
        |angle_rad, blend| LightShape::Spot { position, direction, radius, angle_rad, blend, soft_falloff };
    vec![
        lamp(LightShape::Point { position, radius, soft_falloff }, 100.0, [1.0; 3]),
        lamp(spot(0.8, 0.25), 50.0, [2.0, 1.0, 0.5]),
        lamp(spot(std::f64::consts::PI, 0.0), 20.0, [1.0; 3]),
        lamp(area, 5.0, [1.0; 3]),
    ]
}

fn mesh(id: u32, world_from_mesh: DAffine3, shadow_catcher: bool) -> Mesh {
    let red = Material { base_color: [0.9, 0.1, 0.05], ..Material::DEFAULT };
    let materials = vec![Material::DEFAULT, red];
    Mesh { id, source: "generated".into(), world_from_mesh, materials, shadow_catcher }
}

/// A pyramid, smooth or flat, of which one triangle has no area, in two materials.
fn pyramid(is_smooth: bool) -> Outcome<Arc<MeshData>> {
    let corners = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.5]];
    let triangles = vec![[0, 1, 4], [1, 2, 4], [2, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]];
    let data = MeshData::new(corners, triangles, vec![0, 1, 0, 0, 9, 1, 0])?;
    let normals = [[1.0, 0.0, 0.3], [0.0, 1.0, 0.3], [-1.0, 0.0, 0.3], [0.0, -1.0, 0.3], [0.0, 0.0, 1.0]];
    Ok(Arc::new(if is_smooth { data.with_corner_normals(&normals)? } else { data }))
}

fn write(
    folder: &Path,
    name: &str,
    (dense, volume): (Dense, Arc<CompressedVolume>),
    (scene, meshes): (Scene, Vec<Arc<MeshData>>),
    (forms, merging, region): (&[Form], Merging, Option<VoxelRegion>),
) -> Outcome {
    serde_json::to_writer(File::create(folder.join(format!("{name}.json")))?, &scene)?;
    let loaded = LoadedScene::new(scene, vec![volume], meshes)?;
    write_labels(folder, name, &dense, &loaded)?;
    for &form in forms {
        let options = ExportOptions {
            forms: vec![form],
            merging,
            limit_bytes: 1 << 30,
            surroundings: true,
            reader: Reader::Specification,
            region,
        };
        let endings = ["gltf", "glb", "ply", "obj", "stl"];
        for ending in if matches!(form, Form::Voxels | Form::Smooth) { &endings } else { &endings[..2] } {
            let path = folder.join(format!("{name}.{}.{ending}", form.name()));
            export_scene(&loaded, &options, &path, &mut |_| (), &Job::new())?;
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
    let exact = (&[Form::Voxels][..], Merging::Merged, None);
    let region = VoxelRegion::new([5, 0, 9], [66, 41, 30])?;
    // The smoothed surface takes longest, and is written of the smaller scenes alone.
    let [exact_forms, all_forms]: [&[Form]; 2] = [&Form::ALL[..4], &Form::ALL];
    for (name, forms, region) in [("blobs", exact_forms, None), ("part", all_forms, Some(region))] {
        let blobs = volumes::blobs([70, 64, 33], 40, 30, 4);
        let merged = (forms, Merging::Merged, region);
        write(folder, name, blobs, (scene(auto.clone(), turned), vec![]), merged)?;
    }

    // Every parameter of materials, in a sheared frame, with lamps and meshes; an orthographic camera with a limit.
    let glass = Material { transmission: 1.0, roughness: 0.1, ior: 1.33, specular: 0.8, ..Material::DEFAULT };
    let glow = Material {
        emission: [5.0, 4.0, 3.0],
        coat: 0.5,
        coat_roughness: 0.2,
        alpha: 0.25,
        sheen: 0.75,
        sheen_tint: [1.0, 0.5, 0.2],
        sheen_roughness: 0.4,
        ..Material::DEFAULT
    };
    let metal =
        Material { metallic: 1.0, specular: 0.25, specular_tint: [0.2, 0.4, 0.6], ..Material::DEFAULT };
    let some = LabelStyle {
        show: Show::Except(vec![2]),
        materials: [(1, glass), (3, glow), (4, metal), (5, glass)].into(),
        ..LabelStyle::default()
    };
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.5, 2.0, 0.0), DVec3::new(-0.25, 0.1, 3.0));
    let sheared = DAffine3::from_mat3_translation(shear, DVec3::new(-5.0, 1.0, 2.0));
    let mut all = scene(some, sheared);
    all.camera.projection = Projection::Orthographic { scale: 30.0 };
    all.camera.fit = SensorFit::Vertical;
    all.camera.clip = [0.5, 500.0];
    all.lights = lamps();
    let mirrored = DAffine3::from_scale_rotation_translation(
        DVec3::new(-2.0, 2.0, 3.0),
        glam::DQuat::from_rotation_y(0.3),
        DVec3::new(20.0, 0.0, 0.0),
    );
    all.meshes = vec![mesh(1, mirrored, false), mesh(2, sheared, false), mesh(3, sheared, true)];
    let data = vec![pyramid(false)?, pyramid(true)?, pyramid(false)?];
    let noise = volumes::noise([17, 9, 5], 0.3, 6, 2);
    write(folder, "noise", noise, (all, data), (&Form::ALL, Merging::Plain, None))?;

    // More voxels along an axis than positions of 16 bits reach, and more labels than 8 bits number.
    let long = volumes::volume([70_001, 1, 1], |x, _, _| if x / 300 % 7 < 4 { 1 + x / 20_000 } else { 0 });
    let coarse = (&[Form::Cells][..], Merging::Merged, None);
    write(folder, "long", long, (scene(auto, turned), vec![]), coarse)?;
    let many = volumes::volume([7, 7, 7], |x, y, z| 1 + x + 7 * (y + 7 * z));
    write(folder, "many", many, (scene(LabelStyle::default(), turned), vec![]), exact)
}
