//! Corrects the checksums of a damaged `.pumice` file (`docs/file-format.md`), so that the damage reaches the code behind them.

use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// Size of the header in bytes.
pub const HEADER_BYTES: usize = 64;
/// Size of an entry of the section table in bytes.
pub const ENTRY_BYTES: usize = 48;

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    bytes[at..at + 8].iter().rev().fold(0, |v, &b| v << 8 | u64::from(b))
}

/// Sets the checksums of all sections that lie within the file, then that of header and table.
pub fn set(bytes: &mut [u8]) {
    if bytes.len() < HEADER_BYTES {
        return;
    }
    let count = (u64_at(bytes, 32) as u32).min(64) as usize;
    let table = (HEADER_BYTES + ENTRY_BYTES * count).min(bytes.len());
    for entry in 0..(table - HEADER_BYTES) / ENTRY_BYTES {
        let at = HEADER_BYTES + ENTRY_BYTES * entry;
        let (offset, stored) = (u64_at(bytes, at + 8), u64_at(bytes, at + 16));
        let end = offset.saturating_add(stored);
        if let Some(section) = bytes.get(offset as usize..end as usize) {
            let sum = xxh3_64(section);
            bytes[at + 32..at + 40].copy_from_slice(&sum.to_le_bytes());
        }
    }
    set_header(bytes, table);
}

/// Sets the content hash, then the checksum of header and table.
pub fn set_content_hash(bytes: &mut [u8], hash: u128) {
    bytes[40..56].copy_from_slice(&hash.to_le_bytes());
    let count = (u64_at(bytes, 32) as u32) as usize;
    set_header(bytes, HEADER_BYTES + ENTRY_BYTES * count);
}

fn set_header(bytes: &mut [u8], table: usize) {
    let mut hash = Xxh3::new();
    hash.update(&bytes[..56]);
    hash.update(&bytes[HEADER_BYTES..table]);
    let sum = hash.digest();
    bytes[56..64].copy_from_slice(&sum.to_le_bytes());
}
