//! Writes a stage as text (`usda`).
//!
//! Numbers are the shortest that give the same bits back. The grammar: AOUSD Core Specification 1.0.1, section 16.2.

use std::io::Write;

use super::stage::{Attribute, Content, Prim, Property, Specifier, Stage, Variant, VariantSet};
use super::value::{Array, Element, Value};
use crate::Result;

/// Writes the stage.
///
/// # Errors
/// [`ExportError::Write`](crate::ExportError::Write) where `out` fails; those of whoever produces the arrays.
pub fn write_usda(stage: &Stage<'_>, out: &mut impl Write) -> Result<()> {
    let mut text = Text { out, depth: 0 };
    text.out.write_all(b"#usda 1.0\n(\n")?;
    text.depth = 1;
    if !stage.documentation.is_empty() {
        text.line(&format!("doc = {}", quoted(&stage.documentation)))?;
    }
    text.line(&format!("defaultPrim = {}", quoted(&stage.default_prim)))?;
    text.line("metersPerUnit = 1")?;
    text.line("upAxis = \"Z\"")?;
    text.depth = 0;
    text.line(")")?;
    for prim in &stage.prims {
        text.blank()?;
        text.prim(prim)?;
    }
    Ok(())
}

struct Text<'w, W> {
    out: &'w mut W,
    depth: usize,
}

impl<W: Write> Text<'_, W> {
    fn blank(&mut self) -> Result<()> {
        Ok(self.out.write_all(b"\n")?)
    }

    fn indent(&mut self) -> Result<()> {
        Ok(write!(self.out, "{:width$}", "", width = 4 * self.depth)?)
    }

    fn line(&mut self, text: &str) -> Result<()> {
        self.indent()?;
        self.out.write_all(text.as_bytes())?;
        self.blank()
    }

    /// Lines between braces, or other brackets, one step further in.
    fn block(&mut self, brackets: [&str; 2], inside: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        self.line(brackets[0])?;
        self.depth += 1;
        inside(self)?;
        self.depth -= 1;
        self.line(brackets[1])
    }

    fn prim(&mut self, prim: &Prim<'_>) -> Result<()> {
        let word = match prim.specifier {
            Specifier::Def => "def",
            Specifier::Class => "class",
        };
        let space = if prim.type_name.is_empty() { "" } else { " " };
        let head = format!("{word}{space}{} {}", prim.type_name, quoted(&prim.name));
        let metadata = metadata_of(prim);
        if metadata.is_empty() {
            self.line(&head)?;
        } else {
            self.block([&format!("{head} ("), ")"], |text| {
                metadata.iter().try_for_each(|line| text.line(line))
            })?;
        }
        self.block(["{", "}"], |text| {
            text.contents(&prim.properties, &prim.children)?;
            prim.variant_sets.iter().try_for_each(|set| text.variant_set(set))
        })
    }

    fn contents(&mut self, properties: &[Property<'_>], children: &[Prim<'_>]) -> Result<()> {
        properties.iter().try_for_each(|property| self.property(property))?;
        for (i, child) in children.iter().enumerate() {
            if i > 0 || !properties.is_empty() {
                self.blank()?;
            }
            self.prim(child)?;
        }
        Ok(())
    }

    fn variant_set(&mut self, set: &VariantSet<'_>) -> Result<()> {
        self.block([&format!("variantSet {} = {{", quoted(set.name)), "}"], |text| {
            set.variants.iter().try_for_each(|variant| text.variant(variant))
        })
    }

    fn variant(&mut self, variant: &Variant<'_>) -> Result<()> {
        self.block([&format!("{} {{", quoted(&variant.name)), "}"], |text| {
            text.contents(&variant.properties, &variant.children)
        })
    }

    fn property(&mut self, property: &Property<'_>) -> Result<()> {
        match &property.content {
            Content::Attribute(attribute) => self.attribute(&property.name, attribute),
            Content::Relationship(targets) => {
                self.line(&format!("rel {} = {}", property.name, paths(targets)))
            }
        }
    }

    fn attribute(&mut self, name: &str, attribute: &Attribute<'_>) -> Result<()> {
        let custom = if attribute.is_custom { "custom " } else { "" };
        let uniform = if attribute.is_uniform { "uniform " } else { "" };
        let head = format!("{custom}{uniform}{} {name}", attribute.type_name);
        if !attribute.connections.is_empty() {
            self.line(&format!("{head}.connect = {}", paths(&attribute.connections)))?;
            if attribute.value.is_none() {
                return Ok(());
            }
        }
        self.indent()?;
        self.out.write_all(head.as_bytes())?;
        if let Some(value) = &attribute.value {
            self.out.write_all(b" = ")?;
            self.value(value)?;
        }
        if attribute.interpolation.is_empty() {
            return self.blank();
        }
        self.out.write_all(b" (\n")?;
        self.depth += 1;
        self.line(&format!("interpolation = {}", quoted(attribute.interpolation)))?;
        self.depth -= 1;
        self.line(")")
    }

    fn value(&mut self, value: &Value<'_>) -> Result<()> {
        let text = match value {
            Value::Bool(b) => b.to_string(),
            Value::Int(i) => i.to_string(),
            Value::Float(f) => number(*f),
            Value::Double(d) => long_number(*d),
            Value::String(text) | Value::Token(text) => quoted(text),
            Value::Asset(path) => asset(path),
            Value::Float2(v) => tuple(v),
            Value::Float3(v) => tuple(v),
            Value::Matrix4(rows) => {
                let rows = rows.map(|row| format!("({})", row.map(long_number).join(", ")));
                format!("( {} )", rows.join(", "))
            }
            Value::Tokens(texts) => {
                format!("[{}]", texts.iter().map(|text| quoted(text)).collect::<Vec<_>>().join(", "))
            }
            Value::Array(array) => return self.array(array),
        };
        Ok(self.out.write_all(text.as_bytes())?)
    }

    fn array(&mut self, array: &Array<'_>) -> Result<()> {
        self.out.write_all(b"[")?;
        let (out, mut is_first) = (&mut *self.out, true);
        array.for_each_piece(&mut |bytes| {
            for element in bytes.chunks_exact(array.element().bytes()) {
                if !std::mem::take(&mut is_first) {
                    out.write_all(b", ")?;
                }
                let (words, _) = element.as_chunks::<4>();
                let float = |i: usize| f32::from_le_bytes(words[i]);
                match array.element() {
                    Element::Int => write!(out, "{}", i32::from_le_bytes(words[0]))?,
                    Element::Float => out.write_all(number(float(0)).as_bytes())?,
                    Element::Float3 => out.write_all(tuple(&[float(0), float(1), float(2)]).as_bytes())?,
                }
            }
            Ok(())
        })?;
        Ok(self.out.write_all(b"]")?)
    }
}

fn metadata_of(prim: &Prim<'_>) -> Vec<String> {
    let list = |names: Vec<&str>| names.into_iter().map(quoted).collect::<Vec<_>>().join(", ");
    let mut lines = Vec::new();
    if !prim.api_schemas.is_empty() {
        lines.push(format!("prepend apiSchemas = [{}]", list(prim.api_schemas.clone())));
    }
    if !prim.kind.is_empty() {
        lines.push(format!("kind = {}", quoted(prim.kind)));
    }
    if let Some(target) = &prim.payload {
        lines.push(format!("prepend payload = <{target}>"));
    }
    if !prim.variant_sets.is_empty() {
        lines.push("variants = {".into());
        let chosen = prim.variant_sets.iter().map(|set| (set.name, &set.selected));
        lines.extend(chosen.map(|(name, selected)| format!("    string {name} = {}", quoted(selected))));
        lines.push("}".into());
        let names: Vec<&str> = prim.variant_sets.iter().map(|set| set.name).collect();
        match names.as_slice() {
            [name] => lines.push(format!("prepend variantSets = {}", quoted(name))),
            _ => lines.push(format!("prepend variantSets = [{}]", list(names))),
        }
    }
    lines
}

fn paths(targets: &[String]) -> String {
    match targets {
        [target] => format!("<{target}>"),
        _ => {
            format!("[{}]", targets.iter().map(|target| format!("<{target}>")).collect::<Vec<_>>().join(", "))
        }
    }
}

/// The path of a file between signs of its own: `@…@`, or `@@@…@@@` where it has such a sign itself.
fn asset(path: &str) -> String {
    match path.contains('@') {
        false => format!("@{path}@"),
        true => format!("@@@{}@@@", path.replace("@@@", "\\@@@")),
    }
}

fn tuple(values: &[f32]) -> String {
    format!("({})", values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", "))
}

fn number(value: f32) -> String {
    shorter(value.to_string(), format!("{value:e}"))
}

fn long_number(value: f64) -> String {
    shorter(value.to_string(), format!("{value:e}"))
}

/// Without an exponent, unless that has many zeros.
fn shorter(plain: String, with_exponent: String) -> String {
    if plain.len() > with_exponent.len() + 6 { with_exponent } else { plain }
}

/// A text between quotation marks, with what would end it or the line written as an escape.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if (c as u32) < 32 || c == '\u{7f}' => out.push_str(&format!("\\x{:02x}", c as u32)),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
