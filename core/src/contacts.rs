//! Pairs of labels that touch, collected and then packed.
//!
//! The packed form is a sequence of varints. For each label a it holds the number of its partners b > a, then the first partner as b − a −
//! 1 and each next one as its distance from the previous one, less 1. `find_contacts.rs` finds the pairs.

use rustc_hash::FxHashMap;

use crate::NoMemory;
use crate::reserve::{collected, make_room, make_room_in_map};

/// What the memory is for, in errors.
pub(crate) const PAIRS: &str = "a list of the labels that touch";

/// Most bytes of a varint of 32 bits.
const MOST_VARINT: usize = 5;

/// Pairs found so far. A small direct-mapped cache keeps the repeats along a long border away from the set.
pub(crate) struct Pairs {
    set: FxHashMap<u64, ()>,
    recent: [u64; 64],
    /// Corner of a cell in which two labels claim the same voxel, if one was found.
    pub(crate) claimed_twice: Option<[u32; 3]>,
    /// Why pairs are missing, if there was no memory for all.
    no_memory: Option<NoMemory>,
}

impl Pairs {
    pub(crate) fn new() -> Self {
        Self { set: FxHashMap::default(), recent: [0; 64], claimed_twice: None, no_memory: None }
    }

    /// Returns all pairs, in no particular order.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(crate) fn into_vec(self) -> Result<Vec<u64>, NoMemory> {
        match self.no_memory {
            None => collected(self.set.len(), self.set.into_keys(), PAIRS),
            Some(error) => Err(error),
        }
    }

    /// Number of pairs.
    pub(crate) fn len(&self) -> usize {
        self.set.len()
    }

    /// Passes on all pairs, in no particular order; none stay.
    ///
    /// # Errors
    /// [`NoMemory`], as [`Pairs::into_vec`]; those of `visit`.
    pub(crate) fn pass_on(&mut self, visit: impl FnOnce(Vec<u64>) -> crate::Result<()>) -> crate::Result<()> {
        if let Some(error) = self.no_memory.take() {
            return Err(error.into());
        }
        self.recent = [0; 64];
        let pairs = collected(self.set.len(), self.set.drain().map(|(pair, ())| pair), PAIRS)?;
        visit(pairs)
    }

    /// Adds the pair of two different dense indices.
    #[inline]
    pub(crate) fn add(&mut self, a: u32, b: u32) {
        let pair = u64::from(a.min(b)) << 32 | u64::from(a.max(b));
        let slot = (pair.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 58) as usize;
        // The pair (0, 0) does not exist, so an empty slot cannot match.
        if self.recent[slot] != pair {
            self.recent[slot] = pair;
            match make_room_in_map(&mut self.set, PAIRS) {
                Ok(()) => _ = self.set.insert(pair, ()),
                Err(error) => self.no_memory = Some(error),
            }
        }
    }
}

/// Pairs of dense label indices that touch, packed as the module documentation describes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contacts {
    pub(crate) bytes: Vec<u8>,
    pub(crate) pairs: u64,
}

impl Contacts {
    /// Packs pairs `a << 32 | b` with a < b, in rising order, of a volume with `labels` labels.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(crate) fn pack(pairs: &[u64], labels: u32) -> Result<Self, NoMemory> {
        let mut packer = ContactsPacker::new(labels);
        pairs.iter().try_for_each(|&pair| packer.push(pair))?;
        packer.finish()
    }

    /// Validates packed pairs read from a file with `labels` labels. An error gives the byte offset and what is wrong there.
    pub(crate) fn from_packed(bytes: Vec<u8>, labels: u32) -> std::result::Result<Self, (usize, String)> {
        let (mut at, mut pairs) = (0, 0u64);
        for a in 0..labels {
            let count = take_varint(&bytes, &mut at).ok_or_else(|| (at, format!("label {a}: no count")))?;
            let mut before = u64::from(a);
            for _ in 0..count {
                let step =
                    take_varint(&bytes, &mut at).ok_or_else(|| (at, format!("label {a}: no partner")))?;
                before += u64::from(step) + 1;
                if before >= u64::from(labels) {
                    return Err((at, format!("label {a}: partner {before} of {labels} labels")));
                }
                pairs += 1;
            }
        }
        if at != bytes.len() {
            return Err((at, format!("expected the end, got {} more bytes", bytes.len() - at)));
        }
        Ok(Self { bytes, pairs })
    }

    /// Number of pairs.
    pub fn len(&self) -> u64 {
        self.pairs
    }

    /// Whether no two labels touch.
    pub fn is_empty(&self) -> bool {
        self.pairs == 0
    }

    /// Pairs (a, b) of dense label indices with a < b, rising.
    pub fn iter(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        let (mut at, mut left, mut a, mut b, mut label) = (0, 0u32, 0u32, 0u32, 0u32);
        std::iter::from_fn(move || {
            while left == 0 {
                left = take_varint(&self.bytes, &mut at)?;
                (a, b) = (label, label);
                label += 1;
            }
            left -= 1;
            b += take_varint(&self.bytes, &mut at)? + 1;
            Some((a, b))
        })
    }
}

/// Packs pairs one by one.
pub(crate) struct ContactsPacker {
    bytes: Vec<u8>,
    pairs: u64,
    labels: u32,
    /// The label whose partners come now, and those that came.
    label: u32,
    partners: Vec<u32>,
}

impl ContactsPacker {
    /// No pairs yet, of a volume with `labels` labels.
    pub(crate) fn new(labels: u32) -> Self {
        Self { bytes: Vec::new(), pairs: 0, labels, label: 0, partners: Vec::new() }
    }

    /// Adds the next pair `a << 32 | b` with a < b, in rising order.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(crate) fn push(&mut self, pair: u64) -> Result<(), NoMemory> {
        self.go_to((pair >> 32) as u32)?;
        make_room(&mut self.partners, 1, PAIRS)?;
        self.partners.push(pair as u32);
        self.pairs += 1;
        Ok(())
    }

    /// Writes the labels before `label`.
    fn go_to(&mut self, label: u32) -> Result<(), NoMemory> {
        while self.label < label {
            make_room(&mut self.bytes, MOST_VARINT * (1 + self.partners.len()), PAIRS)?;
            put_varint(&mut self.bytes, self.partners.len() as u32);
            let mut before = self.label;
            for partner in self.partners.drain(..) {
                put_varint(&mut self.bytes, partner - before - 1);
                before = partner;
            }
            self.label += 1;
        }
        Ok(())
    }

    /// The packed pairs.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(crate) fn finish(mut self) -> Result<Contacts, NoMemory> {
        self.go_to(self.labels)?;
        self.bytes.shrink_to_fit();
        Ok(Contacts { bytes: self.bytes, pairs: self.pairs })
    }
}

/// Writes a varint: seven bits a byte, lowest first; the top bit says that more bytes follow.
fn put_varint(bytes: &mut Vec<u8>, mut value: u32) {
    while value >= 128 {
        bytes.push(value as u8 | 128);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// Reads a varint; `None` at the end of the bytes and for a value of more than 32 bits.
fn take_varint(bytes: &[u8], at: &mut usize) -> Option<u32> {
    let mut value = 0u64;
    for shift in [0, 7, 14, 21, 28] {
        let byte = *bytes.get(*at)?;
        *at += 1;
        value |= u64::from(byte & 127) << shift;
        if byte < 128 {
            return u32::try_from(value).ok();
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packing_round_trips() {
        let pairs = [(0u64, 1u64), (0, 300), (2, 3), (2, 5), (70_000, 99_999)].map(|(a, b)| a << 32 | b);
        let contacts = Contacts::pack(&pairs, 100_000).unwrap();
        let back: Vec<u64> = contacts.iter().map(|(a, b)| u64::from(a) << 32 | u64::from(b)).collect();
        assert_eq!(back, pairs);
        assert_eq!(Contacts::from_packed(contacts.bytes.clone(), 100_000), Ok(contacts.clone()));
        assert!(Contacts::from_packed(contacts.bytes.clone(), 99_999).is_err());
        assert!(Contacts::from_packed(contacts.bytes[1..].to_vec(), 100_000).is_err());
    }
}
