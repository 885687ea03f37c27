//! Tests of the removal of dead code: modules assembled by hand, and the renderer's own shaders.

use super::*;
use crate::device::{Backend, Gpu, Instance, InstanceOptions, survey};

const HEADER: [u32; HEADER_WORDS] = [0x0723_0203, 0x0001_0500, 0, 100, 0];
const ENTRY: u32 = 50;
const VOID: u32 = 1;
const BOOL: u32 = 2;
const UINT: u32 = 3;
const ZERO: u32 = 5;
/// A specialisation constant, and what the module asks of it: whether it is not 0.
const NEEDS: u32 = 6;
const NEEDED: u32 = 7;
/// A value that is not known.
const OPEN: u32 = 8;

fn line(number: u32, operands: &[u32]) -> Vec<u32> {
    [&[(operands.len() as u32 + 1) << 16 | number], operands].concat()
}

/// A module whose functions have these lines, and a name for each of `named`.
fn module(named: &[u32], functions: &[Vec<u32>]) -> Vec<u32> {
    let mut words = [&HEADER[..], &line(op::ENTRY_POINT, &[5, ENTRY, 0x6E_69_61])].concat();
    // OpSource: language and version, which is also the number of a value.
    words.extend(line(3, &[2, 22]));
    named.iter().for_each(|id| words.extend(line(op::NAME, &[*id, 0x61])));
    words.extend(line(op::DECORATE, &[NEEDS, DECORATION_SPEC_ID, 1]));
    words.extend([[19, VOID], [20, BOOL]].iter().flat_map(|[number, id]| line(*number, &[*id])));
    words.extend(line(21, &[UINT, 32, 0]));
    words.extend(line(op::CONSTANT, &[UINT, ZERO, 0]));
    words.extend(line(op::SPEC_CONSTANT, &[UINT, NEEDS, 1]));
    words.extend(line(op::SPEC_CONSTANT_OP, &[BOOL, NEEDED, op::I_NOT_EQUAL, NEEDS, ZERO]));
    words.extend(line(1, &[BOOL, OPEN]));
    words.extend(functions.concat());
    words
}

fn function(id: u32, lines: &[Vec<u32>]) -> Vec<u32> {
    [line(op::FUNCTION, &[VOID, id, 0, 4]), lines.concat(), line(op::FUNCTION_END, &[])].concat()
}

fn label(id: u32) -> Vec<u32> {
    line(op::LABEL, &[id])
}

fn branch(to: u32) -> Vec<u32> {
    line(op::BRANCH, &[to])
}

fn branch_if(condition: u32, yes: u32, no: u32) -> Vec<u32> {
    line(op::BRANCH_CONDITIONAL, &[condition, yes, no])
}

fn merge(at: u32) -> Vec<u32> {
    line(op::SELECTION_MERGE, &[at, 0])
}

fn value(id: u32) -> Vec<u32> {
    line(197, &[UINT, id, 90, 91])
}

fn end() -> Vec<u32> {
    line(253, &[])
}

#[test]
fn a_branch_that_is_not_taken_goes_with_its_names() {
    let lines = |first: &[Vec<u32>], yes: &[Vec<u32>], no: &[Vec<u32>]| {
        function(ENTRY, &[first, yes, no, &[label(13), end()]].concat())
    };
    let yes = [label(11), value(21), branch(13)];
    let no = [label(12), value(22), branch(13)];
    let both = [label(10), merge(13), branch_if(NEEDED, 11, 12)];
    let whole = module(&[NEEDS, 21, 22], &[lines(&both, &yes, &no)]);
    let one = |to| [label(10), branch(to)];
    assert_eq!(*specialised(&whole, &[0, 1]), module(&[NEEDS, 21], &[lines(&one(11), &yes, &[])]));
    assert_eq!(*specialised(&whole, &[0, 0]), module(&[NEEDS, 22], &[lines(&one(12), &[], &no)]));
    // Without a value for the constant, and where the condition is another: as it was.
    assert_eq!(*specialised(&whole, &[0]), whole);
    let open = module(&[21], &[lines(&[label(10), merge(13), branch_if(OPEN, 11, 12)], &yes, &no)]);
    assert_eq!(*specialised(&open, &[0, 0]), open);
}

/// `needed && …` and `needed || …`, as the compiler writes them where the right-hand side takes work.
#[test]
fn logic_that_is_decided_by_one_side() {
    let and = |condition: &[Vec<u32>], right: &[Vec<u32>], sources: &[u32], after: &[Vec<u32>]| {
        let phi = line(op::PHI, &[&[BOOL, 30], sources].concat());
        function(ENTRY, &[&[label(10)], condition, right, &[label(12), phi], after].concat())
    };
    let test = [merge(12), branch_if(NEEDED, 11, 12)];
    let right = [label(11), line(op::LOGICAL_NOT, &[BOOL, 31, OPEN]), branch(12)];
    let after = [merge(14), branch_if(30, 13, 14), label(13), value(21), branch(14), label(14), end()];
    let whole = module(&[], &[and(&test, &right, &[NEEDED, 10, 31, 11], &after)]);
    let decided = [branch(14), label(14), end()];
    assert_eq!(
        *specialised(&whole, &[0, 0]),
        module(&[], &[and(&[branch(12)], &[], &[NEEDED, 10], &decided)])
    );
    assert_eq!(*specialised(&whole, &[0, 1]), module(&[], &[and(&[branch(11)], &right, &[31, 11], &after)]));
    // The other operations, each with what only one side decides.
    let known = Known::from([(1, 0), (2, 1), (3, 7)]);
    let results = [
        (op::LOGICAL_AND, &[1, 9][..], Some(0)),
        (op::LOGICAL_AND, &[9, 1], Some(0)),
        (op::LOGICAL_AND, &[2, 9], None),
        (op::LOGICAL_AND, &[2, 2], Some(1)),
        (op::LOGICAL_OR, &[9, 2], Some(1)),
        (op::LOGICAL_OR, &[1, 9], None),
        (op::LOGICAL_OR, &[1, 1], Some(0)),
        (op::LOGICAL_NOT, &[1], Some(1)),
        (op::LOGICAL_EQUAL, &[1, 2], Some(0)),
        (op::LOGICAL_NOT_EQUAL, &[1, 2], Some(1)),
        (op::I_EQUAL, &[3, 3], Some(1)),
        (op::I_EQUAL, &[3, 9], None),
        (op::BITWISE_OR, &[3, 2], Some(7)),
        (op::SELECT, &[2, 3, 9], Some(7)),
        (op::SELECT, &[1, 3, 9], None),
        (op::SELECT, &[9, 3, 3], None),
    ];
    for (number, operands, expected) in results {
        assert_eq!(folded(number, operands, &known), expected, "{number} of {operands:?}");
    }
}

/// A function whose every return says the same decides the branches of its callers; one that nobody calls any more goes.
#[test]
fn functions_that_say_a_constant_and_functions_that_nobody_calls() {
    let asks = |lines: &[Vec<u32>]| function(60, lines);
    let returns = |id| line(op::RETURN_VALUE, &[id]);
    let callee = asks(&[
        label(40),
        merge(42),
        branch_if(NEEDED, 41, 42),
        label(41),
        returns(OPEN),
        label(42),
        returns(NEEDED),
    ]);
    let work = function(61, &[label(43), value(23), end()]);
    let call = line(op::FUNCTION_CALL, &[BOOL, 32, 60]);
    let main = |lines: &[Vec<u32>]| function(ENTRY, &[&[label(10), call.clone()], lines].concat());
    let does = [label(11), line(op::FUNCTION_CALL, &[VOID, 33, 61]), branch(12)];
    let caller = main(&[&[merge(12), branch_if(32, 11, 12)], &does[..], &[label(12), end()]].concat());
    let whole = module(&[23, 61, 60], &[callee, work.clone(), caller.clone()]);
    let callee = asks(&[label(40), branch(42), label(42), returns(NEEDED)]);
    let expected = module(&[60], &[callee, main(&[branch(12), label(12), end()])]);
    assert_eq!(*specialised(&whole, &[0, 0]), expected);
    let callee = asks(&[label(40), branch(41), label(41), returns(OPEN)]);
    assert_eq!(*specialised(&whole, &[0, 1]), module(&[23, 61, 60], &[callee, work, caller]));
}

/// A loop that is left before it can repeat keeps its continue target, which the language wants, and a selection both of whose sides
/// return keeps its merge block.
#[test]
fn what_the_language_wants_stays() {
    let lines = |body: &[Vec<u32>], again: &[Vec<u32>], merged: &[Vec<u32>]| {
        let head =
            [label(10), branch(11), label(11), line(op::LOOP_MERGE, &[14, 13, 0]), branch(12), label(12)];
        function(ENTRY, &[&head, body, &[label(13)], again, &[branch(11), label(14)], merged].concat())
    };
    let open = [merge(17), branch_if(OPEN, 15, 16), label(15), end(), label(16), end(), label(17)];
    let body = [merge(18), branch_if(NEEDED, 18, 19), label(19), branch(13), label(18), branch(14)];
    let whole = module(&[24], &[lines(&body, &[value(24)], &[&open[..], &[value(25), end()]].concat())]);
    let unreachable = [&open[..], &[line(op::UNREACHABLE, &[])]].concat();
    let expected = module(&[], &[lines(&[branch(18), label(18), branch(14)], &[], &unreachable)]);
    assert_eq!(*specialised(&whole, &[0, 1]), expected);
    // A φ in the header would want a value from there: the module stays.
    let phi = [label(11), line(op::PHI, &[UINT, 34, ZERO, 10, 24, 13]), line(op::LOOP_MERGE, &[14, 13, 0])];
    let with_phi: Vec<u32> = {
        let plain = [label(11), line(op::LOOP_MERGE, &[14, 13, 0])].concat();
        let place = whole.windows(plain.len()).position(|w| w == plain).unwrap();
        [&whole[..place], &phi.concat(), &whole[place + plain.len()..]].concat()
    };
    assert_eq!(*specialised(&with_phi, &[0, 1]), with_phi);
}

/// What is no valid module stays unchanged, so that the driver is the one that refuses it.
#[test]
fn broken_modules_stay() {
    let whole = path(Backend::Compute);
    for length in (0..300).chain((300..whole.len()).step_by(997)) {
        assert_eq!(*specialised(&whole[..length], &[0; 22]), whole[..length], "{length} words");
    }
    for word in (0..whole.len()).step_by(4999) {
        let mut broken = whole.clone();
        for value in [0, 1, u32::MAX, 0x0001_0038, whole[word] ^ 0x0001_0000] {
            broken[word] = value;
            let _ = specialised(&broken, &[0; 22]);
        }
    }
}

/// The shaders of a backend by name, those for native doubles, the path first.
fn shaders(backend: Backend) -> Vec<(&'static str, Vec<u32>)> {
    macro_rules! spirv {
        ($($name:literal),*) => {
            vec![$(($name, &include_bytes!(concat!("../../../spirv/", $name, ".spv"))[..])),*]
        };
    }
    let all = match backend {
        Backend::Compute => spirv!["path_bvh.comp.f64", "first_bvh.comp.f64"],
        Backend::RayQuery => spirv!["path_query.comp.f64", "first_query.comp.f64"],
        Backend::RayPipeline => {
            spirv!["path.rgen.f64", "first.rgen.f64", "box.rint.f64", "nothing.rmiss"]
        }
    };
    let words =
        |bytes: &[u8]| bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect();
    all.into_iter().map(|(name, bytes)| (name, words(bytes))).collect()
}

fn path(backend: Backend) -> Vec<u32> {
    shaders(backend).swap_remove(0).1
}

/// How many instructions a driver has once it has copied each function to where it is called.
fn instructions(words: &[u32]) -> usize {
    let module = Module::parse(words).unwrap();
    let places: HashMap<u32, usize> = module.functions.iter().enumerate().map(|(i, f)| (f.id, i)).collect();
    let mut counts = vec![0; places.len()];
    for i in module.callees_first(&places) {
        let lines = module.functions[i].lines();
        counts[i] = lines.map(|line| 1 + callee(line).map_or(0, |id| counts[places[&id]])).sum();
    }
    counts.into_iter().max().unwrap()
}

#[test]
fn a_plain_scene_needs_less_than_half_of_a_path() {
    for backend in [Backend::Compute, Backend::RayQuery, Backend::RayPipeline] {
        let path = path(backend);
        let [all, none] = [1, 0].map(|needed| instructions(&specialised(&path, &[needed; 22])));
        println!(
            "{backend}: {} instructions, {all} with every part, {none} without any",
            instructions(&path)
        );
        assert!(all <= instructions(&path) && 2 * none < all, "{all} and {none}");
    }
}

/// The validation layer finds nothing wrong with any shader of the renderer, whatever a scene needs. A branch to nowhere is noticed.
#[test]
fn modules_are_valid_whatever_a_scene_needs() {
    let options = InstanceOptions { validation: true, ..InstanceOptions::default() };
    let instance = Instance::new(&options).expect("Vulkan with its validation layer");
    let devices = survey(&instance).expect("a list of devices");
    // Numerical Recipes' generator; what matters is only that the sets differ.
    let mut state = 1u32;
    let mut bits = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 12
    };
    for backend in [Backend::Compute, Backend::RayQuery, Backend::RayPipeline] {
        let candidate = devices.iter().find(|c| c.can(backend)).expect("a device");
        let gpu = Gpu::open(&instance, candidate, backend, None).expect("a device");
        let said = |words: &[u32], constants: &[u32]| {
            crate::device::compute::Module::new(&gpu, words, constants).expect("a module");
            instance.messages().take()
        };
        for (name, shader) in shaders(backend) {
            let random: [[u32; 22]; 8] =
                std::array::from_fn(|set| std::array::from_fn(|i| u32::from(bits() >> i & 7 <= set as u32)));
            for constants in random.into_iter().chain([[0; 22], [1; 22]]) {
                let specialised = specialised(&shader, &constants);
                assert!(matches!(specialised, Cow::Owned(_)), "{name} is understood");
                assert_eq!(said(&shader, &constants), Vec::<String>::new(), "{name} with {constants:?}");
            }
        }
        let mut broken = specialised(&path(backend), &[0; 22]).into_owned();
        let place = broken.iter().rposition(|word| *word == 2 << 16 | op::BRANCH).unwrap();
        broken[place + 1] += 1;
        assert_ne!(said(&broken, &[]), Vec::<String>::new(), "a branch to nowhere");
    }
}
