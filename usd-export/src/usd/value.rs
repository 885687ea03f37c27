//! Values of a stage, as both file forms take them. Long arrays are produced while they are written, so that memory never holds one.

use std::fmt;

use crate::Result;
use bytemuck::Pod;

/// Takes the elements of an array, some at a time.
pub type Sink<'s> = dyn FnMut(&[u8]) -> Result<()> + 's;

/// Produces all elements of an array, in order, each time it is called.
type Produce<'a> = dyn Fn(&mut Sink<'_>) -> Result<()> + Send + Sync + 'a;

/// Kinds of array elements: what USD stores, whatever its role (`point3f` and `color3f` are both three floats).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// `int`: `i32`.
    Int,
    /// `float`: `f32`.
    Float,
    /// `float3`: `[f32; 3]`.
    Float3,
}

impl Element {
    /// Bytes of one element.
    pub fn bytes(self) -> usize {
        match self {
            Self::Int | Self::Float => 4,
            Self::Float3 => 12,
        }
    }
}

/// A type of array elements.
pub trait ArrayElement: Pod {
    /// Its kind.
    const ELEMENT: Element;
}

impl ArrayElement for i32 {
    const ELEMENT: Element = Element::Int;
}

impl ArrayElement for f32 {
    const ELEMENT: Element = Element::Float;
}

impl ArrayElement for [f32; 3] {
    const ELEMENT: Element = Element::Float3;
}

/// An array whose elements are produced when they are written.
pub struct Array<'a> {
    element: Element,
    len: u64,
    produce: Box<Produce<'a>>,
}

impl<'a> Array<'a> {
    /// An array of `len` elements. `produce` hands all of them to its argument, in pieces of any size and the same each time.
    pub fn new<T: ArrayElement>(
        len: u64,
        produce: impl Fn(&mut dyn FnMut(&[T]) -> Result<()>) -> Result<()> + Send + Sync + 'a,
    ) -> Self {
        let produce =
            move |sink: &mut Sink<'_>| produce(&mut |piece: &[T]| sink(bytemuck::cast_slice(piece)));
        Self { element: T::ELEMENT, len, produce: Box::new(produce) }
    }

    /// An array that is in memory already.
    pub fn of<T: ArrayElement + Send + Sync>(values: Vec<T>) -> Self {
        Self::new(values.len() as u64, move |sink| sink(&values))
    }

    /// What its elements are.
    pub fn element(&self) -> Element {
        self.element
    }

    /// Number of elements.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether it has no elements.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Produces the elements as little-endian bytes.
    ///
    /// # Errors
    /// Those of `sink` and of whoever produces the elements.
    pub fn for_each_piece(&self, sink: &mut Sink<'_>) -> Result<()> {
        (self.produce)(sink)
    }

    /// Produces the elements as numbers, where they are `int`.
    pub(super) fn for_each_int(&self, sink: &mut dyn FnMut(&[i32]) -> Result<()>) -> Result<()> {
        self.for_each_piece(&mut |bytes| {
            let (words, _) = bytes.as_chunks::<4>();
            let ints: Vec<i32> = words.iter().map(|word| i32::from_le_bytes(*word)).collect();
            sink(&ints)
        })
    }
}

impl fmt::Debug for Array<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} × {:?}", self.len, self.element)
    }
}

/// The value of an attribute.
#[derive(Debug)]
pub enum Value<'a> {
    /// `bool`.
    Bool(bool),
    /// `int`.
    Int(i32),
    /// `float`.
    Float(f32),
    /// `double`.
    Double(f64),
    /// `string`.
    String(String),
    /// `token`.
    Token(String),
    /// `asset`: the path of a file, relative to the stage's, without control characters, which USD does not take.
    Asset(String),
    /// Two floats, such as `float2`.
    Float2([f32; 2]),
    /// Three floats, such as `color3f`.
    Float3([f32; 3]),
    /// `matrix4d`, by rows; a point is a row that is multiplied from the left.
    Matrix4([[f64; 4]; 4]),
    /// A short `token[]`.
    Tokens(Vec<String>),
    /// A long array.
    Array(Array<'a>),
}
