//! Where arrays of HDF5, Zarr and N5 lie by their attributes, the names of axes, and what of HDF5 is refused by name.
//!
//! `files/attributes.h5` is by h5py 3 with `libver="latest"`. Every data set is `numpy.arange(24).reshape(2, 3, 4)` in
//! bytes, without chunks:
//!
//! ```text
//! parts/integers    resolution [40, 4, 8] of int64, offset [80, 0, 16] of big-endian int32, units ["nm", "nm", "nm"]
//! floats            voxel_size [40, 0.5, 8] of float32, units ["nm", "um", "nm"]
//! one               resolution 4, units "nm"
//! mask              the numbers that three divides, of bool
//! named             dims[0..3].label are x, y, z
//! enumeration       the remainders by three, of an enumeration {soma: 1, axon: 2}
//! parts/virtual     a virtual data set
//! ```

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests")]

use std::fs;
use std::path::Path;

use pumice_core::{Unit, VolumeInfo};
use pumice_formats::{OpenOptions, probe};

/// The description of a volume, and all warnings.
fn described(path: &Path, options: OpenOptions) -> Result<(VolumeInfo, String), String> {
    let found = probe(path, &options).map_err(|e| e.to_string())?;
    Ok((found.info, options.warnings.list().join("\n")))
}

fn middle(info: &VolumeInfo) -> [f64; 3] {
    info.world_from_centre().translation.to_array()
}

#[cfg(feature = "hdf5")]
mod hdf5 {
    use pumice_formats::open;

    use super::*;

    fn file(name: &str) -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files").join(name)
    }

    fn of(name: &str) -> OpenOptions {
        OpenOptions { dataset: Some(name.into()), ..OpenOptions::default() }
    }

    #[test]
    fn attributes_of_any_type_of_number_are_read() {
        let place = |name: &str| described(&file("attributes.h5"), of(name)).unwrap();
        let (info, warnings) = place("parts/integers");
        assert_eq!((info.spacing(), info.unit), ([8.0, 4.0, 40.0], Unit::Nanometre));
        assert_eq!(middle(&info), [16.0 + 4.0, 2.0, 80.0 + 20.0]);
        assert!(!warnings.contains("spacing"), "{warnings}");
        // Lengths in micrometres along y become those of the unit of x.
        let (info, _) = place("floats");
        assert_eq!((info.spacing(), info.unit), ([8.0, 500.0, 40.0], Unit::Nanometre));
        let (info, _) = place("one");
        assert_eq!((info.spacing(), info.unit), ([4.0; 3], Unit::Nanometre));
    }

    #[test]
    fn a_mask_is_read_and_other_enumerations_are_named() {
        let mut source = open(&file("attributes.h5"), &of("mask")).unwrap();
        let block = source.next_block().unwrap().unwrap();
        let voxels: Vec<u64> = (0..block.labels.len()).map(|i| block.labels.get(i)).collect();
        assert_eq!(voxels, (0..24).map(|n| u64::from(n % 3 == 0)).collect::<Vec<_>>());
        let line = described(&file("attributes.h5"), of("enumeration")).unwrap_err();
        assert!(line.contains("the data set enumeration has an enumeration of names"), "{line}");
    }

    #[test]
    fn labels_of_dimensions_are_names_of_axes() {
        let (info, warnings) = described(&file("attributes.h5"), of("named")).unwrap();
        assert_eq!(info.dims, [2, 3, 4]);
        assert!(!warnings.contains("which axis is which"), "{warnings}");
        // Control: without labels.
        let (info, warnings) = described(&file("attributes.h5"), of("one")).unwrap();
        assert!(info.dims == [4, 3, 2] && warnings.contains("which axis is which"), "{warnings}");
    }

    #[test]
    fn a_virtual_data_set_is_refused_by_name() {
        for options in [OpenOptions::default(), of("parts/virtual"), of("parts/other")] {
            let line = described(&file("attributes.h5"), options).unwrap_err();
            let what = "virtual is a virtual data set, put together from others";
            assert!(line.contains(what) && line.contains("--dataset") && line.lines().count() == 1, "{line}");
        }
        // Others are read by their names, as the tests above do.
        assert!(described(&file("attributes.h5"), of("parts/integers")).is_ok());
    }
}

#[cfg(feature = "zarr")]
mod zarr {
    use super::*;

    const AXES: &str = r#"[{"name": "z", "type": "space", "unit": "micrometer"}, {"name": "y", "type": "space"}, {"name": "x", "type": "space"}]"#;

    /// An array of Zarr 2 without chunks, which are the fill value.
    fn array(folder: &Path) {
        fs::create_dir_all(folder).unwrap();
        let about = r#"{"zarr_format": 2, "shape": [2, 3, 4], "chunks": [2, 3, 4], "dtype": "|u1", "compressor": null, "fill_value": 1, "order": "C", "filters": null}"#;
        fs::write(folder.join(".zarray"), about).unwrap();
    }

    /// An image with these scales, whose first level is there.
    fn image(scales: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        array(&folder.path().join("0"));
        let level = |(n, scale): (usize, &&str)| {
            format!(
                r#"{{"path": "{n}", "coordinateTransformations": [{{"type": "scale", "scale": {scale}}}]}}"#
            )
        };
        let levels = scales.iter().enumerate().map(level).collect::<Vec<_>>().join(", ");
        let about = format!(r#"{{"multiscales": [{{"axes": {AXES}, "datasets": [{levels}]}}]}}"#);
        fs::write(folder.path().join(".zgroup"), r#"{"zarr_format": 2}"#).unwrap();
        fs::write(folder.path().join(".zattrs"), about).unwrap();
        folder
    }

    #[test]
    fn a_scale_below_0_is_refused() {
        let folder = image(&["[-4, 2, 1]"]);
        let line = described(folder.path(), OpenOptions::default()).unwrap_err();
        assert!(line.contains("the spacing along z is -4, expected a positive length"), "{line}");
        let said = OpenOptions { spacing: Some([1.0; 3]), ..OpenOptions::default() };
        assert_eq!(described(folder.path(), said).unwrap().0.world_from_index.matrix3.z_axis.z, 1.0);
        // Control.
        assert!(described(image(&["[4, 2, 1]"]).path(), OpenOptions::default()).is_ok());
        let line = described(image(&[r#"["NaN", 2, 1]"#]).path(), OpenOptions::default()).unwrap_err();
        assert!(line.ends_with(r#"scale: expected 3 numbers, one an axis, got ["NaN",2,1]"#), "{line}");
    }

    #[test]
    fn a_level_that_is_missing_has_no_invented_size() {
        let folder = image(&["[4, 2, 1]", "[8, 4, 2]"]);
        let found = probe(folder.path(), &OpenOptions::default()).unwrap();
        let expected = "0: 4 × 3 × 2 voxels of 1 × 2 × 4 µm; 1: missing or damaged, voxels of 2 × 4 × 8 µm";
        assert_eq!(found.choices[0].listed, expected);
        // Control: with the level.
        array(&folder.path().join("1"));
        let found = probe(folder.path(), &OpenOptions::default()).unwrap();
        assert!(found.choices[0].listed.ends_with("1: 4 × 3 × 2 voxels of 2 × 4 × 8 µm"));
    }

    #[test]
    fn attributes_of_a_plain_array_place_it() {
        let folder = tempfile::tempdir().unwrap();
        array(folder.path());
        let place = |attributes: &str| {
            fs::write(folder.path().join(".zattrs"), attributes).unwrap();
            described(folder.path(), OpenOptions::default()).unwrap()
        };
        let (none, _) = place(r#"{"resolution": [40, 4, 8]}"#);
        assert_eq!((middle(&none), none.spacing()), ([4.0, 2.0, 20.0], [8.0, 4.0, 40.0]));
        assert_eq!(none, place(r#"{"resolution": [40, 4, 8], "offset": [0, 0, 0]}"#).0);
        let (info, warnings) = place(r#"{"resolution": 4, "units": ["um", "furlong", "nm"]}"#);
        assert!(warnings.contains(r#"the unit "furlong" of axis y is not known"#), "{warnings}");
        assert_eq!((info.spacing(), info.unit), ([4.0, 4.0, 4000.0], Unit::Nanometre));
        let (info, warnings) = place(r#"{"resolution": [8, 4, 40], "axis_names": ["x", "y", "z"]}"#);
        assert_eq!((info.dims, info.spacing(), warnings.as_str()), ([2, 3, 4], [8.0, 4.0, 40.0], ""));
    }
}

mod n5 {
    use super::*;

    /// A data set with these attributes.
    fn place(attributes: &str) -> (VolumeInfo, String) {
        let folder = tempfile::tempdir().unwrap();
        let about = format!(
            r#"{{"dimensions": [4, 3, 2], "blockSize": [4, 3, 2], "dataType": "uint8", "compression": {{"type": "raw"}}, {attributes}}}"#
        );
        fs::write(folder.path().join("attributes.json"), about).unwrap();
        described(folder.path(), OpenOptions::default()).unwrap()
    }

    #[test]
    fn offset_and_units_are_read_x_first() {
        let (info, warnings) =
            place(r#""resolution": [8, 4, 40], "offset": [16, 0, 80], "units": ["nm", "nm", "nm"]"#);
        assert_eq!((info.spacing(), info.unit, warnings.as_str()), ([8.0, 4.0, 40.0], Unit::Nanometre, ""));
        assert_eq!(middle(&info), [16.0 + 4.0, 2.0, 80.0 + 20.0]);
        // No offset is an offset of 0, whatever states the lengths.
        for lengths in [r#""resolution": [8, 4, 40]"#, r#""pixelResolution": [8, 4, 40]"#] {
            assert_eq!(place(lengths).0, place(&format!(r#"{lengths}, "offset": [0, 0, 0]"#)).0);
        }
        assert_eq!(middle(&place(r#""pixelResolution": [8, 4, 40]"#).0), [0.0; 3]);
        // A level begins at the corner of the finest one.
        let level =
            place(r#""resolution": [8, 4, 40], "offset": [16, 0, 80], "downsamplingFactors": [2, 2, 1]"#).0;
        assert_eq!(middle(&level), [16.0 + 8.0, 4.0, 80.0 + 20.0]);

        let (info, _) = place(r#""resolution": [8, 4, 40], "units": ["nm", "nm", "um"]"#);
        assert_eq!(info.spacing(), [8.0, 4.0, 40_000.0]);
        // funlib's names say the order of its attributes.
        let zyx = place(
            r#""voxel_size": [40, 4, 8], "offset": [80, 0, 16], "units": ["um", "nm", "nm"], "axis_names": ["z", "y", "x"]"#,
        );
        assert_eq!((zyx.0.spacing(), zyx.0.unit), ([8.0, 4.0, 40_000.0], Unit::Nanometre));
        assert_eq!(middle(&zyx.0), [16.0 + 4.0, 2.0, 80_000.0 + 20_000.0]);
        let (_, warnings) = place(r#""resolution": [8, 4, 40], "units": ["nm", "nm", "furlong"]"#);
        assert!(warnings.ends_with(r#"the unit "furlong" of axis z is not known"#), "{warnings}");
    }
}
