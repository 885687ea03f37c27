//! Parses the fields of an NRRD header; [`crate::nrrd`] interprets them for a label volume.
//!
//! ```text
//! NRRD0005                          magic and version
//! # comment
//! sizes: 2 128 128 34               field
//! Segment0_Name:=ribs               key/value pair
//!                                   empty line, then the voxels (attached header)
//! ```
//! Format: Teem, *Definition of NRRD File Format*, <https://teem.sourceforge.net/nrrd/format.html>; the section numbers below refer to it.

use std::path::Path;

use pumice_core::LabelType;

use crate::error::{FormatError, Result};
use crate::header_text::{self, format_number, numbers, shorten};

/// Storage of the voxels (§5, `encoding`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Raw,
    Ascii,
    Gzip,
}

/// Location of the voxels (§5, `data file`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum DataFile {
    Attached,
    /// One or more files, by the names in the header.
    Names(Vec<String>),
}

/// A parsed header.
pub(crate) struct NrrdHeader {
    pub(crate) label_type: LabelType,
    pub(crate) encoding: Encoding,
    pub(crate) big_endian: bool,
    /// Size of each axis, fastest first.
    pub(crate) sizes: Vec<u64>,
    /// Lower-case kind of each axis; empty where the header has none.
    pub(crate) kinds: Vec<String>,
    pub(crate) spacings: Option<Vec<f64>>,
    /// Direction of each axis; `None` for an axis outside the space.
    pub(crate) directions: Option<Vec<Option<Vec<f64>>>>,
    pub(crate) origin: Option<Vec<f64>>,
    /// Lower-case name of the space.
    pub(crate) space: Option<String>,
    /// Unit of each dimension of the space, or of each axis where the header has no space.
    pub(crate) units: Vec<String>,
    pub(crate) line_skip: u64,
    /// Bytes to skip before the voxels; −1 means that the voxels are the last bytes of the file.
    pub(crate) byte_skip: i64,
    pub(crate) data: DataFile,
    pub(crate) pairs: Vec<(String, String)>,
    /// Offset of the first byte after the header.
    pub(crate) end: u64,
}

/// Largest number of axes (Teem's own limit, `NRRD_DIM_MAX`).
const MAX_AXES: usize = 16;

/// Largest number of names that a pattern may stand for: as many as slices of the largest volume.
const MAX_DATA_FILES: i64 = 1 << 20;

/// Most fields of a header; the format defines some 40.
const MAX_FIELDS: usize = 256;

/// Longest value of a field in bytes. A field has a word for each of at most [`MAX_AXES`] axes; words cost up to thirty times their length.
const MAX_FIELD_BYTES: usize = 1 << 20;

/// Reads and parses the header of `path`.
pub(crate) fn read(path: &Path) -> Result<NrrdHeader> {
    // The header ends with an empty line, or with the file when it is detached; the names of a LIST continue to the end of the file.
    let mut in_list = false;
    let text = header_text::read_lines(path, |line| {
        in_list |= field(line).is_some_and(|(name, value)| is_data_file(&name) && value.starts_with("LIST"));
        line.is_empty() && !in_list
    })?;
    let bad = |what: String| FormatError::damaged(path, what);
    let magic = text.lines.first().map_or("", String::as_str);
    if !(magic.len() == 8 && magic.starts_with("NRRD000") && matches!(magic.as_bytes()[7], b'1'..=b'6')) {
        return Err(bad(format!("expected the magic NRRD0001 to NRRD0005, got {magic:?}")));
    }

    // Collect the fields; each may occur once.
    let mut fields: Vec<(String, String)> = Vec::new();
    let mut pairs = Vec::new();
    let mut list_names = Vec::new();
    let mut list = false;
    let damaged_end = text.at_file_end && !text.lines.last().is_some_and(String::is_empty);
    for line in text.lines.into_iter().skip(1) {
        let line = line.as_str();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        if list {
            list_names.push(line.trim().to_owned());
        } else if let Some((key, value)) = pair(line) {
            pairs.push((key, value));
        } else if let Some((name, value)) = field(line) {
            list = is_data_file(&name) && value.starts_with("LIST");
            if fields.len() == MAX_FIELDS {
                return Err(bad(format!("expected at most {MAX_FIELDS} fields in the header, got more")));
            }
            if value.len() > MAX_FIELD_BYTES {
                let got = value.len();
                return Err(bad(format!(
                    "the field {:?} has {got} bytes, expected at most {MAX_FIELD_BYTES}",
                    shorten(&name)
                )));
            }
            if fields.iter().any(|(n, _)| *n == name) {
                return Err(bad(format!("the field {name:?} occurs twice")));
            }
            fields.push((name, value));
        } else {
            return Err(bad(format!("expected `field: value` in the header, got {:?}", shorten(line))));
        }
    }
    let get =
        |names: &[&str]| fields.iter().find(|(n, _)| names.contains(&n.as_str())).map(|(_, v)| v.as_str());
    let need = |names: &[&str]| get(names).ok_or_else(|| bad(format!("the field {:?} is missing", names[0])));

    // Basic fields (§4).
    let label_type = label_type(path, need(&["type"])?)?;
    let dimension: usize =
        need(&["dimension"])?.parse().ok().filter(|d| (1..=MAX_AXES).contains(d)).ok_or_else(|| {
            bad(format!("the dimension is {:?}, expected 1 to {MAX_AXES}", get(&["dimension"])))
        })?;
    let per_axis = |what: &str, n: usize| {
        if n == dimension {
            Ok(())
        } else {
            Err(bad(format!("the field {what:?} has {n} entries, expected {dimension}, one an axis")))
        }
    };
    let sizes: Vec<u64> = numbers(need(&["sizes"])?)
        .ok_or_else(|| bad(format!("the sizes are {:?}, expected whole numbers", get(&["sizes"]))))?;
    per_axis("sizes", sizes.len())?;
    let encoding = encoding(path, need(&["encoding"])?)?;
    let big_endian = match get(&["endian"]).map(str::to_ascii_lowercase).as_deref() {
        Some("big") => true,
        Some("little") => false,
        Some(other) => return Err(bad(format!("the endian is {other:?}, expected little or big"))),
        None if encoding == Encoding::Ascii || matches!(label_type, LabelType::U8 | LabelType::I8) => false,
        None => return Err(bad("the field \"endian\" is missing: the byte order is not known".into())),
    };

    // Fields of each axis (§6) and of the space (§7).
    let kinds: Vec<String> =
        get(&["kinds"]).unwrap_or("").split_whitespace().map(str::to_ascii_lowercase).collect();
    if !kinds.is_empty() {
        per_axis("kinds", kinds.len())?;
    }
    let spacings: Option<Vec<f64>> = match get(&["spacings"]) {
        None => None,
        Some(text) => Some(
            numbers(text)
                .ok_or_else(|| bad(format!("the spacings are {:?}, expected numbers", shorten(text))))?,
        ),
    };
    if let Some(spacings) = &spacings {
        per_axis("spacings", spacings.len())?;
    }
    let directions =
        match get(&["space directions"]) {
            None => None,
            Some(text) => Some(vectors(text).ok_or_else(|| {
                bad(format!("the space directions are {:?}, expected vectors", shorten(text)))
            })?),
        };
    if let Some(directions) = &directions {
        per_axis("space directions", directions.len())?;
    }
    let origin = match get(&["space origin"]) {
        None => None,
        Some(text) => Some(
            vectors(text)
                .and_then(|v| v.into_iter().next().flatten())
                .ok_or_else(|| bad(format!("the space origin is {:?}, expected a vector", shorten(text))))?,
        ),
    };

    // Location of the voxels (§5).
    let skip = |names: &[&str]| match get(names) {
        None => Ok(0),
        Some(text) => text
            .parse::<i64>()
            .map_err(|_| bad(format!("the field {:?} is {text:?}, expected a whole number", names[0]))),
    };
    let line_skip = u64::try_from(skip(&["line skip", "lineskip"])?)
        .map_err(|_| bad("the line skip is negative, expected a number ≥ 0".into()))?;
    let byte_skip = skip(&["byte skip", "byteskip"])?;
    if byte_skip < -1 {
        return Err(bad(format!("the byte skip is {byte_skip}, expected a number ≥ −1")));
    }
    let data = match get(&["data file", "datafile"]) {
        None if damaged_end => {
            return Err(bad("the header does not end with an empty line, and gives no data file".into()));
        }
        None => DataFile::Attached,
        Some(value) if value.starts_with("LIST") => DataFile::Names(list_names),
        Some(value) => DataFile::Names(expand_pattern(path, value)?),
    };
    if matches!(&data, DataFile::Names(names) if names.is_empty()) {
        return Err(bad("the list of data files is empty".into()));
    }

    Ok(NrrdHeader {
        label_type,
        encoding,
        big_endian,
        sizes,
        kinds,
        spacings,
        directions,
        origin,
        space: get(&["space"]).map(str::to_ascii_lowercase),
        units: quoted(get(&["space units"]).or(get(&["units"])).unwrap_or("")),
        line_skip,
        byte_skip,
        data,
        pairs,
        end: text.end,
    })
}

/// Parses `name: value`; returns the name in lower case.
fn field(line: &str) -> Option<(String, String)> {
    let (name, value) = line.split_once(':')?;
    (!value.starts_with('=') && !line.starts_with('#'))
        .then(|| (name.trim().to_ascii_lowercase(), value.trim().to_owned()))
}

/// Parses `key:=value` with the escapes of §3.
fn pair(line: &str) -> Option<(String, String)> {
    let (key, value) = line.split_once(":=")?;
    // A field whose value contains ":=" further on is still a field.
    if key.contains(": ") {
        return None;
    }
    let mut text = String::new();
    let mut characters = value.chars();
    while let Some(c) = characters.next() {
        text.push(match (c, characters.clone().next()) {
            ('\\', Some('n')) => '\n',
            ('\\', Some('\\')) => '\\',
            _ => {
                text.push(c);
                continue;
            }
        });
        characters.next();
    }
    Some((key.to_owned(), text))
}

fn is_data_file(name: &str) -> bool {
    name == "data file" || name == "datafile"
}

/// Parses the type names of §4, `type`.
fn label_type(path: &Path, text: &str) -> Result<LabelType> {
    let words = text.to_ascii_lowercase().split_whitespace().collect::<Vec<_>>().join(" ");
    Ok(match words.as_str() {
        "signed char" | "int8" | "int8_t" => LabelType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => LabelType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => LabelType::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => LabelType::U16,
        "int" | "signed int" | "int32" | "int32_t" => LabelType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => LabelType::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => LabelType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            LabelType::U64
        }
        "float" => LabelType::F32,
        "double" => LabelType::F64,
        "block" => {
            return Err(FormatError::unsupported(
                path,
                "the type is \"block\"",
                "only numbers can be labels",
            ));
        }
        _ => return Err(FormatError::damaged(path, format!("the type {text:?} is not one of NRRD"))),
    })
}

fn encoding(path: &Path, text: &str) -> Result<Encoding> {
    Ok(match text.to_ascii_lowercase().as_str() {
        "raw" => Encoding::Raw,
        "txt" | "text" | "ascii" => Encoding::Ascii,
        "gz" | "gzip" => Encoding::Gzip,
        name @ ("hex" | "bz2" | "bzip2" | "zrl" | "zlib" | "lzma") => {
            return Err(FormatError::unsupported(
                path,
                format!("the encoding {name:?} is not read"),
                "save it again as gzip or raw (pynrrd, 3D Slicer and `unu save -e gzip` do)",
            ));
        }
        _ => return Err(FormatError::damaged(path, format!("the encoding {text:?} is not one of NRRD"))),
    })
}

/// Parses vectors such as `(1,0,0) none (0, nan, 0)`; a vector with a NaN counts as none.
fn vectors(text: &str) -> Option<Vec<Option<Vec<f64>>>> {
    let mut all = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none").or_else(|| rest.strip_prefix("None")) {
            all.push(None);
            rest = after.trim_start();
            continue;
        }
        let (inside, after) = rest.strip_prefix('(')?.split_once(')')?;
        let vector: Vec<f64> = inside.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
        all.push((!vector.iter().any(|v| v.is_nan())).then_some(vector));
        rest = after.trim_start();
    }
    Some(all)
}

/// Texts between quotes, as in `"mm" "mm" ""`; without quotes, the words.
fn quoted(text: &str) -> Vec<String> {
    if text.contains('"') {
        text.split('"').skip(1).step_by(2).map(str::to_owned).collect()
    } else {
        text.split_whitespace().map(str::to_owned).collect()
    }
}

/// Expands `slice%03d.raw 1 40 1`, a printf pattern with first, last and step, to file names; any other value is one name.
fn expand_pattern(path: &Path, value: &str) -> Result<Vec<String>> {
    let words: Vec<&str> = value.split_whitespace().collect();
    let Some((pattern, range)) =
        words.split_first().filter(|(p, r)| p.contains('%') && (3..=4).contains(&r.len()))
    else {
        return Ok(vec![value.to_owned()]);
    };
    let bad = || {
        FormatError::damaged(
            path,
            format!("the data file pattern {value:?} is not valid, expected one like slice%03d.raw 1 40 1"),
        )
    };
    let range: Vec<i64> = range.iter().map(|w| w.parse().ok()).collect::<Option<_>>().ok_or_else(bad)?;
    let (first, last, step) = (range[0], range[1], range[2]);
    let count = last
        .checked_sub(first)
        .and_then(|span| span.checked_div(step))
        .and_then(|n| n.checked_add(1))
        .ok_or_else(bad)?;
    if !(1..=MAX_DATA_FILES).contains(&count) {
        return Err(bad());
    }
    (0..count).map(|i| format_number(pattern, first + i * step).ok_or_else(bad)).collect()
}
