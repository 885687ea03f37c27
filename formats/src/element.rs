//! Converts the bytes of voxels to labels: byte order, sign, floating point.
//!
//! Unsigned types only change their byte order. Signed ones are checked to be ≥ 0. Floats, and integers with a scale factor, are checked to
//! be whole numbers in 0..=2⁵³, beyond which f64 cannot tell neighbouring ids apart; they become the narrowest unsigned type that holds
//! their block.

use pumice_core::{LabelBuffer, LabelType};

/// 2⁵³: every whole number up to here has an exact f64 (IEEE 754, 53 bits of significand).
pub(crate) const MAX_EXACT_F64: f64 = 9_007_199_254_740_992.0;

/// Number type, byte order and scale of one stored voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Element {
    pub(crate) label_type: LabelType,
    pub(crate) big_endian: bool,
    /// (slope, intercept): the label is `stored · slope + intercept` (NIfTI `scl_slope`, `scl_inter`).
    pub(crate) scale: Option<(f64, f64)>,
}

/// A value that is not a label, and its index in the block.
#[derive(Debug, PartialEq)]
pub(crate) struct BadLabel {
    pub(crate) index: usize,
    pub(crate) value: String,
    pub(crate) reason: &'static str,
}

const NEGATIVE: &str = "but labels are whole numbers ≥ 0";
const NOT_WHOLE: &str = "which is not a whole number: this looks like an image, not a label map";
const NOT_EXACT: &str = "but floating-point labels above 2^53 are not exact: save the labels as integers";

/// The number type of a name as numpy, N5, Neuroglancer and Zarr write it, such as `uint8`.
pub(crate) fn type_of_name(name: &str) -> Option<LabelType> {
    Some(match name {
        "uint8" => LabelType::U8,
        "uint16" => LabelType::U16,
        "uint32" => LabelType::U32,
        "uint64" => LabelType::U64,
        "int8" => LabelType::I8,
        "int16" => LabelType::I16,
        "int32" => LabelType::I32,
        "int64" => LabelType::I64,
        "float32" => LabelType::F32,
        "float64" => LabelType::F64,
        _ => return None,
    })
}

/// The number type of a code of numpy's array interface without its byte order, such as `u4`; booleans are bytes of 0 and 1.
pub(crate) fn type_of_code(code: &str) -> Option<LabelType> {
    Some(match code {
        "b1" | "u1" => LabelType::U8,
        "u2" => LabelType::U16,
        "u4" => LabelType::U32,
        "u8" => LabelType::U64,
        "i1" => LabelType::I8,
        "i2" => LabelType::I16,
        "i4" => LabelType::I32,
        "i8" => LabelType::I64,
        "f4" => LabelType::F32,
        "f8" => LabelType::F64,
        _ => return None,
    })
}

impl Element {
    /// A plain element without a scale.
    pub(crate) fn new(label_type: LabelType, big_endian: bool) -> Self {
        Self { label_type, big_endian, scale: None }
    }

    /// Size of one voxel in bytes.
    pub(crate) fn bytes(self) -> usize {
        match self.label_type {
            LabelType::U8 | LabelType::I8 => 1,
            LabelType::U16 | LabelType::I16 => 2,
            LabelType::U32 | LabelType::I32 | LabelType::F32 => 4,
            LabelType::U64 | LabelType::I64 | LabelType::F64 => 8,
        }
    }

    /// Decodes labels; `bytes` holds a whole number of voxels.
    pub(crate) fn decode(self, bytes: &[u8]) -> Result<LabelBuffer, BadLabel> {
        // Read every voxel as `$t` in the file's byte order and apply `$map`.
        macro_rules! each {
            ($t:ty, $map:expr) => {{
                let (voxels, _) = bytes.as_chunks::<{ size_of::<$t>() }>();
                if self.big_endian {
                    voxels.iter().map(|&b| <$t>::from_be_bytes(b)).map($map).collect()
                } else {
                    voxels.iter().map(|&b| <$t>::from_le_bytes(b)).map($map).collect()
                }
            }};
        }
        macro_rules! signed {
            ($t:ty, $u:ty, $variant:ident) => {{
                // The OR of all values is negative exactly if one of them is. So one cheap pass suffices, and the search runs only on
                // failure.
                let mut any: $t = 0;
                let labels: Vec<$u> = each!($t, |v| {
                    any |= v;
                    v as $u
                });
                if any < 0 {
                    let index = labels.iter().position(|&v| (v as $t) < 0).unwrap_or(0);
                    let value = (labels[index] as $t).to_string();
                    return Err(BadLabel { index, value, reason: NEGATIVE });
                }
                Ok(LabelBuffer::$variant(labels))
            }};
        }
        if let Some((slope, intercept)) = self.scale {
            let values: Vec<f64> = match self.label_type {
                LabelType::U8 => each!(u8, f64::from),
                LabelType::U16 => each!(u16, f64::from),
                LabelType::U32 => each!(u32, f64::from),
                LabelType::I8 => each!(i8, f64::from),
                LabelType::I16 => each!(i16, f64::from),
                LabelType::I32 => each!(i32, f64::from),
                // 64-bit integers above 2⁵³ are rounded here. The limit on the result refuses them unless the slope shrinks them, and then
                // the format itself defines them as inexact.
                LabelType::U64 => each!(u64, |v| v as f64),
                LabelType::I64 => each!(i64, |v| v as f64),
                LabelType::F32 => each!(f32, f64::from),
                LabelType::F64 => each!(f64, |v| v),
            };
            return from_floats(values.into_iter().map(|v| v * slope + intercept).collect());
        }
        match self.label_type {
            LabelType::U8 => Ok(LabelBuffer::U8(bytes.to_vec())),
            LabelType::U16 => Ok(LabelBuffer::U16(each!(u16, |v| v))),
            LabelType::U32 => Ok(LabelBuffer::U32(each!(u32, |v| v))),
            LabelType::U64 => Ok(LabelBuffer::U64(each!(u64, |v| v))),
            LabelType::I8 => signed!(i8, u8, U8),
            LabelType::I16 => signed!(i16, u16, U16),
            LabelType::I32 => signed!(i32, u32, U32),
            LabelType::I64 => signed!(i64, u64, U64),
            LabelType::F32 => from_floats(each!(f32, f64::from)),
            LabelType::F64 => from_floats(each!(f64, |v| v)),
        }
    }
}

/// Converts floating-point values, which must be whole numbers in 0..=2⁵³, to labels.
fn from_floats(values: Vec<f64>) -> Result<LabelBuffer, BadLabel> {
    let mut largest = 0f64;
    for (index, &v) in values.iter().enumerate() {
        let reason = if !v.is_finite() || v.fract() != 0.0 {
            NOT_WHOLE
        } else if v < 0.0 {
            NEGATIVE
        } else if v > MAX_EXACT_F64 {
            NOT_EXACT
        } else {
            largest = largest.max(v);
            continue;
        };
        return Err(BadLabel { index, value: v.to_string(), reason });
    }
    Ok(if largest <= f64::from(u8::MAX) {
        LabelBuffer::U8(values.into_iter().map(|v| v as u8).collect())
    } else if largest <= f64::from(u16::MAX) {
        LabelBuffer::U16(values.into_iter().map(|v| v as u16).collect())
    } else if largest <= f64::from(u32::MAX) {
        LabelBuffer::U32(values.into_iter().map(|v| v as u32).collect())
    } else {
        LabelBuffer::U64(values.into_iter().map(|v| v as u64).collect())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_both_byte_orders() {
        let bytes = [1, 2, 3, 4];
        for (big_endian, expected) in [(false, 0x0403_0201), (true, 0x0102_0304)] {
            let got = Element::new(LabelType::U32, big_endian).decode(&bytes);
            assert_eq!(got, Ok(LabelBuffer::U32(vec![expected])));
        }
    }

    #[test]
    fn refuses_what_is_no_label() {
        let f32s = |v: &[f32]| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let f64s = |v: &[f64]| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let f32_type = Element::new(LabelType::F32, false);
        let f64_type = Element::new(LabelType::F64, false);
        assert_eq!(f32_type.decode(&f32s(&[0.0, -0.0, 7.0])), Ok(LabelBuffer::U8(vec![0, 0, 7])));
        for bad in [0.5, -1.0, f32::NAN, f32::INFINITY] {
            let error = f32_type.decode(&f32s(&[1.0, bad])).unwrap_err();
            assert_eq!(error.index, 1, "{bad}");
        }
        assert_eq!(f64_type.decode(&f64s(&[MAX_EXACT_F64])), Ok(LabelBuffer::U64(vec![1 << 53])));
        assert_eq!(f64_type.decode(&f64s(&[MAX_EXACT_F64 + 2.0])).unwrap_err().reason, NOT_EXACT);
        let signed = Element::new(LabelType::I16, false);
        assert_eq!(
            signed.decode(&[5, 0, 0xFE, 0xFF]),
            Err(BadLabel { index: 1, value: "-2".into(), reason: NEGATIVE })
        );
        assert_eq!(signed.decode(&[5, 0, 0xFE, 0x7F]), Ok(LabelBuffer::U16(vec![5, 0x7FFE])));
    }

    #[test]
    fn scale_must_give_whole_numbers() {
        let half = Element { scale: Some((0.5, 1.0)), ..Element::new(LabelType::U8, false) };
        assert_eq!(half.decode(&[0, 4, 254]), Ok(LabelBuffer::U8(vec![1, 3, 128])));
        assert_eq!(half.decode(&[0, 3]).unwrap_err().index, 1);
    }
}
