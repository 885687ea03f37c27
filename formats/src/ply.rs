//! PLY (Stanford, Greg Turk 1994): triangle meshes, as text or binary of either byte order.
//!
//! ```text
//! ply
//! format binary_little_endian 1.0        or ascii, or binary_big_endian
//! comment …
//! element vertex 8
//! property float x                       three numbers x, y, z; other properties may stand between them
//! property float nx                      nx, ny, nz, optional: the mesh is shaded smooth
//! …
//! element face 12
//! property list uchar int vertex_indices       (or vertex_index): corners, counterclockwise from outside
//! property int material_index            optional: the face's material
//! end_header
//! … the elements, in that order
//! ```
//! A face of more than three corners becomes a fan of triangles about its first corner, which is right for convex faces. Other elements and
//! properties are skipped. Counts in the header reserve no memory: if data is missing, reading fails.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use pumice_core::MeshData;

use crate::error::{FormatError, Result};
use crate::stream::open_file;

/// Longest header line in bytes, and largest number of lines; real headers are text of some hundred bytes.
const MOST_LINE_BYTES: u64 = 4096;
const MOST_LINES: usize = 1024;

/// Largest number of corners of a face; a longer list comes from a damaged count.
const MOST_CORNERS: u64 = 65_536;

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Clone, Copy)]
enum Number {
    Int { bytes: usize, signed: bool },
    Float { bytes: usize },
}

struct Property {
    name: String,
    /// Number type of a list's length; `None` for a property that is not a list.
    length: Option<Number>,
    number: Number,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

/// Reads the file's numbers in order.
struct Numbers<R> {
    from: R,
    encoding: Encoding,
}

/// Whether a file begins like a PLY file.
pub(crate) fn is_ply(head: &[u8]) -> bool {
    head.starts_with(b"ply\n") || head.starts_with(b"ply\r\n")
}

/// Reads the mesh.
pub(crate) fn read_ply(path: &Path) -> Result<MeshData> {
    read(BufReader::new(open_file(path)?)).map_err(|fault| match fault {
        PlyError::Io(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            FormatError::damaged(path, "the file ends before its mesh is complete")
        }
        PlyError::Io(source) => FormatError::Io { path: path.to_owned(), source },
        PlyError::File(what) => FormatError::damaged(path, what),
    })
}

enum PlyError {
    Io(std::io::Error),
    File(String),
}

impl From<std::io::Error> for PlyError {
    fn from(e: std::io::Error) -> Self {
        Self::Io(e)
    }
}

fn read(mut from: impl BufRead) -> std::result::Result<MeshData, PlyError> {
    let (encoding, elements) = header(&mut from)?;
    let mut numbers = Numbers { from, encoding };
    let (mut positions, mut triangles, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    let mut normals = None;
    let place = |e: &Element, name: &str| e.properties.iter().position(|p| p.name == name);
    for element in &elements {
        let axes = ["x", "y", "z"].map(|name| place(element, name));
        let normal_axes = ["nx", "ny", "nz"].map(|name| place(element, name));
        let corners = place(element, "vertex_indices").or(place(element, "vertex_index"));
        let material = place(element, "material_index");
        let is_vertex = element.name == "vertex";
        let is_face = element.name == "face";
        if is_vertex && axes.iter().any(Option::is_none) {
            return Err(PlyError::File("expected properties x, y and z of element vertex".into()));
        }
        let has_normals = is_vertex && normal_axes.iter().any(Option::is_some);
        if has_normals && normal_axes.iter().any(Option::is_none) {
            return Err(PlyError::File(
                "expected all of the properties nx, ny and nz of element vertex, or none".into(),
            ));
        }
        if is_face && corners.is_none_or(|c| element.properties[c].length.is_none()) {
            return Err(PlyError::File("expected a list vertex_indices of element face".into()));
        }
        for row in 0..element.count {
            let (mut point, mut normal) = ([0.0; 3], [0.0f32; 3]);
            let mut face: Vec<u32> = Vec::new();
            let mut own = 0;
            for (i, property) in element.properties.iter().enumerate() {
                let Some(length) = property.length else {
                    let value = numbers.next(property.number)?;
                    if let Some(axis) = axes.iter().position(|a| *a == Some(i)) {
                        point[axis] = value;
                    }
                    if let Some(axis) = normal_axes.iter().position(|a| *a == Some(i)) {
                        normal[axis] = value as f32;
                    }
                    if material == Some(i) {
                        own = whole(value, &format!("material_index of face {row}"))?;
                    }
                    continue;
                };
                let length = u64::from(whole(numbers.next(length)?, "the length of a list")?);
                if length > MOST_CORNERS {
                    return Err(PlyError::File(format!(
                        "a list of {length} numbers; expected at most {MOST_CORNERS}"
                    )));
                }
                for _ in 0..length {
                    let value = numbers.next(property.number)?;
                    if is_face && corners == Some(i) {
                        face.push(whole(value, &format!("a corner of face {row}"))?);
                    }
                }
            }
            if is_vertex {
                positions.push(point);
            }
            if has_normals {
                normals.get_or_insert_with(Vec::new).push(normal);
            }
            if is_face {
                for two in face.get(1..).unwrap_or_default().windows(2) {
                    triangles.push([face[0], two[0], two[1]]);
                    materials.push(own);
                }
            }
        }
    }
    let mesh = MeshData::new(positions, triangles, materials);
    let mesh = match normals {
        Some(normals) => mesh.and_then(|mesh| mesh.with_corner_normals(&normals)),
        None => mesh,
    };
    mesh.map_err(|e| PlyError::File(e.to_string()))
}

/// Converts a value to a whole number of at least 0 below 2³².
fn whole(value: f64, what: &str) -> std::result::Result<u32, PlyError> {
    if value.fract() == 0.0 && (0.0..4_294_967_296.0).contains(&value) {
        return Ok(value as u32);
    }
    Err(PlyError::File(format!("{what}: expected a whole number of at least 0, got {value}")))
}

fn header(from: &mut impl BufRead) -> std::result::Result<(Encoding, Vec<Element>), PlyError> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for number in 0..MOST_LINES {
        let mut line = Vec::new();
        from.by_ref().take(MOST_LINE_BYTES).read_until(b'\n', &mut line)?;
        let text = String::from_utf8_lossy(&line);
        if !text.ends_with('\n') {
            return Err(PlyError::File("expected the line end_header, got a line that does not end".into()));
        }
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        let bad =
            || PlyError::File(format!("line {} of the header is not valid: {}", number + 1, text.trim()));
        match words[..] {
            ["ply"] if number == 0 => {}
            ["format", name, "1.0"] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(bad()),
                });
            }
            ["comment" | "obj_info", ..] | [] => {}
            ["element", name, count] => {
                let count = count.parse().map_err(|_| bad())?;
                elements.push(Element { name: name.into(), count, properties: Vec::new() });
            }
            ["property", "list", length, kind, name] => {
                let length = Some(number_type(length).ok_or_else(bad)?);
                let number = number_type(kind).ok_or_else(bad)?;
                let element = elements.last_mut().ok_or_else(bad)?;
                element.properties.push(Property { name: name.into(), length, number });
            }
            ["property", kind, name] => {
                let number = number_type(kind).ok_or_else(bad)?;
                let element = elements.last_mut().ok_or_else(bad)?;
                element.properties.push(Property { name: name.into(), length: None, number });
            }
            ["end_header"] => {
                let encoding = encoding
                    .ok_or_else(|| PlyError::File("expected a line that begins with format".into()))?;
                // Rows without bytes would be counted without end.
                elements.retain(|e| !e.properties.is_empty());
                return Ok((encoding, elements));
            }
            _ => return Err(bad()),
        }
    }
    Err(PlyError::File(format!("expected the line end_header within {MOST_LINES} lines")))
}

fn number_type(name: &str) -> Option<Number> {
    let int = |bytes, signed| Some(Number::Int { bytes, signed });
    match name {
        "char" | "int8" => int(1, true),
        "uchar" | "uint8" => int(1, false),
        "short" | "int16" => int(2, true),
        "ushort" | "uint16" => int(2, false),
        "int" | "int32" => int(4, true),
        "uint" | "uint32" => int(4, false),
        "float" | "float32" => Some(Number::Float { bytes: 4 }),
        "double" | "float64" => Some(Number::Float { bytes: 8 }),
        _ => None,
    }
}

impl<R: BufRead> Numbers<R> {
    fn next(&mut self, number: Number) -> std::result::Result<f64, PlyError> {
        if self.encoding == Encoding::Ascii {
            let word = self.word()?;
            return word.parse().map_err(|_| PlyError::File(format!("expected a number, got {word:?}")));
        }
        let (Number::Int { bytes, .. } | Number::Float { bytes }) = number;
        let mut raw = [0u8; 8];
        self.from.read_exact(&mut raw[..bytes])?;
        if self.encoding == Encoding::Big {
            raw[..bytes].reverse();
        }
        let bits = u64::from_le_bytes(raw);
        Ok(match number {
            Number::Float { bytes: 4 } => f64::from(f32::from_bits(bits as u32)),
            Number::Float { .. } => f64::from_bits(bits),
            Number::Int { signed: false, .. } => bits as f64,
            Number::Int { .. } => {
                let unused = 64 - 8 * bytes as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
        })
    }

    /// The next word of a text file.
    fn word(&mut self) -> std::result::Result<String, PlyError> {
        let mut word = Vec::new();
        loop {
            let mut byte = [0];
            self.from.read_exact(&mut byte).or_else(|e| match e.kind() {
                std::io::ErrorKind::UnexpectedEof if !word.is_empty() => {
                    byte = *b"\n";
                    Ok(())
                }
                _ => Err(e),
            })?;
            match (byte[0].is_ascii_whitespace(), word.is_empty()) {
                (true, true) => {}
                (true, false) => return Ok(String::from_utf8_lossy(&word).into_owned()),
                (false, _) if word.len() < 64 => word.push(byte[0]),
                (false, _) => {
                    return Err(PlyError::File("expected a number, got a word of more than 64 bytes".into()));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "ply\r\nformat ascii 1.0\r\ncomment a square\r\nelement vertex 4\r\nproperty float x\r\n\
        property double y\r\nproperty float z\r\nproperty uchar red\r\nelement face 1\r\n\
        property list uchar int vertex_indices\r\nproperty short material_index\r\nend_header\r\n\
        0 0 0.5 9\r\n1 0 0.5 9\r\n1 1 0.5 9\r\n0 1 -2e3 9\r\n4 0 1 2 3 7";

    fn parse(bytes: &[u8]) -> std::result::Result<MeshData, String> {
        read(bytes).map_err(|f| match f {
            PlyError::Io(e) => e.kind().to_string(),
            PlyError::File(what) => what,
        })
    }

    /// The same square as binary, written here by hand.
    fn binary(big: bool) -> Vec<u8> {
        let name = if big { "binary_big_endian" } else { "binary_little_endian" };
        let header = TEXT.split("end_header").next().unwrap().replace("ascii", name);
        let mut bytes = (header + "end_header\n").into_bytes();
        let mut put = |raw: &[u8]| {
            let ordered: Vec<u8> = if big { raw.iter().rev().copied().collect() } else { raw.to_vec() };
            bytes.extend(ordered);
        };
        for [x, y, z] in [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [1.0, 1.0, 0.5], [0.0, 1.0, -2e3f32]] {
            put(&x.to_le_bytes());
            put(&f64::from(y).to_le_bytes());
            put(&z.to_le_bytes());
            put(&[9]);
        }
        put(&[4]);
        (0..4i32).for_each(|i| put(&i.to_le_bytes()));
        put(&7i16.to_le_bytes());
        bytes
    }

    #[test]
    fn text_and_binary_are_the_same_mesh() {
        let mesh = parse(TEXT.as_bytes()).unwrap();
        assert_eq!(mesh.positions()[3], [0.0, 1.0, -2000.0]);
        assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.material(1), 7);
        assert_eq!(parse(&binary(false)).unwrap(), mesh);
        assert_eq!(parse(&binary(true)).unwrap(), mesh);
    }

    /// Normals among other properties and in another order; the result equals normals set by an array.
    #[test]
    fn normals_are_read() {
        let names = "property uchar red\r\nproperty double nz\r\nproperty float nx\r\nproperty float ny";
        let text = TEXT.replace("property uchar red", names);
        let with = |normal: &str| {
            let rows = text.replace("0.5 9", &format!("0.5 9 {normal}"));
            parse(rows.replace("-2e3 9", "-2e3 9 1 0 0").as_bytes())
        };
        let up = [0.0, 0.0, 1.0];
        let flat = parse(TEXT.as_bytes()).unwrap();
        let expected =
            flat.clone().with_corner_normals(&[[0.5, -0.5, 2.0], [0.5, -0.5, 2.0], [0.5, -0.5, 2.0], up]);
        let got = with("2 0.5 -0.5").unwrap();
        assert_eq!(got, expected.unwrap());
        assert!(got.is_smooth() && !flat.is_smooth());
        assert_eq!(with("nan 0 0").unwrap_err(), "normal 0: expected finite numbers, got [0.0, 0.0, NaN]");
        // A number beyond 32-bit floats makes no direction either.
        assert_eq!(
            with("0 1e300 0").unwrap_err(),
            "normal 0: expected finite numbers, got [1e300, 0.0, 0.0]".replace("1e300", "inf")
        );
        let two = text.replace("property float ny", "property float v");
        assert_eq!(
            parse(two.as_bytes()).unwrap_err(),
            "expected all of the properties nx, ny and nz of element vertex, or none"
        );
    }

    #[test]
    fn whatever_is_cut_off_is_told() {
        for whole in [TEXT.as_bytes().to_vec(), binary(false)] {
            for end in 0..whole.len() - 1 {
                assert!(parse(&whole[..end]).is_err(), "{end} bytes make no square");
            }
        }
    }

    #[test]
    fn faults_are_named() {
        let fault = |from: &str, to: &str| parse(TEXT.replace(from, to).as_bytes()).unwrap_err();
        assert_eq!(fault("4 0 1 2 3 7", "4 0 1 2 4 7"), "triangle 1: expected corners below 4, got 4");
        assert_eq!(
            fault("4 0 1 2 3 7", "4 0 1 2 -1 7"),
            "a corner of face 0: expected a whole number of at least 0, got -1"
        );
        assert_eq!(fault("0 0 0.5", "0 nan 0.5"), "corner 0: expected finite numbers, got [0.0, NaN, 0.5]");
        assert_eq!(fault("4 0 1", "4000000 0 1"), "a list of 4000000 numbers; expected at most 65536");
        assert_eq!(fault("float x", "float u"), "expected properties x, y and z of element vertex");
        assert_eq!(fault("vertex_indices", "corners"), "expected a list vertex_indices of element face");
        assert_eq!(fault("double y", "quad y"), "line 6 of the header is not valid: property quad y");
        assert_eq!(fault("element vertex 4", "element vertex 99999999999"), "unexpected end of file");
    }
}
