//! How much light GGX surfaces keep, by angle and roughness: grids of numbers in [0, 1], between which lines are drawn; and sheen's.
//!
//! | table | entries, the first index fastest | what |
//! |---|---|---|
//! | `REFLECTION` | 32 roughnesses × 32 cosines | part that one reflection leaves, if microfacets were mirrors |
//! | `REFLECTION_AVERAGE` | 32 roughnesses | its average over the cosine-weighted hemisphere |
//! | `FRESNEL_SHARE` | 16 roughnesses × 16 cosines × 16 indices | where the reflectance is between that at normal incidence and 1 |
//! | `GLASS` | 16 × 16 × 16 | part that one reflection or refraction leaves, from outside |
//! | `GLASS_AVERAGE` | 16 roughnesses × 16 indices | its average |
//! | `GLASS_INSIDE`, `GLASS_INSIDE_AVERAGE` | as those | the same from inside |
//! | `SHEEN`, three of them | 32 cosines × 32 roughnesses | A, B and R of `bsdf/sheen.rs` |
//!
//! Roughnesses and cosines go from 0 to 1. An index of refraction n has the place √((n−1)/(n+1)). The grids are Cycles', so that
//! what lies between entries is as there; the numbers are computed by `examples/scattering_tables.rs`.
//!
//! Those of the sheen are published: `fitting/python/data/ltc_table_sheen_volume.npy` of github.com/tizian/ltc-sheen at 9262411
//! (Apache-2.0), rounded to five digits as in Cycles, in the order of the table above. They are a fit to days of random walks, and
//! where little is reflected they are that fit's noise, so that another fit would be another picture.

use glam::Vec3;

/// Place of `REFLECTION` among all entries.
pub const REFLECTION: usize = 0;
/// See the module.
pub const REFLECTION_AVERAGE: usize = 1024;
/// See the module.
pub const FRESNEL_SHARE: usize = 1056;
/// See the module.
pub const GLASS: usize = 5152;
/// See the module.
pub const GLASS_AVERAGE: usize = 9248;
/// From `GLASS` to `GLASS_INSIDE`, and from the one average to the other.
pub const INSIDE: usize = 4352;
/// See the module; the first of the three.
pub const SHEEN: usize = 13_856;
/// Of each of the three.
pub const SHEEN_ENTRIES: usize = 1024;
/// Number of all entries.
pub const ENTRIES: usize = SHEEN + 3 * SHEEN_ENTRIES;

/// All tables, one after the other.
pub static TABLES: [f32; ENTRIES] = floats(include_bytes!("tables.bin"), include_bytes!("sheen.bin"));

/// Little-endian floats, of two files.
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

/// A table of `n` entries at `x`, 0 to 1.
#[inline]
pub fn table_1d(at: usize, n: usize, x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
    let i = (x as usize).min(n - 2);
    let t = x - i as f32;
    TABLES[at + i] * (1.0 - t) + TABLES[at + i + 1] * t
}

/// A table of `n` × `n` entries.
#[inline]
pub fn table_2d(at: usize, n: usize, x: f32, y: f32) -> f32 {
    let y = y.clamp(0.0, 1.0) * (n - 1) as f32;
    let i = (y as usize).min(n - 2);
    let t = y - i as f32;
    table_1d(at + i * n, n, x) * (1.0 - t) + table_1d(at + (i + 1) * n, n, x) * t
}

/// A table of `n` × `n` × `n` entries.
#[inline]
pub fn table_3d(at: usize, n: usize, x: f32, y: f32, z: f32) -> f32 {
    let z = z.clamp(0.0, 1.0) * (n - 1) as f32;
    let i = (z as usize).min(n - 2);
    let t = z - i as f32;
    table_2d(at + i * n * n, n, x, y) * (1.0 - t) + table_2d(at + (i + 1) * n * n, n, x, y) * t
}

/// Place of an index of refraction.
pub fn index_place(eta: f32) -> f32 {
    ((eta - 1.0).abs() / (eta + 1.0)).sqrt()
}

/// How much more light a rough surface reflects by all its scatterings than by the first alone, of which it keeps the part `kept`
/// from here and `kept_average` from everywhere; `once` is what one scattering leaves (Kulla and Conty 2017, appendix; as in
/// Cycles, the lobe of the first stands for all, and one factor `once` is in it already).
pub(super) fn gain(once: Vec3, kept: f32, kept_average: f32) -> Vec3 {
    let further = once * kept_average / (Vec3::ONE - once * (1.0 - kept_average));
    Vec3::ONE + further * ((1.0 - kept) / kept)
}
