//! A stage as a tree of values: what a file of either form says, and nothing of how it says it.
//!
//! The words are those of USD: a *prim* is a node of the tree, its *properties* are attributes and relationships; a *variant set* is a
//! choice between alternative contents of a prim.

use super::value::Value;

/// One file: metadata and the prims at its root.
#[derive(Debug, Default)]
pub struct Stage<'a> {
    /// What a program opens where nothing else is asked for: a prim at the root.
    pub default_prim: String,
    /// Human-readable text about the whole file.
    pub documentation: String,
    /// Prims at the root.
    pub prims: Vec<Prim<'a>>,
}

/// What a prim does with what other places say about it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Specifier {
    /// Defines it.
    #[default]
    Def,
    /// Defines what others refer to, and what is not drawn itself.
    Class,
}

/// A node of the tree.
#[derive(Debug, Default)]
pub struct Prim<'a> {
    /// Letters, digits and underscores, not a digit first ([`identifier`](super::identifier())).
    pub name: String,
    /// Its schema, such as `Mesh`; empty for none.
    pub type_name: &'static str,
    /// Definition or class.
    pub specifier: Specifier,
    /// Its place in a hierarchy of models, such as `component`; empty for none.
    pub kind: &'static str,
    /// Schemas in addition to its type, such as `MaterialBindingAPI`.
    pub api_schemas: Vec<&'static str>,
    /// A prim of the same file whose contents are loaded here on demand: its path.
    pub payload: Option<String>,
    /// Attributes and relationships.
    pub properties: Vec<Property<'a>>,
    /// Prims below.
    pub children: Vec<Prim<'a>>,
    /// Choices between contents.
    pub variant_sets: Vec<VariantSet<'a>>,
}

/// A choice between alternative contents of a prim.
#[derive(Debug)]
pub struct VariantSet<'a> {
    /// Its name.
    pub name: &'static str,
    /// The variant that is chosen unless somebody chooses another.
    pub selected: String,
    /// The alternatives.
    pub variants: Vec<Variant<'a>>,
}

/// One of the alternatives of a variant set.
#[derive(Debug, Default)]
pub struct Variant<'a> {
    /// Its name.
    pub name: String,
    /// What it adds to the prim.
    pub properties: Vec<Property<'a>>,
    /// Prims that it adds below.
    pub children: Vec<Prim<'a>>,
}

/// An attribute or a relationship of a prim.
#[derive(Debug)]
pub struct Property<'a> {
    /// Its name, with colons between namespaces.
    pub name: String,
    /// What it holds.
    pub content: Content<'a>,
}

/// What a property holds.
#[derive(Debug)]
pub enum Content<'a> {
    /// A value.
    Attribute(Attribute<'a>),
    /// Paths of other prims.
    Relationship(Vec<String>),
}

/// The value of an attribute, and how it is meant.
#[derive(Debug, Default)]
pub struct Attribute<'a> {
    /// USD's name of its type, such as `point3f[]`.
    pub type_name: &'static str,
    /// Whether it is of no schema.
    pub is_custom: bool,
    /// Whether it cannot vary over time.
    pub is_uniform: bool,
    /// Its value; none where it only says that it exists, or takes its value from elsewhere.
    pub value: Option<Value<'a>>,
    /// Of a primvar: what each of its values belongs to, such as `vertex`; empty for none.
    pub interpolation: &'static str,
    /// Paths of the attributes that it takes its value from.
    pub connections: Vec<String>,
}

impl<'a> Property<'a> {
    /// An attribute that a schema defines.
    pub fn new(name: impl Into<String>, type_name: &'static str, value: Value<'a>) -> Self {
        let attribute = Attribute { type_name, value: Some(value), ..Attribute::default() };
        Self { name: name.into(), content: Content::Attribute(attribute) }
    }

    /// As [`Property::new`], for an attribute that cannot vary over time.
    pub fn uniform(name: impl Into<String>, type_name: &'static str, value: Value<'a>) -> Self {
        Self::new(name, type_name, value).with(|attribute| attribute.is_uniform = true)
    }

    /// A primvar: values that are interpolated over a surface.
    pub fn primvar(
        name: &str,
        type_name: &'static str,
        interpolation: &'static str,
        value: Value<'a>,
    ) -> Self {
        Self::new(format!("primvars:{name}"), type_name, value)
            .with(|attribute| attribute.interpolation = interpolation)
    }

    /// An attribute of no schema.
    pub fn custom(name: impl Into<String>, type_name: &'static str, value: Value<'a>) -> Self {
        Self::new(name, type_name, value).with(|attribute| attribute.is_custom = true)
    }

    /// An output without a value of its own, such as that of a shader.
    pub fn output(name: impl Into<String>, type_name: &'static str) -> Self {
        let attribute = Attribute { type_name, ..Attribute::default() };
        Self { name: name.into(), content: Content::Attribute(attribute) }
    }

    /// An attribute that takes its value from another.
    pub fn connected(name: impl Into<String>, type_name: &'static str, to: String) -> Self {
        Self::output(name, type_name).with(|attribute| attribute.connections = vec![to])
    }

    /// A relationship.
    pub fn relationship(name: impl Into<String>, targets: Vec<String>) -> Self {
        Self { name: name.into(), content: Content::Relationship(targets) }
    }

    fn with(mut self, change: impl FnOnce(&mut Attribute<'a>)) -> Self {
        if let Content::Attribute(attribute) = &mut self.content {
            change(attribute);
        }
        self
    }
}
