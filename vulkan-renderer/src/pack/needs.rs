//! What a scene needs of its shaders: specialisation constants, so that what it does not need is not compiled.

use pumice_picture::PassSums;
use pumice_scene::{Camera, Film, Part, Settings, Spare};
use pumice_transport::{Lights, Sky};

use super::PackedLooks;
use crate::layout::Material;

/// What each specialisation constant compiles.
const PARTS: [(usize, Part); 17] = [
    (1, Part::Microfacets),
    (2, Part::SkyPicture),
    (3, Part::Aiming),
    (4, Part::Lens),
    (5, Part::Lamps),
    (6, Part::Coats),
    (7, Part::Glass),
    (8, Part::Clear),
    (9, Part::Cuts),
    (10, Part::Meshes),
    (11, Part::Sorting),
    (12, Part::Sheen),
    (13, Part::Emitters),
    (14, Part::Mattes),
    (15, Part::SmoothNormals),
    (16, Part::Catchers),
    (17, Part::InstanceTree),
];

/// The constants, with those of spare parts set too.
pub fn carrying(mut constants: Vec<u32>, spare: Spare) -> Vec<u32> {
    for (number, _) in PARTS.iter().filter(|(_, part)| spare.has(*part)) {
        constants[*number] = 1;
    }
    constants
}

/// The parts that constants leave out.
pub fn compiled_parts() -> Spare {
    PARTS.iter().fold(Spare::NONE, |all, (_, part)| all.with(*part))
}

/// Twin of `shaders/needs.glsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShaderNeeds {
    /// Some label has microfacets: metal, glass, a dielectric layer.
    pub lobes: bool,
    /// A picture surrounds the scene.
    pub picture: bool,
    /// Some light is aimed at.
    pub aim: bool,
    /// The camera's opening has a size.
    pub lens: bool,
    /// Lamps stand in the scene.
    pub lamps: bool,
    /// Some label has a clear coat.
    pub coat: bool,
    /// Some label is glass, wholly or in part.
    pub glass: bool,
    /// Some label is not wholly there.
    pub clear: bool,
    /// Something is cut away.
    pub cuts: bool,
    /// There are triangle meshes.
    pub meshes: bool,
    /// Light is clamped, or sorted for passes or a transparent film.
    pub sorted: bool,
    /// Some label has sheen.
    pub sheen: bool,
    /// Surfaces that shine are aimed at.
    pub emitters: bool,
    /// Pixels keep which labels they see, by name.
    pub mattes: bool,
    /// Some surface is shaded by another normal than its own.
    pub smooth: bool,
    /// Some mesh is a shadow catcher.
    pub catchers: bool,
    /// There is a hierarchy over instances.
    pub instance_tree: bool,
    /// Some volume is drawn by bricks.
    pub bricks: bool,
    /// Some volume is drawn by boxes.
    pub boxes: bool,
}

impl ShaderNeeds {
    /// What this camera, film, settings, these lights, these looks of all instances and meshes, these cuts and these meshes need.
    pub fn new<'a>(
        camera: &Camera,
        film: &Film,
        settings: &Settings,
        lights: &Lights,
        looks: impl IntoIterator<Item = &'a PackedLooks>,
        cuts: bool,
        meshes: bool,
    ) -> Self {
        let (mut materials, mut catchers) = (Vec::<Material>::new(), false);
        for looks in looks {
            materials.extend(&looks.materials);
            catchers |= looks.catches;
        }
        let kept = PassSums::of(film, catchers);
        let any = |is: fn(&Material) -> bool| materials.iter().any(is);
        let has_microfacets =
            |m: &Material| m.metallic > 0.0 || m.transmission > 0.0 || (m.specular > 0.0 && m.ior != 1.0);
        Self {
            lobes: any(has_microfacets),
            coat: any(|m| m.coat > 0.0),
            glass: any(|m| m.transmission > 0.0),
            clear: any(|m| m.alpha < 1.0),
            sheen: any(|m| m.sheen > 0.0),
            picture: matches!(lights.sky(), Sky::Image(_)),
            aim: lights.any_aimed(),
            lens: camera.aperture.is_some(),
            lamps: !lights.lamps().is_empty(),
            cuts,
            meshes,
            emitters: lights.emitters().is_some(),
            mattes: kept.ranks > 0,
            // Scenes do not say what meshes have: who has them does.
            smooth: false,
            instance_tree: false,
            // Nor how volumes lie on the device.
            bricks: false,
            boxes: true,
            sorted: settings.clamps() || kept.stride() > 0,
            catchers,
        }
    }

    /// Specialisation constants by their numbers; number 0 is the probe's.
    pub fn constants(&self) -> [u32; 20] {
        let Self {
            lobes,
            picture,
            aim,
            lens,
            lamps,
            coat,
            glass,
            clear,
            cuts,
            meshes,
            sorted,
            sheen,
            emitters,
            mattes,
            smooth,
            catchers,
            instance_tree,
            bricks,
            boxes,
        } = *self;
        [
            false,
            lobes,
            picture,
            aim,
            lens,
            lamps,
            coat,
            glass,
            clear,
            cuts,
            meshes,
            sorted,
            sheen,
            emitters,
            mattes,
            smooth,
            catchers,
            instance_tree,
            bricks,
            boxes,
        ]
        .map(u32::from)
    }
}
