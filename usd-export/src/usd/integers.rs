//! Compressed bytes and integers of crate files.
//!
//! ```text
//! bytes      u8 0 │ LZ4 block                             up to 2,113,929,216 bytes; else u8 n, and n times: i32 size │ LZ4 block
//! integers   bytes of:  i32 most common step │ 2 bits a value │ steps that are not the most common one
//!                                              0 common, 1: 8 bits, 2: 16 bits, 3: 32 bits
//! ```
//! A step is the difference of a value to the one before; the first is the difference to 0. Source: AOUSD Core Specification 1.0.1, section
//! 16.3, and for the count of LZ4 blocks what usd-core reads (one byte).

use pumice_core::Error;
use rustc_hash::FxHashMap;

use crate::Result;

/// Longest input of one LZ4 block.
const MOST_BYTES_A_BLOCK: usize = 0x7E00_0000;

/// Most different steps that are counted in search of the most common one: enough for every pattern of indices, and a bound for noise.
const MOST_STEPS: usize = 1 << 12;

/// The bytes, compressed.
///
/// # Errors
/// [`Error::Limit`] for more than 127 blocks of LZ4 (268 GB).
pub(super) fn compressed(bytes: &[u8]) -> Result<Vec<u8>> {
    if bytes.len() <= MOST_BYTES_A_BLOCK {
        return Ok([&[0], lz4_flex::block::compress(bytes).as_slice()].concat());
    }
    let blocks = bytes.chunks(MOST_BYTES_A_BLOCK);
    let limit =
        |got: u64| Error::Limit { what: "LZ4 blocks of an array in a usdc file".into(), limit: 127, got };
    let count =
        u8::try_from(blocks.len()).ok().filter(|&n| n < 128).ok_or_else(|| limit(blocks.len() as u64))?;
    let mut out = vec![count];
    for block in blocks {
        let block = lz4_flex::block::compress(block);
        let size = i32::try_from(block.len()).map_err(|_| limit(block.len() as u64))?;
        out.extend(size.to_le_bytes());
        out.extend(block);
    }
    Ok(out)
}

/// Produces integers, the same each time, in pieces.
pub(super) type Integers<'a> = dyn Fn(&mut dyn FnMut(&[i32]) -> Result<()>) -> Result<()> + 'a;

/// `len` integers, compressed.
///
/// # Errors
/// Those of the producer, and of [`compressed`].
pub(super) fn compressed_integers(len: u64, integers: &Integers<'_>) -> Result<Vec<u8>> {
    let common = most_common_step(integers)?;
    let mut codes = vec![0u8; len.div_ceil(4) as usize];
    let mut steps = Vec::new();
    let mut at = 0;
    for_each_run(integers, |step, times| {
        let run = at..at + times;
        at += times;
        if step == common {
            return;
        }
        for at in run {
            let code = if let Ok(short) = i8::try_from(step) {
                steps.extend(short.to_le_bytes());
                1
            } else if let Ok(short) = i16::try_from(step) {
                steps.extend(short.to_le_bytes());
                2
            } else {
                steps.extend(step.to_le_bytes());
                3
            };
            if let Some(byte) = codes.get_mut(at / 4) {
                *byte |= code << (2 * (at % 4));
            }
        }
    })?;
    if at as u64 != len {
        return Err(Error::Caller(format!("an array of {len} integers has {at}")).into());
    }
    let mut bytes = Vec::with_capacity(4 + codes.len() + steps.len());
    bytes.extend(common.to_le_bytes());
    bytes.append(&mut codes);
    bytes.append(&mut steps);
    compressed(&bytes)
}

/// As [`compressed_integers`], for few integers that are in memory.
pub(super) fn compressed_slice(integers: &[i32]) -> Result<Vec<u8>> {
    compressed_integers(integers.len() as u64, &|sink| sink(integers))
}

/// Visits the steps, and how often each follows itself, piece by piece.
fn for_each_run(integers: &Integers<'_>, mut visit: impl FnMut(i32, usize)) -> Result<()> {
    let mut before = 0i32;
    integers(&mut |piece| {
        let mut start = 0;
        while start < piece.len() {
            let step = piece[start].wrapping_sub(before);
            let end = start + 1 + pairs_that_differ_by(step, &piece[start..]);
            visit(step, end - start);
            before = piece[end - 1];
            start = end;
        }
        Ok(())
    })
}

/// How many neighbours from the first on differ by this step.
fn pairs_that_differ_by(step: i32, values: &[i32]) -> usize {
    /// Compared without a branch each, which a processor does for several at once.
    const AT_ONCE: usize = 64;
    // 0 where the step is this one.
    let error = |(from, to): (&i32, &i32)| to.wrapping_sub(*from) ^ step;
    let pairs = |from: usize| values[from..].iter().zip(&values[from + 1..]);
    let mut same = 0;
    while same + AT_ONCE < values.len() && pairs(same).take(AT_ONCE).fold(0, |all, p| all | error(p)) == 0 {
        same += AT_ONCE;
    }
    same + pairs(same).take_while(|&pair| error(pair) == 0).count()
}

fn most_common_step(integers: &Integers<'_>) -> Result<i32> {
    let mut counts: FxHashMap<i32, usize> = FxHashMap::default();
    for_each_run(integers, |step, times| {
        if counts.len() < MOST_STEPS || counts.contains_key(&step) {
            *counts.entry(step).or_default() += times;
        }
    })?;
    // Of equally common ones the largest, so that the file is the same each time.
    Ok(counts.into_iter().max_by_key(|&(step, count)| (count, step)).map_or(0, |(step, _)| step))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads as the specification says, so that it shares no code with the writer.
    fn decoded(bytes: &[u8], len: usize) -> Vec<i32> {
        assert_eq!(bytes[0], 0, "one block");
        let bytes = lz4_flex::block::decompress(&bytes[1..], 16 + 5 * len).unwrap();
        let common = i32::from_le_bytes(bytes[..4].try_into().unwrap());
        let (codes, mut rest) = bytes[4..].split_at((2 * len).div_ceil(8));
        let (mut value, mut values) = (0i32, Vec::new());
        for i in 0..len {
            let width = [0, 1, 2, 4][usize::from(codes[i / 4] >> (2 * (i % 4)) & 3)];
            let (step, after) = rest.split_at(width);
            rest = after;
            value = value.wrapping_add(match width {
                0 => common,
                1 => i32::from(step[0] as i8),
                2 => i32::from(i16::from_le_bytes(step.try_into().unwrap())),
                _ => i32::from_le_bytes(step.try_into().unwrap()),
            });
            values.push(value);
        }
        assert_eq!(rest, [] as [u8; 0], "nothing is left");
        values
    }

    #[test]
    fn integers_come_back() {
        let mut state = 1u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state as i32
        };
        let lists: Vec<Vec<i32>> = vec![
            vec![],
            vec![0],
            vec![i32::MIN, i32::MAX, 0, -1, i32::MIN],
            (0..1000).collect(),
            vec![4; 777],
            (0..5000).map(|_| noise()).collect(),
            (0..5000).map(|i| i + noise() % 200).collect(),
            (0..5000).map(|i| i * 40_000).collect(),
            // Runs of every length around what is compared at once.
            (0..200).flat_map(|run| (0..run).map(move |i| run * run + i * (run % 3))).collect(),
        ];
        for list in lists {
            assert_eq!(decoded(&compressed_slice(&list).unwrap(), list.len()), list);
        }
    }

    /// Indices of quads without shared corners: almost nothing.
    #[test]
    fn regular_integers_are_short() {
        let list: Vec<i32> = (0..400_000).collect();
        assert!(compressed_slice(&list).unwrap().len() < 1000);
        assert!(compressed_integers(5, &|sink| sink(&[1, 2])).is_err(), "fewer than were promised");
        assert!(compressed_integers(1, &|sink| sink(&[1, 2, 3, 4, 5, 6])).is_err(), "more");
    }
}
