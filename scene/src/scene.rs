//! The scene: instances of volumes, their labels' looks, camera, light, settings.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::path::PathBuf;

use glam::DAffine3;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::{Camera, Film, Material, Settings, Show, Sun, World};

/// Version of the JSON form that this code writes and reads.
pub const SCENE_VERSION: u32 = 1;

/// How the labels of a volume look: one material for all, and exceptions by id.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LabelStyle {
    /// Which labels are drawn.
    pub show: Show,
    /// Material of labels that have none of their own; its base colour is replaced where `auto_color` is set.
    pub material: Material,
    /// Gives each label a colour unlike its neighbours'.
    pub auto_color: bool,
    /// Materials by original id.
    #[serde(deserialize_with = "each_once")]
    pub materials: BTreeMap<u64, Material>,
}

/// Reads a map by label id and refuses an id that comes twice: which of the two was meant cannot be known.
pub(crate) fn each_once<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<BTreeMap<u64, T>, D::Error> {
    struct EachOnce<T>(PhantomData<T>);
    impl<'de, T: Deserialize<'de>> Visitor<'de> for EachOnce<T> {
        type Value = BTreeMap<u64, T>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("materials by label id")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut materials = BTreeMap::new();
            while let Some((LabelId(id), material)) = map.next_entry()? {
                if materials.insert(id, material).is_some() {
                    return Err(serde::de::Error::custom(format!("materials: {id} has two")));
                }
            }
            Ok(materials)
        }
    }
    from.deserialize_map(EachOnce(PhantomData))
}

/// A key of such a map. JSON spells keys as text; within a tagged form ([`crate::SceneEdit`]) serde hands that text over as it is.
struct LabelId(u64);

impl<'de> Deserialize<'de> for LabelId {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Id;
        impl Visitor<'_> for Id {
            type Value = LabelId;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a label id from 0 to 18446744073709551615")
            }

            fn visit_u64<E: serde::de::Error>(self, id: u64) -> Result<LabelId, E> {
                Ok(LabelId(id))
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<LabelId, E> {
                // As `to_string` writes it: no sign, no leading zeros, so that no id has two spellings.
                let id = text.parse().ok().filter(|id: &u64| id.to_string() == text);
                id.map(LabelId).ok_or_else(|| E::invalid_value(serde::de::Unexpected::Str(text), &self))
            }
        }
        from.deserialize_any(Id)
    }
}

/// A volume placed in the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Instance {
    /// Stable across edits: hits and passes name it.
    pub id: u32,
    /// A `.pumice` file or any label volume; relative paths are relative to the scene file.
    pub source: PathBuf,
    /// Maps the volume's index space to the world. Mirrored and sheared matrices are allowed, singular ones are not.
    pub world_from_index: DAffine3,
    /// Its labels' looks.
    #[serde(default)]
    pub style: LabelStyle,
}

/// Everything that is to be drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// [`SCENE_VERSION`].
    pub version: u32,
    /// Volumes.
    pub instances: Vec<Instance>,
    /// The camera.
    pub camera: Camera,
    /// The picture.
    pub film: Film,
    /// Sky and backdrop.
    pub world: World,
    /// Sun lights.
    #[serde(default)]
    pub suns: Vec<Sun>,
    /// How it is computed.
    #[serde(default)]
    pub settings: Settings,
}
