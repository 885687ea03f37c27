//! Small scenes, one for each feature of the integrator, as the CPU renders them.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_core::MeshData;
use pumice_cpu::traverse::{MeshTracer, SceneTracer, TracedInstance, VolumeTracer};
use pumice_cpu::{PathTracer, Surroundings, emitters_of};
use pumice_picture::{Image, PassSums};
use pumice_scene::{
    Aperture, Camera, Film, Filter, LabelStyle, Light, LightShape, Lod, Material, Mode, Outline, Projection,
    SensorFit, Settings, Sun,
};
use pumice_transport::geometry::{Contacts, LodChoice, Placement};
use pumice_transport::{EnvironmentTable, Lights, MaterialTable, ReadyLamp, ReadySun, Sky};

use crate::exact::volumes::{blobs, noise, volume};
use crate::shapes;

/// Pixels along each side of the film. Not a multiple of the workgroup's 8.
pub(crate) const SIDE: u32 = 28;

/// A scene, with what is known of its numerical errors beforehand.
#[derive(Clone)]
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) traced: Vec<TracedInstance>,
    /// Meshes, which follow the volumes.
    pub(crate) meshes: Vec<(Arc<MeshData>, DAffine3)>,
    pub(crate) around: Surroundings,
    /// Where its volumes touch.
    pub(crate) contacts: Option<Contacts>,
    pub(crate) camera: Camera,
    pub(crate) film: Film,
    /// Factor from a float's rounding error to the error of a scattered direction: 1/α of the sharpest lobe, 1 where all is diffuse.
    pub(crate) sharpness: f64,
    /// Probability that a lookup in the environment map finds another pixel's density: its borders, 2⁻¹⁹ of a turn wide each.
    pub(crate) borders: f64,
    /// Edge of the smallest voxel in the world, and the longest way through everything that is drawn.
    pub(crate) voxel: f64,
    pub(crate) reach: f64,
}

impl Case {
    pub(crate) fn tracer(&self) -> SceneTracer {
        let smooth = self.around.settings.smooth_voxels;
        let volumes = (0u32..).zip(&self.traced).map(|(i, traced)| {
            Arc::new(VolumeTracer::new(i, traced).expect("a tracer").shaded_smooth(smooth).unwrap())
        });
        let volumes = SceneTracer::of(volumes.collect());
        let meshes = (0u32..).zip(&self.meshes).map(|(i, (mesh, place))| {
            let instance = self.traced.len() as u32 + i;
            Arc::new(MeshTracer::new(i, instance, mesh, *place).expect("a mesh"))
        });
        let catches: Vec<bool> = self.materials_of_meshes().map(|materials| materials.catches()).collect();
        volumes.with_meshes(meshes.collect()).with_catchers(&catches).with_contacts(self.contacts.clone())
    }

    fn materials_of_meshes(&self) -> impl Iterator<Item = &Arc<MaterialTable>> {
        self.around.materials.iter().skip(self.traced.len())
    }

    /// Sums that the film keeps for render passes.
    pub(crate) fn kept(&self) -> PassSums {
        PassSums::of(&self.film, self.materials_of_meshes().any(|materials| materials.catches()))
    }

    /// The CPU's path tracer, without samples.
    pub(crate) fn path_tracer(&self) -> PathTracer<SceneTracer> {
        PathTracer::new(self.tracer(), self.around.clone(), &self.camera, &self.film)
            .expect("memory for the film")
    }

    pub(crate) fn with_lights(mut self, lights: Lights) -> Self {
        self.around.lights = Arc::new(lights);
        self
    }

    /// Samples emissive surfaces as lights, in addition to the other lights.
    pub(crate) fn sampling_emission(self) -> Self {
        let emitters = emitters_of(&self.tracer(), &self.around.materials).expect("emitters");
        assert!(emitters.is_some(), "{} is dark", self.name);
        let lights = Lights::clone(&self.around.lights).with_emitters(emitters.map(Arc::new));
        self.with_lights(lights)
    }

    fn settings(mut self, change: impl FnOnce(&mut Settings)) -> Self {
        change(&mut self.around.settings);
        self
    }

    fn with_style(mut self, style: &LabelStyle, sharpness: f64) -> Self {
        let look = |t: &TracedInstance| {
            let table = t.volume.labels();
            Arc::new(MaterialTable::new(style, table.ids(), table.contacts().iter(), &t.visible))
        };
        self.around.materials = self.traced.iter().map(look).collect::<Vec<_>>().into();
        self.sharpness = sharpness;
        self
    }

    fn lod(mut self, lod: Lod) -> Self {
        self.around.settings.lod = lod;
        for t in &mut self.traced {
            t.lod = LodChoice::new(lod, &self.camera, &self.film);
        }
        self
    }

    fn named(mut self, name: &'static str) -> Self {
        self.name = name;
        self
    }
}

/// A camera at `from` that looks at `to`.
fn looking(from: DVec3, to: DVec3, projection: Projection) -> Camera {
    let z = (from - to).normalize();
    let x = DVec3::Z.cross(z).normalize();
    let matrix = DAffine3::from_mat3_translation(DMat3::from_cols(x, z.cross(x), z), from);
    Camera { shift: [0.05, -0.1], clip: [0.1, 1e6], ..Camera::new(matrix, projection) }
}

fn traced(volume: &Arc<pumice_core::CompressedVolume>, world_from_index: DAffine3) -> TracedInstance {
    let visible = vec![true; volume.labels().len()];
    TracedInstance { volume: Arc::clone(volume), world_from_index, visible, lod: LodChoice::Voxels }
}

/// Bodies of many labels, 48 voxels wide: Lambert materials under a uniform sky.
pub(crate) fn bodies() -> Case {
    let (_, volume) = blobs([48, 44, 40], 40, 16, 4);
    let instance = traced(&volume, DAffine3::IDENTITY);
    let material = Material { base_color: [0.8, 0.6, 0.4], specular: 0.0, ..Material::default() };
    let around = Surroundings {
        lights: Arc::new(Lights::new(Sky::Constant(Vec3::new(0.9, 1.0, 1.1)), Vec::new(), None)),
        materials: vec![Arc::new(MaterialTable::same(material))].into(),
        settings: Settings { bounces: 4, seed: 7, ..Settings::default() },
    };
    let projection = Projection::Perspective { fov_rad: 0.45 };
    Case {
        name: "an even sky",
        traced: vec![instance],
        meshes: Vec::new(),
        around,
        contacts: None,
        camera: looking(DVec3::new(95.0, -60.0, 70.0), DVec3::new(24.0, 22.0, 20.0), projection),
        film: Film::new(SIDE, SIDE, Filter::BlackmanHarris { width: 3.0 }),
        sharpness: 1.0,
        borders: 0.0,
        voxel: 1.0,
        reach: 77.0,
    }
}

/// A sun of some width.
pub(crate) fn sun(angle_rad: f64, strength: f32) -> ReadySun {
    let direction = [-0.6, 0.7, -1.0];
    ReadySun::new(&Sun { direction, strength, color: [1.0, 0.9, 0.8], angle_rad })
}

fn dark() -> Sky {
    Sky::Constant(Vec3::splat(0.05))
}

/// An environment map: a bright window in a sky that changes slowly.
pub(crate) fn picture(strength: f32) -> Sky {
    let pixel = |i: usize| {
        let (x, y) = ((i % 64) as f32 / 64.0, (i / 64) as f32 / 32.0);
        let lamp = if (0.6..0.7).contains(&x) && (0.2..0.3).contains(&y) { 10.0 } else { 0.0 };
        [0.5 + lamp + 0.2 * (x * std::f32::consts::TAU).sin(), 0.4 + lamp, 0.6 + lamp - 0.3 * y]
    };
    let image = Image::new(64, 32, (0..64 * 32).map(pixel).collect());
    Sky::Image(std::sync::Arc::new(EnvironmentTable::new(image, strength, 0.3).expect("a sky")))
}

/// Probability that a position in [`picture`], off by 2⁻²⁰ of a turn, is across one of its 64 + 32 borders.
const BORDERS: f64 = 96.0 / 524_288.0;

/// Gives every label another material: glossy, metal, both, emissive; α = 0.3² for the sharpest.
fn surfaces(case: Case) -> Case {
    surfaces_of(case, 0.3)
}

/// As [`surfaces`], of this roughness and rougher.
fn surfaces_of(case: Case, roughness: f32) -> Case {
    let base = |m: Material, i: usize| Material { base_color: [0.9, 0.3 + 0.04 * i as f32, 0.5], ..m };
    let kinds = [
        Material { specular: 0.5, roughness, ..Material::default() },
        Material { metallic: 1.0, roughness: roughness + 0.1, ..Material::default() },
        Material { metallic: 0.5, roughness: 0.8, ior: 1.8, ..Material::default() },
        Material { specular: 0.0, emission: [0.4, 0.2, 0.1], ..Material::default() },
    ];
    let ids = case.traced[0].volume.labels().ids().to_vec();
    let materials = ids.iter().enumerate().map(|(i, id)| (*id, base(kinds[i % kinds.len()], i))).collect();
    case.with_style(&LabelStyle { materials, ..LabelStyle::default() }, 1.0 / f64::from(roughness).powi(2))
}

/// Lamps of all kinds about [`bodies`], some within the picture.
fn lit_by_lamps() -> Lights {
    let from = |p: [f64; 3], to: [f64; 3]| {
        looking(DVec3::from(p), DVec3::from(to), Projection::Orthographic { scale: 1.0 })
    };
    let above = from([10.0, 70.0, 90.0], [24.0, 22.0, 20.0]).world_from_camera;
    let shapes = [
        LightShape::Point { position: [60.0, -30.0, 50.0], radius: 4.0, soft_falloff: false },
        LightShape::Point { position: [24.0, -20.0, 60.0], radius: 0.0, soft_falloff: false },
        LightShape::Point { position: [70.0, 30.0, 20.0], radius: 3.0, soft_falloff: true },
        LightShape::Spot {
            position: [20.0, -40.0, 80.0],
            direction: [0.0, 0.7, -0.7],
            radius: 2.0,
            angle_rad: 0.9,
            blend: 0.3,
            soft_falloff: false,
        },
        LightShape::Area {
            world_from_light: above,
            outline: Outline::Rectangle,
            size: [30.0, 20.0],
            spread_rad: std::f64::consts::PI,
        },
        LightShape::Area {
            world_from_light: above,
            outline: Outline::Ellipse,
            size: [40.0, 20.0],
            spread_rad: 1.2,
        },
    ];
    let light = |(shape, power_w)| Light { shape, power_w, color: [1.0, 0.9, 0.8], visible_to_camera: true };
    let powers = [4e4, 2e4, 3e4, 2e4, 3e4, 3e4];
    let lamps = shapes.into_iter().zip(powers).map(light).map(|l| ReadyLamp::new(&l)).collect();
    Lights::new(dark(), vec![sun(0.3, 1.0)], None).with_lamps(lamps)
}

/// Gives every label a material that transmits light, or one with a coat or sheen.
fn passed_through(case: Case) -> Case {
    let base = |m: Material, i: usize| Material { base_color: [0.9, 0.3 + 0.04 * i as f32, 0.5], ..m };
    let rough = Material { roughness: 0.7, ..Material::default() };
    let kinds = [
        Material { transmission: 1.0, ..rough },
        Material { alpha: 0.4, ..rough },
        Material { coat: 1.0, coat_roughness: 0.6, coat_tint: [0.9, 0.7, 0.5], emission: [0.1; 3], ..rough },
        Material { transmission: 0.5, alpha: 0.8, multiscatter: false, ior: 1.3, ..rough },
        Material { sheen: 1.0, sheen_tint: [0.5, 0.8, 1.0], coat: 0.5, coat_roughness: 0.7, ..rough },
    ];
    let ids = case.traced[0].volume.labels().ids().to_vec();
    let materials = ids.iter().enumerate().map(|(i, id)| (*id, base(kinds[i % kinds.len()], i))).collect();
    case.with_style(
        &LabelStyle { materials, ..LabelStyle::default() },
        1.0 / f64::from(rough.roughness).powi(2),
    )
}

fn several() -> Case {
    let mut case = bodies();
    let (_, sparse) = noise([30, 20, 25], 0.03, 4, 2);
    let turned = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7);
    let placed = DAffine3::from_translation(DVec3::new(30.0, -20.0, 10.5)) * turned;
    case.traced.push(traced(&sparse, placed * DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.5))));
    case.traced.push(traced(&sparse, DAffine3::from_translation(DVec3::new(-10.0, 5.0, 30.0))));
    for (i, visible) in case.traced[0].visible.iter_mut().enumerate() {
        *visible = i % 3 != 0;
    }
    // About 70 × 60 × 60 voxels in all.
    case.reach = 130.0;
    case.with_style(&LabelStyle { auto_color: true, ..LabelStyle::default() }, 4.0)
}

/// The labels of the bodies by turns in three instances at one place, and two more instances that together are one body.
fn touching() -> Case {
    let mut case = passed_through(bodies().with_lights(Lights::new(dark(), vec![sun(0.3, 2.0)], None)));
    let (whole, table) = (case.traced[0].clone(), Arc::clone(&case.around.materials[0]));
    let shown =
        |turn: usize, t: &TracedInstance| t.visible.iter().enumerate().map(|(i, _)| i % 3 == turn).collect();
    case.traced =
        (0..3).map(|turn| TracedInstance { visible: shown(turn, &whole), ..whole.clone() }).collect();
    let (_, block) = volume([10, 20, 12], |_, _, _| 1);
    for x in [30.3, 40.3] {
        case.traced.push(traced(&block, DAffine3::from_translation(DVec3::new(x, -24.6, 9.7))));
    }
    let glass = Material { transmission: 1.0, roughness: 0.7, base_color: [0.9; 3], ..Material::default() };
    let of_block = Arc::new(MaterialTable::same(glass));
    case.around.materials = [vec![table; 3], vec![of_block; 2]].concat().into();
    let placements = case.traced.iter().filter_map(|t| Placement::new(t.world_from_index));
    case.contacts = Some(Contacts::of(placements, vec![0, 1, 2, 3, 3]));
    case
}

/// Adds a floor under the bodies, and a bumpy ball of glass, metal and transparent triangles among them.
fn beside_meshes(case: Case) -> Case {
    let mut case = case;
    let rough = Material { roughness: 0.7, base_color: [0.9, 0.8, 0.7], ..Material::default() };
    let floor = DAffine3::from_translation(DVec3::new(-20.0, -20.0, -12.3)) * DAffine3::from_rotation_y(0.05);
    let ball = shapes::bumpy_ball(2, &mut shapes::Random(8));
    let faces = (0..ball.triangles().len() as u32).map(|i| i % 4).collect();
    let ball = MeshData::new(ball.positions().to_vec(), ball.triangles().to_vec(), faces).expect("a mesh");
    let mirrored = DAffine3::from_scale(DVec3::new(-14.0, 12.0, 15.0));
    let ball = (Arc::new(ball), DAffine3::from_translation(DVec3::new(52.0, -8.0, 30.0)) * mirrored);
    case.meshes =
        vec![(shapes::cube(90.0, 3), floor * DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.05))), ball];
    let of_ball = [
        Material { transmission: 1.0, ..rough },
        Material { metallic: 1.0, ..rough },
        Material { alpha: 0.4, emission: [0.2, 0.1, 0.0], ..rough },
    ];
    case.around.materials.push(Arc::new(MaterialTable::of_mesh(&[Material { specular: 0.0, ..rough }])));
    case.around.materials.push(Arc::new(MaterialTable::of_mesh(&of_ball)));
    case.reach = 170.0;
    case
}

/// As [`beside_meshes`], with vertex normals that fit the bumps badly: some lie on the far side of their triangle, and mirror directions
/// are often below the surface.
fn beside_smooth_meshes(case: Case) -> Case {
    let mut case = beside_meshes(case);
    for (mesh, _) in &mut case.meshes {
        let middle =
            mesh.positions().iter().map(|p| DVec3::from(*p)).sum::<DVec3>() / mesh.positions().len() as f64;
        let normals: Vec<_> =
            mesh.positions().iter().map(|p| (DVec3::from(*p) - middle).as_vec3().to_array()).collect();
        *mesh = Arc::new(MeshData::clone(mesh).with_corner_normals(&normals).expect("normals"));
        assert!(mesh.is_smooth());
    }
    let rough = Material { roughness: 0.7, base_color: [0.9, 0.8, 0.7], ..Material::default() };
    let of_ball = [
        Material { transmission: 1.0, ..rough },
        Material { metallic: 1.0, ..rough },
        Material { coat: 1.0, coat_roughness: 0.7, sheen: 0.5, emission: [0.2, 0.1, 0.0], ..rough },
        Material { alpha: 0.5, sheen: 1.0, specular: 0.0, ..rough },
    ];
    let last = case.around.materials.len() - 1;
    case.around.materials[last] = Arc::new(MaterialTable::of_mesh(&of_ball));
    case
}

/// A room with a window in its ceiling and four pillars, seen from within: light comes in after many bounces.
fn room() -> Case {
    let (_, room) = volume([48, 36, 28], |x, y, z| {
        let within = |v: u32, end: u32| (2..end - 2).contains(&v);
        let window = (16..28).contains(&x) && (12..20).contains(&y) && z > 20;
        let pillar = x % 16 / 4 == 2 && y % 12 / 4 == 1;
        match (within(x, 48) && within(y, 36) && within(z, 28), window) {
            (_, true) => 0,
            (true, _) => u32::from(pillar) * (1 + x / 16),
            _ => 4 + x / 12,
        }
    });
    let mut case = bodies();
    case.traced = vec![traced(&room, DAffine3::IDENTITY)];
    case.camera.world_from_camera =
        looking(DVec3::new(5.0, 4.5, 12.0), DVec3::new(30.0, 20.0, 12.0), case.camera.projection)
            .world_from_camera;
    case.camera.projection = Projection::Perspective { fov_rad: 1.4 };
    case.around.settings.bounces = 32;
    case.reach = 66.0;
    // Rough: errors of many mirror reflections would be too large for a comparison.
    surfaces_of(case, 0.8)
}

/// The floor under bodies and meshes is a shadow catcher, for a sun, emissive surfaces and uniform light around.
pub(crate) fn catching() -> Vec<Case> {
    let sky = Sky::Constant(Vec3::new(0.4, 0.5, 0.6));
    let lit = |suns| beside_meshes(bodies().with_lights(Lights::new(sky.clone(), suns, None)));
    // The ball's roughness.
    let shining = Case { sharpness: 1.0 / 0.49, ..lit(vec![sun(0.3, 2.0)]).sampling_emission() };
    let around = lit(Vec::new()).settings(|s| (s.mode, s.ao_distance) = (Mode::AmbientOcclusion, 30.0));
    let mut cases = vec![
        shining.named("a floor that catches, among what shines"),
        around.named("a floor that catches, occlusion"),
    ];
    for case in &mut cases {
        let floor = case.traced.len();
        case.around.materials[floor] =
            Arc::new(MaterialTable::clone(&case.around.materials[floor]).catching(true));
    }
    cases
}

/// All scenes.
pub(crate) fn cases() -> Vec<Case> {
    let aimed = |case: Case, suns: Vec<ReadySun>| case.with_lights(Lights::new(dark(), suns, None));
    let painted = |case: Case, suns: Vec<ReadySun>| {
        let case = case.with_lights(Lights::new(picture(1.0), suns, None));
        Case { borders: BORDERS, ..case }
    };
    let backdrop = Some([[0.1, 0.2, 0.3], [0.9, 0.8, 0.7]]);
    let mut flat = surfaces(bodies()).named("parallel rays, a backdrop");
    flat.camera.projection = Projection::Orthographic { scale: 50.0 };
    flat.film.filter = Filter::Box { width: 1.5 };
    // The near plane cuts through the bodies: half of the rays begin within one.
    let mut cut = flat.clone().named("rays that begin within");
    cut.camera.clip[0] = 115.0;
    let far = Lod::Distance { pixels: 1.6 };
    let aperture = Aperture { radius: 4.0, focus_distance: 118.0, blades: 5, rotation_rad: 0.3, ratio: 1.4 };
    let mut soft = aimed(bodies(), vec![sun(0.3, 2.0)]).named("depth of field");
    (soft.camera.aperture, soft.camera.fit, soft.film.pixel_aspect) =
        (Some(aperture), SensorFit::Vertical, 1.2);
    vec![
        bodies(),
        aimed(bodies(), vec![sun(0.0, 2.0)]).named("a sun of one direction"),
        aimed(bodies(), vec![sun(0.009, 2.0)]).named("the sun's own width"),
        aimed(bodies(), vec![sun(0.6, 2.0), sun(0.0, 0.5)]).named("a wide sun and a needle"),
        painted(bodies(), vec![]).named("a picture"),
        surfaces(painted(bodies(), vec![sun(0.3, 1.0)])).named("all surfaces under a picture and a sun"),
        surfaces(bodies()).named("all surfaces under an even sky"),
        Case { reach: 400.0, ..surfaces(bodies().with_lights(lit_by_lamps())) }
            .named("lamps of all kinds and a sun"),
        passed_through(aimed(bodies(), vec![sun(0.3, 2.0)])).named("glass, clear surfaces, coats and sheen"),
        bodies().settings(|s| s.mode = Mode::OneBounce).named("one bounce"),
        bodies().settings(|s| (s.mode, s.ao_distance) = (Mode::AmbientOcclusion, 9.0)).named("occlusion"),
        room().named("32 bounces and roulette"),
        room()
            .settings(|s| (s.russian_roulette, s.bounces) = (false, 12))
            .named("12 bounces without roulette"),
        aimed(bodies(), vec![sun(0.3, 2.0)]).lod(Lod::Cells).named("cells"),
        aimed(bodies(), vec![sun(0.3, 2.0)]).lod(Lod::Boxes).named("boxes"),
        aimed(bodies(), vec![sun(0.3, 2.0)]).lod(far).named("cells and voxels by distance"),
        several().named("several instances, labels hidden, colours of the palette"),
        beside_meshes(passed_through(aimed(bodies(), vec![sun(0.3, 2.0)]))).named("meshes beside a volume"),
        touching().named("instances that touch"),
        beside_smooth_meshes(passed_through(aimed(bodies(), vec![sun(0.3, 2.0)]))).named("smooth meshes"),
        beside_smooth_meshes(bodies())
            .settings(|s| (s.mode, s.ao_distance) = (Mode::AmbientOcclusion, 30.0))
            .named("occlusion of smooth surfaces"),
        surfaces(several().with_lights(Lights::new(dark(), vec![sun(0.3, 2.0)], None)))
            .settings(|s| s.smooth_voxels = true)
            .named("smooth voxels"),
        passed_through(aimed(bodies(), vec![sun(0.3, 2.0)]))
            .lod(far)
            .settings(|s| s.smooth_voxels = true)
            .named("glass and levels of detail, shaded smooth"),
        surfaces(aimed(bodies(), vec![])).sampling_emission().named("labels that shine, in the dark"),
        surfaces(painted(bodies(), vec![sun(0.3, 1.0)]))
            .sampling_emission()
            .named("labels that shine, under a picture and a sun"),
        surfaces(several()).sampling_emission().named("labels that shine, of several instances"),
        surfaces(aimed(bodies(), vec![sun(0.3, 2.0)]))
            .lod(far)
            .sampling_emission()
            .named("labels that shine, cells and voxels by distance"),
        beside_meshes(passed_through(aimed(bodies(), vec![])))
            .sampling_emission()
            .named("meshes and coated labels that shine, among glass"),
        cut,
        soft,
        flat.with_lights(Lights::new(dark(), vec![sun(0.3, 2.0)], backdrop)),
    ]
}
