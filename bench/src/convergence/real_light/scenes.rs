//! The scenes of the bench: figures of shipped volumes in the light that artists use.
//!
//! | scene | volume | light | labels besides rough plastic |
//! |---|---|---|---|
//! | `sky-floor` | nuclei | a constant sky | clear glass |
//! | `hdr-spots` | brain regions | a picture with small bright spots | metal, coat |
//! | `sun-and-sky` | cortex | a clear sky and the sun | coat |
//! | `area-lights` | nuclei | three area lights from 0.3 to 4 units, and a spot | metal |
//! | `hdr-area-floor` | brain regions | the picture with spots and an area light | coat |
//! | `many-lamps` | cortex | 100 small lamps and emissive labels | metal, emission |
//!
//! All but `hdr-spots` have a floor, a mesh. A figure spans 10 units about the origin, and the camera stands in front of it and above. Glass
//! is only where labels do not touch and no light is small: elsewhere single bright paths through glass decide the variance of both
//! programs, and its interval says nothing.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use glam::{DAffine3, DMat3, DVec3};
use pumice_core::CompressedVolume;
use pumice_picture::{Image, Picture, write_exr};
use pumice_scene::{
    Environment, LabelGroup, LabelGroups, LabelMaterials, Light, LightShape, Material, Outline, Passes,
    Scene, SceneError, Sun,
};
use pumice_session::error::{Result, SessionError};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::selection::select_labels;
use pumice_transport::sun::frame_around;

use super::skies;
use crate::ray_sets::mix;

/// A scene of the bench (see the module).
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LightScene {
    /// A constant sky.
    SkyFloor,
    /// A picture with small bright spots.
    HdrSpots,
    /// A clear sky and the sun.
    SunAndSky,
    /// Three area lights and a spot.
    AreaLights,
    /// The picture with spots and an area light.
    HdrAreaFloor,
    /// 100 lamps and emissive labels.
    ManyLamps,
}

/// What all scenes have in common.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Figure {
    /// Width and height in pixels.
    pub(crate) size: [u32; 2],
    /// Number of labels, the longest ones.
    pub(crate) pick: usize,
    /// Bounces, as `settings.bounces` of a scene.
    pub(crate) bounces: u32,
}

/// Radiance of the sky where lamps light the scene.
const DUSK: [f32; 3] = [0.02, 0.022, 0.025];

/// The material of a third of the labels, and of the floor.
const PLASTIC: Material = Material { roughness: 0.6, ..Material::DEFAULT };
const METAL: Material =
    Material { base_color: [0.9, 0.65, 0.3], metallic: 1.0, roughness: 0.25, ..Material::DEFAULT };
const GLASS: Material =
    Material { base_color: [0.95; 3], transmission: 1.0, roughness: 0.0, ..Material::DEFAULT };
const COAT: Material =
    Material { base_color: [0.6, 0.08, 0.05], coat: 1.0, roughness: 0.5, ..Material::DEFAULT };
const GLOWING: Material =
    Material { base_color: [0.2; 3], emission: [3.0, 1.8, 0.6], roughness: 0.8, ..Material::DEFAULT };

impl LightScene {
    /// Name on the command line, in tables and of files.
    pub fn name(self) -> &'static str {
        match self {
            Self::SkyFloor => "sky-floor",
            Self::HdrSpots => "hdr-spots",
            Self::SunAndSky => "sun-and-sky",
            Self::AreaLights => "area-lights",
            Self::HdrAreaFloor => "hdr-area-floor",
            Self::ManyLamps => "many-lamps",
        }
    }

    /// Place of its volume among nuclei, brain regions and cortex; of other lists of volumes it takes the one at this place, modulo their
    /// number.
    pub(super) fn volume(self) -> usize {
        match self {
            Self::SkyFloor | Self::AreaLights => 0,
            Self::HdrSpots | Self::HdrAreaFloor => 1,
            Self::SunAndSky | Self::ManyLamps => 2,
        }
    }

    /// Writes the scene of `volume`, whose file is the absolute path `source`, to `NAME.json` in `folder`, with its sky beside it. Returns
    /// the scene with absolute paths.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(super) fn write(
        self,
        folder: &Path,
        volume: &CompressedVolume,
        source: PathBuf,
        figure: Figure,
    ) -> Result<Scene> {
        let path = folder.join(format!("{}.json", self.name()));
        let in_file = |source: SceneError| SessionError::Scene { path: path.clone(), source };
        let labels = select_labels(volume, figure.pick);
        let ids: Vec<u64> = labels.iter().map(|&label| volume.labels().ids()[label as usize]).collect();
        let options = FigureOptions {
            size: figure.size,
            labels: Some(labels),
            floor: self != Self::HdrSpots,
            ..FigureOptions::default()
        };
        let mut scene = compose(volume, source, &options);
        for floor in &mut scene.meshes {
            floor.shadow_catcher = false;
            floor.materials = vec![PLASTIC];
        }
        let style = &mut scene.instances[0].style;
        style.material = PLASTIC;
        style.materials = LabelMaterials::default();
        style.groups = groups(&ids, self.materials()).map_err(in_file)?;
        scene.world.backdrop = None;
        scene.world.environment = self.environment(folder)?;
        scene.suns = self.suns();
        scene.lights = self.lamps();
        scene.settings.bounces = figure.bounces;
        scene.save(&path).map_err(in_file)?;
        Ok(scene)
    }

    /// Materials besides rough plastic.
    fn materials(self) -> &'static [Material] {
        match self {
            Self::SkyFloor => &[GLASS],
            Self::HdrSpots => &[METAL, COAT],
            Self::SunAndSky | Self::HdrAreaFloor => &[COAT],
            Self::AreaLights => &[METAL],
            Self::ManyLamps => &[METAL, GLOWING],
        }
    }

    fn environment(self, folder: &Path) -> Result<Environment> {
        let picture = |name: &str, image: Image| {
            let path = folder.join(name);
            write_exr(&path, &Picture::of(image), &Passes::NONE)?;
            Ok(Environment::Image { path, rotation_rad: 0.4, strength: 1.0 })
        };
        match self {
            Self::SkyFloor => Ok(Environment::Constant { radiance: [0.8, 0.85, 0.95] }),
            Self::HdrSpots | Self::HdrAreaFloor => picture("spots.exr", skies::spots()),
            Self::SunAndSky => picture("clear.exr", skies::clear(toward_sun())),
            Self::AreaLights | Self::ManyLamps => Ok(Environment::Constant { radiance: DUSK }),
        }
    }

    fn suns(self) -> Vec<Sun> {
        match self {
            Self::SunAndSky => vec![Sun {
                direction: (-toward_sun()).to_array(),
                strength: 2.5,
                color: [1.0, 0.93, 0.82],
                angle_rad: 0.0093,
            }],
            _ => Vec::new(),
        }
    }

    fn lamps(self) -> Vec<Light> {
        match self {
            Self::AreaLights => vec![
                area(DVec3::new(-6.0, -4.0, 5.0), Outline::Rectangle, [4.0, 4.0], 400.0),
                area(DVec3::new(6.0, -3.0, 4.0), Outline::Rectangle, [1.5, 1.0], 160.0),
                area(DVec3::new(1.0, 7.0, 5.0), Outline::Ellipse, [0.3, 0.3], 120.0),
                spot(DVec3::new(3.0, -6.0, 6.0)),
            ],
            Self::HdrAreaFloor => {
                vec![area(DVec3::new(-5.0, -4.0, 6.0), Outline::Rectangle, [2.0, 2.0], 300.0)]
            }
            Self::ManyLamps => (0..100).map(small_lamp).collect(),
            _ => Vec::new(),
        }
    }
}

/// Unit vector to the sun: from the left, 40° above the horizon, behind the camera.
fn toward_sun() -> DVec3 {
    DVec3::new(-0.6, -0.48, 0.64).normalize()
}

/// Groups of labels: of `materials.len() + 1` labels in a row, the first stays in no group, and each other one has one of the materials.
fn groups(ids: &[u64], materials: &[Material]) -> std::result::Result<LabelGroups, SceneError> {
    let group_of = |(place, material): (usize, &Material)| {
        let members = ids.iter().skip(place + 1).step_by(materials.len() + 1).copied().collect();
        LabelGroup::new(*material, members, Vec::new())
    };
    LabelGroups::new(materials.iter().enumerate().map(group_of).collect::<std::result::Result<_, _>>()?)
}

/// An area light at a point, which shines towards the figure.
fn area(position: DVec3, outline: Outline, size: [f64; 2], power_w: f32) -> Light {
    let away = position.normalize();
    let (x, y) = frame_around(away);
    let world_from_light = DAffine3 { matrix3: DMat3::from_cols(x, y, away), translation: position };
    let shape = LightShape::Area { world_from_light, outline, size, spread_rad: std::f64::consts::PI };
    Light { shape, power_w, color: [1.0; 3], visible_to_camera: false }
}

fn spot(position: DVec3) -> Light {
    let shape = LightShape::Spot {
        position: position.to_array(),
        direction: (-position).to_array(),
        radius: 0.1,
        angle_rad: 0.6,
        blend: 0.3,
        soft_falloff: false,
    };
    Light { shape, power_w: 1200.0, color: [0.9, 0.95, 1.0], visible_to_camera: false }
}

/// Lamp number `i` of a grid of 10 × 10 above the figure, at a height, with a power and a colour of its own.
fn small_lamp(i: u64) -> Light {
    let part = |which: u64| (mix(3 * i + which) >> 40) as f64 / f64::from(1 << 24);
    let place = |along: u64| 1.4 * (along as f64 - 4.5);
    let position = [place(i % 10), place(i / 10), 4.5 + 2.0 * part(0)];
    let warm = part(1) as f32;
    Light {
        shape: LightShape::Point { position, radius: 0.05, soft_falloff: false },
        power_w: (2.0 * 10f64.powf(part(2))) as f32,
        color: [1.0, 0.6 + 0.4 * warm, 0.3 + 0.7 * warm],
        visible_to_camera: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pumice_oracle::volumes::blobs;

    /// Each label has one material, and all materials have as many labels but for one.
    #[test]
    fn materials_take_turns() {
        let ids: Vec<u64> = (10..21).collect();
        let found = groups(&ids, &[METAL, COAT]).unwrap();
        let of: Vec<&[u64]> = found.iter().map(LabelGroup::ids).collect();
        assert_eq!(of, [&[11, 14, 17, 20][..], &[12, 15, 18]]);
        assert!(groups(&ids, &[]).unwrap().is_empty());
    }

    #[test]
    fn written_scenes_are_read_back_wherever_their_folder_is() {
        let (_, volume) = blobs([24; 3], 6, 6, 1);
        let folder = tempfile::tempdir().unwrap();
        let figure = Figure { size: [24, 16], pick: 6, bounces: 3 };
        for which in LightScene::value_variants() {
            let made = which.write(folder.path(), &volume, "/a/v.nrrd".into(), figure).unwrap();
            let path = folder.path().join(format!("{}.json", which.name()));
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(!text.contains(&folder.path().display().to_string()), "{text}");
            assert_eq!(Scene::load(&path).unwrap(), made, "{}", which.name());
            assert!(!made.meshes.iter().any(|m| m.shadow_catcher));
            let lit = made.suns.len() + made.lights.len();
            let expected = [0, 0, 1, 4, 1, 100][*which as usize];
            assert_eq!(lit, expected, "{}", which.name());
        }
    }

    #[test]
    fn area_lights_shine_at_the_figure() {
        let LightShape::Area { world_from_light, .. } =
            area(DVec3::new(3.0, -4.0, 12.0), Outline::Rectangle, [1.0; 2], 1.0).shape
        else {
            panic!("an area light")
        };
        // It emits along −z of its own space: 13 units along lies the origin.
        assert!(world_from_light.transform_point3(DVec3::new(0.0, 0.0, -13.0)).length() < 1e-12);
        assert!((world_from_light.matrix3.determinant() - 1.0).abs() < 1e-12);
    }
}
