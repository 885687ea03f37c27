//! NumPy's `.npy`: one array, in C or Fortran order.
//!
//! ```text
//! \x93NUMPY  major minor  header length (u16 in version 1, u32 in 2 and 3)  {'descr': '<u4', 'fortran_order': False, 'shape': (3, 4, 5), }  voxels
//! ```
//! In C order the last index varies fastest: in the file, `a[x, y, z]` has z fastest and `a[z, y, x]` has x fastest. Format: NumPy, *NEP 1:
//! A simple file format for NumPy arrays* and `numpy.lib.format`.

use std::path::Path;

use pumice_core::{LabelType, VolumeInfo};

use crate::array_axes;
use crate::choice::{self, ChoiceValue, OpenChoice, refuse_absent};
use crate::element::{Element, type_of_code};
use crate::error::{FormatError, Result};
use crate::layout::{FileAxis, Layout, Role};
use crate::npy_header::{self, NpyHeader};
use crate::options::{ArrayAxes, OpenOptions};
use crate::placement;
use crate::stream::{PlainStream, open_file};
use crate::volume_file::{Format, Takes, VolumeFile, Voxels};

/// NPY files.
pub(crate) const FORMAT: Format = Format {
    name: "NPY",
    takes: Takes { axes: true, ..Takes::NOTHING },
    recognises: |_, head| head.starts_with(npy_header::MAGIC),
    read,
};

/// Reads the header of `path`.
fn read(path: &Path, options: &OpenOptions) -> Result<VolumeFile> {
    let mut stream = PlainStream::open(path, 0)?;
    let header = npy_header::read(path, &mut stream)?;
    let array = Array::new(path, &header, options)?;
    let offset = header.bytes;
    let bytes = open_file(path)?.metadata().map_err(FormatError::io(path))?.len();
    let got = bytes.saturating_sub(offset);
    if got < array.layout.total_bytes() {
        let expected = array.layout.total_bytes();
        return Err(FormatError::Short { path: path.to_owned(), expected, got, at: Some(bytes) });
    }
    let data = path.to_owned();
    let voxels = Voxels::Plain(Box::new(move || Ok(Box::new(PlainStream::open(&data, offset)?))));
    Ok(array.volume_file("NPY", "raw", voxels))
}

/// The order of axes that is assumed where the caller gives none.
const ASSUMED: ArrayAxes = ArrayAxes::Xyz;

/// The order of axes as a choice that the file leaves open.
fn open_axes() -> OpenChoice {
    let text = |axes| match axes {
        ArrayAxes::Xyz => "a[x, y, z], as of nibabel and pynrrd",
        _ => "a[z, y, x], as of tifffile, scikit-image and napari",
    };
    let value = |axes: ArrayAxes| ChoiceValue { value: axes.name().into(), text: text(axes).into() };
    OpenChoice {
        keyword: "axes",
        option: "--axes",
        what: "the file does not say which axis is which".into(),
        listed: ArrayAxes::OF_ARRAYS.map(|axes| format!("{}: {}", axes.name(), text(axes))).join("; "),
        values: ArrayAxes::OF_ARRAYS.map(value).to_vec(),
        count: ArrayAxes::OF_ARRAYS.len() as u64,
        assumed: Some(ASSUMED.name()),
    }
}

/// An array that is a valid volume.
pub(crate) struct Array {
    pub(crate) layout: Layout,
    element: Element,
    info: VolumeInfo,
    /// The order of axes, where the caller does not say it.
    pub(crate) choices: Vec<OpenChoice>,
}

impl Array {
    /// Assigns the indices to axes, and checks type and size.
    pub(crate) fn new(path: &Path, header: &NpyHeader, options: &OpenOptions) -> Result<Self> {
        refuse_absent(path, options, &[&choice::TIME, &choice::CHANNEL, &choice::LAYER])?;
        let label_type = label_type(path, &header.descr)?;
        let element = Element::new(label_type, header.descr.starts_with('>'));

        // Axes of one step are left out, the last first, until three axes remain.
        let mut shape = header.shape.clone();
        while shape.len() > 3 {
            let Some(one) = shape.iter().rposition(|&size| size == 1) else {
                return Err(FormatError::unsupported(
                    path,
                    format!("the array has {} axes, shape {}", header.shape.len(), header.shape_text()),
                    "save one array of two or three axes a file",
                ));
            };
            shape.remove(one);
        }
        if shape.len() < 2 {
            return Err(FormatError::unsupported(
                path,
                format!("the array has shape {}, expected two or three axes", header.shape_text()),
                "reshape it before saving, or read the numbers as raw voxels",
            ));
        }
        // Map indices to x, y, z; an image `a[y, x]` has no z.
        let order = array_axes::of_three(path, options)?.unwrap_or(ASSUMED);
        let mut axes: Vec<FileAxis> = shape
            .iter()
            .enumerate()
            .map(|(i, &size)| {
                let space = match order {
                    ArrayAxes::Xyz => i,
                    _ => shape.len() - 1 - i,
                };
                FileAxis { size, role: Role::Space(space) }
            })
            .collect();
        if !header.fortran_order {
            axes.reverse();
        }
        let layout = Layout::new(path, axes, element.bytes())?;
        if options.spacing.is_none() {
            options.warnings.push(format!(
                "{}: NumPy arrays have no spacing; 1 is assumed along each axis (give --spacing x,y,z)",
                path.display()
            ));
        }
        let mut choices = Vec::new();
        if options.axes.is_none() {
            choices.push(open_axes());
            options.warnings.push(format!(
                "{}: NumPy arrays do not say which axis is which; the shape {} is taken as {} (give --axes xyz or zyx)",
                path.display(),
                header.shape_text(),
                ASSUMED.name()
            ));
        }
        let affine = placement::from_spacing(path, [1.0; 3], options)?;
        let info = VolumeInfo::new(layout.dims(), label_type).from_centre_affine(affine);
        Ok(Self { layout, element, info, choices })
    }

    /// The array as a volume in a file.
    pub(crate) fn volume_file(self, format: &'static str, encoding: &str, voxels: Voxels) -> VolumeFile {
        VolumeFile {
            format,
            encoding: encoding.into(),
            info: self.info,
            layout: self.layout,
            element: self.element,
            layers: Vec::new(),
            choices: self.choices,
            voxels,
        }
    }
}

/// Parses a type such as `'<u4'`. Booleans are stored as bytes 0 and 1.
pub(crate) fn label_type(path: &Path, descr: &str) -> Result<LabelType> {
    let refused = |what: &str| {
        Err(FormatError::unsupported(
            path,
            format!("the array's type is {what} (descr {descr})"),
            "convert it with .astype('uint32') before saving",
        ))
    };
    let kind = descr.trim_start_matches(['<', '>', '|', '=']);
    if let Some(known) = type_of_code(kind) {
        return Ok(known);
    }
    if kind.starts_with('[') {
        return refused("structured");
    }
    match kind.as_bytes().first() {
        Some(b'O') => refused("Python objects"),
        Some(b'c') => refused("complex"),
        Some(b'U' | b'S' | b'a') => refused("text"),
        Some(b'M' | b'm') => refused("date or time"),
        Some(b'V') => refused("untyped bytes"),
        Some(b'f') => refused("floating point of unusual width"),
        _ => Err(FormatError::damaged(path, format!("the array's type {descr:?} is not known"))),
    }
}
