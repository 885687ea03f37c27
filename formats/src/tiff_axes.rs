//! The meaning of the pages of a TIFF file. TIFF itself has no third axis; ImageJ and OME write one into the description.
//!
//! ```text
//! ImageJ      ImageJ=1.54f\nimages=30\nchannels=2\nslices=5\nframes=3\nunit=micron\nspacing=0.5      page order C, Z, T
//! OME-TIFF    <OME …><Pixels DimensionOrder="XYZCT" SizeZ="5" PhysicalSizeX="0.1" …><TiffData IFD="0"/></Pixels></OME>
//! tifffile    {"shape": [40, 50, 70], "axes": "ZYX", "truncated": true}      counts only where one page stands for all planes
//! neither     pages are slices, in their order, with a warning
//! --axes      tzyx, zcyx, …: the caller says what the pages are, slowest first, in place of the file
//! ```
//! ImageJ's description: `ij.io.FileInfo`, `ij.io.TiffDecoder`; OME: *OME-TIFF specification* 6.

use std::path::Path;

use pumice_core::Unit;

use crate::choice::{ChoiceValue, OpenChoice};
use crate::error::{FormatError, Result};
use crate::options::ArrayAxes;
use crate::placement;
use crate::stores;

/// Longest description of tifffile that is read, in bytes: it has a number and a letter an axis, and what a caller adds.
const MOST_SHAPE_BYTES: usize = 1 << 20;

/// Meaning of one axis of pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PageAxis {
    Z,
    Channel,
    Time,
}

/// The axes and lengths from a description.
#[derive(Debug)]
pub(crate) struct Axes {
    pub(crate) format: &'static str,
    /// Sizes of the page axes, fastest first; their product is the number of planes.
    pub(crate) order: Vec<(PageAxis, u64)>,
    /// Lengths of a voxel along x, y, z; `None` where the description has none.
    pub(crate) spacing: [Option<f64>; 3],
    pub(crate) unit: Unit,
    /// For OME: the page of each plane, where that is not the plane's own number.
    pub(crate) page_of_plane: Option<Vec<usize>>,
    pub(crate) warnings: Vec<String>,
    /// What is assumed of the pages, where the file does not say what they are.
    pub(crate) assumed: Option<String>,
}

/// The axes of pages without a description.
pub(crate) fn plain(pages: u64) -> Axes {
    let assumed = (pages > 1).then(|| {
        format!("the file does not say what its {pages} pages are; they are read as slices along z")
    });
    Axes {
        format: "TIFF",
        order: vec![(PageAxis::Z, pages)],
        spacing: [None; 3],
        unit: Unit::Unknown,
        page_of_plane: None,
        warnings: Vec::new(),
        assumed,
    }
}

/// The axes of one page that holds a whole volume, as its tag says.
pub(crate) fn volume(depth: u64) -> Axes {
    Axes { assumed: None, ..plain(depth) }
}

/// The axes of one page that stands for several planes by tifffile's description; `None` where there is no such description, or as many pages as
/// planes. `size` is that of a page along x and y. A description that does not fit the pages is an older one: a warning says so.
pub(crate) fn shaped(text: &str, pages: u64, size: [u64; 2]) -> Option<Axes> {
    if text.len() > MOST_SHAPE_BYTES || !text.starts_with('{') {
        return None;
    }
    let about = serde_json::from_str::<serde_json::Value>(text).ok()?;
    let shape = stores::numbers(about.get("shape"))?;
    // One value a pixel may be an axis of its own, the last.
    let page = [size[1], size[0]];
    let fits = shape.ends_with(&page) || (shape.len() > 2 && shape.ends_with(&[page[0], page[1], 1]));
    let inner = if shape.ends_with(&page) || !fits { 2 } else { 3 };
    let outer = &shape[..shape.len().saturating_sub(inner)];
    let planes = outer.iter().try_fold(1u64, |n, &size| n.checked_mul(size)).unwrap_or(u64::MAX);
    if planes <= pages {
        return None;
    }
    if pages > 1 || !fits {
        let shape = shape.iter().take(8).map(u64::to_string).collect::<Vec<_>>().join(" × ");
        let mut axes = plain(pages);
        axes.warnings.push(format!(
            "the description has the shape {shape}, but the file has {pages} pages of {} × {} pixels, which are read",
            size[0], size[1]
        ));
        return Some(axes);
    }
    // Letters of the axes, one for each number of the shape.
    let letters = about.get("axes").and_then(|axes| axes.as_str()).filter(|axes| axes.len() == shape.len());
    let mut order: Vec<(PageAxis, u64)> = Vec::new();
    for (&size, letter) in outer.iter().zip(letters.unwrap_or_default().bytes()) {
        let axis = match letter {
            b'Z' => PageAxis::Z,
            b'T' => PageAxis::Time,
            b'C' => PageAxis::Channel,
            _ => break,
        };
        if !order.iter().any(|a| a.0 == axis) {
            order.push((axis, size));
        }
    }
    // The shape is slowest first. Axes with other names, or with none, are slices.
    if order.len() == outer.len() {
        order.reverse();
        return Some(Axes { order, assumed: None, ..plain(planes) });
    }
    let assumed =
        format!("the description does not say what its {planes} planes are; they are read as slices along z");
    Some(Axes { assumed: Some(assumed), ..plain(planes) })
}

impl Axes {
    /// The same pages with the meaning that the caller gives them; the file's own names of axes are passed over.
    ///
    /// # Errors
    /// For an order that does not end with the pixels of a page, y and x, and for one with more axes than the pages have.
    pub(crate) fn said_to_be(mut self, path: &Path, said: ArrayAxes) -> Result<Self> {
        let wrong = |what: String| FormatError::option(path, format!("--axes {}: {what}", said.name()));
        let Some(letters) = said.name().strip_suffix("yx") else {
            return Err(wrong(
                "the pages of a TIFF file hold y and x: expected an order such as zyx or tzyx".into(),
            ));
        };
        let named: Vec<PageAxis> = letters.chars().map(PageAxis::of_letter).collect();
        // Both lists are slowest first; an axis of one page says nothing.
        let sizes: Vec<u64> = self.order.iter().rev().map(|a| a.1).filter(|&size| size != 1).collect();
        let new: Vec<(PageAxis, u64)> = if named.len() == sizes.len() {
            named.into_iter().zip(sizes).collect()
        } else if let [one] = named[..] {
            vec![(one, sizes.iter().try_fold(1u64, |n, &size| n.checked_mul(size)).unwrap_or(u64::MAX))]
        } else {
            let text = sizes.iter().map(u64::to_string).collect::<Vec<_>>().join(" × ");
            let has = if sizes.is_empty() { "one page".to_owned() } else { format!("{text} pages") };
            return Err(wrong(format!("it names {} axes of pages, and the file has {has}", named.len())));
        };
        self.order = new.into_iter().rev().collect();
        self.assumed = None;
        Ok(self)
    }

    /// The orders that the pages may have, where the file leaves it open or says that there is time or channels and nothing else: many stacks of
    /// slices were saved so, because ImageJ guesses it.
    pub(crate) fn open_order(&self) -> Option<OpenChoice> {
        let several: Vec<&(PageAxis, u64)> = self.order.iter().filter(|a| a.1 > 1).collect();
        let [(axis, pages)] = several[..] else { return None };
        if self.assumed.is_none() && *axis == PageAxis::Z {
            return None;
        }
        let text = |axes: ArrayAxes| match axes {
            ArrayAxes::Tyx => "each page is a time step",
            ArrayAxes::Cyx => "each page is a channel",
            _ => "the pages are slices along z",
        };
        let orders = [ArrayAxes::Zyx, ArrayAxes::Tyx, ArrayAxes::Cyx];
        let assumed =
            orders[[PageAxis::Z, PageAxis::Time, PageAxis::Channel].iter().position(|a| a == axis)?];
        Some(OpenChoice {
            keyword: "axes",
            option: "--axes",
            what: match self.assumed {
                Some(_) => format!("the file does not say what its {pages} pages are"),
                None => format!(
                    "the file calls its {pages} pages {}",
                    if *axis == PageAxis::Time { "time steps" } else { "channels" }
                ),
            },
            listed: orders.map(|axes| format!("{}: {}", axes.name(), text(axes))).join("; "),
            values: orders
                .map(|axes| ChoiceValue { value: axes.name().into(), text: text(axes).into() })
                .into(),
            count: 3,
            assumed: Some(assumed.name()),
        })
    }
}

impl PageAxis {
    fn of_letter(letter: char) -> Self {
        match letter {
            't' => Self::Time,
            'c' => Self::Channel,
            _ => Self::Z,
        }
    }
}

/// Parses ImageJ's description; `pixel` holds the lengths from the resolution tags, in ImageJ's unit.
pub(crate) fn imagej(path: &Path, text: &str, pages: u64, pixel: [Option<f64>; 2]) -> Result<Axes> {
    let get =
        |key: &str| text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('=')).map(str::trim);
    let count = |key: &str| -> Result<Option<u64>> {
        get(key)
            .map(|v| {
                v.parse().map_err(|_| {
                    FormatError::damaged(path, format!("ImageJ's {key} is {v:?}, expected a whole number"))
                })
            })
            .transpose()
    };
    let images = count("images")?.unwrap_or(pages.max(1));
    let (channels, slices, frames) = (count("channels")?, count("slices")?, count("frames")?);
    let (mut warnings, mut assumed) = (Vec::new(), None);
    let order = if channels.is_none() && slices.is_none() && frames.is_none() {
        if images > 1 {
            assumed = Some(format!(
                "ImageJ's description does not say what its {images} images are; they are read as slices along z"
            ));
        }
        vec![(PageAxis::Z, images)]
    } else {
        let order = vec![
            (PageAxis::Channel, channels.unwrap_or(1)),
            (PageAxis::Z, slices.unwrap_or(1)),
            (PageAxis::Time, frames.unwrap_or(1)),
        ];
        let product = order.iter().try_fold(1u64, |n, a| n.checked_mul(a.1));
        if product != Some(images) {
            return Err(FormatError::damaged(
                path,
                format!(
                    "ImageJ's description has images={images}, but channels × slices × frames is {} × {} × {}",
                    order[0].1, order[1].1, order[2].1
                ),
            ));
        }
        order
    };
    let (unit, scale) = match get("unit") {
        None | Some("pixel" | "pixels" | "") => (Unit::Unknown, 1.0),
        Some(name) => named_unit(name, &mut warnings),
    };
    let length = |v: f64| v * scale;
    let z = get("spacing").and_then(|v| v.parse::<f64>().ok()).map(f64::abs);
    Ok(Axes {
        format: "TIFF (ImageJ)",
        order,
        spacing: [pixel[0].map(length), pixel[1].map(length), z.map(length)],
        unit,
        page_of_plane: None,
        warnings,
        assumed,
    })
}

/// Parses OME-XML.
pub(crate) fn ome(path: &Path, text: &str, pages: usize) -> Result<Axes> {
    let document = roxmltree::Document::parse(text)
        .map_err(|e| FormatError::damaged(path, format!("the OME-XML cannot be parsed: {e}")))?;
    let named = |name: &'static str| document.descendants().filter(move |n| n.tag_name().name() == name);
    let pixels =
        named("Pixels").next().ok_or_else(|| FormatError::damaged(path, "the OME-XML has no Pixels"))?;
    let mut warnings = Vec::new();
    let images = named("Pixels").count();
    if images > 1 {
        warnings.push(format!("the OME-TIFF holds {images} images; the first one is read"));
    }
    let size = |name: &str| -> Result<u64> {
        let text = pixels.attribute(name).unwrap_or("1");
        text.parse().ok().filter(|&n| n > 0).ok_or_else(|| {
            FormatError::damaged(path, format!("OME's {name} is {text:?}, expected a whole number above 0"))
        })
    };
    let order_text = pixels.attribute("DimensionOrder").unwrap_or("XYZCT");
    let mut order = Vec::new();
    for letter in order_text.chars().skip(2) {
        order.push(match letter {
            'Z' => (PageAxis::Z, size("SizeZ")?),
            'C' => (PageAxis::Channel, size("SizeC")?),
            'T' => (PageAxis::Time, size("SizeT")?),
            _ => return Err(FormatError::damaged(path, format!("OME's DimensionOrder is {order_text:?}"))),
        });
    }
    let planes = order.iter().try_fold(1u64, |n, a| n.checked_mul(a.1)).unwrap_or(u64::MAX);
    let all = ["Z", "C", "T"].iter().all(|&l| order_text.get(2..).unwrap_or("").matches(l).count() == 1);
    if !all || !order_text.starts_with("XY") {
        return Err(FormatError::damaged(
            path,
            format!("OME's DimensionOrder is {order_text:?}, expected one like XYZCT"),
        ));
    }
    if planes > pages as u64 {
        return Err(FormatError::damaged(
            path,
            format!(
                "the OME-XML describes {planes} planes, the file has {pages} pages (are the others in another file?)"
            ),
        ));
    }
    let page_of_plane = planes_to_pages(path, pixels, &order, planes as usize, pages)?;

    // Lengths, all converted to the unit of x.
    let mut spacing = [None; 3];
    let mut unit = Unit::Unknown;
    let mut metres_of_x = None;
    for (a, axis) in ["X", "Y", "Z"].iter().enumerate() {
        let Some(length) = pixels.attribute(format!("PhysicalSize{axis}").as_str()) else { continue };
        let length: f64 = length.parse().map_err(|_| {
            FormatError::damaged(path, format!("OME's PhysicalSize{axis} is {length:?}, expected a number"))
        })?;
        // The schema's default unit.
        let name = pixels.attribute(format!("PhysicalSize{axis}Unit").as_str()).unwrap_or("µm");
        let (this, scale) = named_unit(name, &mut warnings);
        let metres = metres(this);
        let factor = match (metres, metres_of_x) {
            (Some(m), Some(x)) => m / x,
            (None, Some(_)) | (Some(_), None) if unit != Unit::Unknown => {
                return Err(FormatError::damaged(
                    path,
                    "OME's physical sizes have units that cannot be compared",
                ));
            }
            _ => 1.0,
        };
        if metres_of_x.is_none() {
            metres_of_x = metres;
            unit = this;
        }
        // Multiplication by 1 must not change a bit; the quotient of equal units is exactly 1.
        spacing[a] = Some(length * scale * factor);
    }
    Ok(Axes { format: "TIFF (OME)", order, spacing, unit, page_of_plane, warnings, assumed: None })
}

/// The page of each plane, from the `TiffData` elements; `None` where plane N is page N.
fn planes_to_pages(
    path: &Path,
    pixels: roxmltree::Node<'_, '_>,
    order: &[(PageAxis, u64)],
    planes: usize,
    pages: usize,
) -> Result<Option<Vec<usize>>> {
    let bad = |what: String| FormatError::damaged(path, what);
    let blocks: Vec<_> = pixels.children().filter(|n| n.tag_name().name() == "TiffData").collect();
    let files: std::collections::BTreeSet<&str> = blocks
        .iter()
        .flat_map(|n| n.children())
        .filter(|n| n.tag_name().name() == "UUID")
        .filter_map(|n| n.attribute("FileName"))
        .collect();
    if files.len() > 1 {
        return Err(FormatError::unsupported(
            path,
            format!("the OME-TIFF is spread over {} files", files.len()),
            "save it as one file, or give a folder of slices",
        ));
    }
    // Without explicit numbers, pages follow the dimension order.
    if blocks.iter().all(|n| n.attributes().all(|a| matches!(a.name(), "PlaneCount") || a.value() == "0")) {
        return Ok(None);
    }
    let mut map: Vec<Option<usize>> = vec![None; planes];
    for block in blocks {
        let number = |name: &str| -> Result<Option<usize>> {
            block
                .attribute(name)
                .map(|v| v.parse().map_err(|_| bad(format!("OME's TiffData {name} is {v:?}"))))
                .transpose()
        };
        let ifd = number("IFD")?;
        let first = |axis| -> Result<u64> {
            let name = match axis {
                PageAxis::Z => "FirstZ",
                PageAxis::Channel => "FirstC",
                PageAxis::Time => "FirstT",
            };
            Ok(number(name)?.unwrap_or(0) as u64)
        };
        let (mut plane, mut stride) = (0u64, 1u64);
        for &(axis, size) in order {
            plane = plane.saturating_add(first(axis)?.saturating_mul(stride));
            stride *= size;
        }
        let count = number("PlaneCount")?.unwrap_or(if ifd.is_some() { 1 } else { planes });
        for i in 0..count.min(planes) {
            let page = ifd.unwrap_or(0).saturating_add(i);
            let slot = usize::try_from(plane.saturating_add(i as u64)).unwrap_or(usize::MAX);
            match map.get_mut(slot) {
                Some(entry) if page < pages => *entry = Some(page),
                _ => {
                    return Err(bad(format!(
                        "OME's TiffData maps plane {slot} to page {page}, which does not exist"
                    )));
                }
            }
        }
    }
    let map: Option<Vec<usize>> = map.into_iter().collect();
    map.map(Some).ok_or_else(|| bad("OME's TiffData leaves planes without a page".into()))
}

/// A unit by name, and the factor that converts to it; ImageJ and OME also use cm, inch and Å.
fn named_unit(name: &str, warnings: &mut Vec<String>) -> (Unit, f64) {
    if let Some(unit) = placement::unit_by_name(name) {
        return (unit, 1.0);
    }
    match name {
        "cm" => (Unit::Millimetre, 10.0),
        "inch" | "in" => (Unit::Millimetre, 25.4),
        "Å" | "A" => (Unit::Nanometre, 0.1),
        "pixel" | "reference frame" => (Unit::Unknown, 1.0),
        _ => {
            warnings.push(format!("the unit {name:?} is not known"));
            (Unit::Unknown, 1.0)
        }
    }
}

/// Number of metres in a unit. Powers of ten up to 10²² are exact, so a quotient is rounded only once.
fn metres(unit: Unit) -> Option<f64> {
    match unit {
        Unit::Nanometre => Some(1.0 / 1e9),
        Unit::Micrometre => Some(1.0 / 1e6),
        Unit::Millimetre => Some(1.0 / 1e3),
        Unit::Metre => Some(1.0),
        Unit::Unknown => None,
    }
}
