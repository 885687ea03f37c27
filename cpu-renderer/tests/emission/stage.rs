//! Hand-made scenes with emissive surfaces, and the mean of a camera's picture from above.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pumice_core::{CompressedVolume, Job, MeshData};
use pumice_cpu::traverse::{MeshTracer, SceneTracer, TracedInstance, VolumeTracer};
use pumice_cpu::{PathTracer, Surroundings, emitters_of};
use pumice_scene::{Camera, CutShape, Film, Filter, LabelStyle, Material, Mode, Projection, Settings, Sun};
use pumice_transport::geometry::LodChoice;
use pumice_transport::{Emitters, LightStrategy, Lights, MaterialTable, ReadySun, Sky};

pub(crate) fn lambert(albedo: f32) -> Material {
    Material { base_color: [albedo; 3], specular: 0.0, roughness: 1.0, ..Material::default() }
}

pub(crate) fn glowing(emission: [f32; 3]) -> Material {
    Material { emission, ..lambert(0.3) }
}

/// Two triangles that lean against each other and one below; the second material is that of one side.
pub(crate) fn tent() -> Arc<MeshData> {
    let positions =
        vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.5, 1.5], [1.0, 2.0, 0.0], [0.5, 3.0, -1.0]];
    let triangles = vec![[0, 1, 2], [1, 3, 2], [0, 3, 4]];
    Arc::new(MeshData::new(positions, triangles, vec![1, 0, 1]).unwrap())
}

pub(crate) struct Stage {
    pub(crate) tracer: SceneTracer,
    materials: Vec<Arc<MaterialTable>>,
    under_a_sky: bool,
    mode: Mode,
    seen: Option<(DVec3, f64)>,
    bounds: (DVec3, DVec3),
}

impl Stage {
    pub(crate) fn new() -> Self {
        Self {
            tracer: SceneTracer::of(Vec::new()),
            materials: Vec::new(),
            under_a_sky: false,
            mode: Mode::Path,
            seen: None,
            bounds: (DVec3::INFINITY, DVec3::NEG_INFINITY),
        }
    }

    fn reach(&mut self, points: impl Iterator<Item = DVec3>) {
        for p in points {
            self.bounds = (self.bounds.0.min(p), self.bounds.1.max(p));
        }
    }

    /// Adds a volume with all labels shown; the first material is that of the first label.
    pub(crate) fn with_volume(
        mut self,
        volume: &Arc<CompressedVolume>,
        place: DAffine3,
        materials: &[Material],
        lod: LodChoice,
    ) -> Self {
        let ids = volume.labels().ids();
        let visible = vec![true; ids.len()];
        let style = LabelStyle {
            materials: ids.iter().copied().zip(materials.iter().copied()).collect(),
            ..LabelStyle::default()
        };
        let materials = MaterialTable::new(&style, ids, std::iter::empty(), &visible);
        let traced = TracedInstance { volume: Arc::clone(volume), world_from_index: place, visible, lod };
        let instance = self.materials.len() as u32;
        let mut volumes = self.tracer.volumes().to_vec();
        volumes.push(Arc::new(VolumeTracer::new(instance, &traced).unwrap()));
        self.tracer = SceneTracer::of(volumes);
        self.materials.push(Arc::new(materials));
        let dims = volume.info().dims.map(f64::from);
        self.reach((0..8).map(|c| {
            place
                .transform_point3(DVec3::from([0, 1, 2].map(|a| if c >> a & 1 == 1 { dims[a] } else { 0.0 })))
        }));
        self
    }

    /// Adds a mesh; meshes must come last.
    pub(crate) fn with_mesh(mut self, mesh: &Arc<MeshData>, place: DAffine3, materials: &[Material]) -> Self {
        let instance = self.materials.len() as u32;
        let triangles = MeshTracer::new(0, instance, mesh, place).unwrap();
        self.tracer = SceneTracer::of(self.tracer.volumes().to_vec()).with_meshes(vec![Arc::new(triangles)]);
        self.materials.push(Arc::new(MaterialTable::of_mesh(materials)));
        self
    }

    /// Cuts the only volume.
    pub(crate) fn cut(mut self, cuts: &[CutShape]) -> Self {
        let [only] = self.tracer.volumes() else { panic!("one volume") };
        let place = only.placement().world_from_index;
        let again = only.again(0, place, LodChoice::Voxels).unwrap().unwrap();
        self.tracer = SceneTracer::of(vec![Arc::new(again.with_cuts(cuts))]);
        self
    }

    pub(crate) fn under_a_sky(mut self) -> Self {
        self.under_a_sky = true;
        self
    }

    /// Looks straight down at a square around a point, from just above it; one bounce.
    pub(crate) fn seen_at(mut self, point: DVec3, side: f64) -> Self {
        self.seen = Some((point, side));
        self.mode = Mode::OneBounce;
        self
    }

    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        self.bounds
    }

    pub(crate) fn emitters(&self) -> Option<Emitters> {
        emitters_of(&self.tracer, &self.materials).unwrap()
    }

    /// Mean of the picture over this many seeds, channels added up, and the variance of that mean.
    pub(crate) fn estimate(&self, finding: LightStrategy, seeds: u64, samples: u32) -> (f64, f64) {
        let (sky, suns) = match self.under_a_sky {
            false => (Sky::Constant(Vec3::ZERO), vec![]),
            true => {
                let direction = [0.3, 0.2, -1.0];
                let sun = Sun { direction, strength: 0.5, color: [1.0; 3], angle_rad: 0.1 };
                (Sky::Constant(Vec3::splat(0.1)), vec![ReadySun::new(&sun)])
            }
        };
        let emitters = self.emitters().map(Arc::new);
        let lights = Lights::new(sky, suns, None).with_emitters(emitters).with_strategy(finding);
        let lights = Arc::new(lights);
        let (lo, hi) = self.bounds;
        let (middle, side) = self.seen.unwrap_or(((lo + hi) * 0.5, (hi - lo).max_element()));
        let near = 1e-3 * side;
        let (position, far) = match self.seen {
            Some(_) => (middle + DVec3::Z * near, 2.0 * near),
            None => (DVec3::new(middle.x, middle.y, hi.z + side), f64::INFINITY),
        };
        let above = DAffine3::from_mat3_translation(DMat3::IDENTITY, position);
        let mut camera = Camera::new(above, Projection::Orthographic { scale: side });
        camera.clip = [0.0, far];
        let film = Film::new(12, 12, Filter::Box { width: 1.0 });
        let means: Vec<f64> = (0..seeds)
            .map(|seed| {
                let around = Surroundings {
                    lights: Arc::clone(&lights),
                    materials: self.materials.clone().into(),
                    settings: Settings { mode: self.mode, bounces: 4, seed, ..Settings::default() },
                };
                let tracer = SceneTracer::of(self.tracer.volumes().to_vec())
                    .with_meshes(self.tracer.meshes().to_vec());
                let mut picture = PathTracer::new(tracer, around, &camera, &film).unwrap();
                picture.add_samples(samples, &Job::default()).unwrap();
                let mean = picture.film().mean().unwrap();
                let sum: Vec3 = mean.pixels.iter().map(|p| Vec3::from_array(*p)).sum();
                f64::from(sum.element_sum()) / mean.pixels.len() as f64
            })
            .collect();
        let n = seeds as f64;
        let mean = means.iter().sum::<f64>() / n;
        (mean, means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n * (n - 1.0)))
    }
}
