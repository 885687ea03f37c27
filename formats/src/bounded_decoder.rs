//! Decoders of compressed chunks that stop where a chunk is full.
//!
//! A chunk states its size before it is read: a few bytes of gzip can hold gigabytes. Each decoder here gives at most as many bytes as its caller
//! allows, and allocates no more; a payload that holds more is refused after that many.

use std::io::Read;

use brotli_decompressor::Decompressor;
use flate2::read::{MultiGzDecoder, ZlibDecoder};
use pumice_core::error::one_line;
#[cfg(feature = "zarr")]
use zarrs::array::codec::api::{BytesRepresentation, BytesToBytesCodecTraits as _, CodecOptions};

/// Bytes that the decoder of brotli reads at a time.
const BROTLI_BUFFER: usize = 4096;

/// How a chunk is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Coder {
    /// One member or several.
    Gzip,
    Zlib,
    Brotli,
    /// One frame or several.
    Zstd,
    #[cfg(feature = "zarr")]
    Bzip2,
    /// A frame of c-blosc 1, with any of its inner codecs.
    #[cfg(feature = "zarr")]
    Blosc,
}

impl Coder {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Gzip => "gzip",
            Self::Zlib => "zlib",
            Self::Brotli => "brotli",
            Self::Zstd => "zstd",
            #[cfg(feature = "zarr")]
            Self::Bzip2 => "bzip2",
            #[cfg(feature = "zarr")]
            Self::Blosc => "blosc",
        }
    }

    /// The plain bytes of `stored`, at most `most` of them.
    ///
    /// # Errors
    /// One line that names the coder: damaged data, or more than `most` bytes.
    pub(crate) fn decode(self, stored: &[u8], most: u64) -> Result<Vec<u8>, String> {
        let named = |e: std::io::Error| one_line(&format!("{}: {e}", self.name()));
        match self {
            Self::Gzip => self.taken(MultiGzDecoder::new(stored), most),
            Self::Zlib => self.taken(ZlibDecoder::new(stored), most),
            Self::Brotli => self.taken(Decompressor::new(stored, BROTLI_BUFFER), most),
            // Streams: the window of a frame is allocated as the frame says, so the largest is limited too.
            Self::Zstd => {
                let mut decoder = zstd::stream::read::Decoder::new(stored).map_err(named)?;
                decoder.window_log_max(window_log(most)).map_err(named)?;
                self.taken(decoder, most)
            }
            #[cfg(feature = "zarr")]
            Self::Bzip2 => self.taken(bzip2::read::MultiBzDecoder::new(stored), most),
            #[cfg(feature = "zarr")]
            Self::Blosc => self.blosc(stored, most),
        }
    }

    fn taken(self, decoder: impl Read, most: u64) -> Result<Vec<u8>, String> {
        let mut plain = Vec::new();
        decoder
            .take(most.saturating_add(1))
            .read_to_end(&mut plain)
            .map_err(|e| one_line(&format!("{}: {e}", self.name())))?;
        if plain.len() as u64 > most {
            return Err(self.too_long(most));
        }
        Ok(plain)
    }

    fn too_long(self, most: u64) -> String {
        format!("{}: the data inflate to more than the {most} bytes of a chunk", self.name())
    }

    #[cfg(feature = "zarr")]
    fn blosc(self, stored: &[u8], most: u64) -> Result<Vec<u8>, String> {
        use zarrs::array::codec::{BloscCodec, BloscCompressor, BloscShuffleMode};
        if check_blosc(stored, most)? == 0 {
            return Ok(Vec::new());
        }
        // The frame says how it was made; the codec's own settings are for writing.
        let level = 9.try_into().map_err(|_| "blosc: its level is not known".to_owned())?;
        BloscCodec::new(BloscCompressor::Zstd, level, None, BloscShuffleMode::NoShuffle, None)
            .map_err(|e| one_line(&format!("blosc: {e}")))?
            .decode(stored.into(), &BytesRepresentation::BoundedSize(most), &CodecOptions::default())
            .map(std::borrow::Cow::into_owned)
            .map_err(|e| one_line(&format!("blosc: {e}")))
    }
}

/// The number of bytes that a frame of c-blosc holds, which it states itself: its decoder writes no more.
///
/// # Errors
/// One line for a frame that is too short or holds more than `most` bytes.
#[cfg(feature = "zarr")]
pub(crate) fn check_blosc(stored: &[u8], most: u64) -> Result<u64, String> {
    // `blosc.h`: version, version of the codec, flags, size of an element; u32 bytes plain, of a block, in all.
    let plain = stored.get(4..8).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let Some(plain) = plain.filter(|_| stored.len() >= 16) else {
        return Err(format!("blosc: the frame has {} bytes, fewer than its header", stored.len()));
    };
    if u64::from(plain) > most {
        return Err(Coder::Blosc.too_long(most));
    }
    Ok(plain.into())
}

/// The binary logarithm of the largest window of zstd that is accepted for `most` bytes: no frame of so many bytes needs a larger one. zstd's own
/// default, which suits small chunks too, is 27.
fn window_log(most: u64) -> u32 {
    most.max(1).next_power_of_two().trailing_zeros().clamp(27, 31)
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn bombs(bytes: usize) -> Vec<(Coder, Vec<u8>)> {
        let plain = vec![0; bytes];
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        let mut zlib = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        gzip.write_all(&plain).unwrap();
        zlib.write_all(&plain).unwrap();
        vec![
            (Coder::Gzip, gzip.finish().unwrap()),
            (Coder::Zlib, zlib.finish().unwrap()),
            (Coder::Zstd, zstd::stream::encode_all(plain.as_slice(), 3).unwrap()),
        ]
    }

    #[test]
    fn a_payload_that_holds_more_than_a_chunk_is_refused() {
        for (coder, stored) in bombs(1 << 20) {
            assert_eq!(coder.decode(&stored, 1 << 20).unwrap().len(), 1 << 20, "{coder:?}");
            let error = coder.decode(&stored, (1 << 20) - 1).unwrap_err();
            assert!(error.contains("more than the 1048575 bytes"), "{error}");
            assert!(coder.decode(&stored[..stored.len() / 2], 1 << 20).is_err(), "{coder:?}");
        }
    }

    #[test]
    fn a_frame_of_zstd_that_asks_for_a_huge_window_is_refused() {
        // RFC 8878: magic; no content size; window of 2^41 bytes; an empty last block.
        let frame = [0x28, 0xB5, 0x2F, 0xFD, 0x00, 31 << 3, 1, 0, 0];
        assert!(Coder::Zstd.decode(&frame, 4096).unwrap_err().starts_with("zstd: "));
    }
}
