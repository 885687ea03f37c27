//! Separable filters on one channel, with a choice of how the picture continues beyond its border.

use rayon::prelude::*;

/// How a picture continues beyond its border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Border {
    /// The nearest pixel of the border, repeated.
    Clamp,
    /// The picture mirrored, its border pixel repeated once.
    Mirror,
}

impl Border {
    fn index(self, i: isize, n: usize) -> usize {
        let n = n as isize;
        (match self {
            Self::Clamp => i.clamp(0, n - 1),
            // A mirrored picture repeats after 2n pixels.
            Self::Mirror => {
                let j = i.rem_euclid(2 * n);
                j.min(2 * n - 1 - j)
            }
        }) as usize
    }
}

/// One channel of a picture.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f64>,
}

impl Plane {
    /// Correlation with the product of two kernels of odd length, `across` along rows and `down` along columns.
    pub(super) fn filtered(&self, across: &[f64], down: &[f64], border: Border) -> Self {
        let (w, h) = (self.width, self.height);
        let mut rows = vec![0.0; w * h];
        rows.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
            let line = &self.values[y * w..][..w];
            let r = (across.len() / 2) as isize;
            for (x, v) in out.iter_mut().enumerate() {
                *v = (-r..).zip(across).map(|(d, k)| k * line[border.index(x as isize + d, w)]).sum();
            }
        });
        let mut values = vec![0.0; w * h];
        values.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
            let r = (down.len() / 2) as isize;
            for (d, k) in (-r..).zip(down) {
                let line = &rows[border.index(y as isize + d, h) * w..][..w];
                out.iter_mut().zip(line).for_each(|(v, l)| *v += k * l);
            }
        });
        Self { width: w, height: h, values }
    }

    /// The plane whose values are `f` of this one's and another's.
    pub(super) fn zip(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let values = self.values.iter().zip(&other.values).map(|(&a, &b)| f(a, b)).collect();
        Self { width: self.width, height: self.height, values }
    }
}

/// exp(−d² / 2σ²) for d from −radius to radius, not normalised.
pub(super) fn gaussian(radius: usize, sigma: f64) -> Vec<f64> {
    let r = radius as isize;
    (-r..=r).map(|d| (-((d * d) as f64) / (2.0 * sigma * sigma)).exp()).collect()
}

/// The kernel scaled to sum 1.
pub(super) fn normalised(kernel: &[f64]) -> Vec<f64> {
    let sum: f64 = kernel.iter().sum();
    kernel.iter().map(|k| k / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_repeat_as_said() {
        let seen = |b: Border| (-5..8).map(|i| b.index(i, 3)).collect::<Vec<_>>();
        assert_eq!(seen(Border::Clamp), [0, 0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2, 2]);
        assert_eq!(seen(Border::Mirror), [1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
    }

    #[test]
    fn separable_matches_the_double_sum() {
        let (w, h) = (5, 4);
        let values: Vec<f64> = (0..w * h).map(|i| ((i * 7919) % 13) as f64).collect();
        let plane = Plane { width: w, height: h, values: values.clone() };
        let (across, down) = ([1.0, -2.0, 0.5], [3.0, 0.0, 1.0, 2.0, -1.0]);
        for border in [Border::Clamp, Border::Mirror] {
            let got = plane.filtered(&across, &down, border);
            for y in 0..h {
                for x in 0..w {
                    let mut expected = 0.0;
                    for (j, kd) in (-2..).zip(down) {
                        for (i, ka) in (-1..).zip(across) {
                            let (sx, sy) = (border.index(x as isize + i, w), border.index(y as isize + j, h));
                            expected += kd * ka * values[sy * w + sx];
                        }
                    }
                    // Whole numbers and halves: exact in any order.
                    assert_eq!(got.values[y * w + x], expected, "{border:?} at {x}, {y}");
                }
            }
        }
    }
}
