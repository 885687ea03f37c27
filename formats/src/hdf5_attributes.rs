//! Attributes of an HDF5 data set: numbers of any type, texts, and the names of axes (HDF5's dimension labels).
//!
//! ```text
//! resolution        (3,) of int64, float32, … in either byte order, or one number
//! units             (3,) of strings, or one
//! DIMENSION_LABELS  (3,) of strings, one an axis: H5DSset_label, h5py's `dims[0].label`; or `axis_names` of funlib
//! ```

use hdf5_reader::datatype_api::H5Type;
use hdf5_reader::{Attribute, Dataset};
use pumice_core::LabelType;

use crate::hdf5_datasets::label_type;

/// Most numbers or texts of an attribute that can be about axes: HDF5's own limit of axes is 32.
const MOST: u64 = 32;

fn found(dataset: &Dataset, name: &str) -> Option<Attribute> {
    dataset.attribute(name).ok().filter(|found| found.num_elements().is_ok_and(|count| count <= MOST))
}

/// The numbers of an attribute.
pub(crate) fn numbers(dataset: &Dataset, name: &str) -> Option<Vec<f64>> {
    numbers_of(&found(dataset, name)?)
}

fn numbers_of(attribute: &Attribute) -> Option<Vec<f64>> {
    /// The reader converts byte orders, not types.
    fn all<T: H5Type>(attribute: &Attribute, number: impl Fn(T) -> f64) -> Option<Vec<f64>> {
        Some(attribute.read_1d::<T>().ok()?.into_iter().map(number).collect())
    }
    match label_type(&attribute.datatype)? {
        LabelType::U8 => all::<u8>(attribute, f64::from),
        LabelType::U16 => all::<u16>(attribute, f64::from),
        LabelType::U32 => all::<u32>(attribute, f64::from),
        LabelType::U64 => all::<u64>(attribute, |n| n as f64),
        LabelType::I8 => all::<i8>(attribute, f64::from),
        LabelType::I16 => all::<i16>(attribute, f64::from),
        LabelType::I32 => all::<i32>(attribute, f64::from),
        LabelType::I64 => all::<i64>(attribute, |n| n as f64),
        LabelType::F32 => all::<f32>(attribute, f64::from),
        LabelType::F64 => all::<f64>(attribute, |n| n),
    }
}

/// The texts of an attribute; one text is a list of one.
pub(crate) fn texts(dataset: &Dataset, name: &str) -> Option<Vec<String>> {
    let attribute = found(dataset, name)?;
    attribute.read_strings().ok().or_else(|| Some(vec![attribute.read_string().ok()?]))
}

/// The names of all axes, where all are x, y, z, time or channel, each once: HDF5's own, or those of funlib.
pub(crate) fn axis_names(dataset: &Dataset) -> Option<Vec<String>> {
    let fits = |names: &Vec<String>| names.len() == dataset.shape().len() && are_axes(names);
    ["DIMENSION_LABELS", "axis_names"].into_iter().find_map(|name| texts(dataset, name).filter(fits))
}

fn are_axes(names: &[String]) -> bool {
    let lower: Vec<String> = names.iter().map(|name| name.to_lowercase()).collect();
    let is_known = |name: &String| matches!(name.as_str(), "x" | "y" | "z" | "t" | "time" | "c" | "channel");
    let space = lower.iter().filter(|name| matches!(name.as_str(), "x" | "y" | "z")).count();
    space >= 2 && lower.iter().enumerate().all(|(n, name)| is_known(name) && !lower[..n].contains(name))
}

#[cfg(test)]
mod tests {
    use hdf5_reader::{ByteOrder, Datatype};

    use super::*;

    fn attribute(datatype: Datatype, shape: &[u64], raw_data: Vec<u8>) -> Attribute {
        let shape = shape.to_vec();
        Attribute { name: "resolution".into(), datatype, shape, raw_data, decoded_strings: None }
    }

    #[test]
    fn numbers_of_every_type_and_byte_order_are_read() {
        use ByteOrder::{BigEndian, LittleEndian};
        for byte_order in [LittleEndian, BigEndian] {
            let bytes = |number: f64, size: u8, is_float: bool| {
                let mut bytes = match (is_float, size) {
                    (true, 4) => (number as f32).to_le_bytes().to_vec(),
                    (true, _) => number.to_le_bytes().to_vec(),
                    (false, size) => (number as i64).to_le_bytes()[..usize::from(size)].to_vec(),
                };
                if byte_order == BigEndian {
                    bytes.reverse();
                }
                bytes
            };
            for (size, signed) in [1u8, 2, 4, 8].iter().flat_map(|&size| [(size, true), (size, false)]) {
                let datatype = Datatype::FixedPoint { size, signed, byte_order };
                let last = if signed { -4.0 } else { 100.0 };
                let raw = [40.0, 8.0, last].map(|n| bytes(n, size, false)).concat();
                assert_eq!(
                    numbers_of(&attribute(datatype, &[3], raw)),
                    Some(vec![40.0, 8.0, last]),
                    "{size}"
                );
            }
            for size in [4, 8] {
                let datatype = Datatype::FloatingPoint { size, byte_order };
                let raw = [0.5, 40.0].map(|n| bytes(n, size, true)).concat();
                assert_eq!(numbers_of(&attribute(datatype.clone(), &[2], raw)), Some(vec![0.5, 40.0]));
                let one = attribute(datatype, &[], bytes(0.25, size, true));
                assert_eq!(numbers_of(&one), Some(vec![0.25]));
            }
        }
        // Bytes that are not there.
        let datatype = Datatype::FixedPoint { size: 8, signed: true, byte_order: LittleEndian };
        assert_eq!(numbers_of(&attribute(datatype, &[3], vec![0; 8])), None);
    }

    #[test]
    fn names_count_where_all_are_axes() {
        let are = |names: &[&str]| are_axes(&names.iter().map(|&n| n.to_owned()).collect::<Vec<_>>());
        for names in [&["x", "y", "z"][..], &["Z", "Y", "X"], &["t", "channel", "y", "x"]] {
            assert!(are(names), "{names:?}");
        }
        for names in [&["x", "y", ""][..], &["x", "x", "y"], &["row", "y", "x"], &["t", "c", "x"], &[]] {
            assert!(!are(names), "{names:?}");
        }
    }
}
