//! For each box of a volume, the nearby boxes of the same label. Smooth voxel normals need them to see the surroundings of a face.
//!
//! ```text
//! ends    [e0, e1, …]          one for each box
//! boxes   [… box 0's …|… box 1's …|…]     the list of box i ends at ends[i] and starts at the end before; ascending, includes i itself
//! ```
//! Built only where voxels are shaded smooth. A label's boxes are about 16 voxels wide, so most have up to 26 such neighbours. A hierarchy
//! would find them too, but on a graphics processor it answers only rays.

use std::collections::HashMap;

use crate::BoxBounds;

/// How far the surroundings of a face reach, in voxels.
pub const REACH: u32 = 3;

/// log₂ of the edge length, in voxels, of the cells that boxes are sorted into.
const CELL_SHIFT: u32 = 4;

/// Lists of nearby boxes (see the module).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Neighbors {
    end_offsets: Vec<u32>,
    boxes: Vec<u32>,
}

impl Neighbors {
    /// Builds the lists of `count` boxes; `drawn` gives the drawn boxes as (index, label, bounds).
    pub fn new(count: usize, drawn: &[(u32, u32, BoxBounds)]) -> Self {
        // Boxes by the cells that they reach into.
        let mut by_cell = HashMap::<(u32, [u32; 3]), Vec<usize>>::new();
        for (at, &(_, label, bounds)) in drawn.iter().enumerate() {
            cells(bounds, |cell| by_cell.entry((label, cell)).or_default().push(at));
        }
        let mut of = vec![Vec::new(); count];
        for &(number, label, bounds) in drawn {
            let wide = BoxBounds {
                lo: bounds.lo.map(|v| v.saturating_sub(REACH)),
                hi: bounds.hi.map(|v| v.saturating_add(REACH)),
            };
            let found: &mut Vec<u32> = &mut of[number as usize];
            cells(wide, |cell| {
                let here = by_cell.get(&(label, cell)).into_iter().flatten();
                let near = here
                    .map(|&at| &drawn[at])
                    .filter(|(_, _, b)| (0..3).all(|a| b.lo[a] < wide.hi[a] && wide.lo[a] < b.hi[a]));
                found.extend(near.map(|(number, ..)| number));
            });
            found.sort_unstable();
            found.dedup();
        }
        let mut end = 0;
        let ends = of.iter().map(|found| {
            end += found.len() as u32;
            end
        });
        Self { end_offsets: ends.collect(), boxes: of.concat() }
    }

    /// Indices of the boxes near this box, itself included.
    #[inline]
    pub fn of(&self, number: u32) -> &[u32] {
        let at = number as usize;
        let start = if at == 0 { 0 } else { self.end_offsets[at - 1] };
        &self.boxes[start as usize..self.end_offsets[at] as usize]
    }

    /// End of each box's list in [`Neighbors::boxes`].
    pub fn end_offsets(&self) -> &[u32] {
        &self.end_offsets
    }

    /// The lists of all boxes, one after another.
    pub fn boxes(&self) -> &[u32] {
        &self.boxes
    }

    /// Size on the heap in bytes.
    pub fn bytes(&self) -> u64 {
        4 * (self.end_offsets.len() + self.boxes.len()) as u64
    }
}

/// Calls `visit` for each cell that the bounds reach into.
fn cells(bounds: BoxBounds, mut visit: impl FnMut([u32; 3])) {
    let [lo, hi] = [bounds.lo.map(|v| v >> CELL_SHIFT), bounds.hi.map(|v| v.saturating_sub(1) >> CELL_SHIFT)];
    for z in lo[2]..=hi[2] {
        for y in lo[1]..=hi[1] {
            for x in lo[0]..=hi[0] {
                visit([x, y, z]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with a test of every pair.
    #[test]
    fn neighbors_are_those_that_reach_each_other() {
        let mut state = 7u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) % below
        };
        let drawn: Vec<_> = (0..400u32)
            .map(|i| {
                let lo = [random(120), random(90), random(60)];
                let hi = [0, 1, 2].map(|a| lo[a] + 1 + random(16));
                (2 * i, random(3), BoxBounds { lo, hi })
            })
            .collect();
        let found = Neighbors::new(801, &drawn);
        let mut several = 0;
        for &(number, label, a) in &drawn {
            let near = |b: &BoxBounds| (0..3).all(|i| a.lo[i] < b.hi[i] + REACH && b.lo[i] < a.hi[i] + REACH);
            let naive: Vec<u32> =
                drawn.iter().filter(|(_, l, b)| *l == label && near(b)).map(|(n, ..)| *n).collect();
            assert!(naive.contains(&number));
            assert_eq!(found.of(number), naive);
            several += usize::from(naive.len() > 2);
        }
        assert!(several > 100 && found.of(1).is_empty() && found.of(800).is_empty());
        assert_eq!(found.bytes(), 4 * (801 + found.boxes().len()) as u64);
    }
}
