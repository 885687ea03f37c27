//! The types of a scene, as plain serde types. The JSON form of a scene is these types and nothing else.
//!
//! Frames: **world** is the scene's space, right-handed, z up, f64. **camera** looks along −z, +y up, +x right. **index** is a
//! volume's own voxel space (`pumice_core::info`). A matrix named `a_from_b` maps b to a.
//! Units: lengths in world units, angles in radians, radiance linear Rec. 709.
#![forbid(unsafe_code)]

pub mod camera;
pub mod cut;
pub mod diff;
pub mod edit;
pub mod error;
pub mod json;
pub mod label_groups;
pub mod label_materials;
pub mod light;
pub mod material;
pub mod mesh;
pub mod needs;
pub mod part;
pub mod passes;
pub mod reading;
pub mod scene;
pub mod settings;
pub mod show;
pub mod validate;

pub use camera::{Aperture, Camera, Projection, SensorFit};
pub use cut::{Cut, CutShape};
pub use diff::{InstanceDiff, MeshDiff, SceneDiff};
pub use edit::SceneEdit;
pub use error::SceneError;
pub use label_groups::{LabelGroup, LabelGroups};
pub use label_materials::LabelMaterials;
pub use light::{Environment, Light, LightShape, Outline, Sun, World};
pub use material::Material;
pub use mesh::Mesh;
pub use needs::{INSTANCES_OF_A_TREE, LAMPS_OF_A_TREE, LabelCount, Needs};
pub use part::{Part, PartSet};
pub use passes::{Pass, Passes};
pub use reading::{AbsentChunks, AxisOrder, LevelOfFile, RawVoxels, Reading};
pub use scene::{Instance, LabelStyle, SCENE_VERSION, Scene};
pub use settings::{Adaptive, Film, Filter, Lod, Mode, Settings, ViewTransform};
pub use show::Show;
