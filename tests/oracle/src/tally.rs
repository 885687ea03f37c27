//! Counts the oracle's verdicts on a set of rays.

use super::Verdict;

/// Counts of verdicts.
#[derive(Default, Debug)]
pub struct Tally {
    /// Rays that were checked.
    pub rays: u64,
    /// Rays that hit something.
    pub hits: u64,
    /// Rays with the verdict [`Verdict::Touch`].
    pub touches: u64,
    /// Longest chord that was skipped, in voxels.
    pub worst_chord: f64,
    /// Rays with a wrong hit or miss.
    pub wrong: u64,
    /// Description of the first of them.
    pub first_wrong: Option<String>,
}

impl Tally {
    /// Counts one ray.
    pub fn add(&mut self, verdict: Verdict, hit: bool, describe: impl FnOnce() -> String) {
        self.rays += 1;
        self.hits += u64::from(hit);
        match verdict {
            Verdict::Exact => {}
            Verdict::Touch(chord) => {
                self.touches += 1;
                self.worst_chord = self.worst_chord.max(chord);
            }
            Verdict::Wrong(why) => {
                self.wrong += 1;
                self.first_wrong.get_or_insert_with(|| format!("{why}: {}", describe()));
            }
        }
    }

    /// Prints the counts.
    pub fn report(&self, name: &str) {
        println!(
            "{name:32} {:>9} rays {:>9} hits {:>7} touches, worst chord {:.1e}, {} wrong",
            self.rays, self.hits, self.touches, self.worst_chord, self.wrong
        );
    }

    /// Prints the counts and asserts that no ray was wrong.
    ///
    /// # Panics
    /// When a ray was wrong.
    pub fn assert_right(&self, name: &str) {
        self.report(name);
        assert_eq!(self.wrong, 0, "{name}: {}", self.first_wrong.as_deref().unwrap_or(""));
    }
}
