//! A scene with the volumes and the meshes that it names: one value, valid as a whole.
//!
//! ```text
//! Scene ── instances[i] ── volumes[i]     checked together, once: lists of equal length, labels that are there, numbers in range
//!      └── meshes[i] ───── meshes[i]
//! ```
//! What it needs of a renderer is found then too. It never changes: an edit gives another one, which shares what the edit leaves alone. Copies share everything.

use std::collections::BTreeMap;
use std::sync::Arc;

use pumice_core::{CompressedVolume, MeshData};
use pumice_scene::{Film, Instance, Mesh, Needs, Part, PartSet, Scene, SceneEdit, SceneError};

use crate::RenderError;
use crate::geometry::LodChoice;

/// See the module.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    scene: Arc<Scene>,
    volumes: Arc<[Arc<CompressedVolume>]>,
    meshes: Arc<[Arc<MeshData>]>,
    needs: Arc<Needs>,
}

/// A change to a loaded scene. What is added comes with its data.
#[derive(Clone, Debug)]
pub enum LoadedEdit {
    /// Of what is there already.
    Scene(SceneEdit),
    /// One more instance, or another one in the place of that with the same id.
    Add {
        /// The instance.
        instance: Box<Instance>,
        /// Its volume.
        volume: Arc<CompressedVolume>,
    },
    /// One more mesh, or another one in the place of that with the same id.
    AddMesh {
        /// The mesh.
        mesh: Box<Mesh>,
        /// Its triangles.
        data: Arc<MeshData>,
    },
}

impl LoadedEdit {
    /// Names of the edits that bring data with them; all others are [`SceneEdit::NAMES`].
    pub const NAMES_OF_ADDING: [&str; 2] = ["add", "add_mesh"];

    /// Counters are named by it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Scene(edit) => edit.name(),
            Self::Add { .. } => Self::NAMES_OF_ADDING[0],
            Self::AddMesh { .. } => Self::NAMES_OF_ADDING[1],
        }
    }
}

impl From<SceneEdit> for LoadedEdit {
    fn from(edit: SceneEdit) -> Self {
        Self::Scene(edit)
    }
}

fn fault(error: SceneError) -> RenderError {
    RenderError::Scene(error.to_string())
}

impl LoadedScene {
    /// `volumes[i]` belongs to `scene.instances[i]`, `meshes[i]` to `scene.meshes[i]`.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the field that is not valid ([`Scene::validate`]), the counts that differ, or the label that the
    /// volume does not have or that was not read from its file.
    pub fn new(
        scene: Scene,
        volumes: Vec<Arc<CompressedVolume>>,
        meshes: Vec<Arc<MeshData>>,
    ) -> Result<Self, RenderError> {
        scene.validate().map_err(fault)?;
        check_count("instances", "volume", scene.instances.len(), volumes.len())?;
        check_count("meshes", "mesh", scene.meshes.len(), meshes.len())?;
        for (place, (instance, volume)) in scene.instances.iter().zip(&volumes).enumerate() {
            check_labels(place, instance, volume)?;
        }
        let ids: Vec<&[u64]> = volumes.iter().map(|v| v.labels().ids()).collect();
        let needs = Needs::of(&scene, &ids, meshes.iter().any(|mesh| mesh.is_smooth()));
        let (scene, needs) = (Arc::new(scene), Arc::new(needs));
        Ok(Self { scene, volumes: volumes.into(), meshes: meshes.into(), needs })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The volume of each instance.
    pub fn volumes(&self) -> &[Arc<CompressedVolume>] {
        &self.volumes
    }

    /// The triangles of each mesh.
    pub fn meshes(&self) -> &[Arc<MeshData>] {
        &self.meshes
    }

    /// What a renderer builds for it.
    pub fn needs(&self) -> &Needs {
        &self.needs
    }

    /// How its levels of detail are chosen: among all of them where they are built though all boxes are drawn by their voxels.
    pub fn lod(&self) -> LodChoice {
        let lod = LodChoice::new(self.scene.settings.lod, &self.scene.camera, &self.scene.film);
        if self.needs.parts().has(Part::Levels) { lod.with_level_bounds() } else { lod }
    }

    /// The same, for which these parts are built besides; its picture is the same.
    #[must_use]
    pub fn with_parts(&self, parts: PartSet) -> Self {
        let needs = parts.parts().fold(Needs::clone(&self.needs), Needs::with);
        Self { needs: Arc::new(needs), ..self.clone() }
    }

    /// The volume of the instance with this id.
    pub fn volume(&self, id: u32) -> Option<&Arc<CompressedVolume>> {
        let place = self.scene.instances.iter().position(|i| i.id == id)?;
        self.volumes.get(place)
    }

    /// Which labels of the instance at a place are drawn, by dense index.
    pub fn visible(&self, place: usize) -> Vec<bool> {
        self.scene.instances[place].style.show.among(self.volumes[place].labels().ids())
    }

    /// The same on another film.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the field of the film that is not valid.
    pub fn with_film(&self, film: Film) -> Result<Self, RenderError> {
        let scene = Scene { film, ..Scene::clone(&self.scene) };
        scene.validate().map_err(fault)?;
        let needs = Arc::new(self.needs.on_film(&scene));
        Ok(Self { scene: Arc::new(scene), needs, ..self.clone() })
    }

    /// The scene after edits, in their order: all of them, or none where this fails.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the instance that is not there, or what of the result is not valid, as [`LoadedScene::new`].
    pub fn edited(&self, edits: Vec<LoadedEdit>) -> Result<Self, RenderError> {
        let mut scene = Scene::clone(&self.scene);
        let mut volumes: BTreeMap<u32, Arc<CompressedVolume>> =
            scene.instances.iter().map(|i| i.id).zip(self.volumes.iter().cloned()).collect();
        let mut meshes: BTreeMap<u32, Arc<MeshData>> =
            scene.meshes.iter().map(|m| m.id).zip(self.meshes.iter().cloned()).collect();
        for (number, edit) in edits.into_iter().enumerate() {
            match edit {
                LoadedEdit::Scene(edit) => scene.apply_one(number, edit).map_err(fault)?,
                LoadedEdit::Add { instance, volume } => {
                    volumes.insert(instance.id, volume);
                    scene.put_instance(*instance);
                }
                LoadedEdit::AddMesh { mesh, data } => {
                    meshes.insert(mesh.id, data);
                    scene.put_mesh(*mesh);
                }
            }
        }
        let volumes = scene.instances.iter().filter_map(|i| volumes.get(&i.id).cloned()).collect();
        let meshes = scene.meshes.iter().filter_map(|m| meshes.get(&m.id).cloned()).collect();
        Self::new(scene, volumes, meshes)
    }
}

fn check_count(list: &str, what: &str, expected: usize, got: usize) -> Result<(), RenderError> {
    if expected == got {
        return Ok(());
    }
    Err(RenderError::Scene(format!("{list}: expected one {what} for each of {expected}, got {got}")))
}

/// Whether a volume has the labels that its instance shows.
fn check_labels(place: usize, instance: &Instance, volume: &CompressedVolume) -> Result<(), RenderError> {
    let (ids, field) = (volume.labels().ids(), format!("instances[{place}].style.show"));
    let shown = instance.style.show.resolve(&field, ids).map_err(fault)?;
    if volume.is_whole() {
        return Ok(());
    }
    let missing = (0u32..).zip(shown).find(|(label, is_shown)| *is_shown && !volume.holds(*label));
    match missing {
        None => Ok(()),
        Some((label, _)) => Err(RenderError::Scene(format!(
            "{field}: label {} was not read from the volume's file; open it with this label too",
            ids[label as usize]
        ))),
    }
}
