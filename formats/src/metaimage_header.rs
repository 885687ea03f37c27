//! Parses the fields of a MetaImage header; [`crate::metaimage`] interprets them for a label volume.
//!
//! ```text
//! ObjectType = Image
//! NDims = 3
//! DimSize = 128 128 34
//! ElementType = MET_USHORT
//! ElementDataFile = LOCAL          always the last field: LOCAL, a file, LIST and names, or a pattern with first, last, step
//! ```
//! Format: Kitware, *MetaIO* documentation, "MetaImage", <https://docs.itk.org/en/latest/learn/metaio.html>.

use std::path::Path;

use pumice_core::LabelType;

use crate::error::{FormatError, Result};
use crate::header_text::{self, format_number, numbers, shorten};

/// Location of the voxels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum DataFile {
    Local,
    Names(Vec<String>),
}

/// Storage of the voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Raw,
    Ascii,
    /// zlib or gzip.
    Compressed,
}

/// A header whose fields have been checked one by one.
#[derive(Clone, Debug)]
pub(crate) struct MetaHeader {
    pub(crate) label_type: LabelType,
    pub(crate) big_endian: bool,
    /// Size of each axis; two to four axes.
    pub(crate) sizes: Vec<u64>,
    /// Spacing of each axis, where the header has it.
    pub(crate) spacing: Option<Vec<f64>>,
    pub(crate) origin: Option<Vec<f64>>,
    /// Direction of the first axis, then of the second, and so on.
    pub(crate) directions: Option<Vec<f64>>,
    pub(crate) units: Option<String>,
    pub(crate) encoding: Encoding,
    pub(crate) compressed_bytes: Option<u64>,
    /// Bytes before the voxels from the start of their file; −1 means that the voxels are its last bytes.
    pub(crate) header_size: i64,
    pub(crate) data: DataFile,
    /// Offset of the first byte after the header.
    pub(crate) end: u64,
}

/// Largest number of slice files that a pattern may name.
const MAX_DATA_FILES: u64 = 1 << 23;

/// Whether the first bytes of a file look like a header.
pub(crate) fn recognises(head: &[u8]) -> bool {
    // Only the part before binary voxels is text.
    head.split(|&b| b == b'\n').map_while(|line| std::str::from_utf8(line).ok()?.split_once('=')).any(
        |(key, _)| ["objecttype", "ndims", "dimsize"].contains(&key.trim().to_ascii_lowercase().as_str()),
    )
}

/// Reads and parses the header of `path`.
pub(crate) fn read(path: &Path) -> Result<MetaHeader> {
    let bad = |what: String| FormatError::damaged(path, what);

    // Collect the fields up to ElementDataFile; the names of a LIST continue to the end of the file.
    let mut in_list = false;
    let text = header_text::read_lines(path, |line| {
        let Some((_, value)) = field(line).filter(|(key, _)| key == DATA_FILE) else { return false };
        in_list |= is_list(value);
        !in_list
    })?;
    let mut fields: Vec<(String, String)> = Vec::new();
    let mut names = Vec::new();
    let mut list = false;
    for line in &text.lines {
        if list {
            if !line.trim().is_empty() {
                names.push(line.trim().to_owned());
            }
        } else if let Some((key, value)) = field(line) {
            list = key == DATA_FILE && is_list(value);
            if key != "comment" && fields.iter().any(|(k, _)| *k == key) {
                return Err(bad(format!("the field {key:?} occurs twice")));
            }
            fields.push((key, value.to_owned()));
        } else if !line.trim().is_empty() {
            return Err(bad(format!("expected `Field = value` in the header, got {:?}", shorten(line))));
        }
    }
    let fields = Fields { path, fields };

    // What is stored: type and sizes.
    if let Some(object) = fields.get(&["objecttype"]).filter(|o| !o.eq_ignore_ascii_case("image")) {
        return Err(FormatError::unsupported(
            path,
            format!("the object type is {:?}, not Image", shorten(object)),
            "save a label map as MetaImage",
        ));
    }
    let count = match fields.need("NDims")?.parse::<usize>() {
        Ok(n @ 2..=4) => n,
        _ => return Err(bad(format!("NDims is {:?}, expected 2 to 4", fields.get(&["ndims"]).map(shorten)))),
    };
    let sizes = numbers::<u64>(fields.need("DimSize")?).filter(|s| s.len() == count).ok_or_else(|| {
        bad(format!("DimSize is {:?}, expected {count} whole numbers", fields.get(&["dimsize"]).map(shorten)))
    })?;
    if let Some(channels) = fields.get(&["elementnumberofchannels"]).filter(|&c| c != "1") {
        return Err(FormatError::unsupported(
            path,
            format!("the file has {:?} channels a voxel", shorten(channels)),
            "labels are one number a voxel: save the label map alone",
        ));
    }
    let label_type = label_type(path, fields.need("ElementType")?)?;

    // How and where the voxels are stored.
    let compressed = fields.flag(&["compresseddata"], false)?;
    let encoding = match (fields.flag(&["binarydata"], true)?, compressed) {
        (_, true) => Encoding::Compressed,
        (true, false) => Encoding::Raw,
        (false, false) => Encoding::Ascii,
    };
    let whole = |key: &str, least: i64| match fields.get(&[key]) {
        None => Ok(None),
        Some(text) => text.parse::<i64>().ok().filter(|&n| n >= least).map(Some).ok_or_else(|| {
            bad(format!("the field {key:?} is {:?}, expected a whole number ≥ {least}", shorten(text)))
        }),
    };
    let data = match fields.need("ElementDataFile")? {
        value if value.eq_ignore_ascii_case("local") => DataFile::Local,
        value if is_list(value) => DataFile::Names(names),
        value => DataFile::Names(expand_pattern(path, value, sizes[count - 1])?),
    };
    if data == DataFile::Names(Vec::new()) {
        return Err(bad("the list of data files is empty".into()));
    }
    Ok(MetaHeader {
        label_type,
        big_endian: fields.flag(&["binarydatabyteordermsb", "elementbyteordermsb"], false)?,
        spacing: fields.floats(&["elementspacing", "elementsize"], count)?,
        origin: fields.floats(&["offset", "position", "origin"], count)?,
        directions: fields.floats(&["transformmatrix", "orientation", "rotation"], count * count)?,
        units: fields.get(&["distanceunits"]).map(str::to_owned),
        sizes,
        encoding,
        compressed_bytes: whole("compresseddatasize", 0)?.map(i64::unsigned_abs).filter(|&n| n > 0),
        header_size: whole("headersize", -1)?.unwrap_or(0),
        data,
        end: text.end,
    })
}

const DATA_FILE: &str = "elementdatafile";

/// Parses `Key = value`; returns the key in lower case.
fn field(line: &str) -> Option<(String, &str)> {
    let (key, value) = line.split_once('=')?;
    Some((key.trim().to_ascii_lowercase(), value.trim()))
}

/// Whether a value is `LIST`, or `LIST 2` with the number of axes in each file.
fn is_list(value: &str) -> bool {
    value.split_whitespace().next().is_some_and(|word| word.eq_ignore_ascii_case("list"))
}

/// The fields of one header.
struct Fields<'a> {
    path: &'a Path,
    fields: Vec<(String, String)>,
}

impl Fields<'_> {
    /// The value of the first of `keys` that the header has. They are synonyms, the usual name first.
    fn get(&self, keys: &[&str]) -> Option<&str> {
        keys.iter().find_map(|key| self.fields.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str()))
    }

    fn need(&self, key: &str) -> Result<&str> {
        self.get(&[&key.to_ascii_lowercase()])
            .ok_or_else(|| FormatError::damaged(self.path, format!("the field {key:?} is missing")))
    }

    fn flag(&self, keys: &[&str], default: bool) -> Result<bool> {
        match self.get(keys).map(str::to_ascii_lowercase).as_deref() {
            None => Ok(default),
            Some("true" | "1") => Ok(true),
            Some("false" | "0") => Ok(false),
            Some(other) => Err(FormatError::damaged(
                self.path,
                format!("the field {:?} is {:?}, expected True or False", keys[0], shorten(other)),
            )),
        }
    }

    fn floats(&self, keys: &[&str], count: usize) -> Result<Option<Vec<f64>>> {
        let Some(text) = self.get(keys) else { return Ok(None) };
        match numbers::<f64>(text).filter(|n| n.len() == count) {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(FormatError::damaged(
                self.path,
                format!("the field {:?} is {:?}, expected {count} numbers", keys[0], shorten(text)),
            )),
        }
    }
}

/// Parses MetaIO's type names; its LONG has four bytes on every machine (`MET_ValueTypeSize`).
fn label_type(path: &Path, text: &str) -> Result<LabelType> {
    Ok(match text.to_ascii_uppercase().as_str() {
        "MET_CHAR" | "MET_ASCII_CHAR" => LabelType::I8,
        "MET_UCHAR" => LabelType::U8,
        "MET_SHORT" => LabelType::I16,
        "MET_USHORT" => LabelType::U16,
        "MET_INT" | "MET_LONG" => LabelType::I32,
        "MET_UINT" | "MET_ULONG" => LabelType::U32,
        "MET_LONG_LONG" => LabelType::I64,
        "MET_ULONG_LONG" => LabelType::U64,
        "MET_FLOAT" => LabelType::F32,
        "MET_DOUBLE" => LabelType::F64,
        other if other.starts_with("MET_") => {
            return Err(FormatError::unsupported(
                path,
                format!("the element type is {:?}", shorten(text)),
                "labels are single numbers: save the label map with an integer type",
            ));
        }
        _ => {
            return Err(FormatError::damaged(
                path,
                format!("the element type {:?} is not known", shorten(text)),
            ));
        }
    })
}

/// Expands `slice%03d.raw 1 40 1`, a printf pattern with first, last and step, to file names; any other value is one name.
fn expand_pattern(path: &Path, value: &str, slices: u64) -> Result<Vec<String>> {
    let words: Vec<&str> = value.split_whitespace().collect();
    let Some((pattern, range)) = words.split_first().filter(|(p, r)| p.contains('%') && r.len() <= 3) else {
        return Ok(vec![value.to_owned()]);
    };
    let bad = || {
        FormatError::damaged(
            path,
            format!(
                "the data file pattern {:?} is not valid, expected one like slice%03d.raw 1 40 1",
                shorten(value)
            ),
        )
    };
    let range: Vec<i64> = range.iter().map(|w| w.parse().ok()).collect::<Option<_>>().ok_or_else(bad)?;
    let (first, step) = (range.first().copied().unwrap_or(1), range.get(2).copied().unwrap_or(1));
    let count = match range.get(1) {
        // Without a last number, there is one file per slice.
        None => slices,
        Some(last) => last
            .checked_sub(first)
            .and_then(|span| span.checked_div(step))
            .and_then(|n| u64::try_from(n).ok()?.checked_add(1))
            .ok_or_else(bad)?,
    };
    if step == 0 || !(1..=MAX_DATA_FILES.min(slices)).contains(&count) {
        return Err(FormatError::damaged(
            path,
            format!("the data file pattern {:?} names {count} files for {slices} slices", shorten(value)),
        ));
    }
    (0..count as i64)
        .map(|i| {
            let number = i.checked_mul(step).and_then(|n| n.checked_add(first)).ok_or_else(bad)?;
            format_number(pattern, number).ok_or_else(bad)
        })
        .collect()
}
