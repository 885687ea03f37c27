//! Folders of chunks that are made of an input.
//!
//! ```text
//! input:  kind 1 B · bytes of the description 2 B · description, JSON · chunk          little-endian
//! ```
//! The chunk lies under each name that the first chunk of such a store may have.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::scratch;

/// Name of the description, and names of the first chunk, by kind.
const KINDS: [(&str, &[&str]); 5] = [
    (".zarray", &["0.0.0", "0/0/0"]),
    ("zarr.json", &["c/0/0/0"]),
    ("attributes.json", &["0/0/0"]),
    ("info", &["s/0-4_0-4_0-4", "s/0.shard"]),
    // A level of OME-Zarr: its own description is `LEVEL`.
    (".zattrs", &["0/0.0.0"]),
];

/// The array that a group of OME-Zarr describes.
const LEVEL: &str = r#"{"zarr_format":2,"shape":[4,4,4],"chunks":[4,4,4],"dtype":"<u2","compressor":null,"fill_value":0,"order":"C","filters":null}"#;

/// Makes the folder of an input, in place of that of the last one; `None` for an input that is too short.
///
/// # Panics
/// When it cannot be made, because then no input would be tested.
pub fn put(input: &[u8]) -> Option<PathBuf> {
    let (&kind, rest) = input.split_first()?;
    let (length, rest) = rest.split_first_chunk::<2>()?;
    let (description, chunk) = rest.split_at_checked(usize::from(u16::from_le_bytes(*length)))?;
    let folder = scratch::path(".store");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).unwrap();
    }
    let (name, chunks) = KINDS[usize::from(kind) % KINDS.len()];
    write(&folder.join(name), description);
    for name in chunks {
        write(&folder.join(name), chunk);
    }
    if name == ".zattrs" {
        write(&folder.join("0/.zarray"), LEVEL.as_bytes());
    }
    Some(folder)
}

fn write(path: &Path, bytes: &[u8]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}

/// Valid stores of each kind, with each compressor.
///
/// # Panics
/// When one cannot be made.
pub fn seeds() -> Vec<Vec<u8>> {
    let input = |kind: u8, description: &str, chunk: &[u8]| {
        let length = u16::try_from(description.len()).unwrap().to_le_bytes();
        [&[kind], &length[..], description.as_bytes(), chunk].concat()
    };
    let plain: Vec<u8> = (0..64u16).flat_map(|n| (n % 5).to_le_bytes()).collect();
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(&plain).unwrap();
    let gzip = gzip.finish().unwrap();
    let zstd = zstd::bulk::compress(&plain, 3).unwrap();
    let mut seeds = Vec::new();
    let v2 = |dtype: &str, compressor: &str, order: &str| {
        format!(
            r#"{{"zarr_format":2,"shape":[4,4,4],"chunks":[4,4,4],"dtype":"{dtype}","compressor":{compressor},"fill_value":0,"order":"{order}","filters":null}}"#
        )
    };
    seeds.push(input(0, &v2("<u2", "null", "C"), &plain));
    seeds.push(input(0, &v2(">i2", "null", "F"), &plain));
    seeds.push(input(0, &v2("<u2", r#"{"id":"gzip","level":1}"#, "C"), &gzip));
    seeds.push(input(0, &v2("<u2", r#"{"id":"zstd","level":1}"#, "C"), &zstd));
    // A frame of c-blosc that holds its bytes as they are: version 2, flag 2 (a copy), elements of 2 bytes.
    let blosc =
        [&[2, 1, 2, 2][..], &128u32.to_le_bytes(), &128u32.to_le_bytes(), &144u32.to_le_bytes(), &plain]
            .concat();
    let by = r#"{"id":"blosc","cname":"lz4","clevel":5,"shuffle":1,"blocksize":0}"#;
    seeds.push(input(0, &v2("<u2", by, "C"), &blosc));
    let v3 = |shape: &str, codecs: &str| {
        format!(
            r#"{{"zarr_format":3,"node_type":"array","shape":{shape},"data_type":"uint16","fill_value":0,"chunk_grid":{{"name":"regular","configuration":{{"chunk_shape":[4,4,4]}}}},"chunk_key_encoding":{{"name":"default","configuration":{{"separator":"/"}}}},"codecs":{codecs},"attributes":{{}},"dimension_names":["z","y","x"]}}"#
        )
    };
    let bytes = r#"{"name":"bytes","configuration":{"endian":"little"}}"#;
    let with = |codec: &str| v3("[4,4,4]", &format!("[{bytes},{codec}]"));
    seeds.push(input(1, &with(r#"{"name":"gzip","configuration":{"level":1}}"#), &gzip));
    seeds.push(input(1, &with(r#"{"name":"zstd","configuration":{"level":1,"checksum":false}}"#), &zstd));
    seeds.push(input(
        1,
        &v3("[4,4,4]", &format!(r#"[{{"name":"transpose","configuration":{{"order":[2,0,1]}}}},{bytes}]"#)),
        &plain,
    ));
    // A shard of 2 × 2 × 2 chunks, of which one is there, and no checksum of the index, so that changes of it are read.
    let sharding = format!(
        r#"[{{"name":"sharding_indexed","configuration":{{"chunk_shape":[2,2,2],"codecs":[{bytes}],"index_codecs":[{bytes}],"index_location":"end"}}}}]"#
    );
    let index: Vec<u8> =
        [[0, 16], [u64::MAX; 2]].iter().cycle().take(8).flatten().flat_map(|n| n.to_le_bytes()).collect();
    seeds.push(input(1, &v3("[4,4,4]", &sharding), &[&plain[..16], &index].concat()));
    let n5 = |compression: &str| {
        format!(
            r#"{{"dimensions":[4,4,4],"blockSize":[4,4,4],"dataType":"uint16","compression":{compression},"pixelResolution":[4,4,40]}}"#
        )
    };
    let header = [&0u16.to_be_bytes()[..], &3u16.to_be_bytes(), &[0, 0, 0, 4].repeat(3)].concat();
    for (compression, data) in [
        (r#"{"type":"raw"}"#, &plain),
        (r#"{"type":"gzip","level":1}"#, &gzip),
        (r#"{"type":"zstd","level":1}"#, &zstd),
        (r#"{"type":"blosc","cname":"lz4"}"#, &blosc),
    ] {
        seeds.push(input(2, &n5(compression), &[&header[..], data].concat()));
    }
    let precomputed = |data_type: &str, more: &str| {
        format!(
            r#"{{"type":"segmentation","data_type":"{data_type}","num_channels":1,"scales":[{{"key":"s","size":[4,4,4],"resolution":[4,4,40],"voxel_offset":[0,0,0],"chunk_sizes":[[4,4,4]],{more}}}]}}"#
        )
    };
    seeds.push(input(3, &precomputed("uint16", r#""encoding":"raw""#), &plain));
    seeds.push(input(3, &precomputed("uint16", r#""encoding":"raw""#), &gzip));
    // One block with a table of two ids of 32 bits, and an index of one bit a voxel.
    let words = [&[1u32, 2 + 16 | 1 << 24, 2][..], &[0x5555_5555; 16], &[7, 9]].concat();
    let compressed: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let block = r#""encoding":"compressed_segmentation","compressed_segmentation_block_size":[8,8,8]"#;
    seeds.push(input(3, &precomputed("uint32", block), &compressed));
    let compresso = r#""encoding":"compresso""#;
    seeds.push(input(3, &precomputed("uint16", compresso), include_bytes!("../seeds/chunk.cpso")));
    let sharding = r#""encoding":"raw","sharding":{"@type":"neuroglancer_uint64_sharded_v1","preshift_bits":0,"hash":"identity","minishard_bits":0,"shard_bits":0,"minishard_index_encoding":"raw","data_encoding":"raw"}"#;
    // The pair of the index, the chunk, and the index: id, begin, size.
    let shard = [
        &[128u64, 152].map(u64::to_le_bytes).concat()[..],
        &plain,
        &[0u64, 0, 128].map(u64::to_le_bytes).concat(),
    ]
    .concat();
    seeds.push(input(3, &precomputed("uint16", sharding), &shard));
    let image = r#"{"multiscales":[{"version":"0.4","axes":[{"name":"z","type":"space","unit":"micrometer"},{"name":"y","type":"space"},{"name":"x","type":"space"}],"datasets":[{"path":"0","coordinateTransformations":[{"type":"scale","scale":[4,1,1]},{"type":"translation","translation":[1,2,3]}]}]}],"image-label":{"colors":[{"label-value":3,"rgba":[1,2,3,4]}],"properties":[{"label-value":3,"name":"a"}]}}"#;
    seeds.push(input(4, image, &plain));
    seeds
}
