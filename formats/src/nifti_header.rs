//! Reads the bytes of a NIfTI-1 or NIfTI-2 header as numbers; [`crate::nifti`] interprets them for a label volume.
//!
//! ```text
//!                 NIfTI-1 (348 bytes)          NIfTI-2 (540 bytes)
//! sizeof_hdr        0  i32 = 348                 0  i32 = 540       gives version and byte order
//! magic           344  "n+1\0" or "ni1\0"        4  "n+2\0\r\n\x1A\n" or "ni2\0…"
//! dim              40  8 × i16                  16  8 × i64         dim[0] = number of axes, 1 to 7
//! datatype         70  i16                      12  i16
//! pixdim           76  8 × f32                 104  8 × f64         pixdim[0] = qfac, the sign of the third axis
//! vox_offset      108  f32                     168  i64
//! scl_slope,inter 112  2 × f32                 176  2 × f64
//! xyzt_units      123  u8                      500  i32
//! q/sform_code    252  2 × i16                 344  2 × i32
//! quatern_b,c,d   256  3 × f32                 352  3 × f64
//! qoffset_x,y,z   268  3 × f32                 376  3 × f64
//! srow_x,y,z      280  3 × 4 × f32             400  3 × 4 × f64
//! ```
//! Formats: R. W. Cox et al., `nifti1.h` (2004) and `nifti2.h` (2011), <https://nifti.nimh.nih.gov>.

use std::path::Path;

use crate::error::{FormatError, Result};

/// Size of the longer header in bytes.
pub(crate) const MAX_BYTES: usize = 540;

/// Machine epsilon of f32, in which NIfTI-1 stores the quaternion.
const F32_EPSILON: f64 = f32::EPSILON as f64;

/// A header of either version, as numbers of one width.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NiftiHeader {
    pub(crate) version: u8,
    pub(crate) big_endian: bool,
    /// Whether the voxels are in the same file as the header.
    pub(crate) single_file: bool,
    pub(crate) dim: [i64; 8],
    pub(crate) datatype: i64,
    pub(crate) pixdim: [f64; 8],
    pub(crate) vox_offset: f64,
    pub(crate) scl_slope: f64,
    pub(crate) scl_inter: f64,
    pub(crate) xyzt_units: i64,
    pub(crate) qform_code: i64,
    pub(crate) sform_code: i64,
    pub(crate) quatern: [f64; 3],
    pub(crate) qoffset: [f64; 3],
    pub(crate) srow: [[f64; 4]; 3],
    /// Machine epsilon of the number type in which the file stores the quaternion.
    pub(crate) quatern_epsilon: f64,
}

impl NiftiHeader {
    /// Size of the header in bytes, without extensions.
    pub(crate) fn bytes(&self) -> u64 {
        if self.version == 1 { 348 } else { 540 }
    }
}

/// Version and byte order (true: big-endian), from the first field, `sizeof_hdr`.
pub(crate) fn version(head: &[u8]) -> Option<(u8, bool)> {
    let first = *head.first_chunk::<4>()?;
    match (i32::from_le_bytes(first), i32::from_be_bytes(first)) {
        (348, _) => Some((1, false)),
        (540, _) => Some((2, false)),
        (_, 348) => Some((1, true)),
        (_, 540) => Some((2, true)),
        _ => None,
    }
}

/// Parses the first bytes of a header file.
pub(crate) fn parse(path: &Path, head: &[u8]) -> Result<NiftiHeader> {
    let bad = |what: String| FormatError::damaged(path, what);
    let Some((version, big_endian)) = version(head) else {
        return Err(bad(format!(
            "the NIfTI header begins with bytes {:02x?}, expected its length, 348 or 540",
            &head[..head.len().min(4)]
        )));
    };
    let needed = if version == 1 { 348 } else { 540 };
    if head.len() < needed {
        return Err(bad(format!(
            "the NIfTI-{version} header is cut off: expected {needed} bytes, got {}",
            head.len()
        )));
    }
    let magic = if version == 1 { &head[344..348] } else { &head[4..12] };
    let single_file = match (version, magic) {
        (1, b"n+1\0") | (2, b"n+2\0\r\n\x1A\n") => true,
        (1, b"ni1\0") | (2, b"ni2\0\r\n\x1A\n") => false,
        (1, [0, ..]) => {
            return Err(FormatError::unsupported(
                path,
                "this is an Analyze 7.5 header, which gives neither orientation nor the sign of x",
                "save it as NIfTI",
            ));
        }
        _ => {
            return Err(bad(format!(
                "the NIfTI-{version} magic is \"{}\", expected n+{version} or ni{version} (a text-mode copy damages it)",
                magic.escape_ascii()
            )));
        }
    };
    let fields = Fields { head, big_endian, wide: version == 2 };
    Ok(NiftiHeader {
        version,
        big_endian,
        single_file,
        dim: fields.integers(40, 16),
        datatype: fields.i16(if version == 1 { 70 } else { 12 }),
        pixdim: fields.floats(76, 104),
        vox_offset: if version == 1 { fields.float(108) } else { fields.i64(168) as f64 },
        scl_slope: fields.floats::<1>(112, 176)[0],
        scl_inter: fields.floats::<1>(116, 184)[0],
        xyzt_units: if version == 1 { i64::from(head[123]) } else { fields.i32(500) },
        qform_code: if version == 1 { fields.i16(252) } else { fields.i32(344) },
        sform_code: if version == 1 { fields.i16(254) } else { fields.i32(348) },
        quatern: fields.floats(256, 352),
        qoffset: fields.floats(268, 376),
        srow: [fields.floats(280, 400), fields.floats(296, 432), fields.floats(312, 464)],
        quatern_epsilon: if version == 1 { F32_EPSILON } else { f64::EPSILON },
    })
}

/// Reads numbers at offsets of a header that is known to be long enough.
struct Fields<'a> {
    head: &'a [u8],
    big_endian: bool,
    /// NIfTI-2: 64-bit numbers at the second of the two given offsets.
    wide: bool,
}

impl Fields<'_> {
    /// `N` bytes, least significant first.
    fn little<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.head[at..at + N]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    fn i16(&self, at: usize) -> i64 {
        i16::from_le_bytes(self.little(at)).into()
    }

    fn i32(&self, at: usize) -> i64 {
        i32::from_le_bytes(self.little(at)).into()
    }

    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.little(at))
    }

    fn float(&self, at: usize) -> f64 {
        f32::from_le_bytes(self.little(at)).into()
    }

    fn integers<const N: usize>(&self, narrow_at: usize, wide_at: usize) -> [i64; N] {
        std::array::from_fn(
            |i| {
                if self.wide { self.i64(wide_at + 8 * i) } else { self.i16(narrow_at + 2 * i) }
            },
        )
    }

    fn floats<const N: usize>(&self, narrow_at: usize, wide_at: usize) -> [f64; N] {
        std::array::from_fn(|i| {
            if self.wide {
                f64::from_le_bytes(self.little(wide_at + 8 * i))
            } else {
                self.float(narrow_at + 4 * i)
            }
        })
    }
}
