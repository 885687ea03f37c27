//! Decodes LZF, the filter 32000 of h5py (`lzf_d.c` of LibLZF by M. Lehmann describes the format).
//!
//! ```text
//! 000nnnnn                      n + 1 bytes follow as they are
//! nnnddddd dddddddd             n + 2 bytes from d + 1 bytes before, for n from 1 to 6
//! 111ddddd nnnnnnnn dddddddd    n + 9 bytes
//! ```

/// The plain bytes, of which there are at most `most`.
pub(crate) fn decode(data: &[u8], most: usize) -> Result<Vec<u8>, &'static str> {
    const SHORT: &str = "LZF: the data end within a piece";
    let mut plain = Vec::new();
    let mut rest = data;
    while let Some((&control, after)) = rest.split_first() {
        let length = usize::from(control >> 5);
        if length == 0 {
            let (literal, after) = after.split_at_checked(usize::from(control) + 1).ok_or(SHORT)?;
            if plain.len() + literal.len() > most {
                return Err("LZF: more bytes than a chunk has");
            }
            plain.extend_from_slice(literal);
            rest = after;
            continue;
        }
        let (length, after) = match (length, after) {
            (7, [more, after @ ..]) => (9 + usize::from(*more), after),
            (7, []) => return Err(SHORT),
            (length, after) => (length + 2, after),
        };
        let (&low, after) = after.split_first().ok_or(SHORT)?;
        let back = (usize::from(control & 31) << 8 | usize::from(low)) + 1;
        let from = plain.len().checked_sub(back).ok_or("LZF: a piece from before the first byte")?;
        if plain.len() + length > most {
            return Err("LZF: more bytes than a chunk has");
        }
        // The piece may reach into what it makes.
        for at in from..from + length {
            plain.push(plain[at]);
        }
        rest = after;
    }
    Ok(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_may_overlap_themselves() {
        // `ab`, 4 bytes from 2 before, 9 bytes from 1 before.
        assert_eq!(decode(&[1, b'a', b'b', 2 << 5, 1, 7 << 5, 0, 0], 100).unwrap(), b"abababbbbbbbbbb");
        for bad in [&[3u8, 1][..], &[1 << 5], &[1 << 5, 9], &[7 << 5, 1]] {
            assert!(decode(bad, 100).is_err(), "{bad:?}");
        }
        assert!(decode(&[1, b'a', b'b', 7 << 5, 255, 0], 100).is_err());
    }
}
