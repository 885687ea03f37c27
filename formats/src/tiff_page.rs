//! One page of a TIFF file: its shape, and its pixels row by row.
//!
//! ```text
//! strips: full rows, several per strip      ┌───────────┐      tiles: rectangles      ┌────┬────┬──┐
//!         one row is in memory              ├───────────┤      one row of tiles       ├────┼────┼──┤
//!                                           └───────────┘      is in memory           └────┴────┴──┘
//! ```
//! Compression none, LZW, deflate, PackBits; predictor none, horizontal (TIFF 6.0 §14), floating point (TIFF Technical Note 3).

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use flate2::bufread::ZlibDecoder;
use pumice_core::LabelType;

use crate::error::{FormatError, Result};
use crate::stream::{ByteStream, PlainStream, open_file};
use crate::tiff_ifd::{TiffFile, tag};

/// Number of bytes that are read from disk at once.
const READ_BYTES: u64 = 256 << 10;

/// Largest row of tiles that is held in memory, in bytes.
const MAX_BAND_BYTES: u64 = 256 << 20;

/// Largest compression ratio in TIFF: an LZW code of 12 bits stands for at most 4,096 bytes; deflate reaches 1,032 : 1.
const MAX_RATIO: u64 = 4096;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compression {
    None,
    Lzw,
    Deflate,
    PackBits,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Predictor {
    None,
    Horizontal,
    Float,
}

/// The properties that all pages of a stack must share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PageShape {
    pub(crate) width: u64,
    pub(crate) height: u64,
    /// Slices of a page that holds a whole volume, else 1.
    pub(crate) depth: u64,
    pub(crate) label_type: LabelType,
}

/// A page with parsed tags, ready to read its pixels.
pub(crate) struct Page {
    path: PathBuf,
    file: File,
    pub(crate) shape: PageShape,
    pub(crate) compression: Compression,
    big_endian: bool,
    predictor: Predictor,
    tiled: bool,
    chunk_width: u64,
    chunk_height: u64,
    /// Offset and bytes of each strip or tile.
    pub(crate) chunks: Vec<(u64, u64)>,
}

/// Checks the tags of the page at `at` and returns its shape.
pub(crate) fn shape(path: &Path, tiff: &mut TiffFile, at: u64) -> Result<(PageShape, Compression)> {
    let directory = tiff.directory(at)?;
    let mut get =
        |id: u16, default: u64| -> Result<u64> { Ok(tiff.number(&directory, id)?.unwrap_or(default)) };
    let (width, height) = (get(tag::IMAGE_WIDTH, 0)?, get(tag::IMAGE_LENGTH, 0)?);
    let depth = get(tag::IMAGE_DEPTH, 1)?.max(1);
    let samples = get(tag::SAMPLES_PER_PIXEL, 1)?;
    let photometric = get(tag::PHOTOMETRIC, 1)?;
    let label_map = "labels are one whole number a voxel: save the label map itself as a grey-scale TIFF";
    if photometric == 3 {
        return Err(FormatError::unsupported(path, "the picture has a colour palette", label_map));
    }
    if samples != 1 || photometric > 1 {
        return Err(FormatError::unsupported(
            path,
            format!("the picture is in colour ({samples} values a pixel, photometric {photometric})"),
            label_map,
        ));
    }
    if get(tag::FILL_ORDER, 1)? != 1 {
        return Err(FormatError::unsupported(
            path,
            "the bits are stored in reverse",
            "save it again as plain TIFF",
        ));
    }
    let bits = get(tag::BITS_PER_SAMPLE, 1)?;
    let format = get(tag::SAMPLE_FORMAT, 1)?;
    let label_type = match (bits, format) {
        (8, 1 | 4) => LabelType::U8,
        (16, 1 | 4) => LabelType::U16,
        (32, 1 | 4) => LabelType::U32,
        (64, 1 | 4) => LabelType::U64,
        (8, 2) => LabelType::I8,
        (16, 2) => LabelType::I16,
        (32, 2) => LabelType::I32,
        (64, 2) => LabelType::I64,
        (32, 3) => LabelType::F32,
        (64, 3) => LabelType::F64,
        _ => {
            return Err(FormatError::unsupported(
                path,
                format!("pixels of {bits} bits with sample format {format} are not supported"),
                "save it with 8, 16, 32 or 64 bits a pixel",
            ));
        }
    };
    let compression = match get(tag::COMPRESSION, 1)? {
        1 => Compression::None,
        5 => Compression::Lzw,
        8 | 32946 => Compression::Deflate,
        32773 => Compression::PackBits,
        number => {
            let name = match number {
                2..=4 => "fax",
                6 | 7 => "JPEG, which changes labels",
                34712 | 33003 | 33005 => "JPEG 2000",
                34925 => "LZMA",
                50000 | 34926 => "Zstandard",
                50001 | 34927 => "WebP",
                _ => "unknown",
            };
            return Err(FormatError::unsupported(
                path,
                format!("TIFF compression {number} ({name}) is not read"),
                "save it again uncompressed or with deflate, LZW or PackBits",
            ));
        }
    };
    Ok((PageShape { width, height, depth, label_type }, compression))
}

impl Page {
    /// Reads the tags of the page at `at`.
    pub(crate) fn read(path: &Path, tiff: &mut TiffFile, at: u64) -> Result<Self> {
        let (shape, compression) = shape(path, tiff, at)?;
        let directory = tiff.directory(at)?;
        let damaged = |what: String| FormatError::Damaged { path: path.to_owned(), what, at: Some(at) };
        let predictor = match tiff.number(&directory, tag::PREDICTOR)?.unwrap_or(1) {
            _ if compression == Compression::None || compression == Compression::PackBits => Predictor::None,
            1 => Predictor::None,
            2 => Predictor::Horizontal,
            3 if matches!(shape.label_type, LabelType::F32 | LabelType::F64) => Predictor::Float,
            other => return Err(damaged(format!("the predictor is {other}, expected 1, 2 or 3"))),
        };
        let tiled = tiff.count(&directory, tag::TILE_OFFSETS) > 0;
        let (chunk_width, chunk_height, offsets, counts) = if tiled {
            let width = tiff.number(&directory, tag::TILE_WIDTH)?.unwrap_or(0);
            let height = tiff.number(&directory, tag::TILE_LENGTH)?.unwrap_or(0);
            (width, height, tag::TILE_OFFSETS, tag::TILE_BYTE_COUNTS)
        } else {
            let rows = tiff.number(&directory, tag::ROWS_PER_STRIP)?.unwrap_or(shape.height);
            (shape.width, rows.min(shape.height), tag::STRIP_OFFSETS, tag::STRIP_BYTE_COUNTS)
        };
        if chunk_width == 0 || chunk_height == 0 {
            return Err(damaged(format!(
                "strips or tiles have {chunk_width} × {chunk_height} pixels, expected at least 1 × 1"
            )));
        }
        let wanted = shape.width.div_ceil(chunk_width).saturating_mul(shape.height.div_ceil(chunk_height));
        let have = tiff.count(&directory, offsets);
        if have < wanted {
            return Err(damaged(format!("expected {wanted} strips or tiles, got {have}")));
        }
        // The table lies in the file, so it cannot have more entries than the file has bytes for. The list grows as it is read.
        let mut chunks = Vec::new();
        for i in 0..wanted {
            let offset = tiff.nth(&directory, offsets, i)?;
            let bytes =
                if tiff.count(&directory, counts) > i { tiff.nth(&directory, counts, i)? } else { u64::MAX };
            if offset >= tiff.file_bytes {
                return Err(damaged(format!(
                    "strip or tile {i} is at byte {offset}, but the file has {} bytes: it is cut off or damaged",
                    tiff.file_bytes
                )));
            }
            chunks.push((offset, bytes.min(tiff.file_bytes - offset)));
        }
        let big_endian = tiff.big_endian;
        Ok(Self {
            path: path.to_owned(),
            file: open_file(path)?,
            shape,
            compression,
            big_endian,
            predictor,
            tiled,
            chunk_width,
            chunk_height,
            chunks,
        })
    }

    /// Whether the slices of a page that holds a volume lie one after the other, uncompressed: in strips that are cut anew in each slice, or in one.
    pub(crate) fn has_slices_in_a_row(&self, tiff: &mut TiffFile, at: u64) -> Result<bool> {
        if self.tiled || self.compression != Compression::None || !self.is_contiguous() {
            return Ok(false);
        }
        let directory = tiff.directory(at)?;
        let (strips, count) = (self.chunks.len() as u64, tiff.count(&directory, tag::STRIP_OFFSETS));
        if count == 1 {
            return Ok(true);
        }
        let slice_bytes =
            self.shape.width.saturating_mul(self.shape.height).saturating_mul(self.element_bytes() as u64);
        if count != strips.saturating_mul(self.shape.depth) {
            return Ok(false);
        }
        for strip in strips..count {
            let first = self.chunks[(strip % strips) as usize].0;
            let expected = first.checked_add(slice_bytes.saturating_mul(strip / strips));
            if expected != Some(tiff.nth(&directory, tag::STRIP_OFFSETS, strip)?) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Whether the rows of all strips lie one after the other.
    pub(crate) fn is_contiguous(&self) -> bool {
        let strip_bytes = self.chunk_height * self.shape.width * self.element_bytes() as u64;
        !self.tiled && self.chunks.windows(2).all(|w| w[0].0.checked_add(strip_bytes) == Some(w[1].0))
    }

    /// The bytes of its pixels, row by row, in little-endian order.
    pub(crate) fn into_stream(self) -> Result<Box<dyn ByteStream>> {
        let is_as_stored = self.compression == Compression::None
            && self.is_contiguous()
            && (!self.big_endian || self.element_bytes() == 1);
        match self.chunks.first() {
            Some(&(start, _)) if is_as_stored => Ok(Box::new(PlainStream::open(&self.path, start)?)),
            _ => Ok(Box::new(PageStream::new(self))),
        }
    }

    fn element_bytes(&self) -> usize {
        crate::element::Element::new(self.shape.label_type, false).bytes()
    }

    /// The inflated bytes of strip or tile `index`.
    ///
    /// All chunks share the page's file cursor, so only one of them may be read at a time.
    fn open_chunk(&self, index: usize) -> Result<Box<dyn Read + Send>> {
        let (offset, bytes) = self.chunks[index];
        let mut file = self.file.try_clone().map_err(FormatError::io(&self.path))?;
        file.seek(SeekFrom::Start(offset)).map_err(FormatError::io(&self.path))?;
        let file = BufReader::with_capacity(bytes.clamp(1, READ_BYTES) as usize, file);
        Ok(match self.compression {
            // The byte counts of uncompressed strips are not needed, and are wrong above 4 GiB.
            Compression::None => Box::new(file),
            Compression::Deflate => Box::new(ZlibDecoder::new(file.take(bytes))),
            Compression::Lzw => Box::new(LzwReader::new(file.take(bytes))),
            Compression::PackBits => {
                Box::new(PackBitsReader { input: file.take(bytes), run: 0, repeated: None })
            }
        })
    }
}

/// The rows of one page, in little-endian order.
struct PageStream {
    page: Page,
    /// Next strip, or next row of tiles.
    band: u64,
    strip: Option<Box<dyn Read + Send>>,
    rows_left_in_strip: u64,
    /// One row of pixels (strips), or all rows of one row of tiles.
    buffer: Vec<u8>,
    at: usize,
    rows_left: u64,
}

impl PageStream {
    fn new(page: Page) -> Self {
        let rows_left = page.shape.height;
        Self { page, band: 0, strip: None, rows_left_in_strip: 0, buffer: Vec::new(), at: 0, rows_left }
    }

    /// Fills the buffer with the next rows; leaves it empty after the last.
    fn refill(&mut self) -> Result<()> {
        self.buffer.clear();
        self.at = 0;
        if self.rows_left == 0 {
            return Ok(());
        }
        if self.page.tiled { self.next_tiles() } else { self.next_row() }
    }

    /// Leaves out strips, or rows of tiles, of which at most `rows` rows are to be skipped; returns their rows. The buffer is empty.
    fn skip_bands(&mut self, rows: u64) -> u64 {
        let mut skipped = 0;
        if self.rows_left_in_strip > 0 {
            if rows < self.rows_left_in_strip {
                return 0;
            }
            skipped = std::mem::take(&mut self.rows_left_in_strip);
        }
        let height = self.page.chunk_height;
        let bands = (rows - skipped).min(self.rows_left - skipped) / height;
        self.band += bands;
        skipped += bands * height;
        self.rows_left -= skipped;
        skipped
    }

    fn next_row(&mut self) -> Result<()> {
        if self.rows_left_in_strip == 0 {
            self.strip = Some(self.page.open_chunk(self.band as usize)?);
            self.band += 1;
            self.rows_left_in_strip = self.page.chunk_height.min(self.rows_left);
        }
        let row_bytes = self.page.shape.width * self.page.element_bytes() as u64;
        if let Some(strip) = &mut self.strip {
            read_row(&self.page.path, strip, row_bytes, self.band - 1, &mut self.buffer)?;
        }
        finish_row(&self.page, &mut self.buffer);
        self.rows_left_in_strip -= 1;
        self.rows_left -= 1;
        Ok(())
    }

    fn next_tiles(&mut self) -> Result<()> {
        let page = &self.page;
        let element = page.element_bytes() as u64;
        let rows = page.chunk_height.min(self.rows_left);
        let row_bytes = page.shape.width * element;
        let across = page.shape.width.div_ceil(page.chunk_width);
        let first = (self.band * across) as usize;
        let tiles = first..first + across as usize;
        let band_bytes = row_bytes.saturating_mul(rows);
        if band_bytes.max(page.chunk_width.saturating_mul(element)) > MAX_BAND_BYTES {
            return Err(FormatError::Limit {
                path: page.path.clone(),
                what: "the size of one row of tiles".into(),
                got: format!("{band_bytes} bytes"),
                limit: MAX_BAND_BYTES,
            });
        }
        // Allocate no more than the compressed bytes can fill.
        let stored: u64 = page.chunks[tiles.clone()].iter().map(|c| c.1).fold(0, u64::saturating_add);
        if band_bytes > stored.saturating_mul(MAX_RATIO) {
            return Err(FormatError::damaged(
                &page.path,
                format!(
                    "{stored} bytes of tiles cannot hold {band_bytes} bytes of pixels: the file is damaged"
                ),
            ));
        }
        let mut band = vec![0; band_bytes as usize];
        let mut row = Vec::new();
        for (column, index) in tiles.enumerate() {
            let mut tile = page.open_chunk(index)?;
            let x = column as u64 * page.chunk_width;
            let kept = (page.chunk_width.min(page.shape.width - x) * element) as usize;
            for y in 0..rows {
                row.clear();
                read_row(&page.path, &mut tile, page.chunk_width * element, index as u64, &mut row)?;
                finish_row(page, &mut row);
                let to = (y * row_bytes + x * element) as usize;
                band[to..to + kept].copy_from_slice(&row[..kept]);
            }
        }
        self.buffer = band;
        self.band += 1;
        self.rows_left -= rows;
        Ok(())
    }
}

impl ByteStream for PageStream {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if self.at == self.buffer.len() {
            self.refill()?;
        }
        let n = buffer.len().min(self.buffer.len() - self.at);
        buffer[..n].copy_from_slice(&self.buffer[self.at..self.at + n]);
        self.at += n;
        Ok(n)
    }

    /// Strips and tiles that lie in the skipped bytes as a whole are not decompressed.
    fn skip(&mut self, bytes: u64) -> Result<u64> {
        let row_bytes = self.page.shape.width * self.page.element_bytes() as u64;
        let mut left = bytes;
        while left > 0 {
            if self.at == self.buffer.len() {
                left -= self.skip_bands(left / row_bytes) * row_bytes;
                if left == 0 {
                    break;
                }
                self.refill()?;
                if self.buffer.is_empty() {
                    break;
                }
            }
            let n = left.min((self.buffer.len() - self.at) as u64);
            self.at += n as usize;
            left -= n;
        }
        Ok(bytes - left)
    }
}

/// Reads exactly `bytes` bytes; the buffer grows only as far as data arrive.
fn read_row(path: &Path, chunk: &mut dyn Read, bytes: u64, index: u64, row: &mut Vec<u8>) -> Result<()> {
    use io::ErrorKind::{InvalidData, InvalidInput, UnexpectedEof};
    match chunk.take(bytes).read_to_end(row) {
        Ok(n) if n as u64 == bytes => Ok(()),
        Ok(n) => Err(FormatError::damaged(
            path,
            format!("strip or tile {index} ends in the middle of a row: expected {bytes} bytes, got {n}"),
        )),
        Err(e) if matches!(e.kind(), InvalidData | InvalidInput | UnexpectedEof) => {
            Err(FormatError::damaged(path, format!("strip or tile {index} is damaged: {e}")))
        }
        Err(source) => Err(FormatError::Io { path: path.to_owned(), source }),
    }
}

/// Undoes the predictor and converts the row to little-endian order.
fn finish_row(page: &Page, row: &mut [u8]) {
    let size = page.element_bytes();
    match page.predictor {
        Predictor::Float => {
            // The predictor stores differences of single bytes; the row's most significant bytes come first, then the next ones, and so on
            // (Note 3).
            for i in 1..row.len() {
                row[i] = row[i].wrapping_add(row[i - 1]);
            }
            let planes = row.to_vec();
            let width = row.len() / size;
            for (x, pixel) in row.chunks_exact_mut(size).enumerate() {
                for (b, byte) in pixel.iter_mut().enumerate() {
                    *byte = planes[(size - 1 - b) * width + x];
                }
            }
            return;
        }
        Predictor::Horizontal | Predictor::None => {}
    }
    if page.big_endian && size > 1 {
        row.chunks_exact_mut(size).for_each(<[u8]>::reverse);
    }
    if page.predictor == Predictor::Horizontal {
        // Each pixel is stored as its difference from the pixel to its left, in whole-number arithmetic whatever the type.
        let mut left = 0u64;
        for pixel in row.chunks_exact_mut(size) {
            let mut wide = [0; 8];
            wide[..size].copy_from_slice(pixel);
            left = left.wrapping_add(u64::from_le_bytes(wide));
            pixel.copy_from_slice(&left.to_le_bytes()[..size]);
        }
    }
}

/// TIFF's LZW (TIFF 6.0 §13): most significant bit first; the code width changes one code early.
struct LzwReader<R> {
    input: R,
    decoder: weezl::decode::Decoder,
    ended: bool,
}

impl<R> LzwReader<R> {
    fn new(input: R) -> Self {
        Self {
            input,
            decoder: weezl::decode::Decoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8),
            ended: false,
        }
    }
}

impl<R: BufRead> Read for LzwReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() || self.ended {
            return Ok(0);
        }
        loop {
            let input = self.input.fill_buf()?;
            let at_end = input.is_empty();
            let result = self.decoder.decode_bytes(input, buffer);
            self.input.consume(result.consumed_in);
            let status = result.status.map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))?;
            self.ended |= matches!(status, weezl::LzwStatus::Done);
            if result.consumed_out > 0 || self.ended {
                return Ok(result.consumed_out);
            }
            if at_end || (matches!(status, weezl::LzwStatus::NoProgress) && result.consumed_in == 0) {
                return Ok(0);
            }
        }
    }
}

/// PackBits (TIFF 6.0 §9): after a byte n < 128 come n + 1 literal bytes; after n > 128 comes one byte that is repeated 257 − n times.
struct PackBitsReader<R> {
    input: R,
    run: usize,
    repeated: Option<u8>,
}

impl<R: BufRead> Read for PackBitsReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.run == 0 {
            let mut head = [0];
            if self.input.read(&mut head)? == 0 {
                return Ok(0);
            }
            match head[0] {
                n @ 0..128 => (self.run, self.repeated) = (usize::from(n) + 1, None),
                128 => {}
                n => {
                    let mut value = [0];
                    self.input.read_exact(&mut value)?;
                    (self.run, self.repeated) = (257 - usize::from(n), Some(value[0]));
                }
            }
        }
        let n = self.run.min(buffer.len());
        let n = match self.repeated {
            Some(value) => {
                buffer[..n].fill(value);
                n
            }
            None => match self.input.read(&mut buffer[..n])? {
                0 if n > 0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                n => n,
            },
        };
        self.run -= n;
        Ok(n)
    }
}
