//! The label table: each label's id, number of voxels, type and further numbers, and the labels that it touches.

use crate::annotations::NumericColumn;
use crate::contacts::Contacts;

/// Stands for "no type" in [`LabelTable::types`].
pub(crate) const NO_TYPE: u16 = u16::MAX;

/// Table of labels by dense index, which follows the order of ids. Background (id 0) is not in the table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LabelTable {
    pub(crate) ids: Vec<u64>,
    pub(crate) voxels: Vec<u64>,
    /// Type number of each label; empty where the volume has no types.
    pub(crate) types: Vec<u16>,
    pub(crate) type_names: Vec<String>,
    pub(crate) contacts: Contacts,
    /// Numbers that a table gave to the labels, a value for each label.
    pub(crate) columns: Vec<NumericColumn>,
}

impl LabelTable {
    /// Number of labels.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Whether the volume has no labels.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Original ids in rising order, by dense index.
    pub fn ids(&self) -> &[u64] {
        &self.ids
    }

    /// Number of voxels of each label, by dense index.
    pub fn voxels(&self) -> &[u64] {
        &self.voxels
    }

    /// Dense index of an original id.
    pub fn index_of(&self, id: u64) -> Option<u32> {
        self.ids.binary_search(&id).ok().map(|i| i as u32)
    }

    /// Names of the types that labels can have, by type number; empty where the volume has no types.
    pub fn type_names(&self) -> &[String] {
        &self.type_names
    }

    /// Type number of a label; `None` where it has none.
    pub fn type_of(&self, label: u32) -> Option<u16> {
        self.types.get(label as usize).copied().filter(|&t| t != NO_TYPE)
    }

    /// Pairs of labels that share a face of two voxels.
    pub fn contacts(&self) -> &Contacts {
        &self.contacts
    }

    /// Columns of numbers that a table gave to the labels, by dense index; see [`CompressedVolume::annotate`].
    ///
    /// [`CompressedVolume::annotate`]: crate::CompressedVolume::annotate
    pub fn columns(&self) -> &[NumericColumn] {
        &self.columns
    }

    /// Bytes held on the heap.
    pub fn bytes(&self) -> u64 {
        let names: usize = self.type_names.iter().map(String::capacity).sum();
        let column =
            |c: &NumericColumn| size_of::<NumericColumn>() + c.name.capacity() + c.values.capacity() * 8;
        (self.ids.capacity() * 8
            + self.voxels.capacity() * 8
            + self.types.capacity() * 2
            + self.type_names.capacity() * size_of::<String>()
            + names
            + self.columns.iter().map(column).sum::<usize>()
            + self.contacts.bytes.capacity()) as u64
    }
}
