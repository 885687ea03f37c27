//! Removes from a module what its specialisation constants rule out, before a driver sees it.
//!
//! ```text
//! header │ names, decorations │ types, constants │ functions
//!          of what is left      as they were       those that the entry points still call; in each, the blocks that can be reached
//! ```
//! A driver does the same, but only after it has copied every function into every place that calls it: for the path tracer that is twice
//! the instructions that a plain scene needs. Values stay as they are: only branches whose condition is known are replaced, so that what
//! is left computes the same bits.
//!
//! Known are constants, specialisation constants, comparisons and logic of known values, values of φ whose reachable sources agree, and
//! calls of functions all of whose reachable returns give the same known value. Operations, layout of instructions and the rules for
//! merge blocks: the SPIR-V specification 1.5, sections 2.3, 2.4, 2.11 and 3.32.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

const HEADER_WORDS: usize = 5;

/// Instructions that are read or written here and in `initialised`, by their numbers.
pub(super) mod op {
    macro_rules! numbers {
        ($($name:ident = $number:literal),+ $(,)?) => { $(pub(in super::super) const $name: u32 = $number;)+ };
    }
    numbers! {
        UNDEF = 1,
        NAME = 5,
        MEMBER_NAME = 6,
        STRING = 7,
        EXT_INST_IMPORT = 11,
        ENTRY_POINT = 15,
        TYPE_VOID = 19,
        TYPE_BOOL = 20,
        TYPE_INT = 21,
        TYPE_FLOAT = 22,
        TYPE_VECTOR = 23,
        TYPE_MATRIX = 24,
        TYPE_ARRAY = 28,
        TYPE_STRUCT = 30,
        TYPE_POINTER = 32,
        TYPE_FUNCTION = 33,
        TYPE_FORWARD_POINTER = 39,
        CONSTANT_TRUE = 41,
        CONSTANT_FALSE = 42,
        CONSTANT = 43,
        CONSTANT_NULL = 46,
        SPEC_CONSTANT = 50,
        SPEC_CONSTANT_OP = 52,
        FUNCTION = 54,
        FUNCTION_PARAMETER = 55,
        FUNCTION_END = 56,
        FUNCTION_CALL = 57,
        VARIABLE = 59,
        LOAD = 61,
        STORE = 62,
        DECORATE = 71,
        MEMBER_DECORATE = 72,
        LOGICAL_EQUAL = 164,
        LOGICAL_NOT_EQUAL = 165,
        LOGICAL_OR = 166,
        LOGICAL_AND = 167,
        LOGICAL_NOT = 168,
        SELECT = 169,
        I_EQUAL = 170,
        I_NOT_EQUAL = 171,
        BITWISE_OR = 197,
        PHI = 245,
        LOOP_MERGE = 246,
        SELECTION_MERGE = 247,
        LABEL = 248,
        BRANCH = 249,
        BRANCH_CONDITIONAL = 250,
        SWITCH = 251,
        RETURN = 253,
        RETURN_VALUE = 254,
        UNREACHABLE = 255,
        TYPE_RAY_QUERY = 4472,
        TYPE_ACCELERATION_STRUCTURE = 5341,
    }
}

const DECORATION_SPEC_ID: u32 = 1;

/// The module without what `constants` rule out, where `constants[i]` is specialisation constant i. Unchanged where it is not a valid
/// module, or holds something that is not understood.
pub(super) fn specialised<'a>(words: &'a [u32], constants: &[u32]) -> Cow<'a, [u32]> {
    Module::parse(words)
        .and_then(|module| module.without_dead_code(constants))
        .map_or(Cow::Borrowed(words), Cow::Owned)
}

/// One instruction, its first word included.
pub(super) type Line<'a> = &'a [u32];

pub(super) fn op_of(line: Line<'_>) -> u32 {
    line.first().map_or(0, |first| first & 0xFFFF)
}

/// A word of an instruction; 0, which is no id, where it has no such word.
pub(super) fn word(line: Line<'_>, at: usize) -> u32 {
    line.get(at).copied().unwrap_or(0)
}

struct Module<'a> {
    header: &'a [u32],
    /// All that stands before the first function.
    globals: Vec<Line<'a>>,
    functions: Vec<Function<'a>>,
}

struct Function<'a> {
    id: u32,
    /// `OpFunction` and the parameters.
    head: Vec<Line<'a>>,
    /// In an order in which every block follows those that dominate it.
    blocks: Vec<Block<'a>>,
}

struct Block<'a> {
    label: u32,
    /// What follows the label; the last is a branch or a return.
    lines: Vec<Line<'a>>,
}

/// Scalars of 32 bits, and booleans as 0 and 1, by id.
type Known = HashMap<u32, u32>;

impl<'a> Module<'a> {
    fn parse(words: &'a [u32]) -> Option<Self> {
        let (header, mut rest) = words.split_at_checked(HEADER_WORDS)?;
        let mut module = Self { header, globals: Vec::new(), functions: Vec::new() };
        let mut inside = false;
        while let Some(first) = rest.first() {
            let (line, after) =
                rest.split_at_checked((first >> 16) as usize).filter(|(line, _)| !line.is_empty())?;
            rest = after;
            match (op_of(line), inside) {
                (op::FUNCTION, false) => {
                    module.functions.push(Function {
                        id: word(line, 2),
                        head: vec![line],
                        blocks: Vec::new(),
                    });
                    inside = true;
                }
                (op::FUNCTION_END, true) => inside = false,
                (op::LABEL, true) => {
                    module
                        .functions
                        .last_mut()?
                        .blocks
                        .push(Block { label: word(line, 1), lines: Vec::new() });
                }
                (_, true) => {
                    let function = module.functions.last_mut()?;
                    function
                        .blocks
                        .last_mut()
                        .map_or(&mut function.head, |block| &mut block.lines)
                        .push(line);
                }
                (_, false) if module.functions.is_empty() => module.globals.push(line),
                _ => return None,
            }
        }
        let whole = module.functions.iter().flat_map(|f| &f.blocks).all(|block| !block.lines.is_empty());
        (!inside && whole).then_some(module)
    }

    fn without_dead_code(&self, constants: &[u32]) -> Option<Vec<u32>> {
        let places = self.functions.iter().enumerate().map(|(i, f)| (f.id, i)).collect();
        let (known, reached) = self.analysed(constants, &places);
        let called = self.called(&places, &reached)?;
        let (mut body, mut kept) = (Vec::new(), HashSet::new());
        for (function, reached) in self.functions.iter().zip(&reached).filter(|(f, _)| called.contains(&f.id))
        {
            function.write(reached, &known, &mut body, &mut kept)?;
        }
        let defined_in_bodies = self.functions.iter().flat_map(Function::lines).filter_map(defines);
        let global: HashSet<u32> = self.globals.iter().filter_map(|line| defines_globally(line)).collect();
        let removed: HashSet<u32> =
            defined_in_bodies.filter(|id| !kept.contains(id) && !global.contains(id)).collect();
        let mut words = self.header.to_vec();
        for line in &self.globals {
            let is_about =
                matches!(op_of(line), op::NAME | op::MEMBER_NAME | op::DECORATE | op::MEMBER_DECORATE);
            if !(is_about && removed.contains(&word(line, 1))) {
                words.extend_from_slice(line);
            }
        }
        words.extend(body);
        Some(words)
    }

    /// What is known, and for each function which of its blocks can be reached.
    fn analysed(&self, constants: &[u32], places: &HashMap<u32, usize>) -> (Known, Vec<Vec<bool>>) {
        let mut known = self.known_globally(constants);
        let (mut results, mut reached) = (HashMap::new(), vec![Vec::new(); self.functions.len()]);
        for i in self.callees_first(places) {
            let function = &self.functions[i];
            reached[i] = function.reached(&mut known, &results);
            if let Some(result) = function.result(&reached[i], &known) {
                results.insert(function.id, result);
            }
        }
        (known, reached)
    }

    fn known_globally(&self, constants: &[u32]) -> Known {
        let number = |line: &&Line<'a>| {
            let is_number = op_of(line) == op::DECORATE && word(line, 2) == DECORATION_SPEC_ID;
            is_number.then(|| (word(line, 1), word(line, 3) as usize))
        };
        let numbers: HashMap<u32, usize> = self.globals.iter().filter_map(|line| number(&line)).collect();
        let mut known = Known::new();
        for line in &self.globals {
            let value = match op_of(line) {
                op::CONSTANT_TRUE => Some(1),
                op::CONSTANT_FALSE => Some(0),
                op::CONSTANT if line.len() == 4 => Some(word(line, 3)),
                op::SPEC_CONSTANT if line.len() == 4 => {
                    numbers.get(&word(line, 2)).and_then(|&number| constants.get(number)).copied()
                }
                op::SPEC_CONSTANT_OP => folded(word(line, 3), line.get(4..).unwrap_or_default(), &known),
                _ => None,
            };
            value.map(|value| known.insert(word(line, 2), value));
        }
        known
    }

    /// Places of all functions, each after those that it calls.
    fn callees_first(&self, places: &HashMap<u32, usize>) -> Vec<usize> {
        let (mut order, mut seen) = (Vec::new(), vec![false; self.functions.len()]);
        let mut open: Vec<(usize, bool)> = (0..self.functions.len()).rev().map(|i| (i, false)).collect();
        while let Some((i, is_done)) = open.pop() {
            if is_done {
                order.push(i);
            } else if !std::mem::replace(&mut seen[i], true) {
                open.push((i, true));
                let callees = self.functions[i].lines().filter_map(callee).filter_map(|id| places.get(&id));
                open.extend(callees.map(|&callee| (callee, false)));
            }
        }
        order
    }

    /// Functions that are entry points or called from a block that can be reached. None where one is missing.
    fn called(&self, places: &HashMap<u32, usize>, reached: &[Vec<bool>]) -> Option<HashSet<u32>> {
        let entries = self.globals.iter().filter(|line| op_of(line) == op::ENTRY_POINT);
        let mut open: Vec<u32> = entries.map(|line| word(line, 2)).collect();
        let mut called = HashSet::new();
        while let Some(id) = open.pop() {
            let place = *places.get(&id)?;
            if called.insert(id) {
                let blocks = self.functions[place].reached_blocks(&reached[place]);
                open.extend(blocks.flat_map(|block| &block.lines).filter_map(|line| callee(line)));
            }
        }
        Some(called)
    }
}

impl<'a> Function<'a> {
    fn lines(&self) -> impl Iterator<Item = Line<'a>> {
        self.head.iter().chain(self.blocks.iter().flat_map(|block| &block.lines)).copied()
    }

    /// Which blocks can be reached. Adds to `known` what is found on the way.
    fn reached(&self, known: &mut Known, results: &HashMap<u32, u32>) -> Vec<bool> {
        let places: HashMap<u32, usize> = self.blocks.iter().enumerate().map(|(i, b)| (b.label, i)).collect();
        loop {
            let mut reached = vec![false; self.blocks.len()];
            let mut open = vec![0];
            while let Some(i) = open.pop() {
                if let Some(block) = self.blocks.get(i)
                    && !std::mem::replace(&mut reached[i], true)
                {
                    open.extend(block.targets(known).iter().filter_map(|label| places.get(label)));
                }
            }
            let before = known.len();
            for block in self.reached_blocks(&reached) {
                for line in &block.lines {
                    let value = match op_of(line) {
                        op::PHI => self.agreed(block, line, &reached, known),
                        op::FUNCTION_CALL => results.get(&word(line, 3)).copied(),
                        number => folded(number, line.get(3..).unwrap_or_default(), known),
                    };
                    value.map(|value| known.insert(word(line, 2), value));
                }
            }
            if known.len() == before {
                return reached;
            }
        }
    }

    fn reached_blocks(&self, reached: &[bool]) -> impl Iterator<Item = &Block<'a>> {
        self.blocks.iter().zip(reached).filter(|(_, reached)| **reached).map(|(block, _)| block)
    }

    /// The value on which all sources of a φ agree that can be reached.
    fn agreed(&self, block: &Block<'_>, phi: Line<'_>, reached: &[bool], known: &Known) -> Option<u32> {
        let mut values =
            self.sources(block, phi, reached, known).into_iter().map(|[id, _]| known.get(&id).copied());
        let first = values.next()??;
        values.all(|value| value == Some(first)).then_some(first)
    }

    /// The pairs of a φ (value, label of the block that it comes from) that can be reached.
    fn sources(&self, block: &Block<'_>, phi: Line<'_>, reached: &[bool], known: &Known) -> Vec<[u32; 2]> {
        let comes_from = |label: u32| {
            let mut from = self.reached_blocks(reached).filter(|from| from.label == label);
            from.any(|from| from.targets(known).contains(&block.label))
        };
        let (pairs, _) = phi.get(3..).unwrap_or_default().as_chunks::<2>();
        pairs.iter().filter(|[_, label]| comes_from(*label)).copied().collect()
    }

    /// The value that every reachable return gives.
    fn result(&self, reached: &[bool], known: &Known) -> Option<u32> {
        let ends = self.reached_blocks(reached).filter_map(|block| block.lines.last());
        let mut results =
            ends.filter(|end| op_of(end) == op::RETURN_VALUE).map(|end| known.get(&word(end, 1)).copied());
        let first = results.next()??;
        results.all(|result| result == Some(first)).then_some(first)
    }

    /// Appends the function without the blocks that cannot be reached, and notes the ids that it still defines.
    fn write(
        &self,
        reached: &[bool],
        known: &Known,
        out: &mut Vec<u32>,
        kept: &mut HashSet<u32>,
    ) -> Option<()> {
        let mut put = |line: Line<'_>| {
            out.extend_from_slice(line);
            kept.extend(defines(line));
        };
        // Merge blocks and continue targets that cannot be reached, but which a block names that can be: the language wants them.
        let mut merges = HashSet::new();
        let mut continues = HashMap::new();
        for block in self.reached_blocks(reached) {
            let is_decided = block.decided(known).is_some();
            for line in &block.lines {
                match op_of(line) {
                    op::LOOP_MERGE => {
                        merges.insert(word(line, 1));
                        continues.insert(word(line, 2), block);
                    }
                    op::SELECTION_MERGE if !is_decided => {
                        merges.insert(word(line, 1));
                    }
                    _ => {}
                }
            }
        }
        self.head.iter().for_each(|line| put(line));
        for (block, reached_itself) in self.blocks.iter().zip(reached) {
            let label = [2 << 16 | op::LABEL, block.label];
            if *reached_itself {
                put(&label);
                let decided = block.decided(known);
                for line in &block.lines {
                    match (op_of(line), decided) {
                        (op::SELECTION_MERGE, Some(_)) => {}
                        (op::BRANCH_CONDITIONAL, Some(target)) => put(&[2 << 16 | op::BRANCH, target]),
                        (op::PHI, _) => {
                            let sources = self.sources(block, line, reached, known);
                            let count = 3 + 2 * sources.len() as u32;
                            put(&[
                                &[count << 16 | op::PHI, word(line, 1), word(line, 2)],
                                sources.as_flattened(),
                            ]
                            .concat());
                        }
                        _ => put(line),
                    }
                }
            } else if let Some(header) = continues.get(&block.label) {
                // A φ of the header would need a value from here.
                if header.lines.iter().any(|line| op_of(line) == op::PHI) {
                    return None;
                }
                put(&label);
                put(&[2 << 16 | op::BRANCH, header.label]);
            } else if merges.contains(&block.label) {
                put(&label);
                put(&[1 << 16 | op::UNREACHABLE]);
            }
        }
        put(&[1 << 16 | op::FUNCTION_END]);
        Some(())
    }
}

impl Block<'_> {
    /// The only target of a branch whose condition is known.
    fn decided(&self, known: &Known) -> Option<u32> {
        let end = self.lines.last().filter(|end| op_of(end) == op::BRANCH_CONDITIONAL)?;
        known.get(&word(end, 1)).map(|&condition| word(end, if condition == 0 { 3 } else { 2 }))
    }

    /// Labels of the blocks that may follow.
    fn targets(&self, known: &Known) -> Vec<u32> {
        let Some(end) = self.lines.last() else { return Vec::new() };
        match op_of(end) {
            op::BRANCH => vec![word(end, 1)],
            op::BRANCH_CONDITIONAL => {
                self.decided(known).map_or_else(|| vec![word(end, 2), word(end, 3)], |target| vec![target])
            }
            // Default, then pairs of a literal and a label: no shader switches on more than 32 bits.
            op::SWITCH => {
                let labels = end.get(4..).unwrap_or_default().iter().step_by(2);
                std::iter::once(word(end, 2)).chain(labels.copied()).collect()
            }
            _ => Vec::new(),
        }
    }
}

/// The function that an instruction calls.
fn callee(line: Line<'_>) -> Option<u32> {
    (op_of(line) == op::FUNCTION_CALL).then(|| word(line, 3))
}

/// The id that an instruction of a function defines. For one that defines none it may be an operand, which is defined elsewhere.
fn defines(line: Line<'_>) -> Option<u32> {
    match op_of(line) {
        op::LABEL => line.get(1).copied(),
        op::SELECTION_MERGE => None,
        _ => line.get(2).copied(),
    }
}

/// The id of a type, a constant, a variable or an import. Other instructions before the first function define none, and their numbers may
/// be equal to an id: GLSL's version, for one.
fn defines_globally(line: Line<'_>) -> Option<u32> {
    match op_of(line) {
        op::STRING | op::EXT_INST_IMPORT | op::TYPE_RAY_QUERY | op::TYPE_ACCELERATION_STRUCTURE => {
            line.get(1).copied()
        }
        op::TYPE_VOID..=op::TYPE_FORWARD_POINTER => line.get(1).copied(),
        op::UNDEF | op::VARIABLE | op::CONSTANT_TRUE..=op::SPEC_CONSTANT_OP => line.get(2).copied(),
        _ => None,
    }
}

/// The result of an operation on known values, which may be known although only one of them is.
fn folded(number: u32, operands: &[u32], known: &Known) -> Option<u32> {
    let of = |at: usize| operands.get(at).and_then(|id| known.get(id)).copied();
    let (a, b) = (of(0), of(1));
    let both = || a.zip(b);
    match number {
        op::I_EQUAL | op::LOGICAL_EQUAL => both().map(|(a, b)| u32::from(a == b)),
        op::I_NOT_EQUAL | op::LOGICAL_NOT_EQUAL => both().map(|(a, b)| u32::from(a != b)),
        op::LOGICAL_OR if a == Some(1) || b == Some(1) => Some(1),
        op::LOGICAL_AND if a == Some(0) || b == Some(0) => Some(0),
        op::LOGICAL_OR | op::BITWISE_OR => both().map(|(a, b)| a | b),
        op::LOGICAL_AND => both().map(|(a, b)| a & b),
        op::LOGICAL_NOT => a.map(|a| 1 - a.min(1)),
        op::SELECT => of(if a? == 0 { 2 } else { 1 }),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
