//! Albedos of GGX surfaces by angle and roughness, as linearly interpolated grids of numbers in [0, 1]; and the sheen's tables.
//!
//! | table | entries, the first index fastest | what |
//! |---|---|---|
//! | `REFLECTION` | 32 roughnesses × 32 cosines | albedo of single reflection if microfacets were perfect mirrors |
//! | `REFLECTION_AVERAGE` | 32 roughnesses | its average over the cosine-weighted hemisphere |
//! | `FRESNEL_SHARE` | 16 roughnesses × 16 cosines × 16 indices | position of the reflectance between that at normal incidence and 1 |
//! | `GLASS` | 16 × 16 × 16 | albedo of single reflection or refraction, from outside |
//! | `GLASS_AVERAGE` | 16 roughnesses × 16 indices | its average |
//! | `GLASS_INSIDE`, `GLASS_INSIDE_AVERAGE` | as those | the same from inside |
//! | `SHEEN`, three of them | 32 cosines × 32 roughnesses | A, B and R of `bsdf/sheen.rs` |
//!
//! Roughnesses and cosines go from 0 to 1. An index of refraction n has the coordinate √((n−1)/(n+1)). The grids are those of Cycles, so
//! that interpolated values agree too; `examples/scattering_tables.rs` computes the numbers.
//!
//! The sheen's tables are published: `fitting/python/data/ltc_table_sheen_volume.npy` of github.com/tizian/ltc-sheen at 9262411
//! (Apache-2.0), rounded to five digits as in Cycles, in the order of the table above. They are a fit to days of random walks. Where little
//! is reflected they contain that fit's noise, so another fit would give another picture.

use glam::Vec3;

/// Offset of `REFLECTION` in [`TABLES`].
pub const REFLECTION: usize = 0;
/// Offset of `REFLECTION_AVERAGE` in [`TABLES`].
pub const REFLECTION_AVERAGE: usize = 1024;
/// Offset of `FRESNEL_SHARE` in [`TABLES`].
pub const FRESNEL_SHARE: usize = 1056;
/// Offset of `GLASS` in [`TABLES`].
pub const GLASS: usize = 5152;
/// Offset of `GLASS_AVERAGE` in [`TABLES`].
pub const GLASS_AVERAGE: usize = 9248;
/// Distance from `GLASS` to `GLASS_INSIDE`, and from one average to the other.
pub const INSIDE: usize = 4352;
/// Offset of the first of the three `SHEEN` tables in [`TABLES`].
pub const SHEEN: usize = 13_856;
/// Entries of each of the three `SHEEN` tables.
pub const SHEEN_ENTRIES: usize = 1024;
/// Entries of all tables together.
pub const ENTRIES: usize = SHEEN + 3 * SHEEN_ENTRIES;

/// All tables, one after another.
pub static TABLES: [f32; ENTRIES] = floats(include_bytes!("tables.bin"), include_bytes!("sheen.bin"));

/// Decodes the little-endian floats of the two files.
const fn floats(computed: &[u8; 4 * SHEEN], published: &[u8; 12 * SHEEN_ENTRIES]) -> [f32; ENTRIES] {
    let mut all = [0.0; ENTRIES];
    let mut i = 0;
    while i < ENTRIES {
        let (bytes, at): (&[u8], usize) =
            if i < SHEEN { (computed, 4 * i) } else { (published, 4 * (i - SHEEN)) };
        all[i] = f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        i += 1;
    }
    all
}

/// The entry before coordinate `x` in [0, 1] along a side of `n` entries, and the part of the way to the next.
#[inline(always)]
fn place(n: usize, x: f32) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
    let i = (x as u32 as usize).min(n - 2);
    (i, x - i as f32)
}

/// Interpolates between two numbers.
#[inline(always)]
fn between(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

/// Interpolates a table of `n` entries at `x` in [0, 1].
#[inline]
pub fn table_1d(at: usize, n: usize, x: f32) -> f32 {
    let (i, t) = place(n, x);
    let row = &TABLES[at + i..][..2];
    between(row[0], row[1], t)
}

/// Interpolates a table of `n` × `n` entries; `x` runs fastest.
#[inline]
pub fn table_2d(at: usize, n: usize, x: f32, y: f32) -> f32 {
    let ((i, tx), (j, ty)) = (place(n, x), place(n, y));
    let rows = &TABLES[at + j * n + i..][..n + 2];
    let of_row = |first: usize| between(rows[first], rows[first + 1], tx);
    between(of_row(0), of_row(n), ty)
}

/// Interpolates a table of `n` × `n` × `n` entries; `x` runs fastest.
#[inline]
pub fn table_3d(at: usize, n: usize, x: f32, y: f32, z: f32) -> f32 {
    let ((i, tx), (j, ty), (k, tz)) = (place(n, x), place(n, y), place(n, z));
    let slices = &TABLES[at + (k * n + j) * n + i..][..n * n + n + 2];
    let of_row = |first: usize| between(slices[first], slices[first + 1], tx);
    let of_slice = |first: usize| between(of_row(first), of_row(first + n), ty);
    between(of_slice(0), of_slice(n * n), tz)
}

/// Table coordinate of an index of refraction.
pub fn index_place(eta: f32) -> f32 {
    ((eta - 1.0).abs() / (eta + 1.0)).sqrt()
}

/// Factor by which multiple scattering raises the reflection of a rough surface above single scattering. `kept` is the albedo of single
/// scattering in this direction, `kept_average` its average, and `once` the colour of one scattering (Kulla and Conty 2017, appendix; as in
/// Cycles, the lobe of single scattering stands for all, and already contains one factor `once`).
pub(super) fn gain(once: Vec3, kept: f32, kept_average: f32) -> Vec3 {
    let further = once * kept_average / (Vec3::ONE - once * (1.0 - kept_average));
    Vec3::ONE + further * ((1.0 - kept) / kept)
}
