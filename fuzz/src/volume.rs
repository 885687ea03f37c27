//! Opens a `.pumice` file as the command does, with a corrected content hash, and uses everything in it.

use std::path::Path;

use pumice_core::{CompressedVolume, CompressionLevel as Level, Error, Job, LabelTable};

use crate::{checksums, scratch};

/// Largest number of voxels of a volume that is decoded as a whole.
const SMALL_VOXELS: u64 = 1 << 20;

/// Opens a file whose checksums are correct, and uses it. If only the content hash is wrong, corrects it too, as the maker of a malicious
/// file can.
pub fn open_and_use(mut bytes: Vec<u8>) {
    let path = scratch::path("");
    scratch::put(&path, &bytes);
    let mut opened = CompressedVolume::open(&path, &Job::new());
    if let Err(Error::File { what, .. }) = &opened
        && let Some((_, got)) = what.strip_prefix("content hash: ").and_then(|w| w.split_once("got "))
    {
        let hash = u128::from_str_radix(got, 16).expect("the message ends with the hash");
        checksums::set_content_hash(&mut bytes, hash);
        scratch::put(&path, &bytes);
        opened = CompressedVolume::open(&path, &Job::new());
        assert!(
            opened.is_ok(),
            "the file does not open with the content hash that the error named: {:?}",
            opened.err().map(|e| e.to_string())
        );
    }
    use_chosen(&path, opened.as_ref().ok());
    // A mapped file must pass and fail the same checks as a copied one.
    match (CompressedVolume::open_mapped(&path, &Job::new()), &opened) {
        (Ok(mapped), Ok(copied)) => {
            assert_eq!(mapped.content_hash(), copied.content_hash());
            if copied.info().voxels() <= SMALL_VOXELS {
                let block = |volume: &CompressedVolume| volume.decode_block([0; 3], volume.info().dims);
                assert_eq!(
                    block(&mapped).expect("within the volume"),
                    block(copied).expect("within the volume")
                );
            }
        }
        (Err(mapped), Err(copied)) => assert_eq!(mapped.to_string(), copied.to_string()),
        (mapped, copied) => panic!("mapped: {}, copied: {}", mapped.is_ok(), copied.is_ok()),
    }
    match opened {
        Ok(volume) => use_all(&volume, &path, bytes.len()),
        Err(error) => {
            let text = error.to_string();
            assert!(!text.contains('\n'), "expected an error of one line, got: {text}");
        }
    }
}

/// Opens only every second label. A file that opens as a whole must open so too, with the same voxels of those labels.
fn use_chosen(path: &Path, whole: Option<&CompressedVolume>) {
    let second = |labels: &LabelTable| (0..labels.len()).map(|i| i % 2 == 1).collect();
    let part = match CompressedVolume::open_labels(path, second, &Job::new()) {
        Ok(part) => part,
        Err(error) => {
            let text = error.to_string();
            assert!(whole.is_none() && !text.contains('\n'), "{text}");
            return;
        }
    };
    let dims = part.info().dims;
    let other = |labels: &LabelTable| (0..labels.len()).map(|i| i % 2 == 0).collect();
    let rest = CompressedVolume::open_labels(path, other, &Job::new());
    // The other labels, added, make the whole volume again. (Some files are always read whole.)
    if let (Ok(rest), Some(whole), false) = (&rest, whole, part.is_whole()) {
        let joined = part.with_more_labels(rest).expect("parts of one file");
        if joined.info().voxels() <= SMALL_VOXELS && whole.find_contacts(&Job::new()).is_ok() {
            let block =
                |volume: &CompressedVolume| volume.decode_block([0; 3], dims).expect("within the volume");
            assert_eq!(block(&joined), block(whole));
        }
    }
    if part.info().voxels() <= SMALL_VOXELS {
        let block = part.decode_block([0; 3], dims).expect("within the volume");
        if let Some(whole) = whole {
            let all = whole.decode_block([0; 3], dims).expect("within the volume");
            // 0 is background, other values are a dense index plus 1. Some files are always read whole, with all labels.
            let is_there = |label: u32| label > 0 && part.holds(label - 1);
            let same =
                block.iter().zip(all).all(|(&got, label)| got == if is_there(label) { label } else { 0 });
            assert!(same || whole.find_contacts(&Job::new()).is_err(), "and no two labels claim one voxel");
        }
    }
}

fn use_all(volume: &CompressedVolume, path: &Path, seed: usize) {
    let dims = volume.info().dims;
    let labels = volume.labels().len() as u32;

    // Check the tables.
    for (a, b) in volume.labels().contacts().iter() {
        assert!(a < b && b < labels, "contact {a} {b} of {labels} labels");
    }
    for label in 0..labels.min(1000) {
        let _ = (volume.note(label), volume.labels().type_of(label));
        assert_eq!(volume.labels().index_of(volume.labels().ids()[label as usize]), Some(label));
    }
    for (label, bounds) in volume.label_bounds().into_iter().enumerate() {
        assert!((0..3).all(|a| bounds.high[a] < dims[a]), "label {label}: {bounds:?} in {dims:?}");
    }

    // Decode all voxels, or those around some boxes.
    if volume.info().voxels() <= SMALL_VOXELS {
        let block = volume.decode_block([0; 3], dims).expect("within the volume");
        assert!(block.iter().all(|&l| l <= labels));
    }
    for index in [0, volume.boxes().len() / 2, volume.boxes().len().saturating_sub(1)] {
        if index < volume.boxes().len() {
            let origin = volume.get_box(index).origin;
            let size = [0, 1, 2].map(|a| (dims[a] - origin[a]).min(20));
            volume.decode_block(origin, size).expect("within the volume");
            assert!(volume.label_at(origin).expect("memory").is_none_or(|l| l < labels));
        }
    }
    // Opening does not search for voxels that two labels claim (`file::check` explains why), but finding contacts does.
    let contacts = volume.find_contacts(&Job::new());
    if let Err(error) = &contacts {
        assert!(error.to_string().contains("two labels claim one voxel"), "{error}");
    }

    // A volume that opens can be saved, and the file opens as the same volume.
    let level = match seed % 16 {
        0 => Level::Default,
        1 if volume.info().voxels() <= SMALL_VOXELS && contacts.is_ok() => Level::Small,
        _ => Level::Fast,
    };
    volume.save(path, level, &Job::new()).expect("save");
    let back = match CompressedVolume::open(path, &Job::new()) {
        Ok(back) => back,
        Err(error) => panic!("saved as {level:?}, then: {error}"),
    };
    assert_eq!(back.content_hash(), volume.content_hash());
    assert_eq!(back.info(), volume.info());
    assert_eq!(back.boxes().len(), volume.boxes().len());
}
