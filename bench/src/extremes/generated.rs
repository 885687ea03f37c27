//! Volumes without files, for this bench and that of exports: a rule gives the label of every voxel, and the source delivers slabs of them.

use pumice_core::{BlockSource, LabelBlock, LabelBuffer, LabelType, VolumeInfo};

/// Approximate number of voxels in a block.
const BLOCK_VOXELS: u64 = 1 << 22;

/// Rule that gives the label of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// Label 1 everywhere.
    Full,
    /// A label of its own for each voxel: (index + 1) times an odd number mod 2³², so that ids are sparse and unordered.
    OfItsOwn,
    /// Runs of 7 voxels along z that cycle through labels 0 (background) to 4.
    Runs,
    /// Labels 1 and 2, so that no voxel has a face neighbour of its own label.
    Checkerboard,
    /// Labels 0 to N − 1 at random.
    Noise(u32),
    /// A cube of 4³ voxels in every 8³, each a box of its own, in 1000 labels. Cubes touch nothing.
    Cubes,
}

/// A volume whose labels follow a rule.
#[derive(Debug)]
pub(crate) struct Generated {
    info: VolumeInfo,
    rule: Rule,
    z: u32,
}

impl Generated {
    pub(crate) fn new(dims: [u32; 3], rule: Rule) -> Self {
        Self { info: VolumeInfo::new(dims, LabelType::U32), rule, z: 0 }
    }
}

/// 32 well-mixed bits of a number (the finaliser of MurmurHash3, A. Appleby).
fn mixed(number: u64) -> u64 {
    let mut h = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    h = (h ^ h >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
    h = (h ^ h >> 33).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    (h ^ h >> 33) >> 32
}

impl Rule {
    /// The label of the voxel at [x, y, z], whose index is `number` (x varies fastest).
    fn label(self, number: u64, [x, y, z]: [u32; 3]) -> u32 {
        match self {
            Self::Full => 1,
            Self::OfItsOwn => (number as u32 + 1).wrapping_mul(0x9e37_79b1),
            Self::Runs => z / 7 % 5,
            Self::Checkerboard => 1 + (x + y + z) % 2,
            // Multiplies and shifts instead of taking a remainder, so the distribution is as even as 32 bits allow.
            Self::Cubes if [x, y, z].iter().any(|c| c % 8 >= 4) => 0,
            // Neighbours have other labels, because a label has one box in a block of 16³.
            Self::Cubes => 1 + x / 8 % 10 + 10 * (y / 8 % 10) + 100 * (z / 8 % 10),
            Self::Noise(labels) => ((mixed(number) * u64::from(labels)) >> 32) as u32,
        }
    }
}

impl BlockSource for Generated {
    fn info(&self) -> &VolumeInfo {
        &self.info
    }

    fn next_block(&mut self) -> pumice_core::Result<Option<LabelBlock>> {
        let [x, y, z] = self.info.dims;
        let layer = u64::from(x) * u64::from(y);
        let layers = ((BLOCK_VOXELS / layer.max(1)).max(4) / 4 * 4).min(u64::from(z - self.z)) as u32;
        if layers == 0 {
            return Ok(None);
        }
        let (rule, low) = (self.rule, self.z);
        self.z += layers;
        let labels = match rule {
            // One byte per voxel, without arithmetic.
            Rule::Full => LabelBuffer::U8(vec![1; (layer * u64::from(layers)) as usize]),
            _ => {
                let mut labels = Vec::with_capacity((layer * u64::from(layers)) as usize);
                for pz in low..low + layers {
                    for py in 0..y {
                        let first = u64::from(pz) * layer + u64::from(py) * u64::from(x);
                        labels.extend((0..x).map(|px| rule.label(first + u64::from(px), [px, py, pz])));
                    }
                }
                LabelBuffer::U32(labels)
            }
        };
        Ok(Some(LabelBlock::x_fastest([0, 0, low], [x, y, layers], labels)))
    }
}
