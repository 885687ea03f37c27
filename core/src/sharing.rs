//! Finds which boxes of a chunk have the same contents.

use rayon::prelude::*;

use crate::Result;
use crate::reserve::{make_room, reserved};
use crate::spool::Spool;

/// What memory is for, in errors.
const NODES: &str = "the nodes of the volume";

/// Hashes that are read at once.
const READ_HASHES: u64 = 1 << 12;

/// A hash, and the number of its box.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Numbered([u64; 2], u32);

/// For each box, the number of the first box that has the same contents, which may be itself. `hashes` have 16 bytes for each box, one spool
/// after another; boxes are taken as equal where their hashes are.
///
/// The hashes are sorted in several passes where all of them take more than `most_bytes`: in each, those of another range.
///
/// # Errors
/// [`crate::Error::Memory`]; [`crate::Error::Io`].
pub(crate) fn first_with_same(hashes: &[&Spool<'_>], most_bytes: u64) -> Result<Vec<u32>> {
    let count = hashes.iter().map(|spool| spool.len() / 16).sum::<u64>();
    let mut first: Vec<u32> = reserved(count as usize, NODES)?;
    first.extend(0..count as u32);
    let passes = (count * size_of::<Numbered>() as u64).div_ceil(most_bytes.max(1 << 16)).max(1);
    let mut some: Vec<Numbered> = Vec::new();
    for pass in 0..passes {
        some.clear();
        let (mut read, mut at) = (Vec::<[u64; 2]>::new(), 0);
        for spool in hashes {
            let (mut reader, mut left) = (spool.reader(), spool.len() / 16);
            while left > 0 {
                read.clear();
                reader.values(READ_HASHES.min(left) as usize, &mut read)?;
                left -= read.len() as u64;
                for hash in &read {
                    // Numbers a range by the hash's upper bits, as a fraction of all.
                    if (u128::from(hash[1]) * u128::from(passes)) >> 64 == u128::from(pass) {
                        make_room(&mut some, 1, NODES)?;
                        some.push(Numbered(*hash, at as u32));
                    }
                    at += 1;
                }
            }
        }
        some.par_sort_unstable();
        for same in some.chunk_by(|a, b| a.0 == b.0) {
            same[1..].iter().for_each(|later| first[later.1 as usize] = same[0].1);
        }
    }
    Ok(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spool::Scratch;

    /// The result is that of a plain search, in one pass and in many.
    #[test]
    fn the_first_of_equal_ones_is_found() {
        let mut s = 5u64;
        let hash = |s: &mut u64| {
            *s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let which = *s >> 40 & 0x7FFF;
            [which.wrapping_mul(0x9E37_79B9_7F4A_7C15), which.wrapping_mul(0xC2B2_AE3D_27D4_EB4F)]
        };
        let hashes: Vec<[u64; 2]> = (0..50_000).map(|_| hash(&mut s)).collect();
        let mut known = std::collections::HashMap::new();
        let expected: Vec<u32> = hashes.iter().zip(0..).map(|(h, i)| *known.entry(h).or_insert(i)).collect();
        let scratch = Scratch::new(&std::env::temp_dir());
        let spool = |hashes: &[[u64; 2]]| {
            let mut spool = Spool::new(&scratch, 1000);
            spool.write(bytemuck::cast_slice(hashes)).unwrap();
            spool
        };
        let (whole, none, first, second) =
            (spool(&hashes), spool(&[]), spool(&hashes[..12_345]), spool(&hashes[12_345..]));
        for most in [0, 300_000, u64::MAX] {
            assert_eq!(first_with_same(&[&whole], most).unwrap(), expected, "{most}");
            assert_eq!(first_with_same(&[&first, &none, &second], most).unwrap(), expected, "{most}");
        }
    }
}
