//! What a scene needs from a renderer, and what the renderer leaves out.
//!
//! [`Needs`] both decides what renderers build and explains it to users, so the two always agree. Needs follow from what is drawn: the
//! material of a hidden label needs nothing. `left out` is reported only of work or memory that a renderer saves; what costs nothing to
//! have (metal, glass) is reported where it is needed and otherwise not mentioned. Materials and lights, which ambient occlusion does
//! not use, are prepared in that mode too, so that a change of mode builds nothing: they count as needed, and only work along paths is
//! left out.

use crate::{
    Cut, Environment, LabelStyle, Light, LightShape, Lod, Material, Mode, Part, PartSet, Pass, Scene,
};

/// Least number of instances and meshes together for which a hierarchy over them is built: fewer are tested one by one, which is as
/// fast. `bench/results/instances.md` has the cost of both ways.
pub const INSTANCES_OF_A_TREE: usize = 4;

/// Least number of lamps for which a tree over them is built. Below it, weighing each lamp costs as little, and chooses better.
pub const LAMPS_OF_A_TREE: usize = 256;

/// How many labels of one instance are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LabelCount {
    /// The instance's id.
    pub instance: u32,
    /// Number of labels that are drawn.
    pub visible: usize,
    /// Number of labels of the volume.
    pub all: usize,
}

/// The needs of one scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Needs {
    /// Label counts of each instance.
    pub labels: Vec<LabelCount>,
    /// Lights are sampled: every mode except ambient occlusion.
    pub lighting: bool,
    /// Some surface has a diffuse lobe.
    pub diffuse: bool,
    /// Some surface has a dielectric layer.
    pub specular: bool,
    /// Some surface is metal, wholly or in part.
    pub metal: bool,
    /// Some surface refracts light into its label or mesh.
    pub glass: bool,
    /// Some surface lies under a clear coat.
    pub coat: bool,
    /// Some surface lets light pass straight on.
    pub transparent: bool,
    /// Some surface has sheen.
    pub sheen: bool,
    /// The camera has a lens opening of finite size (depth of field).
    pub lens: bool,
    /// Some surface emits light: it is sampled as a light, and scattered rays can hit it.
    pub emission: bool,
    /// The sky is an image, with an importance sampling table.
    pub sky_table: bool,
    /// Number of suns that give light; they are sampled.
    pub suns: usize,
    /// Number of lamps that give light; they are sampled, and scattered rays can hit them.
    pub lamps: usize,
    /// Number of triangle meshes.
    pub meshes: usize,
    /// There are enough instances and meshes for a hierarchy over them ([`INSTANCES_OF_A_TREE`]).
    pub instance_tree: bool,
    /// Number of meshes that are shadow catchers.
    pub catchers: usize,
    /// Some light is found both by light sampling and by BSDF sampling, so that the two are weighted (multiple importance sampling).
    pub mis: bool,
    /// Paths continue after the first surface.
    pub bounces: bool,
    /// Dim paths may end at random (Russian roulette).
    pub roulette: bool,
    /// Number of cuts that apply to some instance.
    pub cuts: usize,
    /// Light is sorted by kind: for passes, for a transparent film, for shadow catchers, or for a clamp.
    pub sorted: bool,
    /// A Cryptomatte is made: pixels record which labels they see.
    pub mattes: bool,
    /// Voxels are shaded with normals from the gradient of their label's occupancy.
    pub smooth_voxels: bool,
    /// Some mesh has normals other than those of its triangles.
    pub smooth_meshes: bool,
    /// Edge lengths, in voxels, of the elements that rays stop at, rising: of 1, 4, 16.
    pub levels: Vec<u32>,
    /// Parts that are built although the scene does not need them ([`Needs::with`]).
    pub besides: PartSet,
}

impl Needs {
    /// The needs of `scene`. `ids` has for each instance the label ids of its volume, in rising order; `smooth_meshes` says whether some
    /// mesh has normals of its own. Ids in the scene that the volume lacks need nothing ([`crate::Show::resolve`] refuses them).
    pub fn of(scene: &Scene, ids: &[&[u64]], smooth_meshes: bool) -> Self {
        let settings = &scene.settings;
        let lighting = settings.mode != Mode::AmbientOcclusion;
        let bounces = settings.mode == Mode::Path && settings.bounces > 0;

        // Count labels, and collect the materials that can be seen.
        let mut labels = Vec::new();
        let mut seen = Vec::new();
        let (mut diffuse, mut specular, mut metal, mut emission) = (false, false, false, false);
        let (mut glass, mut coat, mut clear, mut sheen) = (false, false, false, false);
        for (instance, ids) in scene.instances.iter().zip(ids) {
            let visible = instance.style.show.among(ids);
            labels.push(LabelCount {
                instance: instance.id,
                visible: visible.iter().filter(|v| **v).count(),
                all: ids.len(),
            });
            seen.extend(materials(&instance.style, ids, &visible));
        }
        seen.extend(scene.meshes.iter().flat_map(|mesh| &mesh.materials).map(|m| (*m, false)));
        for (m, colored) in seen {
            diffuse |= m.metallic < 1.0 && (colored || m.base_color != [0.0; 3]);
            specular |= m.specular > 0.0 && m.ior > 1.0;
            metal |= m.metallic > 0.0;
            glass |= m.transmission > 0.0;
            coat |= m.coat > 0.0;
            clear |= m.alpha < 1.0;
            sheen |= m.sheen > 0.0;
            emission |= m.emission != [0.0; 3];
        }

        // Lights.
        let sky_table = matches!(scene.world.environment, Environment::Image { .. });
        let lit = scene.suns.iter().filter(|s| s.strength > 0.0 && s.color != [0.0; 3]);
        let wide = lit.clone().any(|s| s.angle_rad > 0.0);
        let lamps = scene.lights.iter().filter(|l| l.power_w > 0.0 && l.color != [0.0; 3]);
        let wide = wide || lamps.clone().any(has_extent);
        let catchers = scene.meshes.iter().filter(|m| m.shadow_catcher).count();
        Self {
            labels,
            lighting,
            diffuse,
            specular,
            metal,
            glass,
            coat,
            transparent: clear,
            sheen,
            lens: scene.camera.aperture.is_some(),
            emission,
            sky_table,
            suns: lit.count(),
            lamps: lamps.count(),
            meshes: scene.meshes.len(),
            instance_tree: scene.instances.len() + scene.meshes.len() >= INSTANCES_OF_A_TREE,
            catchers,
            mis: lighting && (sky_table || wide || emission),
            bounces,
            roulette: bounces && settings.russian_roulette,
            cuts: {
                let shown = |cut: &Cut| scene.instances.iter().any(|i| cut.takes_from(i.id));
                scene.cuts.iter().filter(|cut| shown(cut)).count()
            },
            smooth_voxels: settings.smooth_voxels,
            smooth_meshes,
            besides: PartSet::NONE,
            mattes: has_mattes(scene),
            sorted: sorts_light(scene),
            levels: match settings.lod {
                Lod::Voxels => vec![1],
                Lod::Cells => vec![4],
                Lod::Boxes => vec![16],
                Lod::Distance { .. } => vec![1, 4, 16],
            },
        }
    }

    /// The needs of the same scene after its film has changed; `scene` has the new film.
    #[must_use]
    pub fn on_film(&self, scene: &Scene) -> Self {
        Self { mattes: has_mattes(scene), sorted: sorts_light(scene), ..self.clone() }
    }

    /// These needs with one more part that is built although the scene does not need it, to measure what leaving it out saves.
    #[must_use]
    pub fn with(self, part: Part) -> Self {
        Self { besides: self.besides.with(part), ..self }
    }

    /// The parts that are built: all that the scene needs, and [`Needs::besides`]. No scene needs hidden labels.
    pub fn parts(&self) -> PartSet {
        PartSet::ALL.without(self.unneeded()).without(PartSet::NONE.with(Part::HiddenLabels)).or(self.besides)
    }

    /// Least number of instances and meshes together for which a hierarchy is built: [`INSTANCES_OF_A_TREE`], or 1 to measure its cost.
    pub fn least_of_a_tree(&self) -> usize {
        if self.besides.has(Part::InstanceTree) { 1 } else { INSTANCES_OF_A_TREE }
    }

    /// What the scene does not need.
    pub fn unneeded(&self) -> PartSet {
        PartSet::NONE
            .with_if(Part::HiddenLabels, self.labels.iter().any(|l| l.visible < l.all))
            .with_if(Part::Levels, self.levels == [1])
            .with_if(Part::Microfacets, !(self.specular || self.metal || self.glass))
            .with_if(Part::Coats, !self.coat)
            .with_if(Part::Sheen, !self.sheen)
            .with_if(Part::Glass, !self.glass)
            .with_if(Part::Transparent, !self.transparent)
            .with_if(Part::Lamps, self.lamps == 0)
            .with_if(
                Part::LightSampling,
                !(self.sky_table || self.suns > 0 || self.lamps > 0 || self.emission),
            )
            .with_if(Part::SkyPicture, !self.sky_table)
            .with_if(Part::Lens, !self.lens)
            .with_if(Part::Cuts, self.cuts == 0)
            .with_if(Part::Meshes, self.meshes == 0)
            .with_if(Part::Sorting, !self.sorted)
            .with_if(Part::Mattes, !self.mattes)
            .with_if(Part::Emitters, !self.emission)
            .with_if(Part::SmoothNormals, !self.smooth_meshes && !self.smooth_voxels)
            .with_if(Part::InstanceTree, !self.instance_tree)
            .with_if(Part::Catchers, self.catchers == 0)
            .with_if(Part::LampTree, self.lamps < LAMPS_OF_A_TREE)
    }

    /// The needs as text: one line for each thing that is needed (`needed: …`) or left out, with the reason (`left out: … (…)`).
    pub fn explain(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for LabelCount { instance, visible, all } in &self.labels {
            lines.push(format!("needed: boxes of {visible} of {all} labels of instance {instance}"));
            if visible < all {
                let hidden = all - visible;
                lines.push(format!("left out: boxes of {hidden} labels of instance {instance} (not shown)"));
            }
        }

        match self.meshes {
            0 => {}
            1 => lines.push("needed: triangles of 1 mesh".into()),
            n => lines.push(format!("needed: triangles of {n} meshes")),
        }

        // These things are reported whether they are needed or not.
        let mut line = |needed: bool, what: &str, why_not: &str| {
            lines.push(if needed {
                format!("needed: {what}")
            } else {
                format!("left out: {what} ({why_not})")
            });
        };
        let or_ambient =
            |why_not| if self.lighting { why_not } else { "ambient occlusion samples no lights" };
        line(true, "materials", "");
        line(self.specular, "dielectric layer", "no visible label has one");
        let suns = format!("sampling of {} suns", self.suns);
        let suns = match self.suns {
            0 => "sampling of suns",
            1 => "sampling of 1 sun",
            _ => suns.as_str(),
        };
        line(self.suns > 0, suns, "no sun gives light");
        let lamps = format!("{} lamps", self.lamps);
        let lamps = match self.lamps {
            0 => "lamps",
            1 => "1 lamp",
            _ => lamps.as_str(),
        };
        let with_tree = format!("{lamps} with a tree that chooses among them");
        let lamps = if self.lamps < LAMPS_OF_A_TREE { lamps } else { with_tree.as_str() };
        line(self.lamps > 0, lamps, "no lamp gives light");
        line(self.emission, "sampling of emissive surfaces", "no visible label or mesh emits light");
        line(
            self.sky_table,
            "sampling table of the sky",
            "the sky is equally bright everywhere: scattered rays find it as well",
        );
        line(
            self.mis,
            "weights of multiple importance sampling (MIS)",
            or_ambient("each light is sampled in one way only"),
        );
        line(self.bounces, "indirect light", or_ambient("the settings allow no bounces: direct light only"));
        line(
            self.roulette,
            "Russian roulette",
            if self.bounces { "the settings switch it off" } else { "paths end before it" },
        );
        let cuts = match self.cuts {
            0 => "cuts".to_owned(),
            1 => "1 cut".to_owned(),
            n => format!("{n} cuts"),
        };
        line(self.cuts > 0, &cuts, "no cut applies to an instance");
        line(
            self.sorted,
            "separate sums of light",
            "no pass over samples, transparent film, clamp or shadow catcher needs it",
        );
        line(self.mattes, "Cryptomatte", "no Cryptomatte pass is requested");
        line(self.instance_tree, "a hierarchy over instances", "so few are tested one by one");
        let catchers = match self.catchers {
            0 => "shadow catchers".to_owned(),
            1 => "1 shadow catcher".to_owned(),
            n => format!("{n} shadow catchers"),
        };
        line(self.catchers > 0, &catchers, "no mesh is one");
        for edge in [1, 4, 16] {
            let what = format!("elements of {edge}³ voxels");
            line(self.levels.contains(&edge), &what, "the level of detail does not use them");
        }

        // These things cost nothing where they are absent, so they are reported only where they are needed.
        let free = [
            (self.diffuse, "diffuse"),
            (self.metal, "metal"),
            (self.glass, "glass"),
            (self.coat, "clear coat"),
            (self.transparent, "transparent surfaces"),
            (self.sheen, "sheen"),
            (self.lens, "depth of field"),
            (
                self.smooth_voxels,
                "smooth normals of voxels, with a table of neighbouring boxes of each label",
            ),
            (self.smooth_meshes, "smooth normals of meshes"),
        ];
        lines.extend(free.iter().filter(|f| f.0).map(|f| format!("needed: {}", f.1)));
        lines
    }
}

fn has_mattes(scene: &Scene) -> bool {
    scene.film.passes.has_any(Pass::MATTES)
}

/// Whether light is sorted by kind: for passes, for a transparent film, for shadow catchers, or for a clamp.
fn sorts_light(scene: &Scene) -> bool {
    let (film, settings) = (&scene.film, &scene.settings);
    film.transparent
        || film.passes.has_any(Pass::LIGHT)
        || film.passes.has_any(&[Pass::Albedo, Pass::Normal])
        || has_mattes(scene)
        || scene.meshes.iter().any(|mesh| mesh.shadow_catcher)
        || settings.clamps()
}

/// Whether a scattered ray can hit the lamp.
fn has_extent(light: &Light) -> bool {
    match light.shape {
        LightShape::Point { radius, .. } | LightShape::Spot { radius, .. } => radius > 0.0,
        LightShape::Area { spread_rad, .. } => spread_rad > 0.0,
    }
}

/// The materials of visible labels, each with whether other colours replace its base colour.
fn materials(style: &LabelStyle, ids: &[u64], visible: &[bool]) -> Vec<(Material, bool)> {
    let mut rest = visible.to_vec();
    let take = |rest: &mut [bool], dense: usize| std::mem::replace(&mut rest[dense], false);
    let mut seen = Vec::new();
    for (id, material) in &style.materials {
        if ids.binary_search(id).is_ok_and(|dense| take(&mut rest, dense)) {
            seen.push((*material, false));
        }
    }
    for group in style.groups.iter() {
        // A live view asks this at each edit, and most volumes have one group of all labels: to compare two lists takes an eighth of the time
        // of finding each label in the other.
        let is_seen = if style.materials.is_empty() && group.ids() == ids {
            let is_seen = rest.contains(&true);
            rest.fill(false);
            is_seen
        } else {
            group.among(ids).filter(|(dense, _)| take(&mut rest, *dense)).count() > 0
        };
        if is_seen {
            seen.push((group.material, !group.colors().is_empty()));
        }
    }
    if rest.contains(&true) {
        seen.push((style.material, style.auto_color));
    }
    seen
}
