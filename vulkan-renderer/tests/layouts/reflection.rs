//! Reads from a compiled shader the structures that lie in memory: members, offsets, types, strides.
//!
//! A SPIR-V module is a header of five words, then instructions: the first word holds length and opcode, the operands follow (SPIR-V 1.5,
//! §2.3). Of the hundreds of instructions this reads the ten that describe layouts.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

const NAME: u32 = 5;
const MEMBER_NAME: u32 = 6;
const TYPE_INT: u32 = 21;
const TYPE_FLOAT: u32 = 22;
const TYPE_VECTOR: u32 = 23;
const TYPE_ARRAY: u32 = 28;
const TYPE_RUNTIME_ARRAY: u32 = 29;
const TYPE_STRUCT: u32 = 30;
const CONSTANT: u32 = 43;
const DECORATE: u32 = 71;
const MEMBER_DECORATE: u32 = 72;
const ARRAY_STRIDE: u32 = 6;
const OFFSET: u32 = 35;
const SPEC_ID: u32 = 1;
/// Instructions that name an id and do not read it: OpName, OpMemberName, OpSpecConstant, OpDecorate, OpMemberDecorate.
const NAMING: [u32; 5] = [NAME, MEMBER_NAME, 50, DECORATE, MEMBER_DECORATE];

/// A member of a structure: its name, its offset, and its type as Rust would write it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) offset: usize,
    pub(crate) shape: String,
}

/// A structure that has offsets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    pub(crate) name: String,
    pub(crate) fields: Vec<Field>,
    /// Offset of the end of its last member.
    pub(crate) end: usize,
    /// Strides of the unsized arrays that have it as their element.
    pub(crate) strides: Vec<usize>,
}

/// The decorations and types of a module, by id.
#[derive(Default)]
struct Module<'a> {
    names: BTreeMap<u32, String>,
    member_names: BTreeMap<(u32, u32), String>,
    offsets: BTreeMap<(u32, u32), usize>,
    strides: BTreeMap<u32, usize>,
    constants: BTreeMap<u32, u32>,
    types: BTreeMap<u32, (u32, &'a [u32])>,
}

fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).take_while(|&b| b != 0).collect();
    String::from_utf8(bytes).expect("a name in UTF-8")
}

/// The opcode of each instruction, and the range of its operands.
fn instructions(words: &[u32]) -> impl Iterator<Item = (u32, Range<usize>)> {
    let mut next = 5;
    std::iter::from_fn(move || {
        let first = words.get(next)?;
        let place = next + 1..next + (first >> 16) as usize;
        next = place.end;
        Some((first & 0xFFFF, place))
    })
}

/// Word positions of all offsets and strides in a module.
pub(crate) fn decorations(words: &[u32]) -> Vec<usize> {
    let found = instructions(words).filter_map(|(code, place)| match code {
        DECORATE if words[place.start + 1] == ARRAY_STRIDE => Some(place.start + 2),
        MEMBER_DECORATE if words[place.start + 2] == OFFSET => Some(place.start + 3),
        _ => None,
    });
    found.collect()
}

/// All structures of a module that lie in memory.
pub(crate) fn layouts(words: &[u32]) -> Vec<Layout> {
    assert_eq!(words[0], 0x0723_0203, "not SPIR-V");
    let mut module = Module::default();
    for (code, place) in instructions(words) {
        let at = &words[place];
        match code {
            NAME => drop(module.names.insert(at[0], text(&at[1..]))),
            MEMBER_NAME => drop(module.member_names.insert((at[0], at[1]), text(&at[2..]))),
            DECORATE if at[1] == ARRAY_STRIDE => drop(module.strides.insert(at[0], at[2] as usize)),
            MEMBER_DECORATE if at[2] == OFFSET => {
                module.offsets.insert((at[0], at[1]), at[3] as usize);
            }
            CONSTANT => drop(module.constants.insert(at[1], at[2])),
            TYPE_INT..=TYPE_VECTOR | TYPE_ARRAY..=TYPE_STRUCT => {
                module.types.insert(at[0], (code, &at[1..]));
            }
            _ => {}
        }
    }
    let structs = module.types.iter().filter(|(_, (code, _))| *code == TYPE_STRUCT);
    structs.filter_map(|(&id, (_, members))| module.layout(id, members)).collect()
}

impl Module<'_> {
    /// A structure; `None` where it has no offsets, because it does not lie in memory.
    fn layout(&self, id: u32, members: &[u32]) -> Option<Layout> {
        self.offsets.get(&(id, 0))?;
        let mut end = 0;
        let fields = (0..).zip(members).map(|(i, &member)| {
            let offset = self.offsets[&(id, i)];
            let (shape, bytes) = self.shape(member);
            end = end.max(offset + bytes);
            Field { name: self.member_names[&(id, i)].clone(), offset, shape }
        });
        let fields = fields.collect();
        let holds = |t: &(u32, &[u32])| t.0 == TYPE_RUNTIME_ARRAY && t.1[0] == id;
        let arrays = self.types.iter().filter(|(_, t)| holds(t));
        let strides = arrays.map(|(array, _)| self.strides[array]).collect();
        Some(Layout { name: self.names[&id].clone(), fields, end, strides })
    }

    /// A type as Rust would write it, and its size in bytes. The text mentions the stride of an array whose elements are not contiguous.
    fn shape(&self, id: u32) -> (String, usize) {
        let Some(&(code, at)) = self.types.get(&id) else { return (format!("type {id}"), 0) };
        match code {
            TYPE_INT => (format!("{}{}", if at[1] == 0 { 'u' } else { 'i' }, at[0]), at[0] as usize / 8),
            TYPE_FLOAT => (format!("f{}", at[0]), at[0] as usize / 8),
            TYPE_VECTOR => {
                let (of, bytes) = self.shape(at[0]);
                (format!("vector of {} {of}", at[1]), bytes * at[1] as usize)
            }
            TYPE_ARRAY => {
                let ((of, bytes), count) = (self.shape(at[0]), self.constants[&at[1]] as usize);
                let stride = self.strides[&id];
                let apart = if stride == bytes { String::new() } else { format!(", {stride} bytes apart") };
                (format!("[{of}; {count}{apart}]"), stride * count)
            }
            TYPE_STRUCT => {
                let end = self.layout(id, at).map_or(0, |l| l.end);
                (self.names[&id].clone(), end)
            }
            _ => (
                format!("array without an end of {}, {} bytes apart", self.shape(at[0]).0, self.strides[&id]),
                0,
            ),
        }
    }
}

/// The numbers of the specialisation constants that a module reads. (It declares others too.)
pub(crate) fn constants_read(words: &[u32]) -> BTreeSet<u32> {
    let mut numbers = BTreeMap::new();
    let mut read = BTreeSet::new();
    for (opcode, operands) in instructions(words) {
        match words[operands].split_first() {
            Some((&id, &[SPEC_ID, number])) if opcode == DECORATE => drop(numbers.insert(id, number)),
            Some((first, rest)) if !NAMING.contains(&opcode) => {
                read.extend(std::iter::once(first).chain(rest).filter_map(|id| numbers.get(id)).copied());
            }
            _ => {}
        }
    }
    read
}
