//! Parts of a scene's light: scenes that have only some of it, which tell where its noise comes from.
//!
//! | part | what is left | noise |
//! |---|---|---|
//! | one kind of light | sky, sun, area lights, spots, small lamps or emissive labels alone, all bounces | a share of the whole's |
//! | direct light | all lights, no bounce | a share of the whole's |
//! | matte | all lights and bounces; every material Lambert | of another picture |
//! | unfiltered | everything, but each sample goes through the middle of its pixel | of another picture |
//!
//! Light adds up, so with one path for each light the noise of the kinds would add up to that of the whole. What the whole has beyond
//! their sum comes from choosing one light at a surface instead of sampling all, and from what the lights' paths have in common: the
//! position in the pixel and the directions of scattering.

use pumice_scene::{
    Environment, Filter, LabelGroup, LabelGroups, Light, LightShape, Material, Scene, SceneError,
};
use pumice_session::error::{Result, SessionError};

/// A part of a scene's light.
pub(super) struct Part {
    /// What is left.
    pub(super) name: String,
    /// The scene that has it.
    pub(super) scene: Scene,
    /// Whether its light is part of the whole's.
    pub(super) is_share: bool,
}

/// Width of the filter that lets samples only through the middle of a pixel, in pixels: the least that Blender takes.
const UNFILTERED: Filter = Filter::BlackmanHarris { width: 0.02 };

/// Parts that have the lamps of one kind.
const LAMPS: [&str; 3] = ["area lights alone", "spots alone", "small lamps alone"];

/// The part of [`LAMPS`] that has this lamp.
fn part_of(lamp: &Light) -> &'static str {
    match lamp.shape {
        LightShape::Area { .. } => LAMPS[0],
        LightShape::Spot { .. } => LAMPS[1],
        LightShape::Point { .. } => LAMPS[2],
    }
}

/// The parts of a scene, the whole first.
///
/// # Errors
/// None for scenes of the bench: groups stay as they are.
pub(super) fn parts_of(whole: &Scene) -> Result<Vec<Part>> {
    let glows = |m: &Material| m.emission != [0.0; 3];
    let dark = with_materials(whole, |m| Material { emission: [0.0; 3], ..m })?;
    let dark = Scene { suns: Vec::new(), lights: Vec::new(), ..dark };
    let unlit = Scene { world: black(whole), ..dark.clone() };
    let mut parts = vec![("whole".to_owned(), whole.clone(), true)];
    if whole.world.environment != unlit.world.environment {
        parts.push(("sky alone".into(), Scene { world: whole.world.clone(), ..dark }, true));
    }
    if !whole.suns.is_empty() {
        parts.push(("sun alone".into(), Scene { suns: whole.suns.clone(), ..unlit.clone() }, true));
    }
    for name in LAMPS {
        let lights: Vec<Light> = whole.lights.iter().filter(|l| part_of(l) == name).copied().collect();
        if !lights.is_empty() {
            parts.push((name.into(), Scene { lights, ..unlit.clone() }, true));
        }
    }
    let materials = || whole.instances.iter().flat_map(|i| i.style.groups.iter().map(|g| &g.material));
    if materials().any(glows) {
        let only = Scene { world: black(whole), suns: Vec::new(), lights: Vec::new(), ..whole.clone() };
        parts.push(("emissive labels alone".into(), only, true));
    }
    // A single kind is the whole.
    if parts.len() == 2 {
        parts.pop();
    }
    let mut direct = whole.clone();
    direct.settings.bounces = 0;
    parts.push(("direct light".into(), direct, true));
    parts.push(("matte".into(), with_materials(whole, matte)?, false));
    let mut unfiltered = whole.clone();
    unfiltered.film.filter = UNFILTERED;
    parts.push(("unfiltered".into(), unfiltered, false));
    Ok(parts.into_iter().map(|(name, scene, is_share)| Part { name, scene, is_share }).collect())
}

fn black(scene: &Scene) -> pumice_scene::World {
    pumice_scene::World { environment: Environment::Constant { radiance: [0.0; 3] }, ..scene.world.clone() }
}

/// A material's base colour and emission on a Lambert surface.
fn matte(m: Material) -> Material {
    Material { metallic: 0.0, specular: 0.0, transmission: 0.0, coat: 0.0, sheen: 0.0, roughness: 1.0, ..m }
}

/// The scene with each material changed.
fn with_materials(scene: &Scene, change: impl Fn(Material) -> Material) -> Result<Scene> {
    let mut scene = scene.clone();
    let changed = |group: &LabelGroup| {
        LabelGroup::new(change(group.material), group.ids().to_vec(), group.colors().to_vec())
    };
    for instance in &mut scene.instances {
        let style = &mut instance.style;
        style.material = change(style.material);
        let groups: std::result::Result<Vec<LabelGroup>, SceneError> =
            style.groups.iter().map(changed).collect();
        let groups = groups.and_then(LabelGroups::new);
        style.groups = groups.map_err(|e| SessionError::Caller(e.to_string()))?;
    }
    scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.materials).for_each(|m| *m = change(*m));
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::super::scenes::{Figure, LightScene};
    use super::*;
    use pumice_oracle::volumes::blobs;

    fn whole(which: LightScene) -> Scene {
        let folder = tempfile::tempdir().unwrap();
        let figure = Figure { size: [8, 8], pick: 6, bounces: 3 };
        which.write(folder.path(), &blobs([24; 3], 6, 6, 1).1, "/a/v.nrrd".into(), figure).unwrap()
    }

    fn emission(scene: &Scene) -> usize {
        scene.instances[0].style.groups.iter().filter(|g| g.material.emission != [0.0; 3]).count()
    }

    /// Number of lights of a scene: skies with light, suns, lamps, groups that emit.
    fn lights(scene: &Scene) -> [usize; 4] {
        let black = Environment::Constant { radiance: [0.0; 3] };
        let sky = usize::from(scene.world.environment != black);
        [sky, scene.suns.len(), scene.lights.len(), emission(scene)]
    }

    #[test]
    fn kinds_of_light_divide_the_lights_of_the_whole() {
        for (which, kinds) in [
            (LightScene::SunAndSky, vec![("sky alone", [1, 0, 0, 0]), ("sun alone", [0, 1, 0, 0])]),
            (
                LightScene::AreaLights,
                vec![
                    ("sky alone", [1, 0, 0, 0]),
                    ("area lights alone", [0, 0, 3, 0]),
                    ("spots alone", [0, 0, 1, 0]),
                ],
            ),
            (
                LightScene::ManyLamps,
                vec![
                    ("sky alone", [1, 0, 0, 0]),
                    ("small lamps alone", [0, 0, 100, 0]),
                    ("emissive labels alone", [0, 0, 0, 1]),
                ],
            ),
            // One kind alone is the whole, and is not measured twice.
            (LightScene::SkyFloor, vec![]),
        ] {
            let whole = whole(which);
            let parts = parts_of(&whole).unwrap();
            let kinds_found: Vec<(&str, [usize; 4])> = parts[1..parts.len() - 3]
                .iter()
                .map(|part| (part.name.as_str(), lights(&part.scene)))
                .collect();
            assert_eq!(kinds_found, kinds, "{}", which.name());
            let mut sum = [0; 4];
            kinds.iter().for_each(|(_, some)| (0..4).for_each(|i| sum[i] += some[i]));
            assert!(kinds.is_empty() || sum == lights(&whole), "{}: {sum:?}", which.name());
        }
    }

    #[test]
    fn other_parts_change_what_they_are_named_for() {
        let whole = whole(LightScene::ManyLamps);
        let parts = parts_of(&whole).unwrap();
        let part = |name: &str| parts.iter().find(|p| p.name == name).unwrap();
        assert_eq!(part("whole").scene, whole);
        assert_eq!((part("direct light").scene.settings.bounces, part("direct light").is_share), (0, true));
        let matte = &part("matte").scene;
        let mut all =
            matte.instances[0].style.groups.iter().map(|g| g.material).chain([matte.meshes[0].materials[0]]);
        assert!(all.all(|m| m.metallic == 0.0 && m.specular == 0.0 && m.coat == 0.0));
        assert_eq!((emission(matte), part("matte").is_share), (1, false));
        assert_eq!(part("unfiltered").scene.film.filter, UNFILTERED);
        for part in &parts {
            part.scene.validate().unwrap();
        }
    }
}
