//! Tail of Student's t distribution.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// Degrees of freedom beyond which the distribution counts as the normal one, from which it differs by about t⁴ / 4ν of the tail.
/// The incomplete beta function of `statrs` stops after 140 terms: with 10¹² degrees its tail is 2 % off.
const MOST_DEGREES: f64 = 1e6;

/// Probability that |t| is at least `t` with `degrees` of freedom (infinite means the normal distribution); NaN where `degrees` is
/// not above 0.
pub(crate) fn two_sided_tail(t: f64, degrees: f64) -> f64 {
    let degrees = if degrees > MOST_DEGREES { f64::INFINITY } else { degrees };
    StudentsT::new(0.0, 1.0, degrees).map_or(f64::NAN, |distribution| 2.0 * distribution.sf(t.abs()))
}

/// The value that |t| exceeds with `probability`, with `degrees` of freedom: [`two_sided_tail`] solved by bisection. Half a unit of the
/// last of 15 digits is not worth more here.
pub(crate) fn two_sided_quantile(probability: f64, degrees: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while two_sided_tail(high, degrees) > probability && high < f64::MAX / 2.0 {
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if two_sided_tail(middle, degrees) > probability { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_undo_tails() {
        for degrees in [1.0, 2.5, 7.0, 30.125, f64::INFINITY] {
            for probability in [0.5, 0.01, 1e-6, 1e-9] {
                let tail = two_sided_tail(two_sided_quantile(probability, degrees), degrees);
                // The incomplete beta function is good to some 1e-12, relative to a tail of 1e-9 to 1e-3 of that.
                assert!((tail / probability - 1.0).abs() < 1e-3, "{degrees} {probability}: {tail}");
            }
        }
    }

    /// Percentage points that tables of the t distribution print with three decimals, two-sided 5 % and 1 %.
    #[test]
    fn matches_the_printed_table() {
        for (degrees, five_percent, one_percent) in [
            (1.0, 12.706, 63.657),
            (2.0, 4.303, 9.925),
            (7.0, 2.365, 3.499),
            (30.0, 2.042, 2.750),
            (120.0, 1.980, 2.617),
            (f64::INFINITY, 1.960, 2.576),
        ] {
            // Half a unit of the table's last place moves the probability by less than 0.1 % of itself.
            assert!((two_sided_tail(five_percent, degrees) / 0.05 - 1.0).abs() < 2e-3, "{degrees}");
            assert!((two_sided_tail(one_percent, degrees) / 0.01 - 1.0).abs() < 2e-3, "{degrees}");
        }
        assert_eq!(two_sided_tail(0.0, 5.0), 1.0);
    }

    /// One and two degrees have closed forms: 1 − (2/π) arctan t and 1 − t / √(2 + t²).
    #[test]
    fn matches_the_closed_forms() {
        for i in 0..200 {
            let t = f64::from(i) * 0.1;
            let one = 1.0 - t.atan() * std::f64::consts::FRAC_2_PI;
            let two = 1.0 - t / (2.0 + t * t).sqrt();
            assert!((two_sided_tail(t, 1.0) - one).abs() < 1e-12, "{t}");
            assert!((two_sided_tail(t, 2.0) - two).abs() < 1e-12, "{t}");
        }
    }

    /// The normal tail agrees with that of t at the most degrees.
    #[test]
    fn normal_tail_has_no_step() {
        for i in 0..60 {
            let t = f64::from(i) * 0.1;
            let (normal, many) = (two_sided_tail(t, f64::INFINITY), two_sided_tail(t, MOST_DEGREES));
            // The distributions differ by about t⁴ / 4ν of the tail; t = 6 gives 3e-4.
            assert!((normal / many - 1.0).abs() < 4e-4, "{t}: {normal} {many}");
        }
    }
}
