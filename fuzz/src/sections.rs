//! Makes a `.pumice` file from arbitrary sections: offsets, lengths and checksums are correct whatever libFuzzer does to the sections.
//! Sections are not compressed, so that a changed byte changes an element.
//!
//! ```text
//! input:  name 4 B · element width 1 B · filters 1 B · length 2 B · bytes …      for each section, little-endian
//! ```

use crate::checksums::{ENTRY_BYTES, HEADER_BYTES};

/// Largest number of sections in a file.
const MOST_SECTIONS: usize = 64;

/// The file for an input. If the input ends early, the last section is shorter than its length says.
pub fn to_file(mut input: &[u8]) -> Vec<u8> {
    let mut sections: Vec<([u8; 4], [u8; 2], &[u8])> = Vec::new();
    while let Some((&[a, b, c, d, width, filters, low, high], rest)) = input.split_first_chunk::<8>() {
        if sections.len() == MOST_SECTIONS {
            break;
        }
        let (bytes, rest) = rest.split_at(usize::from(u16::from_le_bytes([low, high])).min(rest.len()));
        sections.push(([a, b, c, d], [width, filters], bytes));
        input = rest;
    }

    let mut file = Vec::from(*b"\x89PUMICE\n\x05\0\0\0\0\0\0\0");
    if sections.iter().any(|(name, ..)| name == b"VOXL") {
        // Marks a file of voxels instead of boxes.
        file[12] = 1;
    }
    file.resize(HEADER_BYTES + ENTRY_BYTES * sections.len(), 0);
    file[24..32].copy_from_slice(&(HEADER_BYTES as u64).to_le_bytes());
    file[32..36].copy_from_slice(&(sections.len() as u32).to_le_bytes());
    file[36..40].copy_from_slice(&1u32.to_le_bytes());
    for (i, (name, [width, filters], bytes)) in sections.iter().enumerate() {
        file.resize(file.len().next_multiple_of(8), 0);
        let at = HEADER_BYTES + ENTRY_BYTES * i;
        let (offset, length) = (file.len() as u64, bytes.len() as u64);
        file[at..at + 4].copy_from_slice(name);
        file[at + 4..at + 8].copy_from_slice(&[0, *width, *filters, 0]);
        for (field, value) in [offset, length, length].into_iter().enumerate() {
            file[at + 8 + 8 * field..at + 16 + 8 * field].copy_from_slice(&value.to_le_bytes());
        }
        file.extend_from_slice(bytes);
    }
    file.resize(file.len().next_multiple_of(8), 0);
    let length = file.len() as u64;
    file[16..24].copy_from_slice(&length.to_le_bytes());
    crate::checksums::set(&mut file);
    file
}

/// The input that gives a valid file's sections: decompressed, with filters still applied.
///
/// # Panics
/// When the file is invalid, or a section has 64 KiB or more.
pub fn from_file(file: &[u8]) -> Vec<u8> {
    let word = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize;
    let mut input = Vec::new();
    for i in 0..word(32) & 0xFFFF_FFFF {
        let at = HEADER_BYTES + ENTRY_BYTES * i;
        let stored = &file[word(at + 8)..][..word(at + 16)];
        let bytes = match file[at + 4] {
            0 => stored.to_vec(),
            _ => zstd::stream::decode_all(stored).unwrap(),
        };
        input.extend_from_slice(&file[at..at + 4]);
        input.extend_from_slice(&file[at + 5..at + 7]);
        input.extend_from_slice(&u16::try_from(bytes.len()).unwrap().to_le_bytes());
        input.extend(bytes);
    }
    input
}
