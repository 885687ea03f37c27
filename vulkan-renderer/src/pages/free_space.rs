//! Which parts of a stretch of memory are free: the first free part that is large enough is taken, and neighbouring free parts are joined.

use std::collections::BTreeMap;

/// Free parts of a stretch of memory.
#[derive(Debug)]
pub(super) struct FreeSpace {
    bytes: u64,
    /// Length of each free part by its first byte; no two of them touch.
    parts: BTreeMap<u64, u64>,
}

impl FreeSpace {
    /// So many bytes, all of which are free.
    pub(super) fn new(bytes: u64) -> Self {
        Self { bytes, parts: if bytes > 0 { BTreeMap::from([(0, bytes)]) } else { BTreeMap::new() } }
    }

    /// Length of the whole stretch.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Takes the first free part of this length, if there is one.
    pub(super) fn take(&mut self, bytes: u64) -> Option<u64> {
        let (&at, &length) = self.parts.iter().find(|&(_, &length)| length >= bytes)?;
        self.parts.remove(&at);
        if length > bytes {
            self.parts.insert(at + bytes, length - bytes);
        }
        Some(at)
    }

    /// Gives a part back that was taken.
    pub(super) fn give(&mut self, at: u64, bytes: u64) {
        let (mut at, mut end) = (at, at + bytes);
        if let Some(after) = self.parts.remove(&end) {
            end += after;
        }
        if let Some((&before, &length)) = self.parts.range(..at).next_back()
            && before + length == at
        {
            self.parts.remove(&before);
            at = before;
        }
        self.parts.insert(at, end - at);
    }
}

#[cfg(test)]
mod tests {
    use pumice_oracle::volumes::Random;

    use super::*;

    /// A map of all bytes says the same: parts that are taken lie within the stretch and never overlap, and nothing is lost.
    #[test]
    fn no_byte_is_taken_twice_and_none_is_lost() {
        let (mut random, mut space) = (Random(7), FreeSpace::new(500));
        let (mut taken, mut owned): (Vec<(u64, u64)>, _) = (Vec::new(), [false; 500]);
        let mut refused = 0;
        for _ in 0..5000 {
            let number = (random.unit() * 60.0) as usize;
            if random.unit() < 0.55 {
                let wanted = 1 + number as u64;
                let longest = owned.split(|&owned| owned).map(<[bool]>::len).max().unwrap_or(0) as u64;
                match space.take(wanted) {
                    Some(at) => {
                        let range = at as usize..(at + wanted) as usize;
                        assert!(owned[range.clone()].iter().all(|owned| !owned));
                        owned[range].fill(true);
                        taken.push((at, wanted));
                    }
                    None => {
                        assert!(longest < wanted, "{longest} of {wanted} were free");
                        refused += 1;
                    }
                }
            } else if !taken.is_empty() {
                let (at, bytes) = taken.swap_remove(number % taken.len());
                owned[at as usize..(at + bytes) as usize].fill(false);
                space.give(at, bytes);
            }
        }
        assert!(refused > 100, "{refused}");
        taken.drain(..).for_each(|(at, bytes)| space.give(at, bytes));
        assert_eq!(space.take(500), Some(0));
        assert_eq!(space.take(1), None);
    }
}
