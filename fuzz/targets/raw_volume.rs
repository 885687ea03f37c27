//! Fuzzes the reader of voxels without a header, with an arbitrary layout.
//!
//! ```text
//! input:  dims 3 × 4 B · type 1 B · big-endian 1 B · offset 2 B · file …       little-endian
//! ```
#![no_main]

use pumice_core::LabelType;
use pumice_formats::{OpenOptions, RawLayout};
use pumice_fuzz::{files, scratch, seeds};

const TYPES: [LabelType; 10] = [
    LabelType::U8,
    LabelType::U16,
    LabelType::U32,
    LabelType::U64,
    LabelType::I8,
    LabelType::I16,
    LabelType::I32,
    LabelType::I64,
    LabelType::F32,
    LabelType::F64,
];

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::raw_volumes), |input: &[u8]| {
    let Some((head, file)) = input.split_first_chunk::<16>() else { return };
    let dims = [0, 4, 8].map(|at| u64::from(u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]])));
    let layout = RawLayout {
        dims,
        label_type: TYPES[usize::from(head[12]) % TYPES.len()],
        big_endian: head[13] & 1 != 0,
        offset: u16::from_le_bytes([head[14], head[15]]).into(),
    };
    let path = scratch::path("");
    scratch::put(&path, file);
    files::read_all(&path, OpenOptions { raw: Some(layout), ..OpenOptions::default() });
});
