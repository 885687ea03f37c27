//! Reads voxels written as decimal numbers (NRRD `ascii`) as little-endian bytes of their type.

use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use pumice_core::LabelType;

use crate::error::{FormatError, Result};
use crate::stream::{ByteStream, CountingFile};

/// Longest number that is read: 2⁶⁴ has 20 digits, a float with an exponent has some 25.
const MAX_NUMBER_BYTES: usize = 64;

/// Numbers separated by white space or commas.
pub(crate) struct TextStream {
    path: PathBuf,
    file: CountingFile,
    taken: Arc<AtomicU64>,
    label_type: LabelType,
    /// Bytes of a number that did not fit in the caller's buffer.
    pending: Vec<u8>,
}

impl TextStream {
    /// The numbers of `path` from byte `offset` on.
    pub(crate) fn open(path: &Path, offset: u64, label_type: LabelType) -> Result<Self> {
        let file = CountingFile::open(path, offset)?;
        let taken = file.taken();
        Ok(Self { path: path.to_owned(), file, taken, label_type, pending: Vec::new() })
    }

    /// The bytes of the next number; `None` at the end.
    fn next_number(&mut self) -> Result<Option<Vec<u8>>> {
        let mut text = String::new();
        loop {
            let buffered = self.file.fill_buf().map_err(FormatError::io(&self.path))?;
            let Some(&byte) = buffered.first() else { break };
            let blank = byte.is_ascii_whitespace() || byte == b',';
            if blank && !text.is_empty() {
                break;
            }
            self.file.consume(1);
            if !blank {
                text.push(char::from(byte));
            }
            if text.len() > MAX_NUMBER_BYTES {
                return Err(self.bad(&text));
            }
        }
        if text.is_empty() {
            return Ok(None);
        }
        macro_rules! parse {
            ($t:ty) => {
                text.parse::<$t>().ok().map(|v| v.to_le_bytes().to_vec())
            };
        }
        let bytes = match self.label_type {
            LabelType::U8 => parse!(u8),
            LabelType::U16 => parse!(u16),
            LabelType::U32 => parse!(u32),
            LabelType::U64 => parse!(u64),
            LabelType::I8 => parse!(i8),
            LabelType::I16 => parse!(i16),
            LabelType::I32 => parse!(i32),
            LabelType::I64 => parse!(i64),
            LabelType::F32 => parse!(f32),
            LabelType::F64 => parse!(f64),
        };
        bytes.map(Some).ok_or_else(|| self.bad(&text))
    }

    fn bad(&self, text: &str) -> FormatError {
        FormatError::Damaged {
            path: self.path.clone(),
            what: format!("expected a number of type {:?}, got {text:?}", self.label_type),
            at: Some(self.taken.load(Ordering::Relaxed).saturating_sub(text.len() as u64)),
        }
    }
}

impl ByteStream for TextStream {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            if self.pending.is_empty() {
                match self.next_number()? {
                    Some(bytes) => self.pending = bytes,
                    None => break,
                }
            }
            let n = self.pending.len().min(buffer.len() - filled);
            let rest = self.pending.split_off(n);
            buffer[filled..filled + n].copy_from_slice(&self.pending);
            self.pending = rest;
            filled += n;
        }
        Ok(filled)
    }

    fn position(&self) -> Option<u64> {
        Some(self.taken.load(Ordering::Relaxed))
    }
}
