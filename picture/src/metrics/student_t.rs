//! Tail of Student's t distribution, through the regularised incomplete beta function.

/// Probability that |t| is at least `t` with `degrees` of freedom (above 0; infinite means the normal distribution).
pub(super) fn two_sided_tail(t: f64, degrees: f64) -> f64 {
    // Beyond a million degrees the distribution is the normal one to 1e-6 of the tail, and the fraction would converge slowly.
    if degrees > 1e6 {
        return two_sided_normal_tail(t);
    }
    // Abramowitz and Stegun 26.7.1: I_x(ν/2, ½) with x = ν / (ν + t²).
    incomplete_beta(degrees / (degrees + t * t), degrees / 2.0, 0.5)
}

/// erfc(t / √2): by its power series near 0, by its continued fraction in the tail (Abramowitz and Stegun 7.1.6, 7.1.14).
fn two_sided_normal_tail(t: f64) -> f64 {
    let x = t.abs() / std::f64::consts::SQRT_2;
    let scale = 2.0 / std::f64::consts::PI.sqrt() * (-x * x).exp();
    if x < 2.0 {
        let (mut term, mut sum) = (x, x);
        for n in 1..200 {
            term *= 2.0 * x * x / f64::from(2 * n + 1);
            sum += term;
        }
        return 1.0 - scale * sum;
    }
    let mut fraction = x;
    for n in (1..200).rev() {
        fraction = x + f64::from(n) / 2.0 / fraction;
    }
    scale / (2.0 * fraction)
}

/// I_x(a, b) by the continued fraction 26.5.8 of Abramowitz and Stegun, evaluated forwards after Lentz.
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    // The fraction converges fast below this point; beyond it the mirrored function does.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(1.0 - x, b, a);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (-x).ln_1p()).exp() / a;
    const TINY: f64 = 1e-300;
    let (mut c, mut d) = (1.0, 1.0 / (1.0 - (a + b) * x / (a + 1.0)).max(TINY));
    let mut value = d;
    for m in 1..10_000 {
        let k = f64::from(m);
        let even = k * (b - k) * x / ((a + 2.0 * k - 1.0) * (a + 2.0 * k));
        let odd = -(a + k) * (a + b + k) * x / ((a + 2.0 * k) * (a + 2.0 * k + 1.0));
        let before = value;
        for step in [even, odd] {
            d = 1.0 / (1.0 + step * d);
            c = 1.0 + step / c;
            value *= d * c;
        }
        if ((value - before) / value).abs() < 1e-15 {
            break;
        }
    }
    front * value
}

/// ln Γ(x) for x > 0: Stirling's series (Abramowitz and Stegun 6.1.41) at x + 10, brought back by Γ(x + 1) = x Γ(x).
fn ln_gamma(x: f64) -> f64 {
    let lift: f64 = (0..10).map(|i| (x + f64::from(i)).ln()).sum();
    let z = x + 10.0;
    let inverse = 1.0 / z;
    let square = inverse * inverse;
    let series = inverse * (1.0 / 12.0 - square * (1.0 / 360.0 - square * (1.0 / 1260.0 - square / 1680.0)));
    (z - 0.5) * z.ln() - z + 0.5 * (2.0 * std::f64::consts::PI).ln() + series - lift
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// The two branches of the normal tail agree with each other and with t at many degrees.
    #[test]
    fn normal_tail_has_no_step() {
        for i in 0..60 {
            let t = f64::from(i) * 0.1;
            let (normal, many) = (two_sided_tail(t, f64::INFINITY), two_sided_tail(t, 1e6));
            // The distributions differ by about t⁴ / 4ν of the tail; t = 6 gives 3e-4.
            assert!((normal / many - 1.0).abs() < 4e-4, "{t}: {normal} {many}");
        }
    }
}
