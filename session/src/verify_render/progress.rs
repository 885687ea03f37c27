//! How far a comparison is, as a line for people.
//!
//! ```text
//! 11 of 16 pictures of each; at 8: means within 0.34 % (needed 0.2 %), 212 of 1200 tiles and channels open; 95 s left
//! └ until the next look ───┘ └ what the last look found, against what is needed ────────────────────────┘ └ to --time
//! ```

use std::fmt;

use pumice_picture::agreement::Agreement;

/// How far a comparison is. It is told before each picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VerifyProgress {
    /// Pictures of each renderer so far.
    pub pictures: usize,
    /// Pictures at the next look.
    pub next_look: usize,
    /// Seconds until no further picture is begun, where there is a limit.
    pub seconds_left: Option<f64>,
    /// What the last look found, which did not decide.
    pub last_look: Option<LastLook>,
}

/// What a look at the pictures found that did not decide, or that another look has to confirm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LastLook {
    /// Pictures of each renderer.
    pub pictures: usize,
    /// How far the means of the two renderers may be apart, as a share: the end of the interval of the channel that is farthest.
    pub mean_within: f64,
    /// The share within which the means have to lie.
    pub mean_margin: f64,
    /// Tiles and channels that are not yet known to lie within or beyond their margin.
    pub open: usize,
    /// All tiles and channels that are judged.
    pub tests: usize,
}

impl LastLook {
    /// What of an agreement is told while the comparison goes on.
    pub fn of(agreement: &Agreement) -> Self {
        let share = |value: f64| if agreement.scale > 0.0 { value / agreement.scale } else { 0.0 };
        let farthest = agreement.mean.iter().map(|i| i.difference.abs() + i.half_width).fold(0.0, f64::max);
        let [within, open, outside] = agreement.standing;
        Self {
            pictures: agreement.pictures[0],
            mean_within: share(farthest),
            mean_margin: share(agreement.mean.iter().map(|i| i.margin).fold(0.0, f64::max)),
            open,
            tests: within + open + outside,
        }
    }
}

impl fmt::Display for VerifyProgress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} pictures of each", self.pictures, self.next_look)?;
        if let Some(look) = self.last_look {
            let percent = |share: f64| 100.0 * share;
            write!(
                f,
                "; at {}: means within {:.2} % (needed {:.1} %), {} of {} tiles and channels open",
                look.pictures,
                percent(look.mean_within),
                percent(look.mean_margin),
                look.open,
                look.tests
            )?;
        }
        match self.seconds_left {
            Some(seconds) => write!(f, "; {seconds:.0} s left"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use pumice_picture::Image;
    use pumice_picture::agreement::{PictureSet, judge, level_of_look};

    use super::*;

    /// Eight pictures of 16 × 8 pixels, whose value is `value` and alternates by `swing` from picture to picture.
    fn pictures(value: f32, swing: f32) -> PictureSet {
        let mut set = PictureSet::default();
        for number in 0..8 {
            let sign = if number % 2 == 0 { swing } else { -swing };
            set.push(Image::new(16, 8, vec![[value + sign; 3]; 128]));
        }
        set
    }

    #[test]
    fn the_line_has_pictures_interval_margin_and_time() {
        let mut progress = VerifyProgress { pictures: 3, next_look: 8, seconds_left: None, last_look: None };
        assert_eq!(progress.to_string(), "3 of 8 pictures of each");
        progress.seconds_left = Some(95.4);
        assert_eq!(progress.to_string(), "3 of 8 pictures of each; 95 s left");
        let look = LastLook { pictures: 8, mean_within: 0.0034, mean_margin: 0.002, open: 212, tests: 1200 };
        (progress.pictures, progress.next_look, progress.last_look) = (11, 16, Some(look));
        let expected = "11 of 16 pictures of each; at 8: means within 0.34 % (needed 0.2 %), 212 of 1200 tiles and \
                        channels open; 95 s left";
        assert_eq!(progress.to_string(), expected);
    }

    #[test]
    fn a_look_says_how_far_the_interval_reaches() {
        let found = |theirs: f32, swing: f32| {
            let [a, b] = [pictures(1.0, swing), pictures(theirs, swing)];
            LastLook::of(&judge(&a, &b, &[true; 128], level_of_look(0)))
        };
        let even = found(1.0, 0.0);
        assert!((even.pictures, even.open, even.tests) == (8, 0, 6) && even.mean_within < 0.002, "{even:?}");
        assert!((even.mean_margin - 0.002).abs() < 1e-12, "{even:?}");
        // Noise keeps tiles open, and a difference is part of how far the interval reaches.
        let noisy = found(1.0, 0.1);
        assert!(noisy.open == 6 && noisy.mean_within > 0.05, "{noisy:?}");
        let apart = found(2.0, 0.1);
        assert!(apart.mean_within > 0.5 && apart.mean_within > noisy.mean_within, "{apart:?}");
    }
}
