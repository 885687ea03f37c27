//! Types of labels (§3.2.2): the labels of a type are always shown together, and each type has a graph of its own.

use pumice_core::CompressedVolume;

/// The type of each label.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Types {
    of_label: Vec<u32>,
    count: u32,
}

impl Types {
    /// The types in the volume's label table, and one more for labels without a type. Where the table has no types, each label is a type.
    pub fn of_volume(volume: &CompressedVolume) -> Self {
        let labels = volume.labels();
        let named = labels.type_names().len() as u32;
        let count = labels.len() as u32;
        if named == 0 {
            return Self { of_label: (0..count).collect(), count };
        }
        let of_label = (0..count).map(|l| labels.type_of(l).map_or(named, u32::from)).collect();
        Self { of_label, count: named + 1 }
    }

    /// `count` types, to which labels are assigned round robin.
    pub fn dealt(labels: usize, count: u32) -> Self {
        let count = count.clamp(1, (labels as u32).max(1));
        Self { of_label: (0..labels as u32).map(|l| l % count).collect(), count }
    }

    /// Number of types.
    pub fn count(&self) -> usize {
        self.count as usize
    }

    /// The type of a label.
    pub fn of(&self, label: u32) -> usize {
        self.of_label[label as usize] as usize
    }

    /// Bytes of the table from labels to types, which finds a label's graph.
    pub fn bytes(&self) -> u64 {
        4 * self.of_label.len() as u64
    }
}
