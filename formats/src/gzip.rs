//! Inflates gzip (with several members, or with other data after them), zlib and raw deflate.
//!
//! A gzip member ends with CRC-32 and length of its content (RFC 1952 §2.3.1). They are checked once the member's last byte has been read,
//! so a reader must read to the end of the stream.

use std::io::{BufRead, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use flate2::bufread::{DeflateDecoder, GzDecoder, ZlibDecoder};

use crate::error::{FormatError, Result};
use crate::options::Warnings;
use crate::stream::{ByteStream, CountingFile};

/// First bytes of a gzip member (RFC 1952 §2.3.1).
pub(crate) const GZIP_MAGIC: [u8; 2] = [0x1F, 0x8B];

/// Container format of the deflated data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wrapping {
    Gzip,
    Zlib,
    /// None, as in zip archives.
    Deflate,
}

enum Decoder {
    Gzip(GzDecoder<CountingFile>),
    Zlib(ZlibDecoder<CountingFile>),
    Deflate(DeflateDecoder<CountingFile>),
    /// The last member has ended.
    End,
}

/// The bytes inflated from a file.
pub(crate) struct InflateStream {
    path: PathBuf,
    decoder: Decoder,
    taken: Arc<AtomicU64>,
    warnings: Warnings,
}

impl InflateStream {
    /// Inflates the file at `path` from byte `offset` on.
    pub(crate) fn open(path: &Path, offset: u64, wrapping: Wrapping, warnings: &Warnings) -> Result<Self> {
        let file = CountingFile::open(path, offset)?;
        let taken = file.taken();
        let decoder = match wrapping {
            Wrapping::Gzip => Decoder::Gzip(GzDecoder::new(file)),
            Wrapping::Zlib => Decoder::Zlib(ZlibDecoder::new(file)),
            Wrapping::Deflate => Decoder::Deflate(DeflateDecoder::new(file)),
        };
        Ok(Self { path: path.to_owned(), decoder, taken, warnings: warnings.clone() })
    }

    /// Classifies an error: a damaged stream is a fault of the file, a failing disk one of the system.
    fn explain(&self, source: std::io::Error) -> FormatError {
        use std::io::ErrorKind::{InvalidData, InvalidInput, UnexpectedEof};
        let at = Some(self.taken.load(Ordering::Relaxed));
        let path = self.path.clone();
        match source.kind() {
            UnexpectedEof => FormatError::Damaged {
                path,
                what: "the compressed data are cut off: the file was not copied or saved completely".into(),
                at,
            },
            InvalidInput | InvalidData => {
                FormatError::Damaged { path, what: format!("the compressed data are damaged: {source}"), at }
            }
            _ => FormatError::Io { path, source },
        }
    }

    /// At the end of a member: starts the next member, or returns false at the end of the stream.
    fn next_member(&mut self) -> Result<bool> {
        let Decoder::Gzip(member) = std::mem::replace(&mut self.decoder, Decoder::End) else {
            return Ok(false);
        };
        let mut file = member.into_inner();
        let rest = file.fill_buf().map_err(FormatError::io(&self.path))?;
        if rest.is_empty() {
            return Ok(false);
        }
        // One byte is enough to tell: a file that ends between the two bytes of the magic is cut off, and the decoder reports that.
        if rest[0] == GZIP_MAGIC[0] && rest.get(1).is_none_or(|&b| b == GZIP_MAGIC[1]) {
            self.decoder = Decoder::Gzip(GzDecoder::new(file));
            return Ok(true);
        }
        if rest.iter().any(|&b| b != 0) {
            // Zeros are padding, as in tape blocks and some disk images.
            self.warnings.push(format!(
                "{}: ignored the bytes after the compressed data (from byte {})",
                self.path.display(),
                self.taken.load(Ordering::Relaxed)
            ));
        }
        Ok(false)
    }
}

impl ByteStream for InflateStream {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        loop {
            let n = match &mut self.decoder {
                Decoder::Gzip(d) => d.read(buffer),
                Decoder::Zlib(d) => d.read(buffer),
                Decoder::Deflate(d) => d.read(buffer),
                Decoder::End => return Ok(0),
            }
            .map_err(|e| self.explain(e))?;
            if n > 0 || !self.next_member()? {
                return Ok(n);
            }
        }
    }

    fn position(&self) -> Option<u64> {
        Some(self.taken.load(Ordering::Relaxed))
    }
}
