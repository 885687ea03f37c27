//! Writes TIFF: one page per plane, strips of deflate, voxel size as OME-XML. The format stores no orientation and no names.
//!
//! ```text
//! header │ strips of page 1 │ directory 1 │ strips of page 2 │ directory 2 │ …        each directory's `next` is set when
//!        └──────────────────────► first ──┴────── next ───────────────►               the offset of the next one is known
//! ```
//! The file is a BigTIFF where the voxels alone exceed 3.5 GiB, because classic offsets have 32 bits. OME has no 64-bit integers: files of
//! these have no description, so no voxel size.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pumice_core::{LabelType, Unit, VolumeInfo};

use crate::tiff_ifd::tag;
use crate::voxel_writer::{VoxelWriter, bytes_of, unbuffer};

/// Largest number of bytes of voxels in classic TIFF; the rest of its 4 GiB is for directories and for data that deflate makes larger.
const CLASSIC_BYTES: u64 = 7 << 29;

/// Approximate number of bytes of a strip before deflate.
const STRIP_BYTES: u64 = 256 << 10;

pub(crate) struct TiffWriter {
    file: BufWriter<File>,
    at: u64,
    big: bool,
    label_type: LabelType,
    width: u32,
    height: u32,
    rows_per_strip: u32,
    description: Option<String>,
    /// Offset at which the next directory's offset must be written.
    link_at: u64,
    /// Bytes of the current strip, which is not full yet.
    strip: Vec<u8>,
    rows_done: u32,
    /// Offset and bytes of this page's strips.
    strips: Vec<(u64, u64)>,
}

/// Writes the file header.
pub(crate) fn start(info: &VolumeInfo, mut file: BufWriter<File>) -> io::Result<Box<dyn VoxelWriter>> {
    let row_bytes = u64::from(info.dims[0]) * bytes_of(info.label_type) as u64;
    let big = info.voxels().saturating_mul(bytes_of(info.label_type) as u64) > CLASSIC_BYTES;
    if big {
        file.write_all(b"II\x2B\0\x08\0\0\0\0\0\0\0\0\0\0\0")?;
    } else {
        file.write_all(b"II\x2A\0\0\0\0\0")?;
    }
    Ok(Box::new(TiffWriter {
        file,
        at: if big { 16 } else { 8 },
        big,
        label_type: info.label_type,
        width: info.dims[0],
        height: info.dims[1],
        rows_per_strip: (STRIP_BYTES / row_bytes).clamp(1, info.dims[1].into()) as u32,
        description: ome_xml(info),
        link_at: if big { 8 } else { 4 },
        strip: Vec::new(),
        rows_done: 0,
        strips: Vec::new(),
    }))
}

impl TiffWriter {
    /// Number of bytes of the current strip when it is full.
    fn strip_bytes(&self) -> usize {
        let rows = self.rows_per_strip.min(self.height - self.rows_done);
        rows as usize * self.width as usize * bytes_of(self.label_type)
    }

    fn end_strip(&mut self) -> io::Result<()> {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(&self.strip)?;
        let packed = encoder.finish()?;
        self.strip.clear();
        self.strips.push((self.at, packed.len() as u64));
        self.put(&packed)?;
        self.rows_done += self.rows_per_strip.min(self.height - self.rows_done);
        if self.rows_done == self.height {
            self.end_page()?;
        }
        Ok(())
    }

    /// Writes the directory of a page after all of its strips.
    fn end_page(&mut self) -> io::Result<()> {
        let strips = std::mem::take(&mut self.strips);
        self.rows_done = 0;
        let offsets: Vec<u64> = strips.iter().map(|s| s.0).collect();
        let counts: Vec<u64> = strips.iter().map(|s| s.1).collect();
        let format = match self.label_type {
            LabelType::U8 | LabelType::U16 | LabelType::U32 | LabelType::U64 => 1,
            LabelType::I8 | LabelType::I16 | LabelType::I32 | LabelType::I64 => 2,
            LabelType::F32 | LabelType::F64 => 3,
        };
        let description = self.description.take();
        // Tags must rise (TIFF 6.0 §2). Each is (tag, type, values); the types are 2 text, 3 SHORT, 4 LONG, 16 LONG8.
        let long = if self.big { 16 } else { 4 };
        let mut tags: Vec<(u16, u16, Vec<u64>)> = vec![
            (tag::IMAGE_WIDTH, 4, vec![self.width.into()]),
            (tag::IMAGE_LENGTH, 4, vec![self.height.into()]),
            (tag::BITS_PER_SAMPLE, 3, vec![8 * bytes_of(self.label_type) as u64]),
            (tag::COMPRESSION, 3, vec![8]),
            (tag::PHOTOMETRIC, 3, vec![1]),
        ];
        if let Some(text) = description {
            let with_nul = text.bytes().chain([0]).map(u64::from).collect();
            tags.push((tag::IMAGE_DESCRIPTION, 2, with_nul));
        }
        tags.extend([
            (tag::STRIP_OFFSETS, long, offsets),
            (tag::SAMPLES_PER_PIXEL, 3, vec![1]),
            (tag::ROWS_PER_STRIP, 4, vec![self.rows_per_strip.into()]),
            (tag::STRIP_BYTE_COUNTS, long, counts),
            (tag::SAMPLE_FORMAT, 3, vec![format]),
        ]);

        // Values that do not fit in their entry come first, each at an even offset.
        let fits = if self.big { 8 } else { 4 };
        let mut entries = Vec::new();
        for (id, kind, values) in tags {
            let mut bytes: Vec<u8> = Vec::new();
            let size = match kind {
                2 => 1,
                3 => 2,
                4 => 4,
                _ => 8,
            };
            for value in &values {
                bytes.extend_from_slice(&value.to_le_bytes()[..size]);
            }
            if bytes.len() > fits {
                self.align()?;
                let at = self.at;
                self.put(&bytes)?;
                bytes = at.to_le_bytes()[..fits].to_vec();
            }
            bytes.resize(fits, 0);
            entries.extend_from_slice(&id.to_le_bytes());
            entries.extend_from_slice(&kind.to_le_bytes());
            entries.extend_from_slice(&(values.len() as u64).to_le_bytes()[..fits]);
            entries.extend_from_slice(&bytes);
        }
        self.align()?;
        let directory_at = self.at;
        let count = entries.len() as u64 / (4 + 2 * fits as u64);
        self.put(&count.to_le_bytes()[..if self.big { 8 } else { 2 }])?;
        self.put(&entries)?;
        let next_link_at = self.at;
        self.put(&[0; 8][..fits])?;

        // Link it from the previous directory.
        if !self.big && self.at > u64::from(u32::MAX) {
            return Err(io::Error::other("the compressed voxels are larger than classic TIFF's 4 GiB"));
        }
        self.file.seek(SeekFrom::Start(self.link_at))?;
        self.file.write_all(&directory_at.to_le_bytes()[..fits])?;
        self.file.seek(SeekFrom::Start(self.at))?;
        self.link_at = next_link_at;
        Ok(())
    }

    fn align(&mut self) -> io::Result<()> {
        let padding = self.at % 2;
        self.put(&[0; 2][..padding as usize])
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }
}

impl VoxelWriter for TiffWriter {
    fn write_voxels(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            let n = bytes.len().min(self.strip_bytes() - self.strip.len());
            self.strip.extend_from_slice(&bytes[..n]);
            bytes = &bytes[n..];
            if self.strip.len() == self.strip_bytes() {
                self.end_strip()?;
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<File> {
        unbuffer(self.file)
    }
}

/// OME-XML with the voxel size (OME-TIFF specification 6, schema 2016-06).
fn ome_xml(info: &VolumeInfo) -> Option<String> {
    let type_name = match info.label_type {
        LabelType::U8 => "uint8",
        LabelType::U16 => "uint16",
        LabelType::U32 => "uint32",
        LabelType::I8 => "int8",
        LabelType::I16 => "int16",
        LabelType::I32 => "int32",
        LabelType::F32 => "float",
        LabelType::F64 => "double",
        LabelType::U64 | LabelType::I64 => return None,
    };
    let unit = match info.unit {
        Unit::Nanometre => "nm",
        Unit::Micrometre => "µm",
        Unit::Millimetre => "mm",
        Unit::Metre => "m",
        Unit::Unknown => "reference frame",
    };
    let ([x, y, z], [sx, sy, sz]) = (info.dims, info.spacing());
    Some(format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?><OME xmlns=\"http://www.openmicroscopy.org/Schemas/OME/2016-06\"><Image \
         ID=\"Image:0\" Name=\"labels\"><Pixels ID=\"Pixels:0\" DimensionOrder=\"XYZCT\" Type=\"{type_name}\" SizeX=\"{x}\" \
         SizeY=\"{y}\" SizeZ=\"{z}\" SizeC=\"1\" SizeT=\"1\" PhysicalSizeX=\"{sx}\" PhysicalSizeXUnit=\"{unit}\" \
         PhysicalSizeY=\"{sy}\" PhysicalSizeYUnit=\"{unit}\" PhysicalSizeZ=\"{sz}\" PhysicalSizeZUnit=\"{unit}\"><Channel \
         ID=\"Channel:0:0\" SamplesPerPixel=\"1\"/><TiffData IFD=\"0\" PlaneCount=\"{z}\"/></Pixels></Image></OME>"
    ))
}
