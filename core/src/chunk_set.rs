//! Numbers of the chunks of a volume, and sets of them: what a part of a volume holds.
//!
//! ```text
//! chunks of 1024³ voxels, numbered in Morton order over the volume's grid of chunks (x fastest where the order turns):
//!     5 × 2 chunks     0 1 4 5 8
//!                      2 3 6 7 9        without gaps, where the grid is no power of two
//! set                  0,4-7            rising, both ends included
//! ```

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::{CHUNK_VOXELS, Error, Result};

/// Most chunks of a set: what lists of them may take stays within some hundred megabytes.
const MOST_CHUNKS: u64 = 1 << 24;

/// A box of voxels: the lowest voxel, and the one beyond the highest, along x, y, z.
pub type VoxelRegion = [[u32; 2]; 3];

/// The chunks of a volume along x, y and z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkGrid {
    dims: [u32; 3],
    counts: [u32; 3],
}

impl ChunkGrid {
    /// The grid of a volume of `dims` voxels.
    pub fn new(dims: [u32; 3]) -> Self {
        Self { dims, counts: dims.map(|d| d.div_ceil(CHUNK_VOXELS)) }
    }

    /// Size of the volume in voxels.
    pub(crate) fn dims(&self) -> [u32; 3] {
        self.dims
    }

    /// Number of chunks of the volume.
    pub fn chunks(&self) -> u64 {
        self.counts.iter().fold(1, |product, &n| product * u64::from(n))
    }

    /// Chunks of the grid in the cube of 2^`level` chunks a side at `corner`.
    fn within(&self, corner: [u32; 3], level: u32) -> u64 {
        let side = |a: usize| u64::from(self.counts[a].saturating_sub(corner[a])).min(1 << level);
        (0..3).map(side).product()
    }

    /// The cube's eight halves in Morton order.
    fn halves(corner: [u32; 3], level: u32) -> impl Iterator<Item = [u32; 3]> {
        (0..8u32).map(move |child| [0, 1, 2].map(|a| corner[a] + ((child >> a & 1) << (level - 1))))
    }

    /// Lowest voxel of the chunk with this number; `None` past the last.
    pub fn origin(&self, number: u64) -> Option<[u32; 3]> {
        let (mut corner, mut left) = ([0; 3], number);
        if number >= self.chunks() {
            return None;
        }
        // Sides of 2²¹ chunks hold more than the largest volume.
        for level in (1..=21).rev() {
            corner = Self::halves(corner, level).find(|&half| {
                let inside = self.within(half, level - 1);
                if left < inside {
                    return true;
                }
                left -= inside;
                false
            })?;
        }
        Some(corner.map(|c| c * CHUNK_VOXELS))
    }

    /// Number of the chunk that holds this voxel of the volume.
    pub fn number(&self, voxel: [u32; 3]) -> u64 {
        let chunk = voxel.map(|v| v / CHUNK_VOXELS);
        let (mut corner, mut number) = ([0u32; 3], 0);
        for level in (1..=21).rev() {
            let side = 1 << (level - 1);
            for half in Self::halves(corner, level) {
                if (0..3).all(|a| half[a] <= chunk[a] && chunk[a] - half[a] < side) {
                    corner = half;
                    break;
                }
                number += self.within(half, level - 1);
            }
        }
        number
    }

    /// The voxels of the chunk with this number; `None` past the last.
    pub fn region(&self, number: u64) -> Option<VoxelRegion> {
        let origin = self.origin(number)?;
        Some([0, 1, 2].map(|a| [origin[a], self.dims[a].min(origin[a] + CHUNK_VOXELS)]))
    }
}

/// Numbers of chunks, each once. Its text is `0,4-7`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ChunkSet {
    /// First and last number of each range; rising, with a gap between ranges.
    ranges: Vec<[u64; 2]>,
}

impl ChunkSet {
    /// The set of these numbers, in any order.
    pub fn of(numbers: impl IntoIterator<Item = u64>) -> Self {
        let mut numbers: Vec<u64> = numbers.into_iter().collect();
        numbers.sort_unstable();
        let mut ranges: Vec<[u64; 2]> = Vec::new();
        for n in numbers {
            match ranges.last_mut() {
                Some(last) if n <= last[1].saturating_add(1) => last[1] = n,
                _ => ranges.push([n, n]),
            }
        }
        Self { ranges }
    }

    /// The set of rising ranges, both ends included, that do not overlap.
    pub(crate) fn of_ranges(ranges: impl IntoIterator<Item = [u64; 2]>) -> Self {
        // Ranges without a gap between them become one, so that equal sets have equal texts.
        let mut joined: Vec<[u64; 2]> = Vec::new();
        for range in ranges {
            match joined.last_mut() {
                Some(last) if range[0] == last[1] + 1 => last[1] = range[1],
                _ => joined.push(range),
            }
        }
        Self { ranges: joined }
    }

    /// All chunks of a volume with this grid.
    pub fn all(grid: &ChunkGrid) -> Self {
        let last = grid.chunks().checked_sub(1);
        Self { ranges: last.map(|last| [0, last]).into_iter().collect() }
    }

    /// First and last number of each range, rising.
    pub fn ranges(&self) -> &[[u64; 2]] {
        &self.ranges
    }

    /// All numbers, rising.
    pub fn iter(&self) -> impl Iterator<Item = u64> + '_ {
        self.ranges.iter().flat_map(|&[first, last]| first..=last)
    }

    /// How many numbers there are.
    pub fn len(&self) -> u64 {
        self.ranges.iter().map(|[first, last]| last - first + 1).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.ranges.is_empty()
    }

    /// Whether a chunk is among them.
    pub fn contains(&self, number: u64) -> bool {
        let after = self.ranges.partition_point(|range| range[0] <= number);
        after > 0 && number <= self.ranges[after - 1][1]
    }

    /// Returns an error unless a volume with this grid has all of them, and there is at least one.
    ///
    /// # Errors
    /// [`Error::Caller`] that says how the volume's chunks are numbered; [`Error::Limit`] for more chunks than a set may have.
    pub fn check(&self, grid: &ChunkGrid) -> Result<()> {
        let (chunks, [x, y, z]) = (grid.chunks(), grid.counts);
        match self.ranges.last() {
            Some(&[_, last]) if last < chunks => {}
            _ => {
                let expected = match chunks {
                    0 => "a volume with voxels".to_owned(),
                    1 => "0, the only chunk of this volume".to_owned(),
                    n => format!("numbers from 0 to {} ({x} × {y} × {z} chunks of 1024³ voxels)", n - 1),
                };
                return Err(Error::Caller(format!("chunks: expected {expected}, got `{self}`")));
            }
        }
        match self.len() {
            got if got > MOST_CHUNKS => {
                Err(Error::Limit { what: "chunks of one part".into(), limit: MOST_CHUNKS, got })
            }
            _ => Ok(()),
        }
    }

    /// Voxels of these chunks of a volume with this grid.
    pub(crate) fn voxels(&self, grid: &ChunkGrid) -> u64 {
        let voxels = |r: VoxelRegion| r.iter().map(|[low, high]| u64::from(high - low)).product::<u64>();
        self.iter().filter_map(|number| grid.region(number)).map(voxels).sum()
    }
}

impl fmt::Display for ChunkSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, [first, last]) in self.ranges.iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            match first == last {
                true => write!(f, "{comma}{first}")?,
                false => write!(f, "{comma}{first}-{last}")?,
            }
        }
        Ok(())
    }
}

impl FromStr for ChunkSet {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || format!("expected numbers of chunks such as 3, 0-7 or 0,4-7, got `{text}`");
        let mut ranges = Vec::new();
        for item in text.split(',') {
            let (first, last) = item.split_once('-').unwrap_or((item, item));
            let number = |text: &str| text.trim().parse::<u64>().map_err(|_| wrong());
            let range = [number(first)?, number(last)?];
            if range[0] > range[1] {
                return Err(wrong());
            }
            ranges.push(range);
        }
        ranges.sort_unstable();
        if let Some(pair) = ranges.windows(2).find(|pair| pair[1][0] <= pair[0][1]) {
            return Err(format!("chunk {} comes twice in `{text}`", pair[1][0]));
        }
        Ok(Self::of_ranges(ranges))
    }
}

impl TryFrom<String> for ChunkSet {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        text.parse()
    }
}

impl From<ChunkSet> for String {
    fn from(set: ChunkSet) -> Self {
        set.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::morton;

    /// Numbers are ranks of Morton codes, found by sorting all chunks.
    #[test]
    fn chunks_are_numbered_in_morton_order_without_gaps() {
        for counts in [[1, 1, 1], [5, 2, 1], [3, 3, 3], [1, 7, 2], [0, 3, 1]] {
            let dims = counts.map(|n: u32| (n * 1024).saturating_sub(500));
            let grid = ChunkGrid::new(dims);
            let mut chunks: Vec<[u32; 3]> = Vec::new();
            for z in 0..counts[2] {
                for y in 0..counts[1] {
                    chunks.extend((0..counts[0]).map(|x| [x, y, z]));
                }
            }
            chunks.sort_by_key(|&c| morton::encode(c));
            assert_eq!(grid.chunks(), chunks.len() as u64);
            for (number, chunk) in (0..).zip(&chunks) {
                let origin = chunk.map(|c| c * 1024);
                assert_eq!(grid.origin(number), Some(origin), "{counts:?}");
                assert_eq!(grid.number(origin.map(|o| o + 3)), number, "{counts:?}");
                let region = grid.region(number).unwrap();
                assert!((0..3).all(|a| region[a] == [origin[a], dims[a].min(origin[a] + 1024)]));
            }
            assert_eq!(grid.origin(chunks.len() as u64), None);
        }
        let large = ChunkGrid::new([1 << 23; 3]);
        assert_eq!(large.number(large.origin(123_456_789_012).unwrap()), 123_456_789_012);
    }

    #[test]
    fn sets_have_one_text_and_mistakes_are_named() {
        for (text, same, numbers) in [
            ("3", "3", vec![3]),
            ("5,0-1,2", "0-2,5", vec![0, 1, 2, 5]),
            ("4-7,0", "0,4-7", vec![0, 4, 5, 6, 7]),
        ] {
            let set: ChunkSet = text.parse().unwrap();
            assert_eq!((set.to_string(), set.iter().collect::<Vec<_>>()), (same.to_owned(), numbers.clone()));
            assert_eq!(
                (set.len(), ChunkSet::of(numbers.into_iter().rev())),
                (set.iter().count() as u64, set.clone())
            );
            assert!((0..9).all(|n| set.contains(n) == set.iter().any(|m| m == n)));
        }
        for (text, why) in [
            ("", "expected numbers"),
            ("7-4", "expected numbers"),
            ("1,x", "expected numbers"),
            ("-1", "expected numbers"),
            ("1,,2", "expected numbers"),
            ("99999999999999999999", "expected numbers"),
            ("0-4,3", "chunk 3 comes twice"),
        ] {
            assert!(text.parse::<ChunkSet>().is_err_and(|e| e.contains(why)), "{text}");
        }
        let grid = ChunkGrid::new([3000, 1, 1]);
        assert!("0-2".parse::<ChunkSet>().unwrap().check(&grid).is_ok());
        let error = "1-3".parse::<ChunkSet>().unwrap().check(&grid).unwrap_err().to_string();
        assert!(error.contains("numbers from 0 to 2 (3 × 1 × 1 chunks"), "{error}");
        assert!(ChunkSet::default().check(&grid).is_err());
        assert_eq!("0-2".parse::<ChunkSet>().unwrap().voxels(&grid), 3000);
    }
}
