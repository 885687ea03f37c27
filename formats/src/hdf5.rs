//! HDF5: a data set of a file, by the crate `hdf5-reader`. Place and unit are those that CREMI, PlantSeg, ilastik and funlib write as attributes
//! ([`crate::array_place`]).
//!
//! ```text
//! cells.h5/label     (32, 128, 128) of uint16, chunks, deflate, shuffle     --dataset, if there are several
//!   element_size_um  [0.235, 0.15, 0.15]                                    z, y, x
//! ```
//! A data set without chunks is read in slabs. Chunks that were never written are the fill value, as HDF5 says.

use std::path::{Path, PathBuf};

use hdf5_reader::datatype_api::H5Type;
use hdf5_reader::filters::FilterRegistry;
use hdf5_reader::{Dataset, Datatype, Hdf5File, SliceInfo, SliceInfoElem};
use pumice_core::error::one_line;
use pumice_core::{LabelType, VolumeInfo};

use crate::array_axes::{by_names, by_order};
use crate::array_place::ArrayPlace;
use crate::chunks::{Chunk, ChunkReader, Chunks, place};
use crate::element::Element;
use crate::error::{FormatError, Result};
use crate::hdf5_datasets::{choose, is_bool, label_type, type_text};
use crate::header_text::shorten;
use crate::layout::{FileAxis, Layout};
use crate::options::{MissingChunks, OpenOptions};
use crate::stream::open_file;
use crate::volume_file::{VolumeFile, Voxels};
use crate::{hdf5_attributes, hdf5_lzf};

/// Bytes of a slab of a data set without chunks.
const SLAB_BYTES: u64 = 4 << 20;

/// Number of h5py's LZF filter in HDF5's register.
const LZF: u16 = 32_000;

/// Reads the header of the file and of the chosen data set.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    // An ordinary file only: others may never end.
    open_file(path)?;
    let mut filters = FilterRegistry::new();
    filters.register(
        LZF,
        Box::new(|filter, data, _| {
            // The third number is the size of a chunk.
            let most = filter.client_data.get(2).map_or(usize::MAX, |&n| n as usize);
            hdf5_lzf::decode(data, most).map_err(|what| hdf5_reader::error::Error::InvalidData(what.into()))
        }),
    );
    // Chunks are read once each, so keeping them is of no use. Their size is checked against the memory before they are read.
    let how = hdf5_reader::OpenOptions::default()
        .with_filter_registry(filters)
        .with_chunk_cache_bytes(0)
        .with_max_chunk_bytes(usize::MAX);
    let file = Hdf5File::open_with_options(path, how)
        .map_err(|e| FormatError::damaged(path, one_line(&format!("HDF5: {e}"))))?;
    let mut choices = Vec::new();
    let (name, dataset) = choose(path, &file, options, &mut choices)?;
    let Some(label_type) = label_type(dataset.dtype()) else {
        return Err(FormatError::unsupported(
            path,
            format!("the data set {} has {}", shorten(&name), type_text(dataset.dtype())),
            "labels are integers, or floating-point numbers that are whole",
        ));
    };
    let shape = dataset.shape().to_vec();
    let roles = match hdf5_attributes::axis_names(&dataset) {
        Some(names) => by_names(path, &names, &shape, options, &mut choices)?,
        None => by_order(path, &shape, options, &mut choices)?,
    };
    // Values come in the machine's own byte order.
    let element = Element::new(label_type, cfg!(target_endian = "big"));
    let axes = shape.iter().zip(&roles).map(|(&size, &role)| FileAxis { size, role });
    let layout = Layout::new(path, axes.rev().collect(), element.bytes())?;
    let numbers = |name: &str| hdf5_attributes::numbers(&dataset, name);
    let place = ArrayPlace::find(shape.len(), numbers, |name| hdf5_attributes::texts(&dataset, name));
    let info = place.placed(path, VolumeInfo::new(layout.dims(), label_type), &roles, options)?;
    let chunk: Vec<u64> = match dataset.chunks() {
        Some(chunk) => chunk.iter().zip(&shape).map(|(&c, &size)| u64::from(c).min(size)).collect(),
        None => slab(&shape, element.bytes() as u64),
    };
    let encoding = if dataset.chunks().is_some() { "chunks" } else { "raw" };
    let reader = Reader { path: path.to_owned(), name, dataset, label_type, chunk: chunk.clone() };
    Ok(VolumeFile {
        format: "HDF5",
        encoding: encoding.into(),
        info,
        layout,
        element,
        layers: Vec::new(),
        choices,
        voxels: Voxels::Chunks(Chunks {
            shard: vec![1; chunk.len()],
            chunk: chunk.into_iter().rev().collect(),
            fill: vec![0; element.bytes()],
            missing: MissingChunks::Fill,
            open: Box::new(move || Ok(Box::new(reader))),
        }),
    })
}

/// The size of the slabs in which an array without chunks is read: whole rows and planes, as many as fit.
fn slab(shape: &[u64], element_bytes: u64) -> Vec<u64> {
    let mut slab = vec![1; shape.len()];
    let mut bytes = element_bytes;
    for (to, &size) in slab.iter_mut().zip(shape).rev() {
        let fits = (SLAB_BYTES / bytes).clamp(1, size.max(1));
        // Whole cells of four voxels where the axis is cut.
        *to = if fits < size && fits > 4 { fits - fits % 4 } else { fits };
        bytes = bytes.saturating_mul(*to);
        if fits < size {
            break;
        }
    }
    slab
}

/// A byte of h5py's bool, which is an enumeration: the crate's own types read no enumerations.
#[derive(Clone)]
struct Bool(u8);

impl H5Type for Bool {
    fn hdf5_type() -> Datatype {
        u8::hdf5_type()
    }

    fn from_bytes(bytes: &[u8], _: &Datatype) -> hdf5_reader::error::Result<Self> {
        let none = || hdf5_reader::error::Error::InvalidData("expected a byte, got none".into());
        bytes.first().map(|&byte| Self(byte)).ok_or_else(none)
    }

    fn element_size(_: &Datatype) -> usize {
        1
    }
}

/// Reads the chunks of a data set.
struct Reader {
    path: PathBuf,
    name: String,
    dataset: Dataset,
    label_type: LabelType,
    /// In the order of the indices.
    chunk: Vec<u64>,
}

impl Reader {
    fn bytes<T: H5Type, const N: usize>(
        &self,
        selection: &SliceInfo,
        to_bytes: impl Fn(T) -> [u8; N],
    ) -> hdf5_reader::error::Result<Vec<u8>> {
        let values = self.dataset.read_slice::<T>(selection)?;
        let mut bytes = Vec::with_capacity(values.len() * N);
        values.into_iter().for_each(|value| bytes.extend_from_slice(&to_bytes(value)));
        Ok(bytes)
    }
}

impl ChunkReader for Reader {
    fn read(&self, chunk: &[u64]) -> Result<Option<Chunk>> {
        let axes = self.chunk.len();
        let (mut selections, mut sizes) = (Vec::new(), Vec::new());
        for (a, (&step, &size)) in self.chunk.iter().zip(self.dataset.shape()).enumerate() {
            let start = chunk[axes - 1 - a] * step;
            let end = (start + step).min(size);
            selections.push(SliceInfoElem::Slice { start, end, step: 1 });
            sizes.push(end - start);
        }
        let selection = SliceInfo { selections };
        let read = match self.label_type {
            LabelType::U8 if is_bool(self.dataset.dtype()) => self.bytes(&selection, |Bool(byte)| [byte]),
            LabelType::U8 => self.bytes(&selection, u8::to_ne_bytes),
            LabelType::U16 => self.bytes(&selection, u16::to_ne_bytes),
            LabelType::U32 => self.bytes(&selection, u32::to_ne_bytes),
            LabelType::U64 => self.bytes(&selection, u64::to_ne_bytes),
            LabelType::I8 => self.bytes(&selection, i8::to_ne_bytes),
            LabelType::I16 => self.bytes(&selection, i16::to_ne_bytes),
            LabelType::I32 => self.bytes(&selection, i32::to_ne_bytes),
            LabelType::I64 => self.bytes(&selection, i64::to_ne_bytes),
            LabelType::F32 => self.bytes(&selection, f32::to_ne_bytes),
            LabelType::F64 => self.bytes(&selection, f64::to_ne_bytes),
        };
        let bytes = read.map_err(|e| {
            let what = format!("data set {}, chunk {}: {e}", shorten(&self.name), place(&chunk[..axes]));
            FormatError::damaged(&self.path, one_line(&what))
        })?;
        sizes.reverse();
        Ok(Some(Chunk { bytes, sizes }))
    }
}
