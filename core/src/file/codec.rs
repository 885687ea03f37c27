//! Encodes the bytes of one section: filters that group similar bytes, then zstd.
//!
//! ```text
//! encode:  delta (each element less the previous one, modulo 2⁸ʷ) ─► planes (all first bytes, all second bytes, …) ─► zstd
//! decode:  zstd ─► planes ─► delta, reversed
//! ```
//! Decoding never reserves memory by a declared size: the output grows with the input that is consumed, and zstd cannot yield more than
//! [`MAX_EXPANSION`] times its input. Where memory runs short on the way, that is an error.

use std::io::{Read, Write};

use super::layout::Encoding;
use crate::reserve::zeroed;
use crate::{Job, NoMemory, Result};

/// A zstd block of 4 bytes yields at most 128 KiB.
const MAX_EXPANSION: u64 = 1 << 15;

/// Largest accepted window of a frame; a decoder allocates the window at once. Level 19 uses 2²³.
const MAX_WINDOW_LOG: u32 = 24;

/// Number of bytes between two checks whether the job is cancelled.
pub(super) const PIECE: usize = 1 << 20;

/// Encodes bytes for the file.
pub(super) fn encode(bytes: &[u8], encoding: Encoding, level: i32, job: &Job) -> Result<Vec<u8>> {
    let mut filtered = bytes.to_vec();
    let width = usize::from(encoding.width.max(1));
    if encoding.delta {
        delta(&mut filtered, width);
    }
    if encoding.planes {
        filtered = planes(&filtered, width);
    }
    if !encoding.zstd {
        return Ok(filtered);
    }
    let memory = |source| crate::Error::Io { path: "zstd".into(), source };
    let mut encoder = zstd::stream::write::Encoder::new(Vec::new(), level).map_err(memory)?;
    encoder.set_pledged_src_size(Some(filtered.len() as u64)).map_err(memory)?;
    for piece in filtered.chunks(PIECE) {
        job.check()?;
        encoder.write_all(piece).map_err(memory)?;
    }
    encoder.finish().map_err(memory)
}

/// Compresses `length` bytes that need not be in memory, without filters, into `to`: the same bytes as [`encode`] gives. `read` fills pieces
/// with them in turn.
pub(super) fn encode_from(
    length: u64,
    mut read: impl FnMut(&mut [u8]) -> Result<()>,
    level: i32,
    to: &mut dyn Write,
    job: &Job,
) -> Result<()> {
    let memory = |source| crate::Error::Io { path: "zstd".into(), source };
    let mut encoder = zstd::stream::write::Encoder::new(to, level).map_err(memory)?;
    encoder.set_pledged_src_size(Some(length)).map_err(memory)?;
    let mut piece = zeroed(length.min(PIECE as u64) as usize, "a section of the file")?;
    let mut left = length;
    while left > 0 {
        job.check()?;
        let piece = &mut piece[..left.min(PIECE as u64) as usize];
        read(piece)?;
        encoder.write_all(piece).map_err(memory)?;
        left -= piece.len() as u64;
    }
    encoder.finish().map(|_| ()).map_err(memory)
}

/// Decodes the bytes of a section; the inner error says what is wrong with them.
pub(super) fn decode(
    stored: Vec<u8>,
    encoding: Encoding,
    decoded: u64,
    job: &Job,
) -> Result<std::result::Result<Vec<u8>, String>> {
    let width = usize::from(encoding.width.max(1));
    if (encoding.delta || encoding.planes) && !decoded.is_multiple_of(width as u64) {
        return Ok(Err(format!("decoded size: expected a multiple of {width}, got {decoded}")));
    }
    let mut bytes = if encoding.zstd {
        match inflate(&stored, decoded, job)? {
            Ok(bytes) => bytes,
            Err(what) => return Ok(Err(what)),
        }
    } else {
        stored
    };
    if encoding.planes {
        bytes = unplanes(&bytes, width)?;
    }
    if encoding.delta {
        undelta(&mut bytes, width);
    }
    Ok(Ok(bytes))
}

fn inflate(stored: &[u8], decoded: u64, job: &Job) -> Result<std::result::Result<Vec<u8>, String>> {
    let most = (stored.len() as u64).saturating_mul(MAX_EXPANSION);
    if decoded > most {
        return Ok(Err(format!(
            "decoded size: expected at most {most} from {} bytes, got {decoded}",
            stored.len()
        )));
    }
    let run = || -> std::io::Result<Result<std::result::Result<Vec<u8>, String>>> {
        let mut decoder = zstd::stream::read::Decoder::with_buffer(stored)?.single_frame();
        decoder.window_log_max(MAX_WINDOW_LOG)?;
        let mut bytes = Vec::new();
        loop {
            if let Err(cancelled) = job.check() {
                return Ok(Err(cancelled));
            }
            let before = bytes.len();
            // Ask for one byte more than declared, so that a stream that is too long shows.
            let left = (decoded + 1 - before as u64).min(PIECE as u64);
            if bytes.try_reserve(left as usize).is_err() {
                let what = "a section of the file".to_owned();
                return Ok(Err(NoMemory::Refused { what, needed_bytes: decoded }.into()));
            }
            (&mut decoder).take(left).read_to_end(&mut bytes)?;
            if bytes.len() as u64 > decoded || bytes.len() == before {
                break;
            }
        }
        let rest = decoder.finish().len();
        if bytes.len() as u64 != decoded {
            let more = if bytes.len() as u64 > decoded { "more" } else { "less" };
            return Ok(Ok(Err(format!("zstd: expected {decoded} bytes, got {more}"))));
        }
        if rest != 0 {
            return Ok(Ok(Err(format!("zstd: expected the end, got {rest} more bytes"))));
        }
        bytes.shrink_to_fit();
        Ok(Ok(Ok(bytes)))
    };
    run().unwrap_or_else(|e| Ok(Err(format!("zstd: {e}"))))
}

fn element(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |v, &b| v << 8 | u64::from(b))
}

fn put_element(bytes: &mut [u8], value: u64) {
    for (i, b) in bytes.iter_mut().enumerate() {
        *b = (value >> (8 * i)) as u8;
    }
}

fn delta(bytes: &mut [u8], width: usize) {
    let mut before = 0;
    for e in bytes.chunks_exact_mut(width) {
        let value = element(e);
        put_element(e, value.wrapping_sub(before));
        before = value;
    }
}

fn undelta(bytes: &mut [u8], width: usize) {
    let mut value = 0u64;
    for e in bytes.chunks_exact_mut(width) {
        value = value.wrapping_add(element(e));
        put_element(e, value);
    }
}

fn planes(bytes: &[u8], width: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    for plane in 0..width {
        out.extend(bytes.iter().skip(plane).step_by(width));
    }
    out
}

fn unplanes(bytes: &[u8], width: usize) -> std::result::Result<Vec<u8>, NoMemory> {
    let elements = bytes.len() / width;
    let mut out = zeroed(bytes.len(), "a section of the file")?;
    for plane in 0..width {
        for (to, from) in out.iter_mut().skip(plane).step_by(width).zip(&bytes[plane * elements..]) {
            *to = *from;
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip(bytes: &[u8], encoding: Encoding) {
        let job = Job::new();
        let stored = encode(bytes, encoding, 3, &job).unwrap();
        assert_eq!(decode(stored, encoding, bytes.len() as u64, &job).unwrap().as_deref(), Ok(bytes));
    }

    #[test]
    fn all_encodings_round_trip() {
        let bytes: Vec<u8> = (0..24_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
        for zstd in [false, true] {
            for (delta, planes) in [(false, false), (true, false), (false, true), (true, true)] {
                for width in [1, 2, 3, 4, 8] {
                    round_trip(&bytes, Encoding { zstd, width, delta, planes });
                    round_trip(&[], Encoding { zstd, width, delta, planes });
                }
            }
        }
    }

    #[test]
    fn wrong_sizes_are_told() {
        let job = Job::new();
        let encoding = Encoding { zstd: true, width: 1, ..Encoding::default() };
        let stored = encode(&[7; 5000], encoding, 3, &job).unwrap();
        for decoded in [0, 4999, 5001, 1 << 60] {
            assert!(decode(stored.clone(), encoding, decoded, &job).unwrap().is_err(), "{decoded}");
        }
        let mut longer = stored;
        longer.push(0);
        assert!(decode(longer, encoding, 5000, &job).unwrap().is_err());
    }
}
