//! Small files with right checksums that stand for much more, written byte by byte from the descriptions of their formats.

use std::io::Write;

use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// A `.pumice` file (docs/file-format.md) of `side`³ voxels whose section `LIDS` decodes to `bytes` zeroes; it has no other section but
/// `INFO`.
pub(crate) fn pumice_with_labels(side: u32, bytes: usize) -> Vec<u8> {
    let info = format!(
        r#"{{"volume": {{"dims": [{side}, {side}, {side}], "label_type": "u8",
        "world_from_index": [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], "unit": "unknown", "frame": "unknown", "notes": []}}, "types": []}}"#
    );
    let ids = zstd::bulk::compress(&vec![0; bytes], 1).unwrap();
    let (mut table, mut body) = (Vec::new(), Vec::new());
    for (name, stored, decoded, zstd) in
        [(b"INFO", info.as_bytes(), info.len(), 0u8), (b"LIDS", ids.as_slice(), bytes, 1)]
    {
        let offset = (64 + 2 * 48 + body.len()) as u64;
        table.extend(name);
        table.extend([zstd, 1, 0, 0]);
        for value in [offset, stored.len() as u64, decoded as u64, xxh3_64(stored), 0] {
            table.extend(value.to_le_bytes());
        }
        body.extend(stored);
        body.resize(body.len().next_multiple_of(8), 0);
    }
    let mut file = b"\x89PUMICE\n".to_vec();
    file.extend([6u32, 0].map(u32::to_le_bytes).concat());
    file.extend([(64 + table.len() + body.len()) as u64, 64].map(u64::to_le_bytes).concat());
    file.extend([2u32, 1].map(u32::to_le_bytes).concat());
    file.extend([0; 16]);
    let mut hash = Xxh3::new();
    hash.update(&file);
    hash.update(&table);
    file.extend(hash.digest().to_le_bytes());
    [file, table, body].concat()
}

/// A PNG file (ISO/IEC 15948) of one black pixel with `text` as a compressed `iTXt` chunk of the keyword `pumice`.
pub(crate) fn png_with_text(text: &[u8]) -> Vec<u8> {
    let chunk = |name: &[u8; 4], data: &[u8]| {
        let mut crc = flate2::Crc::new();
        crc.update(&[&name[..], data].concat());
        [&(data.len() as u32).to_be_bytes()[..], name, data, &crc.sum().to_be_bytes()].concat()
    };
    let packed = |bytes: &[u8]| {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    };
    // Width, height, 8 bits of grey; a row of one pixel after its filter.
    let header = [&1u32.to_be_bytes()[..], &1u32.to_be_bytes(), &[8, 0, 0, 0, 0]].concat();
    // Keyword, compressed, by deflate, without language and translated keyword.
    let text = [b"pumice\0\x01\0\0\0", packed(text).as_slice()].concat();
    [
        b"\x89PNG\r\n\x1A\n".to_vec(),
        chunk(b"IHDR", &header),
        chunk(b"iTXt", &text),
        chunk(b"IDAT", &packed(&[0, 0])),
        chunk(b"IEND", &[]),
    ]
    .concat()
}
