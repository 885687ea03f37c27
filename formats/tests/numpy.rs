//! NPY and NPZ files written byte by byte: orders, versions, types, archives, and what is refused.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod files;

use files::*;
use pumice_formats::{ArrayAxes, OpenOptions};

fn header(descr: &str, fortran: bool, shape: &str) -> String {
    let fortran = if fortran { "True" } else { "False" };
    format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}   \n")
}

/// Labels with z fastest, as NumPy writes `a[x, y, z]` in C order.
fn z_fastest() -> Vec<u64> {
    let [nx, ny, nz] = DIMS;
    let mut out = Vec::new();
    for x in 0..nx {
        for y in 0..ny {
            out.extend((0..nz).map(|z| label(x, y, z)));
        }
    }
    out
}

fn zyx() -> OpenOptions {
    OpenOptions { axes: Some(ArrayAxes::Zyx), ..OpenOptions::default() }
}

#[test]
fn reads_orders_versions_and_types() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (false, "(3, 4, 5)", z_fastest(), OpenOptions::default()),
        (true, "(3, 4, 5)", labels(), OpenOptions::default()),
        (false, "(5, 4, 3)", labels(), zyx()),
        (true, "(5, 4, 3)", z_fastest(), zyx()),
        (false, "(1, 3, 4, 1, 5)", z_fastest(), OpenOptions::default()),
    ];
    for (fortran, shape, stored, options) in cases {
        for version in [1, 2, 3] {
            for (descr, bytes, big) in
                [("|u1", 1, false), ("<u2", 2, false), (">i4", 4, true), (">u8", 8, true), ("<i8", 8, false)]
            {
                let file = npy(version, &header(descr, fortran, shape), &integers(&stored, bytes, big));
                let path = write(folder.path(), "a.npy", &file);
                let (info, voxels) = read(&path, &options).unwrap();
                assert_eq!((voxels, info.dims), (labels(), [3, 4, 5]), "{fortran} {shape} {version} {descr}");
            }
        }
    }
    // A control: the wrong meaning of the axes gives another volume.
    let path = write(
        folder.path(),
        "a.npy",
        &npy(1, &header("|u1", false, "(3, 4, 5)"), &integers(&z_fastest(), 1, false)),
    );
    assert_eq!(read(&path, &zyx()).unwrap().0.dims, [5, 4, 3]);
    let later = OpenOptions { time: Some(1), ..OpenOptions::default() };
    refuse(&path, &later, &["--time-step 1", "number of time steps is 1"]);
    // Booleans, and an image a[y, x].
    let path = write(folder.path(), "b.npy", &npy(1, &header("|b1", false, "(2, 3)"), &[0, 1, 1, 0, 0, 1]));
    let (info, voxels) = read(&path, &zyx()).unwrap();
    assert_eq!((info.dims, voxels), ([3, 2, 1], vec![0, 1, 1, 0, 0, 1]));
}

#[test]
fn refuses_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |file: Vec<u8>, words: &[&str]| {
        refuse(&write(folder.path(), "r.npy", &file), &OpenOptions::default(), words);
    };
    for (descr, word) in [
        ("|O", "objects"),
        ("<c8", "complex"),
        ("<U4", "text"),
        ("|S4", "text"),
        ("<f2", "unusual"),
        ("<M8[ns]", "date"),
        ("<q9", "not known"),
        ("<c\n\n8", "complex"),
    ] {
        refused(npy(1, &header(descr, false, "(3, 4, 5)"), &[0; 600]), &[word]);
    }
    let structured = "{'descr': [('a', '<u1'), ('b', '<f4')], 'fortran_order': False, 'shape': (3, 4), }";
    refused(npy(1, structured, &[0; 600]), &["structured"]);
    let u1 = |shape: &str| npy(1, &header("|u1", false, shape), &[0; 59]);
    refused(u1("(3, 4, 5)"), &["expected 60 bytes", "after 59"]);
    refused(u1("(60,)"), &["two or three axes"]);
    refused(u1("()"), &["two or three axes"]);
    refused(u1("(2, 2, 2, 2)"), &["4 axes"]);
    refused(u1("(0, 4, 5)"), &["size is 0"]);
    refused(u1("(-3, 4, 5)"), &["-3"]);
    refused(u1("(8388609, 4, 5)"), &["along x", "8388608"]);
    refused(u1("(8000000, 8000000, 8000000)"), &["2^64"]);
    refused(u1("(99999999999999999999, 2)"), &["64 bits"]);
    refused(u1("(3, 4, 5"), &["does not end"]);
    refused(u1(&format!("({})", "1, ".repeat(65))), &["64 axes"]);
    refused(npy(1, "{'descr': '|u1', 'shape': (3, 4)}", &[]), &["fortran_order is missing"]);
    refused(npy(4, "{}", &[]), &["version is 4"]);
    let mut long = npy(2, "{}", &[]);
    long[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
    refused(long, &["header's length", "1048576"]);
    refused(b"\x93NUMPY\x01\x00\xFF\x00{".to_vec(), &["cut off"]);
    refused(npy(1, &header("<i2", false, "(1, 2)"), &[5, 0, 0xFF, 0xFF]), &["voxel (0, 1, 0) is -1"]);
}

#[test]
fn picks_the_array_of_an_archive() {
    let folder = tempfile::tempdir().unwrap();
    let volume = npy(1, &header("<u2", true, "(3, 4, 5)"), &integers(&labels(), 2, false));
    let spacing = npy(1, &header("<f8", false, "(3,)"), &[0; 24]);
    let text = npy(1, &header("<U3", false, "()"), &[0; 12]);
    for deflate in [false, true] {
        let archive = zip(
            &[("spacing.npy", spacing.clone()), ("labels.npy", volume.clone()), ("name.npy", text.clone())],
            deflate,
        );
        let path = write(folder.path(), "a.npz", &archive);
        assert_eq!(read(&path, &OpenOptions::default()).unwrap().1, labels());

        let archive =
            zip(&[("a.npy", volume.clone()), ("b.npy", volume.clone()), ("note.txt", vec![1])], deflate);
        let path = write(folder.path(), "b.npz", &archive);
        refuse(&path, &OpenOptions::default(), &["2 arrays", "--array", "a, b"]);
        let named = |name: &str| OpenOptions { array: Some(name.into()), ..OpenOptions::default() };
        assert_eq!(read(&path, &named("b")).unwrap().1, labels());
        assert_eq!(read(&path, &named("b.npy")).unwrap().1, labels());
        refuse(&path, &named("c"), &["no array \"c\"", "a, b"]);
    }
    refuse(
        &write(folder.path(), "c.npz", &zip(&[("note.txt", vec![1])], false)),
        &OpenOptions::default(),
        &["no .npy"],
    );
    refuse(
        &write(folder.path(), "d.npz", &zip(&[("s.npy", spacing)], false)),
        &OpenOptions::default(),
        &["shape (3)"],
    );
}

#[test]
fn compares_the_archive_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let volume = npy(1, &header("|u1", true, "(3, 4, 5)"), &integers(&labels(), 1, false));
    let archive = zip(&[("a.npy", volume.clone())], false);
    // Damage the last voxel; 35 bytes of local header and name precede the array.
    let mut damaged = archive.clone();
    damaged[35 + volume.len() - 1] ^= 1;
    refuse(&write(folder.path(), "a.npz", &damaged), &OpenOptions::default(), &["CRC-32"]);
    // Without its directory, an archive cannot be read.
    refuse(
        &write(folder.path(), "b.npz", &archive[..archive.len() - 30]),
        &OpenOptions::default(),
        &["ZIP directory"],
    );
}
