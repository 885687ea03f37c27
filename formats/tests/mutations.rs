//! Damaged files of every kind give an error or a volume, never a panic and never memory that the file cannot back.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod files;

use files::*;
use pumice_formats::{OpenOptions, probe};

/// A small generator (Marsaglia 2003, xorshift64): the damage must be the same on every run.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % n
    }
}

/// One good file of each kind.
fn good_files() -> Vec<(&'static str, Vec<u8>)> {
    let bytes = integers(&labels(), 1, false);
    let nifti = |version, big_endian| {
        let mut header = Nifti::new(version, big_endian, 2);
        header.qform([0.5, 0.5, 0.5], [1.0, 2.0, 3.0]);
        header.file(&bytes)
    };
    let array = npy(1, "{'descr': '|u1', 'fortran_order': False, 'shape': (3, 4, 5), }\n", &bytes);
    let extra = "ElementSpacing = 1 2 3\nTransformMatrix = 0 1 0 0 0 1 1 0 0\nOffset = 4 5 6\n";
    vec![
        ("a.nii", nifti(1, false)),
        ("b.nii", nifti(2, true)),
        ("c.nii.gz", gzip(&nifti(1, false))),
        ("d.npy", array.clone()),
        ("e.npz", zip(&[("a.npy", array.clone())], false)),
        ("f.npz", zip(&[("a.npy", array.clone()), ("s.npy", vec![1, 2, 3])], true)),
        ("g.mha", [meta("MET_UCHAR", extra, "LOCAL").as_bytes(), &bytes].concat()),
        ("h.mha", [meta("MET_UCHAR", "BinaryData = False\n", "LOCAL").as_bytes(), b"1 2 3"].concat()),
    ]
}

#[test]
fn damaged_files_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let (mut opened, mut refused) = (0, 0);
    let mut attempt = |name: &str, bytes: &[u8]| {
        let path = write(folder.path(), name, bytes);
        // Only that it returns, and in one line, is asked for.
        let _ = probe(&path, &OpenOptions::default());
        match read(&path, &OpenOptions::default()) {
            Ok(_) => opened += 1,
            Err(_) => refused += 1,
        }
    };
    for (name, good) in good_files() {
        for length in 0..good.len() {
            attempt(name, &good[..length]);
        }
        for _ in 0..1500 {
            let mut bytes = good.clone();
            match random.below(4) {
                0 => {
                    let at = random.below(bytes.len());
                    bytes[at] ^= 1 << random.below(8);
                }
                1 => {
                    for _ in 0..=random.below(8) {
                        let at = random.below(bytes.len());
                        bytes[at] = random.below(256) as u8;
                    }
                }
                // Absurd numbers: runs of 0xFF, 0x7F or '9'.
                2 => {
                    let at = random.below(bytes.len());
                    let end = bytes.len().min(at + 1 + random.below(8));
                    bytes[at..end].fill([0xFF, 0x7F, b'9', 0x80][random.below(4)]);
                }
                _ => {
                    let at = random.below(bytes.len());
                    let end = bytes.len().min(at + 1 + random.below(32));
                    bytes.drain(at..end);
                }
            }
            attempt(name, &bytes);
        }
    }
    // Damage to voxels alone is no error in formats without a checksum, damage to headers mostly is: both must have occurred.
    assert!(opened > 500 && refused > 2000, "{opened} opened, {refused} refused");
}

#[test]
fn truncation_is_always_noticed() {
    let folder = tempfile::tempdir().unwrap();
    for (name, good) in good_files() {
        if name == "h.mha" || name == "f.npz" {
            continue;
        }
        assert!(read(&write(folder.path(), name, &good), &OpenOptions::default()).is_ok(), "{name}");
        for length in 0..good.len() {
            let path = write(folder.path(), name, &good[..length]);
            assert!(
                read(&path, &OpenOptions::default()).is_err(),
                "{name} cut to {length} of {}",
                good.len()
            );
        }
    }
}
