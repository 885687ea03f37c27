//! Writes scenes of generated volumes as stages, in both forms and with every form of volumes, for tests that open them with other programs.
//!
//! ```text
//! cargo run -p pumice-export --example write_scenes -- FOLDER
//!     FOLDER/NAME.usda, NAME.usdc    the stage
//!     FOLDER/NAME.labels             dims as 3 u32; whether each label is shown, and its dense index + 1 at each voxel (u32), x fastest
//! ```
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use pumice_core::{CompressedVolume, Job};
use pumice_export::usd::{write_usda, write_usdc};
use pumice_export::{Budget, ExportOptions, FaceBytes, Form, Merging, stage_of_scene};
use pumice_oracle::{Dense, volumes};
use pumice_scene::{
    Camera, Environment, Film, Filter, Instance, LabelStyle, Material, Projection, SCENE_VERSION, Scene,
    Settings, Show, World,
};
use pumice_transport::LoadedScene;

fn scene(style: LabelStyle, world_from_index: DAffine3) -> Scene {
    let camera = Camera::new(
        DAffine3::from_translation(DVec3::new(0.0, 0.0, 100.0)),
        Projection::Perspective { fov_rad: 0.7 },
    );
    Scene {
        version: SCENE_VERSION,
        instances: vec![Instance { id: 7, source: "generated".into(), world_from_index, style }],
        camera,
        film: Film::new(64, 48, Filter::Box { width: 1.0 }),
        world: World { environment: Environment::Constant { radiance: [1.0; 3] }, backdrop: None },
        suns: vec![],
        lights: vec![],
        meshes: vec![],
        cuts: vec![],
        settings: Settings::default(),
    }
}

fn write(
    folder: &Path,
    name: &str,
    (dense, volume): (Dense, Arc<CompressedVolume>),
    scene: Scene,
    merging: Merging,
) -> Result<(), Box<dyn std::error::Error>> {
    let loaded = LoadedScene::new(scene, vec![volume], vec![])?;
    let mut notes = BufWriter::new(File::create(folder.join(format!("{name}.labels")))?);
    let visible = loaded.visible(0).into_iter().map(u32::from);
    for number in dense.dims.into_iter().chain([loaded.visible(0).len() as u32]).chain(visible) {
        notes.write_all(&number.to_le_bytes())?;
    }
    notes.write_all(bytemuck::cast_slice(&dense.labels))?;
    notes.flush()?;
    let options = ExportOptions { forms: Form::ALL.to_vec(), merging, limit_bytes: 1 << 30 };
    let mut budget = Budget::new(options.limit_bytes, FaceBytes { a_face: 1, a_box: 1 });
    let stage = stage_of_scene(&loaded, &options, &mut budget, &Job::new())?;
    let file = |form: &str| File::create(folder.join(format!("{name}.{form}"))).map(BufWriter::new);
    write_usda(&stage, &mut file("usda")?)?;
    write_usdc(&stage, &mut file("usdc")?)?;
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("expected a folder")?;
    let folder = Path::new(&folder);
    let auto = LabelStyle { auto_color: true, ..LabelStyle::default() };
    let turned = DAffine3::from_mat3_translation(
        DMat3::from_rotation_z(0.5) * DMat3::from_diagonal(DVec3::new(4.0, -4.0, 40.0)),
        DVec3::new(1e4, -0.1, 3.0),
    );
    write(folder, "blobs", volumes::blobs([70, 64, 33], 40, 30, 4), scene(auto, turned), Merging::Merged)?;
    let glass = Material { transmission: 1.0, roughness: 0.1, ..Material::DEFAULT };
    let glow = Material { emission: [5.0, 4.0, 3.0], coat: 0.5, alpha: 0.25, ..Material::DEFAULT };
    let some = LabelStyle {
        show: Show::Except(vec![2]),
        materials: [(1, glass), (3, glow), (5, glass)].into(),
        ..LabelStyle::default()
    };
    let noise = volumes::noise([17, 9, 5], 0.3, 6, 2);
    write(folder, "noise", noise, scene(some, DAffine3::IDENTITY), Merging::Plain)
}
