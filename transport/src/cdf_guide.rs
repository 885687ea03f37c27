//! Where to begin in a cumulative distribution: the cutpoint method (Chen and Asau 1974, *On Generating Random Variates from an Empirical
//! Distribution*). A search of 1,024 entries has ten steps, each of which waits for the one before; with a guide it mostly has one or two.

use pumice_core::NoMemory;
use pumice_core::reserve::reserved;

/// A guide to several cdfs of about the same length.
#[derive(Clone, Debug)]
pub(crate) struct CdfGuide {
    /// Parts of [0, 1], all alike: a power of two, so that products with it are exact.
    parts: usize,
    /// Of each cdf the number of entries at or below the start of each part, and at or below the end of the last.
    starts: Vec<u32>,
}

/// Entries of a cdf for each part.
const ENTRIES_OF_A_PART: usize = 4;

impl CdfGuide {
    /// The guide to cdfs of at most `entries` ascending numbers each, without their leading 0.
    ///
    /// # Errors
    /// [`NoMemory`].
    pub(crate) fn new<'a, T: Copy + Into<f64> + 'a>(
        cdfs: impl ExactSizeIterator<Item = &'a [T]>,
        entries: usize,
        what: &'static str,
    ) -> Result<Self, NoMemory> {
        let parts = (entries.next_power_of_two() / ENTRIES_OF_A_PART).max(1);
        let mut starts = reserved(cdfs.len() * (parts + 1), what)?;
        for cdf in cdfs {
            let mut below = 0;
            for part in 0..=parts {
                let start = part as f64 / parts as f64;
                below += cdf[below..].iter().take_while(|&&end| end.into() <= start).count();
                starts.push(below as u32);
            }
        }
        Ok(Self { parts, starts })
    }

    /// The number of entries of the cdf at this index, `cdf`, that are at or below `u` in [0, 1].
    #[inline]
    pub(crate) fn count_up_to<T: Copy + Into<f64>>(&self, index: usize, cdf: &[T], u: f64) -> usize {
        let part = ((u * self.parts as f64) as usize).min(self.parts - 1);
        let starts = &self.starts[index * (self.parts + 1) + part..][..2];
        let (first, last) = (starts[0] as usize, starts[1] as usize);
        first + cdf[first..last].partition_point(|&end| end.into() <= u)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The guided search finds what a search of all entries finds, at, beside and between the entries and the parts' borders.
    #[test]
    fn guided_searches_find_what_full_ones_do() {
        let mut state = 7u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1u32 << 24) as f32
        };
        let mut searched = 0;
        for (entries, sharpness) in [(1, 1), (2, 1), (5, 1), (64, 1), (1000, 1), (1000, 40), (3000, 400)] {
            let mut cdf = || {
                let weights: Vec<f64> = (0..entries).map(|_| f64::from(random()).powi(sharpness)).collect();
                let total: f64 = weights.iter().sum();
                let mut end = 0.0;
                let ends = weights.iter().map(|w| {
                    end += w / total;
                    end as f32
                });
                let mut ends: Vec<f32> = ends.collect();
                ends[entries - 1] = 1.0;
                ends
            };
            let cdfs = [cdf(), cdf(), vec![1.0; entries], vec![0.0; entries]];
            let guide = CdfGuide::new(cdfs.iter().map(|cdf| &cdf[..]), entries, "a test").unwrap();
            for (index, cdf) in cdfs.iter().enumerate() {
                let borders = (0..=guide.parts).map(|part| part as f32 / guide.parts as f32);
                let numbers: Vec<f32> = borders.chain(cdf.iter().copied()).collect();
                let beside = numbers.iter().flat_map(|u| [u.next_down(), *u, u.next_up()]);
                for u in beside.chain((0..1000).map(|_| random())).map(|u| u.clamp(0.0, 1.0)) {
                    let expected = cdf.iter().filter(|&&end| end <= u).count();
                    assert_eq!(guide.count_up_to(index, cdf, f64::from(u)), expected, "{u} of {entries}");
                    searched += 1;
                }
            }
        }
        assert!(searched > 40_000, "{searched}");
    }
}
