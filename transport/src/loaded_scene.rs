//! A scene together with its volumes and meshes: one value, validated as a whole.
//!
//! ```text
//! Scene ── instances[i] ── volumes[i]     checked together, once: equal list lengths, existing labels, numbers in range
//!      └── meshes[i] ───── meshes[i]
//! ```
//! The needs of the scene (what a renderer must build) are found at the same time. The value is immutable: an edit returns a new one, which
//! shares all data that the edit does not change. Clones share everything.

use std::collections::BTreeMap;
use std::sync::Arc;

use pumice_core::{CompressedVolume, MeshData};
use pumice_scene::{Film, Instance, Mesh, Needs, Part, PartSet, Scene, SceneEdit, SceneError, Show};

use crate::RenderError;
use crate::geometry::LodChoice;

/// A scene with its data (see the module).
#[derive(Clone, Debug)]
pub struct LoadedScene {
    scene: Arc<Scene>,
    volumes: Arc<[Arc<CompressedVolume>]>,
    meshes: Arc<[Arc<MeshData>]>,
    needs: Arc<Needs>,
}

/// A change to a loaded scene. Added instances and meshes come with their data.
#[derive(Clone, Debug)]
pub enum LoadedEdit {
    /// An edit of what the scene already contains.
    Scene(SceneEdit),
    /// Adds an instance, or replaces the one with the same id.
    Add {
        /// The instance.
        instance: Box<Instance>,
        /// Volume of the instance.
        volume: Arc<CompressedVolume>,
    },
    /// Adds a mesh, or replaces the one with the same id.
    AddMesh {
        /// The mesh.
        mesh: Box<Mesh>,
        /// Triangles of the mesh.
        data: Arc<MeshData>,
    },
}

impl LoadedEdit {
    /// Names of the edits that bring data; the names of all others are [`SceneEdit::NAMES`].
    pub const NAMES_OF_ADDING: [&str; 2] = ["add", "add_mesh"];

    /// Name of the edit, which is also the name of its counter.
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
    /// Combines a scene with its data: `volumes[i]` belongs to `scene.instances[i]`, `meshes[i]` to `scene.meshes[i]`.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the invalid field ([`Scene::validate`]), the lists whose lengths differ, or the label that the volume
    /// does not have or that was not read from its file.
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

    /// The data that a renderer builds for the scene.
    pub fn needs(&self) -> &Needs {
        &self.needs
    }

    /// How levels of detail are chosen. Where the scene's parts include levels, they are chosen box by box even if every box is drawn at
    /// voxel level.
    pub fn lod(&self) -> LodChoice {
        let lod = LodChoice::new(self.scene.settings.lod, &self.scene.camera, &self.scene.film);
        if self.needs.parts().has(Part::Levels) { lod.with_level_bounds() } else { lod }
    }

    /// The same scene, for which these parts are built in addition; its picture is the same.
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

    /// Flags of the visible labels of instance number `place`, by dense index.
    pub fn visible(&self, place: usize) -> Vec<bool> {
        self.scene.instances[place].style.show.among(self.volumes[place].labels().ids())
    }

    /// The same scene on another film.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the invalid field of the film.
    pub fn with_film(&self, film: Film) -> Result<Self, RenderError> {
        let scene = Scene { film, ..Scene::clone(&self.scene) };
        scene.validate().map_err(fault)?;
        let needs = Arc::new(self.needs.on_film(&scene));
        Ok(Self { scene: Arc::new(scene), needs, ..self.clone() })
    }

    /// The scene after these edits, applied in order: all of them, or none if one fails.
    ///
    /// # Errors
    /// [`RenderError::Scene`] names the instance that does not exist, or the invalid part of the result as [`LoadedScene::new`] does.
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

/// Checks that the volume has the labels that its instance shows, and that they were read.
fn check_labels(place: usize, instance: &Instance, volume: &CompressedVolume) -> Result<(), RenderError> {
    if volume.is_whole() && instance.style.show == Show::All {
        return Ok(());
    }
    let (ids, field) = (volume.labels().ids(), format!("instances[{place}].style.show"));
    if volume.is_whole() {
        return instance.style.show.check(&field, ids).map_err(fault);
    }
    let shown = instance.style.show.resolve(&field, ids).map_err(fault)?;
    let missing = (0u32..).zip(shown).find(|(label, is_shown)| *is_shown && !volume.holds(*label));
    match missing {
        None => Ok(()),
        Some((label, _)) => Err(RenderError::Scene(format!(
            "{field}: label {} was not read from the volume's file; open it with this label too",
            ids[label as usize]
        ))),
    }
}
