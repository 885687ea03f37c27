//! Fuzzes the reader of tables that join ids while a volume is read.
#![no_main]

use pumice_core::LabelType;
use pumice_formats::{OpenOptions, RawLayout};
use pumice_fuzz::{files, scratch, seeds};

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::relabel_tables), |input: &[u8]| {
    let (table, volume) = (scratch::path(".csv"), scratch::path(""));
    scratch::put(&table, input);
    scratch::put(&volume, &[1, 2, 3, 4, 5, 6, 7, 0]);
    let raw = RawLayout { dims: [2; 3], label_type: LabelType::U8, big_endian: false, offset: 0 };
    files::read_all(&volume, OpenOptions { raw: Some(raw), relabel: Some(table), ..OpenOptions::default() });
});
