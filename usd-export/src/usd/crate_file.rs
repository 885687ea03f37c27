//! Writes a stage as a crate file (`usdc`), version 0.8.0.
//!
//! ```text
//! offset 0   "PXR-USDC" │ version, 8 bytes │ i64 offset of the table of contents │ 64 bytes 0
//!       88   values that do not fit into 48 bits, in the order of the specs
//!            TOKENS     texts, each once             FIELDS     (token, value), each once
//!            STRINGS    which tokens are strings     FIELDSETS  lists of fields, each ended by 2³² − 1
//!            PATHS      the tree of all paths        SPECS      (path, field set, kind)
//!            table of contents: u64 6, and for each section: name in 16 bytes, i64 offset, i64 bytes
//! ```
//! 0.8.0 is the newest version that every reader in use opens (usd-core from 24.3 on, Blender 4.2). Long arrays go straight to the file.
//! Source: AOUSD Core Specification 1.0.1, section 16.3.

use std::collections::HashMap;
use std::io::{Seek, SeekFrom, Write};

use pumice_core::Error;

use super::integers::{compressed, compressed_integers, compressed_slice};
use super::stage::{Attribute, Content, Prim, Property, Specifier, Stage, Variant, VariantSet};
use super::value::{Array, Element, Value};
use crate::Result;

const VERSION: [u8; 8] = [0, 8, 0, 0, 0, 0, 0, 0];
const HEADER_BYTES: u64 = 88;
/// Arrays of fewer integers are written as they are.
const LEAST_COMPRESSED: u64 = 16;
/// Ends a list of fields.
const END_OF_FIELDS: i32 = -1;
/// The first token, so that the number of a property's name is never 0: its sign says that it is one.
const UNUSED_TOKEN: &str = ";-)";

/// Kinds of values, by their numbers.
mod kind {
    pub(super) const BOOL: u64 = 1;
    pub(super) const INT: u64 = 3;
    pub(super) const FLOAT: u64 = 8;
    pub(super) const DOUBLE: u64 = 9;
    pub(super) const STRING: u64 = 10;
    pub(super) const TOKEN: u64 = 11;
    pub(super) const ASSET_PATH: u64 = 12;
    pub(super) const MATRIX_4D: u64 = 15;
    pub(super) const VEC_2F: u64 = 20;
    pub(super) const VEC_3F: u64 = 24;
    pub(super) const TOKEN_LIST_OP: u64 = 32;
    pub(super) const STRING_LIST_OP: u64 = 33;
    pub(super) const PATH_LIST_OP: u64 = 34;
    pub(super) const TOKEN_VECTOR: u64 = 41;
    pub(super) const SPECIFIER: u64 = 42;
    pub(super) const VARIABILITY: u64 = 44;
    pub(super) const VARIANT_SELECTION_MAP: u64 = 45;
    pub(super) const PAYLOAD_LIST_OP: u64 = 55;
}

/// What a path stands for, by its number.
mod spec {
    pub(super) const ATTRIBUTE: i32 = 1;
    pub(super) const PRIM: i32 = 6;
    pub(super) const PSEUDO_ROOT: i32 = 7;
    pub(super) const RELATIONSHIP: i32 = 8;
    pub(super) const VARIANT: i32 = 10;
    pub(super) const VARIANT_SET: i32 = 11;
}

const IS_ARRAY: u64 = 1 << 63;
const IS_INLINED: u64 = 1 << 62;
const IS_COMPRESSED: u64 = 1 << 61;
/// Largest offset that a value can have.
const MOST_OFFSET: u64 = (1 << 48) - 1;

/// In the first byte of a list of edits: the list replaces all others, or comes before them.
const EXPLICIT: u8 = 1 | 2;
const PREPENDED: u8 = 32;

/// Writes the stage.
///
/// # Errors
/// [`ExportError::Write`](crate::ExportError::Write) where `out` fails; those of whoever produces the arrays; [`Error::Limit`] where the file would be longer than 2⁴⁸ bytes.
pub fn write_usdc(stage: &Stage<'_>, out: &mut (impl Write + Seek)) -> Result<()> {
    let mut file = CrateFile {
        out,
        position: 0,
        tokens: Numbered::default(),
        strings: Numbered::default(),
        paths: Paths::default(),
        fields: Numbered::default(),
        field_sets: Vec::new(),
        starts_of_sets: HashMap::new(),
        specs: Vec::new(),
    };
    file.tokens.number(UNUSED_TOKEN.to_owned());
    file.put(&[0; HEADER_BYTES as usize])?;
    file.stage(stage)?;
    file.finish()
}

/// Things that are numbered from 0 in the order of their first appearance.
struct Numbered<T> {
    all: Vec<T>,
    numbers: HashMap<T, u32>,
}

impl<T> Default for Numbered<T> {
    fn default() -> Self {
        Self { all: Vec::new(), numbers: HashMap::new() }
    }
}

impl<T: Clone + Eq + std::hash::Hash> Numbered<T> {
    fn number(&mut self, thing: T) -> u32 {
        let next = self.all.len() as u32;
        let number = *self.numbers.entry(thing.clone()).or_insert(next);
        if number == next {
            self.all.push(thing);
        }
        number
    }
}

/// The tree of all paths.
#[derive(Default)]
struct Paths {
    nodes: Vec<PathNode>,
    numbers: HashMap<String, u32>,
}

struct PathNode {
    /// Token of the last part; below 0 for a property's.
    element: i32,
    children: Vec<u32>,
}

struct CrateFile<'w, W> {
    out: &'w mut W,
    position: u64,
    tokens: Numbered<String>,
    /// Tokens of the strings.
    strings: Numbered<u32>,
    paths: Paths,
    /// (token, value).
    fields: Numbered<(u32, u64)>,
    field_sets: Vec<i32>,
    starts_of_sets: HashMap<Vec<u32>, u32>,
    /// (path, start of its field set, kind).
    specs: Vec<[i32; 3]>,
}

/// The fields of one spec.
type Fields = Vec<(&'static str, u64)>;

fn inlined(kind: u64, payload: u32) -> u64 {
    IS_INLINED | kind << 48 | u64::from(payload)
}

impl<W: Write + Seek> CrateFile<'_, W> {
    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.write_all(bytes)?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// A value whose bytes begin at the next multiple of 8.
    fn here(&mut self, kind: u64) -> Result<u64> {
        let gap = self.position.next_multiple_of(8) - self.position;
        self.put(&[0; 8][..gap as usize])?;
        if self.position > MOST_OFFSET {
            let what = "bytes of a usdc file".into();
            return Err(Error::Limit { what, limit: MOST_OFFSET, got: self.position }.into());
        }
        Ok(kind << 48 | self.position)
    }

    fn value_of_bytes(&mut self, kind: u64, bytes: &[u8]) -> Result<u64> {
        let value = self.here(kind)?;
        self.put(bytes)?;
        Ok(value)
    }

    fn token(&mut self, text: &str) -> u32 {
        self.tokens.number(text.to_owned())
    }

    fn string(&mut self, text: &str) -> u32 {
        let token = self.token(text);
        self.strings.number(token)
    }

    fn token_value(&mut self, text: &str) -> u64 {
        inlined(kind::TOKEN, self.token(text))
    }

    fn tokens_value(&mut self, texts: &[&str]) -> Result<u64> {
        let mut bytes = (texts.len() as u64).to_le_bytes().to_vec();
        texts.iter().for_each(|text| bytes.extend(self.token(text).to_le_bytes()));
        self.value_of_bytes(kind::TOKEN_VECTOR, &bytes)
    }

    fn list_of_edits(&mut self, kind: u64, header: u8, items: &[u32]) -> Result<u64> {
        let mut bytes = vec![header];
        bytes.extend((items.len() as u64).to_le_bytes());
        items.iter().for_each(|item| bytes.extend(item.to_le_bytes()));
        self.value_of_bytes(kind, &bytes)
    }

    fn paths_value(&mut self, paths: &[String]) -> Result<u64> {
        let numbers: Vec<u32> = paths.iter().map(|path| self.target(path)).collect();
        self.list_of_edits(kind::PATH_LIST_OP, EXPLICIT, &numbers)
    }

    fn value(&mut self, value: &Value<'_>) -> Result<u64> {
        let floats = |floats: &[f32]| floats.iter().flat_map(|f| f.to_le_bytes()).collect::<Vec<u8>>();
        Ok(match value {
            Value::Bool(b) => inlined(kind::BOOL, u32::from(*b)),
            Value::Int(i) => inlined(kind::INT, *i as u32),
            Value::Float(f) => inlined(kind::FLOAT, f.to_bits()),
            Value::Double(d) => self.double(*d)?,
            Value::String(text) => inlined(kind::STRING, self.string(text)),
            Value::Token(text) => self.token_value(text),
            Value::Asset(path) => inlined(kind::ASSET_PATH, self.token(path)),
            Value::Float2(v) => self.value_of_bytes(kind::VEC_2F, &floats(v))?,
            Value::Float3(v) => self.value_of_bytes(kind::VEC_3F, &floats(v))?,
            Value::Matrix4(rows) => {
                let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|d| d.to_le_bytes()).collect();
                self.value_of_bytes(kind::MATRIX_4D, &bytes)?
            }
            Value::Tokens(texts) if texts.is_empty() => IS_ARRAY | kind::TOKEN << 48,
            Value::Tokens(texts) => {
                let mut bytes = (texts.len() as u64).to_le_bytes().to_vec();
                texts.iter().for_each(|text| bytes.extend(self.token(text).to_le_bytes()));
                IS_ARRAY | self.value_of_bytes(kind::TOKEN, &bytes)?
            }
            Value::Array(array) => self.array(array)?,
        })
    }

    fn double(&mut self, value: f64) -> Result<u64> {
        let short = value as f32;
        if f64::from(short) == value {
            return Ok(inlined(kind::DOUBLE, short.to_bits()));
        }
        self.value_of_bytes(kind::DOUBLE, &value.to_le_bytes())
    }

    fn array(&mut self, array: &Array<'_>) -> Result<u64> {
        let kind = match array.element() {
            Element::Int => kind::INT,
            Element::Float => kind::FLOAT,
            Element::Float3 => kind::VEC_3F,
        };
        if array.is_empty() {
            return Ok(IS_ARRAY | kind << 48);
        }
        if array.element() == Element::Int && array.len() >= LEAST_COMPRESSED {
            let bytes = compressed_integers(array.len(), &|sink| array.for_each_int(sink))?;
            let value = self.here(kind)?;
            self.put(&array.len().to_le_bytes())?;
            self.put(&(bytes.len() as u64).to_le_bytes())?;
            self.put(&bytes)?;
            return Ok(IS_ARRAY | IS_COMPRESSED | value);
        }
        let value = self.here(kind)?;
        self.put(&array.len().to_le_bytes())?;
        let start = self.position;
        array.for_each_piece(&mut |bytes| self.put(bytes))?;
        let (expected, got) = (array.len() * array.element().bytes() as u64, self.position - start);
        if expected != got {
            return Err(Error::Caller(format!("an array of {expected} bytes has {got}")).into());
        }
        Ok(IS_ARRAY | value)
    }

    /// The number of a path below another, which has a number already.
    fn path(&mut self, parent: Option<u32>, path: &str, element: &str, is_property: bool) -> u32 {
        if let Some(&number) = self.paths.numbers.get(path) {
            return number;
        }
        let token = self.token(element) as i32;
        let number = self.paths.nodes.len() as u32;
        self.paths
            .nodes
            .push(PathNode { element: if is_property { -token } else { token }, children: Vec::new() });
        self.paths.numbers.insert(path.to_owned(), number);
        if let Some(parent) = parent {
            self.paths.nodes[parent as usize].children.push(number);
        }
        number
    }

    /// The number of a path of prims, with or without a property at its end, which need not have a spec.
    fn target(&mut self, path: &str) -> u32 {
        let (prims, property) = path.split_once('.').map_or((path, None), |(prims, p)| (prims, Some(p)));
        let mut number = self.path(None, "/", "", false);
        let mut so_far = String::new();
        for name in prims.split('/').filter(|name| !name.is_empty()) {
            so_far = format!("{so_far}/{name}");
            number = self.path(Some(number), &so_far, name, false);
        }
        property.map_or(number, |name| self.path(Some(number), path, name, true))
    }

    fn spec(&mut self, path: u32, kind: i32, fields: Fields) {
        let numbers: Vec<u32> = fields
            .into_iter()
            .map(|(name, value)| {
                let token = self.token(name);
                self.fields.number((token, value))
            })
            .collect();
        let next = self.field_sets.len() as u32;
        let start = *self.starts_of_sets.entry(numbers.clone()).or_insert(next);
        if start == next {
            self.field_sets.extend(numbers.iter().map(|&n| n as i32));
            self.field_sets.push(END_OF_FIELDS);
        }
        self.specs.push([path as i32, start as i32, kind]);
    }

    fn stage(&mut self, stage: &Stage<'_>) -> Result<()> {
        let root = self.path(None, "/", "", false);
        let mut fields = vec![
            ("upAxis", self.token_value("Z")),
            ("metersPerUnit", self.double(1.0)?),
            ("defaultPrim", self.token_value(&stage.default_prim)),
        ];
        if !stage.documentation.is_empty() {
            fields.push(("documentation", inlined(kind::STRING, self.string(&stage.documentation))));
        }
        self.children_field(&stage.prims, &mut fields)?;
        self.spec(root, spec::PSEUDO_ROOT, fields);
        stage.prims.iter().try_for_each(|prim| self.prim(prim, root, "/"))
    }

    fn children_field(&mut self, prims: &[Prim<'_>], fields: &mut Fields) -> Result<()> {
        let names: Vec<&str> = prims.iter().map(|prim| prim.name.as_str()).collect();
        if !names.is_empty() {
            fields.push(("primChildren", self.tokens_value(&names)?));
        }
        Ok(())
    }

    fn properties_field(&mut self, properties: &[Property<'_>], fields: &mut Fields) -> Result<()> {
        let names: Vec<&str> = properties.iter().map(|property| property.name.as_str()).collect();
        if !names.is_empty() {
            fields.push(("properties", self.tokens_value(&names)?));
        }
        Ok(())
    }

    /// `beginning` is the path of what is above, with the sign that separates it from a prim's name.
    fn prim(&mut self, prim: &Prim<'_>, above: u32, beginning: &str) -> Result<()> {
        let path = format!("{beginning}{}", prim.name);
        let number = self.path(Some(above), &path, &prim.name, false);
        let specifier = match prim.specifier {
            Specifier::Def => 0,
            Specifier::Class => 2,
        };
        let mut fields = vec![("specifier", inlined(kind::SPECIFIER, specifier))];
        if !prim.type_name.is_empty() {
            fields.push(("typeName", self.token_value(prim.type_name)));
        }
        if !prim.kind.is_empty() {
            fields.push(("kind", self.token_value(prim.kind)));
        }
        if !prim.api_schemas.is_empty() {
            let names: Vec<u32> = prim.api_schemas.iter().map(|name| self.token(name)).collect();
            fields.push(("apiSchemas", self.list_of_edits(kind::TOKEN_LIST_OP, PREPENDED, &names)?));
        }
        if let Some(target) = &prim.payload {
            fields.push(("payload", self.payload(target)?));
        }
        if !prim.variant_sets.is_empty() {
            self.variant_fields(&prim.variant_sets, &mut fields)?;
        }
        self.properties_field(&prim.properties, &mut fields)?;
        self.children_field(&prim.children, &mut fields)?;
        self.spec(number, spec::PRIM, fields);
        prim.properties.iter().try_for_each(|property| self.property(property, number, &path))?;
        let beginning = format!("{path}/");
        prim.children.iter().try_for_each(|child| self.prim(child, number, &beginning))?;
        prim.variant_sets.iter().try_for_each(|set| self.variant_set(set, number, &path))
    }

    /// A prim of this very file, whose path is `target`.
    fn payload(&mut self, target: &str) -> Result<u64> {
        let (asset, path) = (self.string(""), self.target(target));
        let mut bytes = vec![PREPENDED];
        bytes.extend(1u64.to_le_bytes());
        bytes.extend(asset.to_le_bytes());
        bytes.extend(path.to_le_bytes());
        // Offset and scale of its time.
        bytes.extend([0.0f64, 1.0].iter().flat_map(|d| d.to_le_bytes()));
        self.value_of_bytes(kind::PAYLOAD_LIST_OP, &bytes)
    }

    fn variant_fields(&mut self, sets: &[VariantSet<'_>], fields: &mut Fields) -> Result<()> {
        let mut bytes = (sets.len() as u64).to_le_bytes().to_vec();
        for set in sets {
            bytes.extend(self.string(set.name).to_le_bytes());
            bytes.extend(self.string(&set.selected).to_le_bytes());
        }
        fields.push(("variantSelection", self.value_of_bytes(kind::VARIANT_SELECTION_MAP, &bytes)?));
        let names: Vec<u32> = sets.iter().map(|set| self.string(set.name)).collect();
        fields.push(("variantSetNames", self.list_of_edits(kind::STRING_LIST_OP, PREPENDED, &names)?));
        let names: Vec<&str> = sets.iter().map(|set| set.name).collect();
        fields.push(("variantSetChildren", self.tokens_value(&names)?));
        Ok(())
    }

    fn variant_set(&mut self, set: &VariantSet<'_>, prim: u32, prim_path: &str) -> Result<()> {
        let element = format!("{{{}=}}", set.name);
        let number = self.path(Some(prim), &format!("{prim_path}{element}"), &element, false);
        let names: Vec<&str> = set.variants.iter().map(|variant| variant.name.as_str()).collect();
        let fields = vec![("variantChildren", self.tokens_value(&names)?)];
        self.spec(number, spec::VARIANT_SET, fields);
        set.variants.iter().try_for_each(|variant| self.variant(variant, set.name, prim, prim_path))
    }

    fn variant(&mut self, variant: &Variant<'_>, set: &str, prim: u32, prim_path: &str) -> Result<()> {
        let element = format!("{{{set}={}}}", variant.name);
        let path = format!("{prim_path}{element}");
        let number = self.path(Some(prim), &path, &element, false);
        let mut fields = vec![("specifier", inlined(kind::SPECIFIER, 1))];
        self.properties_field(&variant.properties, &mut fields)?;
        self.children_field(&variant.children, &mut fields)?;
        self.spec(number, spec::VARIANT, fields);
        variant.properties.iter().try_for_each(|property| self.property(property, number, &path))?;
        variant.children.iter().try_for_each(|child| self.prim(child, number, &path))
    }

    fn property(&mut self, property: &Property<'_>, prim: u32, prim_path: &str) -> Result<()> {
        let path = format!("{prim_path}.{}", property.name);
        let number = self.path(Some(prim), &path, &property.name, true);
        match &property.content {
            Content::Attribute(attribute) => {
                let fields = self.attribute(attribute)?;
                self.spec(number, spec::ATTRIBUTE, fields);
            }
            Content::Relationship(targets) => {
                let fields = vec![
                    ("variability", inlined(kind::VARIABILITY, 1)),
                    ("targetPaths", self.paths_value(targets)?),
                ];
                self.spec(number, spec::RELATIONSHIP, fields);
            }
        }
        Ok(())
    }

    fn attribute(&mut self, attribute: &Attribute<'_>) -> Result<Fields> {
        let mut fields = vec![("typeName", self.token_value(attribute.type_name))];
        if attribute.is_custom {
            fields.push(("custom", inlined(kind::BOOL, 1)));
        }
        if attribute.is_uniform {
            fields.push(("variability", inlined(kind::VARIABILITY, 1)));
        }
        if !attribute.interpolation.is_empty() {
            fields.push(("interpolation", self.token_value(attribute.interpolation)));
        }
        if let Some(value) = &attribute.value {
            fields.push(("default", self.value(value)?));
        }
        if !attribute.connections.is_empty() {
            fields.push(("connectionPaths", self.paths_value(&attribute.connections)?));
        }
        Ok(fields)
    }

    /// Writes the sections, the table of contents and the header.
    fn finish(mut self) -> Result<()> {
        let mut contents = Vec::new();
        for (name, section) in [
            ("TOKENS", self.tokens_section()?),
            ("STRINGS", self.strings_section()),
            ("FIELDS", self.fields_section()?),
            ("FIELDSETS", self.field_sets_section()?),
            ("PATHS", self.paths_section()?),
            ("SPECS", self.specs_section()?),
        ] {
            let mut entry = [0; 32];
            entry[..name.len()].copy_from_slice(name.as_bytes());
            entry[16..24].copy_from_slice(&self.position.to_le_bytes());
            entry[24..].copy_from_slice(&(section.len() as u64).to_le_bytes());
            contents.push(entry);
            self.put(&section)?;
        }
        let at = self.position;
        self.put(&(contents.len() as u64).to_le_bytes())?;
        self.put(contents.as_flattened())?;
        let header = [b"PXR-USDC".as_slice(), &VERSION, &at.to_le_bytes()].concat();
        self.out.seek(SeekFrom::Start(0))?;
        self.out.write_all(&header)?;
        self.out.seek(SeekFrom::End(0))?;
        Ok(())
    }

    fn tokens_section(&self) -> Result<Vec<u8>> {
        let texts: Vec<u8> =
            self.tokens.all.iter().flat_map(|text| text.bytes().chain(std::iter::once(0))).collect();
        let short = compressed(&texts)?;
        let numbers = [self.tokens.all.len(), texts.len(), short.len()].map(|n| (n as u64).to_le_bytes());
        Ok([numbers.as_flattened(), &short].concat())
    }

    fn strings_section(&self) -> Vec<u8> {
        let tokens = self.strings.all.iter().flat_map(|token| token.to_le_bytes());
        (self.strings.all.len() as u64).to_le_bytes().into_iter().chain(tokens).collect()
    }

    fn fields_section(&self) -> Result<Vec<u8>> {
        let tokens: Vec<i32> = self.fields.all.iter().map(|(token, _)| *token as i32).collect();
        let values: Vec<u8> = self.fields.all.iter().flat_map(|(_, value)| value.to_le_bytes()).collect();
        let mut section = (self.fields.all.len() as u64).to_le_bytes().to_vec();
        with_size(&mut section, &compressed_slice(&tokens)?);
        with_size(&mut section, &compressed(&values)?);
        Ok(section)
    }

    fn field_sets_section(&self) -> Result<Vec<u8>> {
        let mut section = (self.field_sets.len() as u64).to_le_bytes().to_vec();
        with_size(&mut section, &compressed_slice(&self.field_sets)?);
        Ok(section)
    }

    /// The tree in depth-first order: for each path its number, its last part, and where its next sibling is: −2 it has neither child nor
    /// sibling, −1 a child follows and no sibling, 0 a sibling follows and no child, else a child follows, and the sibling as much later.
    fn paths_section(&self) -> Result<Vec<u8>> {
        let nodes = &self.paths.nodes;
        let mut columns: [Vec<i32>; 3] = Default::default();
        // (path, whether a sibling follows), or where the number of places to that sibling is still missing.
        enum Open {
            Path(u32, bool),
            Jump(usize),
        }
        let mut open = vec![Open::Path(0, false)];
        while let Some(next) = open.pop() {
            match next {
                Open::Jump(at) => columns[2][at] = (columns[0].len() - at) as i32,
                Open::Path(number, has_sibling) => {
                    let node = &nodes[number as usize];
                    let at = columns[0].len();
                    columns[0].push(number as i32);
                    columns[1].push(node.element);
                    columns[2].push(match (node.children.is_empty(), has_sibling) {
                        (true, false) => -2,
                        (true, true) => 0,
                        (false, _) => -1,
                    });
                    if has_sibling && !node.children.is_empty() {
                        open.push(Open::Jump(at));
                    }
                    let last = node.children.len().saturating_sub(1);
                    let children = node.children.iter().enumerate().rev();
                    open.extend(children.map(|(i, &child)| Open::Path(child, i < last)));
                }
            }
        }
        let count = (nodes.len() as u64).to_le_bytes();
        let mut section = [count, count].concat();
        columns.iter().try_for_each(|column| -> Result<()> {
            with_size(&mut section, &compressed_slice(column)?);
            Ok(())
        })?;
        Ok(section)
    }

    fn specs_section(&self) -> Result<Vec<u8>> {
        let mut section = (self.specs.len() as u64).to_le_bytes().to_vec();
        for column in 0..3 {
            let values: Vec<i32> = self.specs.iter().map(|spec| spec[column]).collect();
            with_size(&mut section, &compressed_slice(&values)?);
        }
        Ok(section)
    }
}

fn with_size(section: &mut Vec<u8>, bytes: &[u8]) {
    section.extend((bytes.len() as u64).to_le_bytes());
    section.extend(bytes);
}
