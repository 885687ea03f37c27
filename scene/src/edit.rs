//! One change to a scene, as a live client sends it: a camera move sends a camera, a colour edit a material. What is added needs data
//! besides, a volume or triangles, and is no edit of the scene alone: `pumice_transport::LoadedEdit`.
//!
//! The JSON form has the tag `edit` beside the fields of the variant: `{"edit": "camera", "camera": {…}}`.

use std::collections::BTreeMap;

use glam::DAffine3;
use serde::{Deserialize, Serialize};

use crate::label_materials::each_once;
use crate::{
    Camera, Cut, Film, Instance, LabelStyle, Light, Material, Mesh, Scene, SceneError, Settings, Show, Sun,
    World,
};

/// A change to one part of a scene. Instances are named by their id.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "edit", rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum SceneEdit {
    /// Another camera.
    Camera {
        /// The whole of it.
        camera: Camera,
    },
    /// Another size or filter.
    Film {
        /// The whole of it.
        film: Film,
    },
    /// Another sky or backdrop.
    World {
        /// The whole of it.
        world: World,
    },
    /// Other suns.
    Suns {
        /// All of them.
        suns: Vec<Sun>,
    },
    /// Other lamps.
    Lights {
        /// All of them.
        lights: Vec<Light>,
    },
    /// Other parts are cut away.
    Cuts {
        /// All of them.
        cuts: Vec<Cut>,
    },
    /// Another integrator, level of detail or seed.
    Settings {
        /// All of them.
        settings: Settings,
    },
    /// An instance stands elsewhere.
    Place {
        /// Of the instance.
        id: u32,
        /// Index space to world.
        world_from_index: DAffine3,
    },
    /// Other labels of an instance are drawn.
    Show {
        /// Of the instance.
        id: u32,
        /// Which.
        show: Show,
    },
    /// The material of labels that have none of their own.
    Material {
        /// Of the instance.
        id: u32,
        /// The whole of it.
        material: Material,
    },
    /// Whether labels that touch get different colours.
    AutoColor {
        /// Of the instance.
        id: u32,
        /// Whether they do.
        auto_color: bool,
    },
    /// Materials of single labels; those not named stay as they are.
    LabelMaterials {
        /// Of the instance.
        id: u32,
        /// By the label's original id; `null` takes a label's own material away.
        #[serde(deserialize_with = "each_once")]
        materials: BTreeMap<u64, Option<Material>>,
    },
    /// An instance goes.
    Remove {
        /// Of the instance.
        id: u32,
    },
    /// A mesh stands elsewhere.
    PlaceMesh {
        /// Of the mesh.
        id: u32,
        /// Its own space to world.
        world_from_mesh: DAffine3,
    },
    /// A mesh has other materials.
    MeshMaterials {
        /// Of the mesh.
        id: u32,
        /// All of them.
        materials: Vec<Material>,
    },
    /// A mesh goes.
    RemoveMesh {
        /// Of the mesh.
        id: u32,
    },
}

impl SceneEdit {
    /// Every tag of the JSON form.
    pub const NAMES: [&str; 16] = [
        "camera",
        "film",
        "world",
        "suns",
        "lights",
        "cuts",
        "settings",
        "place",
        "show",
        "material",
        "auto_color",
        "label_materials",
        "remove",
        "place_mesh",
        "mesh_materials",
        "remove_mesh",
    ];

    /// The tag of the JSON form; counters are named by it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Camera { .. } => "camera",
            Self::Film { .. } => "film",
            Self::World { .. } => "world",
            Self::Suns { .. } => "suns",
            Self::Lights { .. } => "lights",
            Self::Cuts { .. } => "cuts",
            Self::Settings { .. } => "settings",
            Self::Place { .. } => "place",
            Self::Show { .. } => "show",
            Self::Material { .. } => "material",
            Self::AutoColor { .. } => "auto_color",
            Self::LabelMaterials { .. } => "label_materials",
            Self::Remove { .. } => "remove",
            Self::PlaceMesh { .. } => "place_mesh",
            Self::MeshMaterials { .. } => "mesh_materials",
            Self::RemoveMesh { .. } => "remove_mesh",
        }
    }

    /// Reads a list of edits.
    ///
    /// # Errors
    /// [`SceneError::Json`] says what is no edit, and where.
    pub fn list_from_json(text: &str) -> Result<Vec<Self>, SceneError> {
        Ok(serde_json::from_str(text)?)
    }
}

impl Scene {
    /// Applies edits in their order. The result is not validated: call [`Scene::validate`] when all are in.
    ///
    /// # Errors
    /// [`SceneError::Field`] names an instance that is not there; edits before it have been applied.
    pub fn apply(&mut self, edits: Vec<SceneEdit>) -> Result<(), SceneError> {
        edits.into_iter().enumerate().try_for_each(|(number, edit)| self.apply_one(number, edit))
    }

    /// Applies the edit of this number in a list. The result is not validated.
    ///
    /// # Errors
    /// [`SceneError::Field`] names an instance that is not there; nothing has changed then.
    pub fn apply_one(&mut self, number: usize, edit: SceneEdit) -> Result<(), SceneError> {
        let name = edit.name();
        match edit {
            SceneEdit::Camera { camera } => self.camera = camera,
            SceneEdit::Film { film } => self.film = film,
            SceneEdit::World { world } => self.world = world,
            SceneEdit::Suns { suns } => self.suns = suns,
            SceneEdit::Lights { lights } => self.lights = lights,
            SceneEdit::Cuts { cuts } => self.cuts = cuts,
            SceneEdit::Settings { settings } => self.settings = settings,
            SceneEdit::Place { id, world_from_index } => {
                self.instance_mut(number, name, id)?.world_from_index = world_from_index;
            }
            SceneEdit::Show { id, show } => self.style_mut(number, name, id)?.show = show,
            SceneEdit::Material { id, material } => self.style_mut(number, name, id)?.material = material,
            SceneEdit::AutoColor { id, auto_color } => {
                self.style_mut(number, name, id)?.auto_color = auto_color;
            }
            SceneEdit::LabelMaterials { id, materials } => {
                let own = &mut self.style_mut(number, name, id)?.materials;
                for (label, material) in materials {
                    match material {
                        Some(material) => own.insert(label, material),
                        None => own.remove(&label),
                    };
                }
            }
            SceneEdit::Remove { id } => {
                self.instance_mut(number, name, id)?;
                self.instances.retain(|o| o.id != id);
            }
            SceneEdit::PlaceMesh { id, world_from_mesh } => {
                self.mesh_mut(number, name, id)?.world_from_mesh = world_from_mesh;
            }
            SceneEdit::MeshMaterials { id, materials } => {
                self.mesh_mut(number, name, id)?.materials = materials;
            }
            SceneEdit::RemoveMesh { id } => {
                self.mesh_mut(number, name, id)?;
                self.meshes.retain(|o| o.id != id);
            }
        }
        Ok(())
    }

    /// Adds an instance, or puts it in the place of that with the same id.
    pub fn put_instance(&mut self, instance: Instance) {
        match self.instances.iter_mut().find(|o| o.id == instance.id) {
            Some(old) => *old = instance,
            None => self.instances.push(instance),
        }
    }

    /// Adds a mesh, or puts it in the place of that with the same id.
    pub fn put_mesh(&mut self, mesh: Mesh) {
        match self.meshes.iter_mut().find(|o| o.id == mesh.id) {
            Some(old) => *old = mesh,
            None => self.meshes.push(mesh),
        }
    }

    fn instance_mut(&mut self, edit: usize, name: &str, id: u32) -> Result<&mut Instance, SceneError> {
        let ids: Vec<u32> = self.instances.iter().map(|i| i.id).collect();
        self.instances.iter_mut().find(|i| i.id == id).ok_or_else(|| SceneError::Field {
            field: format!("edits[{edit}].{name}.id"),
            problem: format!("the scene has no instance {id}; its instances are {ids:?}"),
        })
    }

    fn mesh_mut(&mut self, edit: usize, name: &str, id: u32) -> Result<&mut Mesh, SceneError> {
        let ids: Vec<u32> = self.meshes.iter().map(|m| m.id).collect();
        self.meshes.iter_mut().find(|m| m.id == id).ok_or_else(|| SceneError::Field {
            field: format!("edits[{edit}].{name}.id"),
            problem: format!("the scene has no mesh {id}; its meshes are {ids:?}"),
        })
    }

    fn style_mut(&mut self, edit: usize, name: &str, id: u32) -> Result<&mut LabelStyle, SceneError> {
        Ok(&mut self.instance_mut(edit, name, id)?.style)
    }
}
