//! Fuzzes the readers of tables of labels; the content decides which one reads. A table that is read keeps its ids in every format.
#![no_main]

use pumice_formats::{LabelTableFormat, read_label_table, write_label_table};
use pumice_fuzz::{scratch, seeds};

libfuzzer_sys::fuzz_target!(init: seeds::give(seeds::label_tables), |input: &[u8]| {
    let path = scratch::path("");
    scratch::put(&path, input);
    let Ok(read) = read_label_table(&path) else { return };
    for format in LabelTableFormat::ALL {
        // Formats that need colours refuse a table without.
        if write_label_table(&path, format, &read.table).is_ok() {
            let back = read_label_table(&path).expect("what was written is read").table;
            let without_background = |ids: &[u64]| ids.iter().copied().filter(|&id| id != 0).collect::<Vec<_>>();
            assert_eq!(without_background(back.ids()), without_background(read.table.ids()));
        }
    }
});
