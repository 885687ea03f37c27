//! What a scene needs, and what can be left out for it.

use crate::{Environment, Lod, Material, Mode, Scene, Show};

/// What one scene needs of a renderer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Needs {
    /// (shown, all) labels of each instance.
    pub labels: Vec<(usize, usize)>,
    /// Some label has a dielectric layer.
    pub specular: bool,
    /// Some label is metal.
    pub metal: bool,
    /// Some label sends out light.
    pub emission: bool,
    /// The sky is a picture and is sampled by its brightness.
    pub sky_table: bool,
    /// Suns that give light.
    pub suns: usize,
    /// Paths go on after the first surface.
    pub bounces: bool,
    /// Light is looked for at all: not for ambient occlusion.
    pub lighting: bool,
    /// Boxes are walked down to their voxels.
    pub voxels: bool,
}

impl Needs {
    /// Needs of a scene whose instances have these label ids (sorted, by dense index).
    pub fn of(scene: &Scene, ids: &[&[u64]]) -> Self {
        let lighting = scene.settings.mode != Mode::AmbientOcclusion;
        let any = |test: fn(&Material) -> bool| {
            lighting
                && scene
                    .instances
                    .iter()
                    .any(|i| test(&i.style.material) || i.style.materials.values().any(test))
        };
        Self {
            labels: scene
                .instances
                .iter()
                .zip(ids)
                .map(|(i, ids)| (i.style.show.count(ids), ids.len()))
                .collect(),
            specular: any(|m| m.specular > 0.0 && m.metallic < 1.0 && m.ior > 1.0),
            metal: any(|m| m.metallic > 0.0),
            emission: any(|m| m.emission != [0.0; 3]),
            sky_table: lighting && matches!(scene.world.environment, Environment::Image { .. }),
            suns: if lighting { scene.suns.iter().filter(|s| s.strength > 0.0).count() } else { 0 },
            bounces: scene.settings.mode == Mode::Path && scene.settings.bounces > 0,
            lighting,
            voxels: matches!(scene.settings.lod, Lod::Voxels | Lod::Distance { .. }),
        }
    }

    /// A line for each need and each thing left out.
    pub fn explain(&self) -> Vec<String> {
        let mut lines: Vec<String> = self
            .labels
            .iter()
            .enumerate()
            .map(|(i, (shown, all))| {
                format!("instance {i}: boxes of {shown} of {all} labels in the acceleration structure, {} left out", all - shown)
            })
            .collect();
        let mut line = |needed: bool, what: &str, why_not: &str| {
            lines.push(if needed {
                format!("needed: {what}")
            } else {
                format!("left out: {what} ({why_not})")
            });
        };
        line(self.lighting, "lights and materials", "ambient occlusion has neither");
        line(self.suns > 0, "sampling of suns", "no sun gives light");
        line(
            self.sky_table,
            "sampling table of the sky",
            "the sky is the same from everywhere: scattering finds it as well",
        );
        line(self.bounces, "scattered paths", "direct light only");
        line(self.specular, "dielectric layer", "no label has one");
        line(self.metal, "metal", "no label is metal");
        line(self.emission, "emission", "no label sends out light");
        line(self.voxels, "voxels within cells", "the level of detail stops at cells or boxes");
        lines
    }
}

impl Show {
    /// Number of these labels (sorted ids) that are shown.
    pub fn count(&self, ids: &[u64]) -> usize {
        let held = |list: &[u64]| {
            let mut list: Vec<u64> =
                list.iter().copied().filter(|id| ids.binary_search(id).is_ok()).collect();
            list.sort_unstable();
            list.dedup();
            list.len()
        };
        match self {
            Self::All => ids.len(),
            Self::Only(list) => held(list),
            Self::Except(list) => ids.len() - held(list),
        }
    }
}
