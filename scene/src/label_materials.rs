//! Materials by label: a copy-on-write map that copies of a scene share until one of them changes it. Figures colour 10⁵ labels one by
//! one, and a live view copies its scene at each move of the camera.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::Material;

/// Materials by original label id, shared between copies; a change to one copy does not affect the others.
#[derive(Clone, Debug, Default)]
pub struct LabelMaterials(Arc<BTreeMap<u64, Material>>);

impl Deref for LabelMaterials {
    type Target = BTreeMap<u64, Material>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for LabelMaterials {
    fn deref_mut(&mut self) -> &mut Self::Target {
        Arc::make_mut(&mut self.0)
    }
}

impl<'a> IntoIterator for &'a LabelMaterials {
    type Item = (&'a u64, &'a Material);
    type IntoIter = std::collections::btree_map::Iter<'a, u64, Material>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl PartialEq for LabelMaterials {
    fn eq(&self, other: &Self) -> bool {
        // Valid scenes hold no NaN (`Scene::validate`), so a shared map equals itself.
        Arc::ptr_eq(&self.0, &other.0) || self.0 == other.0
    }
}

impl FromIterator<(u64, Material)> for LabelMaterials {
    fn from_iter<I: IntoIterator<Item = (u64, Material)>>(materials: I) -> Self {
        Self(Arc::new(materials.into_iter().collect()))
    }
}

impl<const N: usize> From<[(u64, Material); N]> for LabelMaterials {
    fn from(materials: [(u64, Material); N]) -> Self {
        materials.into_iter().collect()
    }
}

impl Serialize for LabelMaterials {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(to)
    }
}

impl<'de> Deserialize<'de> for LabelMaterials {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        each_once(from).map(|materials| Self(Arc::new(materials)))
    }
}

/// Reads a map by label id and refuses an id that occurs twice, because it is unknown which of the two was meant.
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
                    return Err(serde::de::Error::custom(format!("materials: label {id} occurs twice")));
                }
            }
            Ok(materials)
        }
    }
    from.deserialize_map(EachOnce(PhantomData))
}

/// A key of such a map. JSON keys are text; within a tagged enum ([`crate::SceneEdit`]) serde passes that text on unparsed, so both
/// numbers and text are accepted.
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
                // Only the spelling of `to_string` is accepted (no sign, no leading zeros), so that no id has two spellings.
                let id = text.parse().ok().filter(|id: &u64| id.to_string() == text);
                id.map(LabelId).ok_or_else(|| E::invalid_value(serde::de::Unexpected::Str(text), &self))
            }
        }
        from.deserialize_any(Id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_share_until_one_changes() {
        let mut a: LabelMaterials = [(3, Material::default()), (9, Material::default())].into();
        let b = a.clone();
        assert!(Arc::ptr_eq(&a.0, &b.0) && a == b);
        a.remove(&3);
        assert_eq!((a.len(), b.len()), (1, 2));
        assert_ne!(a, b);
        assert_eq!(
            b,
            [(9, Material::default()), (3, Material::default())].into(),
            "equal without being shared"
        );
    }
}
