//! Cryptomatte: the labels that a pixel sees, each with the share of the pixel that it covers, by the name of the label or of its type.
//!
//! After Friedman and Jones, *Fully automatic ID mattes with support for motion blur and transparency* (SIGGRAPH posters 2015) and
//! *Cryptomatte Specification* 1.2.0 (Psyop), as compositors read it:
//!
//! ```text
//! name  ─ UTF-8 ─► MurmurHash3_x86_32, seed 0 ─► bits of a 32 bit float, exponents 0 and 255 moved by one: the id
//! pixel ─► (id, coverage) in falling order of coverage; a layer's four channels hold two: id, coverage, id, coverage
//! file  ─► cryptomatte/KEY/name        the layers' name without their number
//!          cryptomatte/KEY/hash        MurmurHash3_32
//!          cryptomatte/KEY/conversion  uint32_to_float32
//!          cryptomatte/KEY/manifest    {"name": "hash, 8 hexadecimal digits", …}      KEY: 7 digits of the hash of `name`
//! ```
//! **Names.** The name of a label is its id in decimal: label tables have no other name. The name of a type is that of the table, or
//! [`NO_TYPE`] for a label without a type. The name of a mesh, in both mattes, is the last part of its source, which in Blender is the
//! object's name. Equal names are one matte, in all instances. So are two names with the same hash; of 10,000 labels, one table in a
//! hundred has such a pair.
//!
//! **Coverage** is the share of a pixel's samples whose first surface has the id. Samples are distributed by the film's filter, so all
//! have equal weight. A sample that passes straight through a surface (alpha) counts for the next surface, so coverages are straight,
//! not premultiplied, and add up to alpha.
//!
//! **Slots.** A pixel keeps twice as many ids as are written, with counts. When all slots are taken, a new id replaces the one with the
//! least count and inherits that count: *Space-Saving* (Metwally, Agrawal, El Abbadi, *Efficient computation of frequent and top-k
//! elements in data streams*, ICDT 2005, §3). With n slots, every id that covers more than 1/n of a pixel is kept, no count is too high
//! by more than 1/n of the samples, and the counts still add up to alpha. Where no pixel sees more ids than it has slots, the result is
//! exact. Samples are added in order, so the result depends neither on threads nor on slices.

use std::collections::{BTreeMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use pumice_core::{CompressedVolume, LabelTable, NoMemory};
use pumice_scene::{Film, Pass, Scene};

use crate::film::FilmBuffer;
use crate::picture::Picture;

/// Type name of labels without a type.
pub const NO_TYPE: &str = "no type";

/// Ids of one surface: by label, by type. No surface has the id 0.
pub type Ids = [f32; 2];

/// One of the two mattes: its layers, and the names that its ids stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct Matte {
    /// Kind of the matte: [`Pass::CryptomatteLabel`] or [`Pass::CryptomatteType`].
    pub pass: Pass,
    /// Id, coverage, id, coverage of each pixel; the highest coverages in the first layer.
    pub layers: Vec<Vec<[f32; 4]>>,
    /// Hash of each name that occurs in the picture.
    pub names: BTreeMap<String, u32>,
}

impl Matte {
    /// The part of each pixel that the surfaces with any of these names cover together, from 0 to 1; 0 for names that are not there.
    pub fn coverage(&self, names: &[String]) -> Vec<f32> {
        let wanted: HashSet<u32> = names.iter().map(|name| id_of(name).to_bits()).collect();
        let of = |id: f32, coverage: f32| if wanted.contains(&id.to_bits()) { coverage } else { 0.0 };
        let pixels = self.layers.first().map_or(0, Vec::len);
        let sum = |i: usize| self.layers.iter().map(|l| of(l[i][0], l[i][1]) + of(l[i][2], l[i][3])).sum();
        (0..pixels).map(sum).collect()
    }
}

/// MurmurHash3_x86_32 (Appleby 2011) with seed 0.
pub fn hash(name: &[u8]) -> u32 {
    let scrambled = |k: u32| k.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (blocks, tail) = name.as_chunks::<4>();
    let mut h = 0u32;
    for block in blocks {
        h ^= scrambled(u32::from_le_bytes(*block));
        h = h.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    if !tail.is_empty() {
        let mut last = [0; 4];
        last[..tail.len()].copy_from_slice(tail);
        h ^= scrambled(u32::from_le_bytes(last));
    }
    h ^= name.len() as u32;
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

/// The hash as an id: as a float it is never zero, denormal, infinite or NaN.
pub fn id_of_hash(hash: u32) -> f32 {
    let exponent = hash >> 23 & 255;
    f32::from_bits(if exponent == 0 || exponent == 255 { hash ^ 1 << 23 } else { hash })
}

fn id_of(name: &str) -> f32 {
    id_of_hash(hash(name.as_bytes()))
}

/// The key (7 digits) of the file attributes that belong to the layers of this name.
pub(crate) fn key_of(layers: &str) -> String {
    format!("{:08x}", hash(layers.as_bytes()))[..7].to_owned()
}

fn name_of_type(table: &LabelTable, label: u32) -> &str {
    let number = table.type_of(label).map(usize::from);
    number.and_then(|n| table.type_names().get(n)).map_or(NO_TYPE, String::as_str)
}

fn name_of_mesh(source: &Path) -> String {
    source.file_name().unwrap_or(source.as_os_str()).to_string_lossy().into_owned()
}

/// The ids of a volume's labels, in order of dense index.
pub fn ids_of_volume(table: &LabelTable) -> Vec<Ids> {
    let ids = table.ids().iter().zip(0u32..);
    ids.map(|(id, label)| [id_of(&id.to_string()), id_of(name_of_type(table, label))]).collect()
}

/// The ids of a mesh. They do not depend on the materials of its triangles.
pub fn ids_of_mesh(source: &Path) -> Vec<Ids> {
    vec![[id_of(&name_of_mesh(source)); 2]]
}

impl FilmBuffer {
    /// The mattes of the pixels without names, for the kinds that are kept.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub fn mattes(&self) -> Result<Vec<Matte>, NoMemory> {
        let kept = self.kept();
        let slots = kept.matte_slots();
        let kinds = Pass::MATTES.iter().zip(kept.mattes).filter(|(_, is_kept)| *is_kept);
        let mut at = kept.mattes_at();
        let mut mattes = Vec::new();
        for (&pass, _) in kinds {
            let layer =
                |l: usize| self.of_each_pixel(|sums, n| two_ranks(&sums[at..][..2 * slots], n, 2 * l));
            let layers = (0..slots / 4).map(layer).collect::<Result<_, _>>()?;
            mattes.push(Matte { pass, layers, names: BTreeMap::new() });
            at += 2 * slots;
        }
        Ok(mattes)
    }
}

/// Id, coverage, id, coverage of the rank `first` (0 is the highest coverage) and the next; among equal coverages, the id that came first is
/// first.
///
/// Each layer ranks a pixel's slots anew, with nothing on the heap: few pixels see more than two ids.
fn two_ranks(slots: &[f32], samples: f32, first: usize) -> [f32; 4] {
    let mut pairs = [[0f32; 2]; 2 * Film::MOST_RANKS as usize];
    let slots = slots.as_chunks::<2>().0;
    for (taken, &slot) in slots.iter().enumerate() {
        let place = pairs[..taken].iter().rposition(|pair| pair[1] >= slot[1]).map_or(0, |last| last + 1);
        pairs[place..=taken].rotate_right(1);
        pairs[place] = slot;
    }
    let [[a, count_a], [b, count_b]] = [pairs[first], pairs[first + 1]];
    [a, count_a / samples, b, count_b / samples]
}

/// Adds to the picture's mattes the names of the ids that occur in them.
pub fn name_mattes(picture: &mut Picture, scene: &Scene, volumes: &[Arc<CompressedVolume>]) {
    for Matte { pass, layers, names } in &mut picture.mattes {
        let ids = layers.iter().flatten().flat_map(|p| [p[0].to_bits(), p[2].to_bits()]);
        let seen: HashSet<u32> = ids.collect();
        let mut tell = |name: &str| {
            let hash = hash(name.as_bytes());
            if seen.contains(&id_of_hash(hash).to_bits()) && !names.contains_key(name) {
                names.insert(name.to_owned(), hash);
            }
        };
        for table in volumes.iter().map(|v| v.labels()) {
            match *pass {
                Pass::CryptomatteType => {
                    table.type_names().iter().for_each(|name| tell(name));
                    tell(NO_TYPE);
                }
                _ => table.ids().iter().for_each(|id| tell(&id.to_string())),
            }
        }
        scene.meshes.iter().for_each(|mesh| tell(&name_of_mesh(&mesh.source)));
    }
}

/// The manifest as JSON. It is not limited to ASCII: readers of Cryptomatte know no escapes except those of quotes and backslashes.
pub(crate) fn manifest(names: &BTreeMap<String, u32>) -> Result<String, String> {
    let digits: BTreeMap<&str, String> =
        names.iter().map(|(name, hash)| (name.as_str(), format!("{hash:08x}"))).collect();
    serde_json::to_string(&digits).map_err(|e| format!("manifest: {e}"))
}

/// Parses a manifest.
pub(crate) fn names_of(manifest: &[u8]) -> Result<BTreeMap<String, u32>, String> {
    let digits: BTreeMap<String, String> = serde_json::from_slice(manifest).map_err(|e| e.to_string())?;
    let number = |(name, digits): (String, String)| match u32::from_str_radix(&digits, 16) {
        Ok(hash) => Ok((name, hash)),
        Err(_) => Err(format!("expected hexadecimal digits, got {digits:?}")),
    };
    digits.into_iter().map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the specification's own list and of Appleby's reference program.
    #[test]
    fn hashes_are_those_of_the_specification() {
        for (name, expected) in [
            ("", 0u32),
            ("hello", 0x248b_fa47),
            ("hello, world", 0x149b_bb7f),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
        ] {
            assert_eq!(hash(name.as_bytes()), expected, "{name}");
        }
        // Exponents at both ends move, by one bit; others do not.
        for (hash, bits) in [(0u32, 0x0080_0000u32), (0x8000_0001, 0x8080_0001), (0x7f80_0000, 0x7f00_0000)] {
            assert_eq!(id_of_hash(hash).to_bits(), bits);
        }
        assert_eq!(id_of_hash(0x248b_fa47).to_bits(), 0x248b_fa47);
    }

    #[test]
    fn ranks_fall_and_those_alike_stay_in_order() {
        let slots = [1.5, 2.0, 2.5, 5.0, 3.5, 2.0, 0.0, 0.0];
        assert_eq!(two_ranks(&slots, 10.0, 0), [2.5, 0.5, 1.5, 0.2]);
        assert_eq!(two_ranks(&slots, 10.0, 2), [3.5, 0.2, 0.0, 0.0]);
    }

    #[test]
    fn manifests_come_back_whatever_their_names() {
        let names: BTreeMap<_, _> = ["a\"b\\c", "gehirn \u{df}\u{6f22}", ""]
            .iter()
            .map(|n| (n.to_string(), hash(n.as_bytes())))
            .collect();
        let json = manifest(&names).unwrap();
        assert!(json.contains("gehirn \u{df}\u{6f22}"), "{json}");
        assert_eq!(names_of(json.as_bytes()).unwrap(), names);
        for bad in ["", "[]", "{\"a\": 1}", "{\"a\": \"xyz\"}", "{\"a\": \"123456789\"}"] {
            assert!(names_of(bad.as_bytes()).is_err(), "{bad}");
        }
    }
}
