//! Damaged files of every format: truncated, with flipped bits, with overwritten bytes, with enormous numbers. Whatever the input, there
//! must be no panic, an error of one line, bounded blocks and bounded memory.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::fs;
use std::io::Write as _;
use std::path::Path;

use pumice_core::{LabelNote, LabelType, VolumeInfo};
use pumice_formats::write::write_volume;
use pumice_formats::{OpenOptions, RawLayout, open, probe};
use tempfile::TempDir;

/// Largest number of labels in one block: 16 MiB of one-byte labels.
const MAX_BLOCK_LABELS: usize = 16 << 20;

/// Limit on the memory of this process: two blocks of stored bytes and labels, floats that are being converted to labels (8 bytes for 1),
/// and a row of tiles or a header as large as a small file can claim. A reader that trusts a length needs gigabytes.
const MAX_MEMORY_KIB: u64 = 400 << 10;

/// Largest number of blocks that are read from one file; an undamaged sample has one.
const MAX_BLOCKS: usize = 64;

/// SplitMix64 (Steele, Lea, Flood 2014): reproducible, without a dependency.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// Reads a file to its end; returns the number of labels, or the error's one line.
fn swallow(path: &Path, options: &OpenOptions) -> Result<usize, String> {
    let _ = probe(path, options);
    let mut source = open(path, options).map_err(|e| e.to_string())?;
    let mut labels = 0;
    for _ in 0..MAX_BLOCKS {
        let Some(block) = source.next_block().map_err(|e| e.to_string())? else { break };
        assert!(block.labels.len() <= MAX_BLOCK_LABELS, "a block of {} labels", block.labels.len());
        assert_eq!(block.labels.len(), block.dims.iter().map(|&d| d as usize).product::<usize>());
        labels += block.labels.len();
    }
    Ok(labels)
}

/// Writes a small valid file of each format; returns names and options.
fn samples(folder: &Path) -> Vec<(String, OpenOptions)> {
    let dims = [9u32, 8, 7];
    let plain = OpenOptions::default;
    let mut all = Vec::new();
    for (label_type, name) in [
        (LabelType::U32, "a.nrrd"),
        (LabelType::I16, "a.npy"),
        (LabelType::F32, "a.nii"),
        (LabelType::U64, "a.nii.gz"),
        (LabelType::U16, "a.tif"),
    ] {
        let mut info = VolumeInfo::new(dims, label_type);
        info.notes.push(LabelNote { id: 1, name: Some("one".into()), color_srgb: Some([0.1, 0.2, 0.3]) });
        write_volume(&folder.join(name), &info, &mut |o, d| {
            let voxels = d.iter().map(|&v| u64::from(v)).product();
            Ok((0..voxels).map(|i| (i + u64::from(o[2])) % 99).collect())
        })
        .unwrap();
        all.push((name.to_owned(), plain()));
    }
    let voxels: Vec<u8> = (0..9 * 8 * 7).map(|i| (i % 99) as u8).collect();
    let mut put = |name: &str, parts: &[&[u8]], options: OpenOptions| {
        fs::write(folder.join(name), parts.concat()).unwrap();
        all.push((name.to_owned(), options));
    };
    let head = b"NRRD0005\ntype: uint8\ndimension: 4\nsizes: 9 2 4 7\nkinds: domain list domain domain\nspacings: 1 nan 2 3\n";
    let layer = OpenOptions { layer: Some(1), ..plain() };
    put(
        "layers.nrrd",
        &[head, b"encoding: raw\nSegment0_Name:=x\nSegment0_Layer:=1\n\n", &voxels],
        layer.clone(),
    );
    let text: Vec<String> = voxels.iter().map(u8::to_string).collect();
    put("text.nrrd", &[head, b"encoding: ascii\n\n", text.join(" ").as_bytes()], layer);
    fs::write(folder.join("d.raw"), &voxels).unwrap();
    put(
        "d.nhdr",
        &[b"NRRD0005\ntype: uint8\ndimension: 3\nsizes: 9 8 7\nencoding: raw\nbyte skip: -1\ndata file: d.raw\n"],
        plain(),
    );
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(&voxels).unwrap();
    let packed = encoder.finish().unwrap();
    let meta = format!(
        "ObjectType = Image\nNDims = 3\nCompressedData = True\nCompressedDataSize = {}\nElementSpacing = 1 2 3\nOffset = 0 0 0\n\
         DimSize = 9 8 7\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
        packed.len()
    );
    put("a.mha", &[meta.as_bytes(), &packed], plain());
    put("a.tif.ij.tif", &[&imagej(&voxels)], plain());
    put("a.npz", &[&stored_npz(&fs::read(folder.join("a.npy")).unwrap())], plain());
    let raw = RawLayout { dims: [9, 8, 7], label_type: LabelType::U8, big_endian: false, offset: 0 };
    put("a.raw", &[&voxels], OpenOptions { raw: Some(raw), ..plain() });
    all
}

/// ImageJ's form of large stacks: one big-endian directory for seven planes.
fn imagej(voxels: &[u8]) -> Vec<u8> {
    let text = b"ImageJ=1.54f\nimages=7\nslices=7\nunit=micron\nspacing=2.0\n\0";
    let mut file = b"MM\0*\0\0\0\x08\0\x09".to_vec();
    let text_at = 10 + 9 * 12 + 4;
    let voxels_at = text_at + text.len() as u32;
    for (tag, kind, count, value) in [
        (256u16, 4u16, 1u32, 9u32),
        (257, 4, 1, 8),
        (258, 4, 1, 8),
        (262, 4, 1, 1),
        (270, 2, text.len() as u32, text_at),
        (273, 4, 1, voxels_at),
        (277, 4, 1, 1),
        (278, 4, 1, 8),
        (279, 4, 1, 72),
    ] {
        file.extend(tag.to_be_bytes());
        file.extend(kind.to_be_bytes());
        file.extend(count.to_be_bytes());
        file.extend(value.to_be_bytes());
    }
    file.extend([0; 4]);
    file.extend(text);
    file.extend(voxels);
    file
}

/// A zip archive with one stored member (APPNOTE 4.3): local header, data, central directory, end record.
fn stored_npz(npy: &[u8]) -> Vec<u8> {
    let name = b"labels.npy";
    let crc = crc32fast::hash(npy).to_le_bytes();
    let size = (npy.len() as u32).to_le_bytes();
    let common =
        [&[20, 0, 0, 0, 0, 0, 0, 0, 0, 0][..], &crc, &size, &size, &[name.len() as u8, 0, 0, 0]].concat();
    let mut file = [b"PK\x03\x04", &common[..], name, npy].concat();
    let directory_at = file.len() as u32;
    file.extend([b"PK\x01\x02\x14\0", &common[..], &[0; 14], name].concat());
    let directory_bytes = file.len() as u32 - directory_at;
    file.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
    file.extend(directory_bytes.to_le_bytes());
    file.extend(directory_at.to_le_bytes());
    file.extend([0, 0]);
    file
}

/// Returns a damaged copy.
fn damage(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    // Half of the damage goes into the first 600 bytes, because wrong headers are the interesting cases.
    let within = |random: &mut Random, n: usize| {
        if random.below(2) == 0 { random.below(n.min(600)) } else { random.below(n) }
    };
    match random.below(5) {
        0 => bytes.truncate(within(random, bytes.len())),
        1 => {
            for _ in 0..=random.below(3) {
                let at = within(random, bytes.len());
                bytes[at] ^= 1 << random.below(8);
            }
        }
        2 => {
            for _ in 0..=random.below(8) {
                let at = within(random, bytes.len());
                bytes[at] = random.next() as u8;
            }
        }
        3 => {
            // Make binary numbers huge or negative.
            let at = within(random, bytes.len());
            let end = bytes.len().min(at + (1 << random.below(4)));
            bytes[at..end].fill([0xFF, 0x7F, 0x80, 0][random.below(4)]);
        }
        _ => {
            // Replace a digit of a number written as text by another number.
            let digits: Vec<usize> =
                (0..bytes.len().min(1500)).filter(|&i| bytes[i].is_ascii_digit()).collect();
            if !digits.is_empty() {
                let at = digits[random.below(digits.len())];
                let new: &[u8] = [
                    &b"0"[..],
                    b"99999999",
                    b"18446744073709551615",
                    b"99999999999999999999999",
                    b"-1",
                    b"nan",
                    b"1e999",
                    b"8388608",
                ][random.below(8)];
                bytes.splice(at..=at, new.iter().copied());
            }
        }
    }
    bytes
}

/// Peak resident memory in KiB, where the system reports it.
fn peak_kib() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|l| l.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok())
}

fn torture(rounds: usize, seed: u64) {
    let folder = TempDir::new().unwrap();
    let samples = samples(folder.path());
    let mut random = Random(seed);
    let (mut refused, mut read) = (0, 0);
    for (name, options) in &samples {
        let path = folder.path().join(name);
        let whole = fs::read(&path).unwrap();
        let voxels = 9 * 8 * 7 / if options.layer.is_some() { 2 } else { 1 };
        assert_eq!(swallow(&path, options), Ok(voxels), "the undamaged {name}");

        let damaged_path = folder.path().join(format!("damaged-{name}"));
        for round in 0..rounds {
            // Truncate to every length, or to as many as the rounds allow; then damage at random.
            let damaged = if round < whole.len().min(rounds / 4) {
                whole[..whole.len() * round / whole.len().min(rounds / 4)].to_vec()
            } else {
                damage(&whole, &mut random)
            };
            fs::write(&damaged_path, &damaged).unwrap();
            match swallow(&damaged_path, options) {
                Ok(_) => read += 1,
                Err(line) => {
                    refused += 1;
                    assert!(!line.is_empty() && !line.contains('\n'), "{name}, round {round}: {line:?}");
                }
            }
        }
        if let Some(peak) = peak_kib() {
            assert!(peak < MAX_MEMORY_KIB, "{name}: {peak} KiB of memory");
        }
    }
    // Some of the damage must be found, and some must not be visible.
    assert!(refused > rounds && read > rounds, "{refused} refused, {read} read");
}

#[test]
fn damaged_files_are_refused_in_one_line() {
    torture(400, 1);
}

#[test]
#[ignore = "full: ten times as many damaged files"]
fn many_damaged_files_are_refused_in_one_line() {
    torture(4_000, 2);
}

/// A file that ends early must never be read as a smaller volume or as zeros.
#[test]
fn files_that_end_early_are_refused() {
    let folder = TempDir::new().unwrap();
    for (name, options) in &samples(folder.path()) {
        // A text that ends in the middle of its last number is a valid shorter number, and a header line may lose its end.
        if name == "text.nrrd" || name == "d.nhdr" {
            continue;
        }
        let whole = fs::read(folder.path().join(name)).unwrap();
        // Test every length near both ends, where headers and directories are, and every 7th length between.
        let lengths = (0..whole.len()).filter(|&n| n < 400 || n + 400 > whole.len() || n % 7 == 0);
        let path = folder.path().join(format!("short-{name}"));
        for length in lengths {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(swallow(&path, options).is_err(), "{name} cut to {length} of {}", whole.len());
        }
    }
}

/// A control: the memory limit notices a reader that trusts a length. In a process of its own, because the peak stays, and other tests of
/// this one compare it with the limit.
#[test]
#[ignore = "full: takes a gigabyte"]
fn memory_bound_notices_a_trusted_length() {
    const IN_CHILD: &str = "PUMICE_TEST_TRUSTS_A_LENGTH";
    if std::env::var_os(IN_CHILD).is_some() {
        let trusted = vec![1u8; 1 << 30];
        assert!(trusted.iter().step_by(4096).all(|&b| b == 1));
        if let Some(peak) = peak_kib() {
            assert!(peak > MAX_MEMORY_KIB, "{peak} KiB");
        }
        return;
    }
    let name = "memory_bound_notices_a_trusted_length";
    let ran = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "--include-ignored", name])
        .env(IN_CHILD, "1")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ran.stdout);
    assert!(ran.status.success() && said.contains("1 passed"), "{said}");
}
