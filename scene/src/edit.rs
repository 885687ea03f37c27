//! One change to a scene, as a live client sends it: a camera move sends a camera, a colour edit sends a material. To add an instance or
//! a mesh needs its data too (a volume or triangles), so `pumice_transport::LoadedEdit` does that, not [`SceneEdit`].
//!
//! The JSON form has the tag `edit` beside the fields of the variant: `{"edit": "camera", "camera": {…}}`.

use std::collections::BTreeMap;

use glam::DAffine3;
use serde::{Deserialize, Serialize};

use crate::json::parsed;
use crate::label_materials::each_once;
use crate::{
    Camera, Cut, Film, Instance, LabelGroups, LabelStyle, Light, Material, Mesh, Scene, SceneError, Settings,
    Show, Sun, World,
};

/// A change to one part of a scene. Instances and meshes are named by their id.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "edit", rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum SceneEdit {
    /// Replaces the camera.
    Camera {
        /// The new camera, with all its fields.
        camera: Camera,
    },
    /// Replaces the film, such as its size or its filter.
    Film {
        /// The new film, with all its fields.
        film: Film,
    },
    /// Replaces the sky and the backdrop.
    World {
        /// The new world, with all its fields.
        world: World,
    },
    /// Replaces all suns.
    Suns {
        /// The new list.
        suns: Vec<Sun>,
    },
    /// Replaces all lamps.
    Lights {
        /// The new list.
        lights: Vec<Light>,
    },
    /// Replaces all cuts.
    Cuts {
        /// The new list.
        cuts: Vec<Cut>,
    },
    /// Replaces the settings, such as the integrator, the level of detail or the seed.
    Settings {
        /// The new settings, with all their fields.
        settings: Settings,
    },
    /// Moves an instance.
    Place {
        /// Id of the instance.
        id: u32,
        /// Index space to world.
        world_from_index: DAffine3,
    },
    /// Chooses which labels of an instance are drawn.
    Show {
        /// Id of the instance.
        id: u32,
        /// The labels to draw.
        show: Show,
    },
    /// Replaces the material of the labels of an instance that have none of their own.
    Material {
        /// Id of the instance.
        id: u32,
        /// The new material, with all its fields.
        material: Material,
    },
    /// Switches automatic colours of an instance on or off.
    AutoColor {
        /// Id of the instance.
        id: u32,
        /// Whether labels that touch get different colours.
        auto_color: bool,
    },
    /// Sets materials of single labels; labels that are not named keep theirs.
    LabelMaterials {
        /// Id of the instance.
        id: u32,
        /// By the label's original id; `null` removes a label's own material.
        #[serde(deserialize_with = "each_once")]
        materials: BTreeMap<u64, Option<Material>>,
    },
    /// Replaces all groups of labels of an instance.
    Groups {
        /// Id of the instance.
        id: u32,
        /// The new groups.
        groups: LabelGroups,
    },
    /// Replaces the material of one group of labels.
    GroupMaterial {
        /// Id of the instance.
        id: u32,
        /// Index of the group.
        group: usize,
        /// The new material, with all its fields.
        material: Material,
    },
    /// Removes an instance.
    Remove {
        /// Id of the instance.
        id: u32,
    },
    /// Moves a mesh.
    PlaceMesh {
        /// Id of the mesh.
        id: u32,
        /// The mesh's own space to world.
        world_from_mesh: DAffine3,
    },
    /// Replaces all materials of a mesh.
    MeshMaterials {
        /// Id of the mesh.
        id: u32,
        /// The new list.
        materials: Vec<Material>,
    },
    /// Removes a mesh.
    RemoveMesh {
        /// Id of the mesh.
        id: u32,
    },
}

impl SceneEdit {
    /// The tags of the JSON form, one per variant.
    pub const NAMES: [&str; 18] = [
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
        "groups",
        "group_material",
        "remove",
        "place_mesh",
        "mesh_materials",
        "remove_mesh",
    ];

    /// The tag of this edit in the JSON form. Counters of edits use it as their name.
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
            Self::Groups { .. } => "groups",
            Self::GroupMaterial { .. } => "group_material",
            Self::Remove { .. } => "remove",
            Self::PlaceMesh { .. } => "place_mesh",
            Self::MeshMaterials { .. } => "mesh_materials",
            Self::RemoveMesh { .. } => "remove_mesh",
        }
    }

    /// Reads a list of edits.
    ///
    /// # Errors
    /// [`SceneError::Json`] says what is not a valid edit, by line and column.
    pub fn list_from_json(text: &str) -> Result<Vec<Self>, SceneError> {
        parsed(text)
    }
}

impl Scene {
    /// Applies edits in order. The result is not validated: call [`Scene::validate`] afterwards.
    ///
    /// # Errors
    /// [`SceneError::Field`] names an instance or mesh that does not exist; the edits before it have been applied.
    pub fn apply(&mut self, edits: Vec<SceneEdit>) -> Result<(), SceneError> {
        edits.into_iter().enumerate().try_for_each(|(number, edit)| self.apply_one(number, edit))
    }

    /// Applies one edit. `number` is its index in its list, for error texts. The result is not validated.
    ///
    /// # Errors
    /// [`SceneError::Field`] names an instance or mesh that does not exist; the scene is then unchanged.
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
            SceneEdit::Groups { id, groups } => self.style_mut(number, name, id)?.groups = groups,
            SceneEdit::GroupMaterial { id, group, material } => {
                let groups = &mut self.style_mut(number, name, id)?.groups;
                let count = groups.len();
                *groups.material_mut(group).ok_or_else(|| SceneError::Field {
                    field: format!("edits[{number}].{name}.group"),
                    problem: format!("instance {id} has no group {group}; it has {count}"),
                })? = material;
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

    /// Adds an instance, or replaces the one with the same id.
    pub fn put_instance(&mut self, instance: Instance) {
        match self.instances.iter_mut().find(|o| o.id == instance.id) {
            Some(old) => *old = instance,
            None => self.instances.push(instance),
        }
    }

    /// Adds a mesh, or replaces the one with the same id.
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
