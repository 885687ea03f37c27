//! Gives every variable of a function a value where the function begins, so that no register keeps an old one.
//!
//! A driver copies functions into the loops that call them. A variable that gets its value only on some of the ways through its function
//! then seems to carry its value from the loop's iteration before, and so does a result that one of several returns gives: the compiler keeps it
//! in registers through the whole loop, for nothing. In the path tracer that was a hundred registers of each thread. Nothing else
//! depends on these values, since no shader reads what it has not written.
//!
//! ```text
//! %v = OpVariable Function                     %v = OpVariable Function %null
//!
//! %f = OpFunction T                            %f = OpFunction void
//!      …                                       %r = OpFunctionParameter (pointer to T)
//!      OpReturnValue %a                             OpStore %r %a, OpReturn
//!      …                            ─►              …
//!      OpReturnValue %b                             OpStore %r %b, OpReturn
//!
//! %c = OpFunctionCall T %f                          OpStore %t %null, OpFunctionCall void %f … %t
//!                                              %c = OpLoad T %t
//! ```
//! Left as they are: functions with one return; values that hold pointers or objects; values with an array of more than
//! [`MOST_ELEMENTS`], which lies in memory anyhow and costs time to fill. Instructions: the SPIR-V specification 1.5, section 3.32.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use super::specialised::{Line, op, op_of, word};

const HEADER_WORDS: usize = 5;
/// Word of the header that is greater than every id.
const BOUND: usize = 3;
/// Storage class of a function's variables.
const FUNCTION_STORAGE: u32 = 7;
const MOST_ELEMENTS: u32 = 16;
/// Deepest nesting of types that is looked into. (A type of a broken module may hold itself.)
const MOST_NESTED: u32 = 16;
/// Highest bound of ids of a module that is changed, so that there is room for more. Vulkan's own limit is 2²².
const HIGHEST_BOUND: u32 = 1 << 30;

/// The module with all such variables and results initialised. Unchanged where it is not a valid module.
pub(super) fn initialised(words: &[u32]) -> Cow<'_, [u32]> {
    Module::parse(words).and_then(Module::initialised).map_or(Cow::Borrowed(words), Cow::Owned)
}

struct Module<'a> {
    header: &'a [u32],
    /// All that stands before the first function.
    globals: Vec<Line<'a>>,
    /// Each from `OpFunction` to `OpFunctionEnd`.
    functions: Vec<Vec<Line<'a>>>,
    /// Types by id.
    types: HashMap<u32, Line<'a>>,
    /// Values of constants of 32 bits by id.
    lengths: HashMap<u32, u32>,
    void: u32,
    added: Added,
}

/// Types and constants that are added.
#[derive(Default)]
struct Added {
    lines: Vec<u32>,
    bound: u32,
    /// The constant of zeros of a type, the pointer to a type, and the type of a function by its result and parameters.
    nulls: HashMap<u32, u32>,
    pointers: HashMap<u32, u32>,
    signatures: HashMap<Vec<u32>, u32>,
}

fn put(out: &mut Vec<u32>, number: u32, operands: &[u32]) {
    out.push((operands.len() as u32 + 1) << 16 | number);
    out.extend_from_slice(operands);
}

impl Added {
    fn id(&mut self) -> u32 {
        self.bound += 1;
        self.bound - 1
    }

    fn null(&mut self, of: u32) -> u32 {
        if let Some(&known) = self.nulls.get(&of) {
            return known;
        }
        let id = self.id();
        put(&mut self.lines, op::CONSTANT_NULL, &[of, id]);
        self.nulls.insert(of, id);
        id
    }

    fn pointer(&mut self, to: u32) -> u32 {
        if let Some(&known) = self.pointers.get(&to) {
            return known;
        }
        let id = self.id();
        put(&mut self.lines, op::TYPE_POINTER, &[id, FUNCTION_STORAGE, to]);
        self.pointers.insert(to, id);
        id
    }

    fn signature(&mut self, result_and_parameters: Vec<u32>) -> u32 {
        if let Some(&known) = self.signatures.get(&result_and_parameters) {
            return known;
        }
        let id = self.id();
        put(&mut self.lines, op::TYPE_FUNCTION, &[&[id], &result_and_parameters[..]].concat());
        self.signatures.insert(result_and_parameters, id);
        id
    }
}

impl<'a> Module<'a> {
    fn parse(words: &'a [u32]) -> Option<Self> {
        let (header, mut rest) = words.split_at_checked(HEADER_WORDS)?;
        let (mut globals, mut functions) = (Vec::new(), Vec::<Vec<Line<'a>>>::new());
        let mut inside = false;
        while let Some(first) = rest.first() {
            let (line, after) =
                rest.split_at_checked((first >> 16) as usize).filter(|(line, _)| !line.is_empty())?;
            rest = after;
            match (op_of(line), inside) {
                (op::FUNCTION, false) => {
                    functions.push(vec![line]);
                    inside = true;
                }
                (number, true) => {
                    functions.last_mut()?.push(line);
                    inside = number != op::FUNCTION_END;
                }
                (_, false) if functions.is_empty() => globals.push(line),
                _ => return None,
            }
        }
        let is_type = |line: &&Line<'a>| (op::TYPE_VOID..=op::TYPE_FORWARD_POINTER).contains(&op_of(line));
        let types: HashMap<_, _> =
            globals.iter().filter(is_type).map(|line| (word(line, 1), *line)).collect();
        let constants = globals.iter().filter(|line| op_of(line) == op::CONSTANT && line.len() == 4);
        let lengths = constants.map(|line| (word(line, 2), word(line, 3))).collect();
        if header[BOUND] > HIGHEST_BOUND {
            return None;
        }
        let void = types.values().find(|line| op_of(line) == op::TYPE_VOID).map(|line| word(line, 1))?;
        let mut added = Added { bound: header[BOUND], ..Added::default() };
        for line in types.values() {
            match (op_of(line), word(line, 2)) {
                (op::TYPE_POINTER, FUNCTION_STORAGE) => {
                    added.pointers.insert(word(line, 3), word(line, 1));
                }
                (op::TYPE_FUNCTION, _) => {
                    added.signatures.insert(line.get(2..)?.to_vec(), word(line, 1));
                }
                _ => {}
            }
        }
        (!inside).then_some(Self { header, globals, functions, types, lengths, void, added })
    }

    /// Whether values of a type are numbers and truths alone, without a long array.
    fn is_plain(&self, of: u32) -> bool {
        self.is_plain_within(of, MOST_NESTED)
    }

    fn is_plain_within(&self, of: u32, levels: u32) -> bool {
        let (Some(line), Some(levels)) = (self.types.get(&of), levels.checked_sub(1)) else { return false };
        match op_of(line) {
            op::TYPE_BOOL | op::TYPE_INT | op::TYPE_FLOAT => true,
            op::TYPE_VECTOR | op::TYPE_MATRIX => self.is_plain_within(word(line, 2), levels),
            op::TYPE_ARRAY => {
                self.is_plain_within(word(line, 2), levels)
                    && self.lengths.get(&word(line, 3)).is_some_and(|&length| length <= MOST_ELEMENTS)
            }
            op::TYPE_STRUCT => line.iter().skip(2).all(|&member| self.is_plain_within(member, levels)),
            _ => false,
        }
    }

    fn initialised(mut self) -> Option<Vec<u32>> {
        let functions = std::mem::take(&mut self.functions);
        let several = |f: &&Vec<Line<'a>>| {
            let returns = f.iter().filter(|line| op_of(line) == op::RETURN_VALUE).count();
            returns > 1 && self.is_plain(word(f[0], 1))
        };
        let changed: HashSet<u32> = functions.iter().filter(several).map(|f| word(f[0], 2)).collect();
        let mut body = Vec::new();
        for function in &functions {
            self.write(function, &changed, &mut body)?;
        }
        let mut words = self.header.to_vec();
        words[BOUND] = self.added.bound;
        self.globals.iter().for_each(|line| words.extend_from_slice(line));
        words.extend(self.added.lines);
        words.extend(body);
        Some(words)
    }

    /// Appends a function. Those that are `changed` write their result to a parameter.
    fn write(&mut self, function: &[Line<'a>], changed: &HashSet<u32>, out: &mut Vec<u32>) -> Option<()> {
        let (mut lines, mut variables) = (Vec::new(), Vec::new());
        let (mut result, mut first_block) = (None, None);
        for line in function {
            match op_of(line) {
                op::FUNCTION if changed.contains(&word(line, 2)) => {
                    let to = self.added.pointer(word(line, 1));
                    let former = self.types.get(&word(line, 4))?.get(3..)?;
                    let signature = self.added.signature([&[self.void], former, &[to]].concat());
                    put(&mut lines, op::FUNCTION, &[self.void, word(line, 2), word(line, 3), signature]);
                    result = Some((to, self.added.id()));
                }
                op::LABEL if first_block.is_none() => {
                    if let Some((pointer, parameter)) = result {
                        put(&mut lines, op::FUNCTION_PARAMETER, &[pointer, parameter]);
                    }
                    lines.extend_from_slice(line);
                    first_block = Some(lines.len());
                }
                op::VARIABLE if line.len() == 4 => {
                    let of = word(self.types.get(&word(line, 1))?, 3);
                    if self.is_plain(of) {
                        let null = self.added.null(of);
                        put(&mut lines, op::VARIABLE, &[word(line, 1), word(line, 2), word(line, 3), null]);
                    } else {
                        lines.extend_from_slice(line);
                    }
                }
                op::RETURN_VALUE if result.is_some() => {
                    put(&mut lines, op::STORE, &[result?.1, word(line, 1)]);
                    put(&mut lines, op::RETURN, &[]);
                }
                op::FUNCTION_CALL if changed.contains(&word(line, 3)) => {
                    let (of, value) = (word(line, 1), word(line, 2));
                    let (pointer, null) = (self.added.pointer(of), self.added.null(of));
                    let (variable, nothing) = (self.added.id(), self.added.id());
                    put(&mut variables, op::VARIABLE, &[pointer, variable, FUNCTION_STORAGE, null]);
                    put(&mut lines, op::STORE, &[variable, null]);
                    let call = [&[self.void, nothing], line.get(3..)?, &[variable]].concat();
                    put(&mut lines, op::FUNCTION_CALL, &call);
                    put(&mut lines, op::LOAD, &[of, value, variable]);
                }
                _ => lines.extend_from_slice(line),
            }
        }
        // Variables stand at the beginning of the first block.
        let (head, rest) = lines.split_at_checked(first_block?)?;
        [head, &variables, rest].iter().for_each(|part| out.extend_from_slice(part));
        Some(())
    }
}

#[cfg(test)]
mod tests;
