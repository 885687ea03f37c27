//! Headers alone: what each format leaves to the caller, who may say the order of axes, and that no voxel is read for it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

mod files;

use std::path::{Path, PathBuf};

use files::*;
use pumice_formats::{ArrayAxes, OpenChoice, OpenOptions, RawLayout, Recorded, open, probe};

/// Keyword, values with their texts, assumed answer.
type Choice = (&'static str, Vec<(String, String)>, Option<&'static str>);

/// The choices that a file leaves open.
fn choices(path: &Path, options: &OpenOptions) -> Vec<Choice> {
    let found = probe(path, options).unwrap().choices;
    let values =
        |c: &OpenChoice| c.values.iter().map(|v| (v.value.clone(), v.text.clone())).collect::<Vec<_>>();
    for choice in &found {
        assert!(choice.option.starts_with("--"), "{choice:?}");
        assert_eq!(choice.count, choice.values.len() as u64, "{choice:?}");
        for text in [&choice.what, &choice.listed] {
            assert!(!text.contains('\n') && !text.is_empty(), "{choice:?}");
        }
    }
    found.iter().map(|c| (c.keyword, values(c), c.assumed)).collect()
}

/// Numbers from 0, each without a text.
fn numbers(count: usize) -> Vec<(String, String)> {
    (0..count).map(|i| (i.to_string(), String::new())).collect()
}

fn array(shape: &str, fortran: &str) -> Vec<u8> {
    let header = format!("{{'descr': '<u2', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
    npy(1, &header, &integers(&labels(), 2, false))
}

/// A classic TIFF of one page of 3 × 4 pixels, with a description and the planes one after the other.
fn stack(description: &str, planes: usize) -> Vec<u8> {
    let text = [description.as_bytes(), b"\0"].concat();
    let tags: [(u16, u16, u32); 8] = [
        (256, 3, 3),
        (257, 3, 4),
        (258, 3, 8),
        (262, 3, 1),
        (270, 2, 0),
        (273, 4, 0),
        (278, 3, 4),
        (279, 4, 12),
    ];
    let text_at = 8 + 2 + 12 * tags.len() as u32 + 4;
    let mut file = [&b"II*\0"[..], &8u32.to_le_bytes(), &(tags.len() as u16).to_le_bytes()].concat();
    for (tag, kind, value) in tags {
        let (count, value) = match tag {
            270 => (text.len() as u32, text_at),
            273 => (1, text_at + text.len() as u32),
            _ => (1, value),
        };
        file.extend(
            [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &count.to_le_bytes(), &value.to_le_bytes()]
                .concat(),
        );
    }
    file.extend(0u32.to_le_bytes());
    file.extend(text);
    file.extend(vec![1; 12 * planes]);
    file
}

const IMAGEJ: &str = "ImageJ=1.54f\nimages=12\nchannels=3\nslices=2\nframes=2\nunit=micron\nspacing=0.5\n";
const LAYERS: &[u8] = b"NRRD0004\ntype: uint8\ndimension: 4\nsizes: 2 3 4 5\nkinds: list domain domain domain\n\
    space: left-posterior-superior\nspace directions: none (1,0,0) (0,1,0) (0,0,2)\nencoding: raw\n\
    Segment0_Layer:=0\nSegment0_LabelValue:=1\nSegment0_Name:=ribs\nSegment1_Layer:=1\nSegment1_Name:=left lung\n\n";

/// A file of each format that says which axis is which, with its name in messages.
fn with_axes(folder: &Path) -> Vec<(PathBuf, &'static str)> {
    let meta = [meta("MET_UCHAR", "", "LOCAL").into_bytes(), vec![1; 60]].concat();
    vec![
        (write(folder, "a.nrrd", &[LAYERS, &[1; 120]].concat()), "NRRD"),
        (write(folder, "a.nii", &Nifti::new(1, false, 2).file(&[1; 60])), "NIfTI"),
        (write(folder, "a.mha", &meta), "MetaImage"),
    ]
}

#[test]
fn pages_whose_meaning_is_open_or_doubtful_list_the_orders() {
    let folder = tempfile::tempdir().unwrap();
    let orders = |path: &Path| {
        let found = choices(path, &OpenOptions::default());
        let axes = found.iter().find(|choice| choice.0 == "axes");
        axes.map(|(_, values, assumed)| {
            (values.iter().map(|v| v.0.clone()).collect::<Vec<_>>().join(" "), *assumed)
        })
    };
    let all = |assumed| Some(("zyx tyx cyx".to_owned(), Some(assumed)));
    assert_eq!(orders(&write(folder.path(), "p.tif", &stack("ImageJ=1.54f\nimages=5\n", 5))), all("zyx"));
    let frames = write(folder.path(), "t.tif", &stack("ImageJ=1.54f\nimages=5\nframes=5\n", 5));
    assert_eq!(orders(&frames), all("tyx"));
    // Said by the file, or nothing to say, or several axes.
    assert_eq!(orders(&write(folder.path(), "z.tif", &stack("ImageJ=1.54f\nimages=5\nslices=5\n", 5))), None);
    assert_eq!(orders(&write(folder.path(), "1.tif", &stack("", 1))), None);
    assert_eq!(orders(&write(folder.path(), "c.tif", &stack(IMAGEJ, 12))), None);
    let slices = OpenOptions { axes: Some(ArrayAxes::Zyx), ..OpenOptions::default() };
    let found = probe(&frames, &slices).unwrap();
    assert_eq!((found.info.dims[2], found.choices.len()), (5, 0));
}

#[test]
fn what_a_file_leaves_open_is_listed_and_goes_when_it_is_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let any = OpenOptions::default();

    let layers = write(folder.path(), "l.nrrd", &[LAYERS, &[1; 120]].concat());
    let named = vec![("0".into(), "ribs".into()), ("1".into(), "left lung".into())];
    assert_eq!(choices(&layers, &any), [("layer", named, None)]);
    assert_eq!(choices(&layers, &OpenOptions { layer: Some(1), ..any.clone() }), []);

    let tiff = write(folder.path(), "c.tif", &stack(IMAGEJ, 12));
    assert_eq!(choices(&tiff, &any), [("channel", numbers(3), None), ("time", numbers(2), None)]);
    assert_eq!(
        choices(&tiff, &OpenOptions { channel: Some(2), ..any.clone() }),
        [("time", numbers(2), None)]
    );

    let mut header = Nifti::new(1, false, 2);
    header.dims(&[3, 4, 5, 2, 3]);
    let nifti = write(folder.path(), "t.nii", &header.file(&[1; 360]));
    assert_eq!(choices(&nifti, &any), [("time", numbers(2), None), ("channel", numbers(3), None)]);

    // A control: with one of each there is nothing to choose.
    let plain = write(folder.path(), "p.nii", &Nifti::new(1, false, 2).file(&[1; 60]));
    assert_eq!(choices(&plain, &any), []);
}

#[test]
fn the_error_of_a_file_with_several_is_its_first_open_choice() {
    let folder = tempfile::tempdir().unwrap();
    let archive = zip(&[("a.npy", array("(3, 4, 5)", "True")), ("b.npy", array("(3, 4, 5)", "True"))], false);
    for path in [
        write(folder.path(), "l.nrrd", &[LAYERS, &[1; 120]].concat()),
        write(folder.path(), "c.tif", &stack(IMAGEJ, 12)),
        write(folder.path(), "a.npz", &archive),
    ] {
        let first = probe(&path, &OpenOptions::default()).unwrap().choices.remove(0);
        let expected = format!(
            "{}: {}; choose one with {} ({})",
            path.display(),
            first.what,
            first.option,
            first.listed
        );
        assert_eq!(open(&path, &OpenOptions::default()).err().unwrap().to_string(), expected);
    }
}

#[test]
fn arrays_leave_the_order_of_axes_open_and_say_which_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "a.npy", &array("(3, 4, 5)", "False"));
    let [(keyword, values, assumed)] = &choices(&path, &OpenOptions::default())[..] else { panic!() };
    assert_eq!((*keyword, *assumed), ("axes", Some("xyz")));
    assert_eq!(values.iter().map(|v| v.0.as_str()).collect::<Vec<_>>(), ["xyz", "zyx"]);
    let told = |axes| {
        let options = OpenOptions { axes, ..OpenOptions::default() };
        let found = probe(&path, &options).unwrap();
        (
            found.info.dims,
            found.warnings.iter().any(|w| w.contains("taken as xyz") && w.contains("(3, 4, 5)")),
        )
    };
    assert_eq!(told(None), ([3, 4, 5], true));
    // What the caller says is no assumption.
    assert_eq!(told(Some(ArrayAxes::Xyz)), ([3, 4, 5], false));
    assert_eq!(told(Some(ArrayAxes::Zyx)), ([5, 4, 3], false));
    assert_eq!(choices(&path, &OpenOptions { axes: Some(ArrayAxes::Zyx), ..OpenOptions::default() }), []);
}

#[test]
fn the_first_of_several_arrays_is_described() {
    let folder = tempfile::tempdir().unwrap();
    let small = npy(1, "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }\n", &[0; 24]);
    let members = [
        ("spacing.npy", small),
        ("a.npy", array("(3, 4, 5)", "True")),
        ("b.npy", array("(5, 4, 3)", "False")),
    ];
    let path = write(folder.path(), "a.npz", &zip(&members, true));
    let found = probe(&path, &OpenOptions::default()).unwrap();
    assert_eq!(found.info.dims, [3, 4, 5]);
    let arrays = vec![("a".into(), "(3, 4, 5) of <u2".into()), ("b".into(), "(5, 4, 3) of <u2".into())];
    let open = choices(&path, &OpenOptions::default());
    assert_eq!(open[0], ("array", arrays, None));
    assert_eq!((open.len(), open[1].0), (2, "axes"));
    let named = OpenOptions { array: Some("b".into()), ..OpenOptions::default() };
    assert_eq!(probe(&path, &named).unwrap().info.dims, [5, 4, 3]);
    assert_eq!(choices(&path, &named).iter().map(|c| c.0).collect::<Vec<_>>(), ["axes"]);
}

#[test]
fn files_that_say_which_axis_is_which_refuse_an_order() {
    let folder = tempfile::tempdir().unwrap();
    let ask = |axes| OpenOptions { layer: None, axes: Some(axes), ..OpenOptions::default() };
    for (path, name) in with_axes(folder.path()) {
        assert!(probe(&path, &OpenOptions::default()).is_ok(), "{name}: the file itself is good");
        for axes in ArrayAxes::OF_ARRAYS {
            let error = probe(&path, &ask(axes)).unwrap_err().to_string();
            assert!(error.contains(&format!("{name} files say which axis is which")), "{error}");
            assert!(error.contains(axes.name()) && !error.contains('\n'), "{error}");
            refuse(&path, &ask(axes), &["cannot be chosen"]);
        }
    }
    let slices = folder.path().join("slices");
    std::fs::create_dir(&slices).unwrap();
    write(&slices, "1.tif", &stack("", 1));
    refuse(&slices, &ask(ArrayAxes::Zyx), &["slices of a folder"]);
    let layout =
        RawLayout { dims: [3, 4, 5], label_type: pumice_core::LabelType::U8, big_endian: false, offset: 0 };
    let raw = write(folder.path(), "a.raw", &[1; 60]);
    refuse(&raw, &OpenOptions { raw: Some(layout), ..ask(ArrayAxes::Zyx) }, &["x fastest"]);
}

/// A file of each format with one layer, one time step and one channel, and how it is read.
fn with_one_of_each(folder: &Path) -> Vec<(PathBuf, OpenOptions)> {
    let plain = OpenOptions::default();
    let layout =
        RawLayout { dims: [3, 4, 5], label_type: pumice_core::LabelType::U8, big_endian: false, offset: 0 };
    let meta = [meta("MET_UCHAR", "", "LOCAL").into_bytes(), vec![1; 60]].concat();
    let nrrd = b"NRRD0004\ntype: uint8\ndimension: 4\nsizes: 1 3 4 5\nkinds: list domain domain domain\nencoding: raw\n\n";
    // A time step, which is the only one, is an axis of its own here.
    let mut four_axes = Nifti::new(1, false, 2);
    four_axes.dims(&[3, 4, 5, 1, 1]);
    let slices = folder.join("slices");
    std::fs::create_dir(&slices).unwrap();
    write(&slices, "1.tif", &stack("", 1));
    let stacked = "ImageJ=1.54f\nimages=2\nslices=2\n";
    vec![
        (write(folder, "a.nrrd", &[&nrrd[..], &[1; 60]].concat()), plain.clone()),
        (write(folder, "a.nii", &Nifti::new(1, false, 2).file(&[1; 60])), plain.clone()),
        (write(folder, "b.nii", &four_axes.file(&[1; 60])), plain.clone()),
        (write(folder, "a.tif", &stack(stacked, 2)), plain.clone()),
        (write(folder, "a.mha", &meta), plain.clone()),
        (write(folder, "a.npy", &array("(3, 4, 5)", "True")), plain.clone()),
        (write(folder, "a.raw", &[1; 60]), OpenOptions { raw: Some(layout), ..plain.clone() }),
        (slices, plain),
    ]
}

#[test]
fn an_index_is_refused_where_there_is_one_unless_a_scene_records_0() {
    let folder = tempfile::tempdir().unwrap();
    type Set = fn(&mut OpenOptions, u32);
    let options: [(&str, Set); 3] = [
        ("--layer", |options, index| options.layer = Some(index)),
        ("--time-step", |options, index| options.time = Some(index)),
        ("--channel", |options, index| options.channel = Some(index)),
    ];
    for (path, plain) in with_one_of_each(folder.path()) {
        assert!(open(&path, &plain).is_ok(), "{}: the file itself is good", path.display());
        for (option, set) in options {
            for index in [0, 1] {
                let mut chosen = plain.clone();
                set(&mut chosen, index);
                let words =
                    [&format!("{option} {index} cannot be chosen"), "is 1, which leaves nothing to choose"];
                refuse(&path, &chosen, &words);
                assert!(probe(&path, &chosen).is_err());

                // What a scene records of it is read where it means the only one, and no other.
                chosen.recorded = Recorded { layer: true, time: true, channel: true };
                assert_eq!(open(&path, &chosen).is_ok(), index == 0, "{} {option} {index}", path.display());
                chosen.recorded = Recorded::default();
                assert!(open(&path, &chosen).is_err());
            }
        }
    }

    // Controls: where there are several, the first can be chosen, and an option counts for itself alone.
    let layers = write(folder.path(), "l.nrrd", &[LAYERS, &[1; 120]].concat());
    let first = OpenOptions { layer: Some(0), ..OpenOptions::default() };
    assert!(open(&layers, &first).is_ok());
    let recorded = Recorded { layer: true, ..Recorded::default() };
    refuse(&layers, &OpenOptions { channel: Some(0), recorded, ..first }, &["--channel 0"]);
}

#[test]
fn orientation_is_that_of_the_world_which_the_file_states() {
    let folder = tempfile::tempdir().unwrap();
    let expected = [Some("LPS"), Some("RAS"), Some("LPS"), None];
    let mut files = with_axes(folder.path());
    files.push((write(folder.path(), "a.tif", &stack(IMAGEJ, 12)), "TIFF"));
    for ((path, name), expected) in files.into_iter().zip(expected) {
        assert_eq!(probe(&path, &OpenOptions::default()).unwrap().orientation.as_deref(), expected, "{name}");
    }
}

/// A file of a terabyte, all holes: reading its voxels would take minutes.
#[test]
fn a_terabyte_is_described_without_reading_a_voxel() {
    let folder = tempfile::tempdir().unwrap();
    let side = 1 << 20;
    let array = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': (1024, 1024, {side}), }}\n");
    let nrrd = format!("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1024 1024 {side}\nencoding: raw\n\n");
    for (name, head) in [("a.npy", npy(2, &array, &[])), ("a.nrrd", nrrd.into_bytes())] {
        let path = write(folder.path(), name, &head);
        let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        file.set_len(head.len() as u64 + (1 << 40)).unwrap();
        let found = probe(&path, &OpenOptions::default()).unwrap();
        assert_eq!((found.info.dims, found.bytes_uncompressed), ([1024, 1024, side], 1 << 40), "{name}");
        if name == "a.npy" {
            // A control: one byte less is noticed, so the header is compared with the length of the file.
            file.set_len(head.len() as u64 + (1 << 40) - 1).unwrap();
            let error = probe(&path, &OpenOptions::default()).unwrap_err().to_string();
            assert!(error.contains("data end after"), "{error}");
        }
    }
}
