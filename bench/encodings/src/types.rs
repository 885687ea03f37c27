//! Which labels are always shown together (§3.2.2): each such type gets a graph of its own.

use pumice_core::CompressedVolume;

/// A type for each label.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Types {
    of_label: Vec<u32>,
    count: u32,
}

impl Types {
    /// The volume's own, with one for the labels that have none; each label its own where the volume has no types.
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

    /// Labels dealt to so many types in turn.
    pub fn dealt(labels: usize, count: u32) -> Self {
        let count = count.clamp(1, (labels as u32).max(1));
        Self { of_label: (0..labels as u32).map(|l| l % count).collect(), count }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count as usize
    }

    /// A label's.
    pub fn of(&self, label: u32) -> usize {
        self.of_label[label as usize] as usize
    }

    /// Bytes of the table that finds a label's graph.
    pub fn bytes(&self) -> u64 {
        4 * self.of_label.len() as u64
    }
}
