//! Encodes Neuroglancer's `compressed_segmentation`, with blocks of 8 × 8 × 8 voxels and one channel; the layout is that of
//! [`crate::compressed_segmentation`].

use std::collections::HashMap;

/// Voxels along a side of a block.
const SIDE: usize = 8;

/// Largest offset of a table, in words: it has 24 bits.
const MOST_OFFSET: usize = (1 << 24) - 1;

/// Encodes chunks of ids of 32 or 64 bits.
pub(crate) struct Encoder {
    id_bytes: usize,
    /// Ids of a block's voxels, and of a block, rising.
    block: Vec<u64>,
    table: Vec<u64>,
}

impl Encoder {
    /// `id_bytes` is 4 or 8.
    pub(crate) fn new(id_bytes: usize) -> Self {
        Self { id_bytes, block: Vec::new(), table: Vec::new() }
    }

    /// The bytes of a chunk whose ids lie with x fastest, and fit the type.
    ///
    /// # Errors
    /// When the chunk holds too many ids for the format.
    pub(crate) fn encode(&mut self, ids: &[u64], dims: [u32; 3]) -> Result<Vec<u8>, String> {
        let dims = dims.map(|d| d as usize);
        let grid = dims.map(|d| d.div_ceil(SIDE));
        let blocks = grid.iter().product::<usize>();
        // Words of the channel, behind the word that says where it begins.
        let mut words = vec![0u32; 2 * blocks];
        // Blocks with the same ids share a table.
        let mut tables: HashMap<Vec<u64>, usize> = HashMap::new();
        for number in 0..blocks {
            let low =
                [number % grid[0], number / grid[0] % grid[1], number / grid[0] / grid[1]].map(|c| c * SIDE);
            self.take(ids, dims, low);
            let bits = bits_for(self.table.len());
            let values = words.len();
            words.resize(values + (SIDE.pow(3) * bits as usize).div_ceil(32), 0);
            if bits > 0 {
                for (voxel, id) in self.block.iter().enumerate() {
                    // The table holds each id of the block.
                    let index = self.table.partition_point(|other| other < id) as u32;
                    let at = voxel * bits as usize;
                    words[values + at / 32] |= index << (at % 32);
                }
            }
            let table = match tables.get(&self.table) {
                Some(&at) => at,
                None => {
                    let at = words.len();
                    for id in &self.table {
                        words.push(*id as u32);
                        if self.id_bytes == 8 {
                            words.push((id >> 32) as u32);
                        }
                    }
                    tables.insert(self.table.clone(), at);
                    at
                }
            };
            if table > MOST_OFFSET {
                return Err(
                    "a chunk has too many ids for compressed_segmentation: choose smaller chunks, or raw"
                        .into(),
                );
            }
            words[2 * number] = table as u32 | bits << 24;
            words[2 * number + 1] = values as u32;
        }
        let mut bytes = 1u32.to_le_bytes().to_vec();
        bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        Ok(bytes)
    }

    /// Takes the ids of the block from voxel `low` on. Beyond the chunk's end the last voxel of a row, column or layer is repeated.
    fn take(&mut self, ids: &[u64], dims: [usize; 3], low: [usize; 3]) {
        let inside = |at: usize, a: usize| (low[a] + at).min(dims[a] - 1);
        self.block.clear();
        for z in 0..SIDE {
            for y in 0..SIDE {
                let row = dims[0] * (inside(y, 1) + dims[1] * inside(z, 2));
                self.block.extend((0..SIDE).map(|x| ids[row + inside(x, 0)]));
            }
        }
        self.table.clone_from(&self.block);
        self.table.sort_unstable();
        self.table.dedup();
    }
}

/// Bits of an index into a table of so many ids: 0, 1, 2, 4, 8 or 16.
fn bits_for(ids: usize) -> u32 {
    [0, 1, 2, 4, 8].into_iter().find(|&bits| ids <= 1 << bits).unwrap_or(16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compressed_segmentation::decode;

    #[test]
    fn chunks_of_all_widths_come_back() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 20
        };
        for dims in [[8, 8, 8], [13, 9, 17], [1, 1, 1], [3, 20, 2]] {
            for different in [1, 2, 3, 16, 200, 1 << 40] {
                for id_bytes in [4, 8] {
                    let most = if id_bytes == 4 { u64::from(u32::MAX) } else { u64::MAX };
                    let ids: Vec<u64> = (0..dims.iter().product::<u32>())
                        .map(|_| most.wrapping_sub(random() % different) & most)
                        .collect();
                    let bytes = Encoder::new(id_bytes).encode(&ids, dims).unwrap();
                    let back = decode(&bytes, dims.map(u64::from), 1, [8; 3], id_bytes).unwrap();
                    let expected: Vec<u8> =
                        ids.iter().flat_map(|id| id.to_le_bytes()[..id_bytes].to_vec()).collect();
                    assert_eq!(back, expected, "{dims:?} {different} {id_bytes}");
                }
            }
        }
    }
}
