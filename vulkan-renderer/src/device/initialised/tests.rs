//! Tests of initialised variables: modules assembled by hand. That the results are valid is tested with the renderer's own shaders, by the
//! validation layer (`specialised/tests.rs`), and that they compute the same by the comparisons with the CPU in `tests`.

use super::*;

const ENTRY: u32 = 50;
const VOID: u32 = 1;
const UINT: u32 = 2;
const PLAIN: u32 = 3;
const LONG: u32 = 4;
const POINTER: u32 = 5;
/// Pointers to variables of these types.
const TO_UINT: u32 = 12;
const TO_PLAIN: u32 = 13;
const TO_LONG: u32 = 14;
const TO_POINTER: u32 = 15;
const MAIN: u32 = 20;
const ASKS: u32 = 21;
const BOUND_OF_MODULE: u32 = 100;

fn line(number: u32, operands: &[u32]) -> Vec<u32> {
    let mut out = Vec::new();
    put(&mut out, number, operands);
    out
}

/// A module with types, `more` before the functions, and the functions.
fn module(bound: u32, more: &[Vec<u32>], functions: &[Vec<u32>]) -> Vec<u32> {
    let globals = [
        line(op::ENTRY_POINT, &[5, ENTRY, 0x6E_69_61]),
        line(op::TYPE_VOID, &[VOID]),
        line(op::TYPE_INT, &[UINT, 32, 0]),
        line(op::CONSTANT, &[UINT, 30, 16]),
        line(op::CONSTANT, &[UINT, 31, 17]),
        line(op::TYPE_ARRAY, &[32, UINT, 30]),
        line(op::TYPE_STRUCT, &[PLAIN, UINT, 32]),
        line(op::TYPE_ARRAY, &[33, UINT, 31]),
        line(op::TYPE_STRUCT, &[LONG, UINT, 33]),
        // A pointer to a buffer.
        line(op::TYPE_POINTER, &[POINTER, 5349, UINT]),
        line(op::TYPE_POINTER, &[TO_UINT, FUNCTION_STORAGE, UINT]),
        line(op::TYPE_POINTER, &[TO_PLAIN, FUNCTION_STORAGE, PLAIN]),
        line(op::TYPE_POINTER, &[TO_LONG, FUNCTION_STORAGE, LONG]),
        line(op::TYPE_POINTER, &[TO_POINTER, FUNCTION_STORAGE, POINTER]),
        line(op::TYPE_FUNCTION, &[MAIN, VOID]),
        line(op::TYPE_FUNCTION, &[ASKS, UINT, UINT]),
    ];
    let header = [0x0723_0203, 0x0001_0500, 0, bound, 0];
    [&header[..], &globals.concat(), &more.concat(), &functions.concat()].concat()
}

fn function(of: u32, id: u32, signature: u32, lines: &[Vec<u32>]) -> Vec<u32> {
    [line(op::FUNCTION, &[of, id, 0, signature]), lines.concat(), line(op::FUNCTION_END, &[])].concat()
}

fn label(id: u32) -> Vec<u32> {
    line(op::LABEL, &[id])
}

#[test]
fn variables_begin_as_zero_but_for_pointers_and_long_arrays() {
    let variable =
        |of: u32, id: u32, rest: &[u32]| line(op::VARIABLE, &[&[of, id, FUNCTION_STORAGE], rest].concat());
    let main = |uint: &[u32], plain: &[u32]| {
        function(
            VOID,
            ENTRY,
            MAIN,
            &[
                label(60),
                variable(TO_UINT, 61, uint),
                variable(TO_PLAIN, 62, plain),
                variable(TO_LONG, 63, &[]),
                variable(TO_POINTER, 64, &[]),
                variable(TO_UINT, 65, uint),
                // This one has a value of its own.
                variable(TO_UINT, 66, &[30]),
                line(op::RETURN, &[]),
            ],
        )
    };
    let whole = module(BOUND_OF_MODULE, &[], &[main(&[], &[])]);
    let nulls = [line(op::CONSTANT_NULL, &[UINT, 100]), line(op::CONSTANT_NULL, &[PLAIN, 101])];
    assert_eq!(*initialised(&whole), module(102, &nulls, &[main(&[100], &[101])]));
}

#[test]
fn results_of_several_returns_are_written_to_a_parameter() {
    let branches = |yes: &[Vec<u32>], no: &[Vec<u32>]| {
        let test = [line(op::SELECTION_MERGE, &[73, 0]), line(op::BRANCH_CONDITIONAL, &[74, 71, 72])];
        let end = [label(73), line(op::UNREACHABLE, &[])];
        [&[label(70)], &test[..], &[label(71)], yes, &[label(72)], no, &end].concat()
    };
    let given = line(op::FUNCTION_PARAMETER, &[UINT, 74]);
    let gives = |id| [line(op::RETURN_VALUE, &[id])];
    let callee = [std::slice::from_ref(&given), &branches(&gives(30), &gives(31))].concat();
    let one = [given.clone(), label(80), line(op::RETURN_VALUE, &[74])];
    let call = |of: u32| line(op::FUNCTION_CALL, &[UINT, 90, of, 30]);
    let main = |lines: &[Vec<u32>]| function(VOID, ENTRY, MAIN, &[lines, &[line(op::RETURN, &[])]].concat());
    let whole = module(
        BOUND_OF_MODULE,
        &[],
        &[
            function(UINT, 51, ASKS, &callee),
            function(UINT, 52, ASKS, &one),
            main(&[label(60), call(51), call(52)]),
        ],
    );
    let added = [line(op::TYPE_FUNCTION, &[100, VOID, UINT, TO_UINT]), line(op::CONSTANT_NULL, &[UINT, 102])];
    let stores = |id| [line(op::STORE, &[101, id]), line(op::RETURN, &[])];
    let written = line(op::FUNCTION_PARAMETER, &[TO_UINT, 101]);
    let changed = [&[given, written], &branches(&stores(30), &stores(31))[..]].concat();
    let called = [
        label(60),
        line(op::VARIABLE, &[TO_UINT, 103, FUNCTION_STORAGE, 102]),
        line(op::STORE, &[103, 102]),
        line(op::FUNCTION_CALL, &[VOID, 104, 51, 30, 103]),
        line(op::LOAD, &[UINT, 90, 103]),
        call(52),
    ];
    let expected = module(
        105,
        &added,
        &[function(VOID, 51, 100, &changed), function(UINT, 52, ASKS, &one), main(&called)],
    );
    assert_eq!(*initialised(&whole), expected);
}

/// What is no valid module stays unchanged, so that the driver is the one that refuses it.
#[test]
fn broken_modules_stay() {
    let one = function(UINT, 51, ASKS, &[label(70), line(op::RETURN_VALUE, &[30])]);
    let whole = module(BOUND_OF_MODULE, &[], &[one]);
    for length in 0..whole.len() {
        // A module that ends before its functions, and after its first type, is one without functions.
        if let Cow::Owned(words) = initialised(&whole[..length]) {
            assert_eq!(words, whole[..length], "{length} words");
        }
    }
    for place in 0..whole.len() {
        for value in [0, 1, u32::MAX, 0x0001_0038, whole[place] ^ 0x0001_0000] {
            let mut broken = whole.clone();
            broken[place] = value;
            let _ = initialised(&broken);
        }
    }
}
