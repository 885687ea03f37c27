//! For each box of a volume, the nearby boxes of the same label. Smooth voxel normals need them to see the surroundings of a face.
//!
//! ```text
//! ends    [e0, e1, …]          one for each box
//! boxes   [… box 0's …|… box 1's …|…]     the list of box i ends at ends[i] and starts at the end before; ascending, includes i itself
//! ```
//! Built only where voxels are shaded smooth. A label's boxes are about 16 voxels wide, so most have up to 26 such neighbours. A hierarchy
//! would find them too, but on a graphics processor it answers only rays.

use std::collections::HashMap;

use pumice_core::NoMemory;
use pumice_core::reserve::{make_room, make_room_in_map, reserved, zeroed};

use crate::BoxBounds;

/// What memory is for, in errors.
const WHAT: &str = "the neighbours of boxes";

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
    /// Builds the lists of `count` boxes; `drawn` gives the drawn boxes as (index, label, bounds), by rising index.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn new(count: usize, drawn: &[(u32, u32, BoxBounds)]) -> Result<Self, NoMemory> {
        // For each cell that boxes of a label reach into, the last of these boxes; and before each box, the one before it in that cell. Boxes
        // are at most 16 voxels wide and begin at multiples of 4, so each reaches into up to eight cells.
        let mut last_in = HashMap::<(u32, [u32; 3]), u32>::new();
        let mut links: Vec<(u32, u32)> = reserved(drawn.len(), WHAT)?;
        for (at, &(_, label, bounds)) in drawn.iter().enumerate() {
            cells(bounds, |cell| {
                make_room_in_map(&mut last_in, WHAT)?;
                make_room(&mut links, 1, WHAT)?;
                let before = last_in.insert((label, cell), links.len() as u32);
                links.push((at as u32, before.unwrap_or(NONE)));
                Ok(())
            })?;
        }
        let mut end_offsets: Vec<u32> = zeroed(count, WHAT)?;
        let (mut boxes, mut found): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
        let mut next = 0;
        for &(number, label, bounds) in drawn {
            let wide = BoxBounds {
                lo: bounds.lo.map(|v| v.saturating_sub(REACH)),
                hi: bounds.hi.map(|v| v.saturating_add(REACH)),
            };
            found.clear();
            cells(wide, |cell| {
                let mut link = last_in.get(&(label, cell)).copied().unwrap_or(NONE);
                while let Some(&(at, before)) = links.get(link as usize) {
                    let (other, _, b) = &drawn[at as usize];
                    if (0..3).all(|a| b.lo[a] < wide.hi[a] && wide.lo[a] < b.hi[a]) {
                        found.push(*other);
                    }
                    link = before;
                }
                Ok(())
            })?;
            found.sort_unstable();
            found.dedup();
            end_offsets[next..number as usize].fill(boxes.len() as u32);
            next = number as usize;
            make_room(&mut boxes, found.len(), WHAT)?;
            boxes.extend_from_slice(&found);
        }
        end_offsets[next..].fill(boxes.len() as u32);
        Ok(Self { end_offsets, boxes })
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

/// The end of a chain of boxes in a cell.
const NONE: u32 = u32::MAX;

/// Calls `visit` for each cell that the bounds reach into.
fn cells(bounds: BoxBounds, mut visit: impl FnMut([u32; 3]) -> Result<(), NoMemory>) -> Result<(), NoMemory> {
    let [lo, hi] = [bounds.lo.map(|v| v >> CELL_SHIFT), bounds.hi.map(|v| v.saturating_sub(1) >> CELL_SHIFT)];
    for z in lo[2]..=hi[2] {
        for y in lo[1]..=hi[1] {
            for x in lo[0]..=hi[0] {
                visit([x, y, z])?;
            }
        }
    }
    Ok(())
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
        let found = Neighbors::new(801, &drawn).unwrap();
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
