//! Arrays as bytes in a temporary file of this process: the number of elements in 8 bytes, then the elements as they are in memory.

use bytemuck::{Pod, Zeroable};

use crate::NoMemory;
use crate::reserve::{make_room, zeroed};

/// What memory is for, in errors.
const WHAT: &str = "a part of the volume";

/// Appends an array.
///
/// # Errors
/// [`NoMemory`].
pub fn put<T: Pod>(out: &mut Vec<u8>, elements: &[T]) -> Result<(), NoMemory> {
    let bytes: &[u8] = bytemuck::cast_slice(elements);
    make_room(out, 8 + bytes.len(), WHAT)?;
    out.extend_from_slice(&(elements.len() as u64).to_ne_bytes());
    out.extend_from_slice(bytes);
    Ok(())
}

/// Takes an array from the front of `bytes`; `None` where they end before it does, or where there is no memory for it.
pub fn take<T: Pod + Zeroable>(bytes: &mut &[u8]) -> Option<Vec<T>> {
    let (count, rest) = bytes.split_first_chunk::<8>()?;
    let count = usize::try_from(u64::from_ne_bytes(*count)).ok()?;
    let (own, rest) = rest.split_at_checked(count.checked_mul(size_of::<T>())?)?;
    let mut elements: Vec<T> = zeroed(count, WHAT).ok()?;
    bytemuck::cast_slice_mut(&mut elements).copy_from_slice(own);
    *bytes = rest;
    Some(elements)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back_and_what_is_cut_short_does_not() {
        let (a, b): ([u16; 3], [u64; 2]) = ([1, 2, 65_535], [u64::MAX, 7]);
        let mut bytes = Vec::new();
        put(&mut bytes, &a).unwrap();
        put(&mut bytes, &b).unwrap();
        put::<u32>(&mut bytes, &[]).unwrap();
        let mut rest = bytes.as_slice();
        assert_eq!(take::<u16>(&mut rest).unwrap(), a);
        assert_eq!(take::<u64>(&mut rest).unwrap(), b);
        assert!(take::<u32>(&mut rest).unwrap().is_empty());
        assert!(rest.is_empty() && take::<u8>(&mut rest).is_none());
        for length in 0..8 + 6 {
            assert!(take::<u16>(&mut &bytes[..length]).is_none(), "{length}");
        }
        let absurd = u64::MAX.to_ne_bytes();
        assert!(take::<u64>(&mut &absurd[..]).is_none());
    }
}
