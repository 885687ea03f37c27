//! What is known of each label: id, number of voxels, which others it touches.

/// Labels by dense index, which follows the order of ids. Background (id 0) is not in the table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LabelTable {
    pub(crate) ids: Vec<u64>,
    pub(crate) voxels: Vec<u64>,
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

    /// Original ids, rising, by dense index.
    pub fn ids(&self) -> &[u64] {
        &self.ids
    }

    /// Voxels of each label.
    pub fn voxels(&self) -> &[u64] {
        &self.voxels
    }

    /// Heap bytes held.
    pub fn bytes(&self) -> u64 {
        (self.ids.capacity() * 8 + self.voxels.capacity() * 8) as u64
    }

    /// Dense index of an original id.
    pub fn index_of(&self, id: u64) -> Option<u32> {
        self.ids.binary_search(&id).ok().map(|i| i as u32)
    }
}
