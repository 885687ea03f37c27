//! Numbers of all pixels, one plane for each number, with room around the rows so that a window never leaves them.
//!
//! ```text
//! a row:  MARGIN zeroes │ width values │ zeroes up to a multiple of LANES, and MARGIN more
//! ```
//! The filter takes LANES pixels beside each other at a time, and compilers make vector instructions of loops over them. What lies in the room around takes no part: it is 0 there as well.

use bytemuck::Zeroable;
use pumice_core::NoMemory;
use pumice_core::reserve::zeroed;
use rayon::prelude::*;

use super::{RADIUS, WIDE_STEPS};

/// Room beside a row: how far the widest window reaches.
pub(super) const MARGIN: usize = RADIUS * WIDE_STEPS[1];

/// Pixels that are filtered together: so many that compilers make vector instructions of a loop over them, of whatever width.
pub(super) const LANES: usize = 32;

/// A number of each of [`LANES`] pixels.
pub(super) type Lanes<T = f32> = [T; LANES];

/// Three numbers of each pixel.
pub(super) type Triple = [Vec<f32>; 3];

/// Means, and the variances of these means.
pub(super) struct Means {
    pub(super) mean: Triple,
    pub(super) variance: Triple,
}

/// A row of [`Means`], with the room beside it.
pub(super) struct RowOfMeans<'a> {
    mean: [&'a mut [f32]; 3],
    variance: [&'a mut [f32]; 3],
}

impl Means {
    /// Of zeroes.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for 24 bytes a pixel.
    pub(super) fn zeroes(layout: Layout) -> Result<Self, NoMemory> {
        let zeroes = || Ok([layout.zeroes()?, layout.zeroes()?, layout.zeroes()?]);
        Ok(Self { mean: zeroes()?, variance: zeroes()? })
    }

    /// Calls `fill` with each row and its number.
    pub(super) fn fill_rows(&mut self, layout: Layout, fill: impl Fn(usize, RowOfMeans<'_>) + Sync) {
        let ([red, green, blue], [of_red, of_green, of_blue]) = (&mut self.mean, &mut self.variance);
        let n = layout.stride();
        let of_mean = (red.par_chunks_mut(n), green.par_chunks_mut(n), blue.par_chunks_mut(n));
        let of_variance = (of_red.par_chunks_mut(n), of_green.par_chunks_mut(n), of_blue.par_chunks_mut(n));
        (of_mean, of_variance).into_par_iter().enumerate().for_each(|(y, (mean, variance))| {
            let mean = [mean.0, mean.1, mean.2];
            fill(y, RowOfMeans { mean, variance: [variance.0, variance.1, variance.2] });
        });
    }
}

impl RowOfMeans<'_> {
    /// Sets those of the pixels from `x` on that take part.
    #[inline(always)]
    pub(super) fn set(&mut self, x: usize, takes_part: &Lanes, mean: &[Lanes; 3], variance: &[Lanes; 3]) {
        for c in 0..3 {
            for lane in (0..LANES).filter(|&lane| takes_part[lane] > 0.0) {
                self.mean[c][MARGIN + x + lane] = mean[c][lane];
                self.variance[c][MARGIN + x + lane] = variance[c][lane];
            }
        }
    }
}

/// Where pixels lie in a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Layout {
    /// Values from one row to the next.
    pub(super) fn stride(self) -> usize {
        self.width.next_multiple_of(LANES) + 2 * MARGIN
    }

    /// Where the pixel (x, y) lies in a plane.
    pub(super) fn place(self, x: usize, y: usize) -> usize {
        y * self.stride() + MARGIN + x
    }

    /// A plane of zeroes.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none.
    pub(super) fn zeroes<T: Zeroable>(self) -> Result<Vec<T>, NoMemory> {
        zeroed(self.stride().saturating_mul(self.height), "denoiser: what it compares")
    }

    /// A plane with a value for each pixel, by its number from the upper left and its place in planes.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none.
    pub(super) fn plane<T: Zeroable + Send>(
        self,
        of: impl Fn(usize, usize) -> T + Sync,
    ) -> Result<Vec<T>, NoMemory> {
        let mut plane = self.zeroes()?;
        plane.par_chunks_mut(self.stride()).enumerate().for_each(|(y, row)| {
            let (first, place) = (y * self.width, self.place(0, y));
            let pixels = &mut row[MARGIN..][..self.width];
            pixels.iter_mut().enumerate().for_each(|(x, value)| *value = of(first + x, place + x));
        });
        Ok(plane)
    }

    /// Three such planes.
    ///
    /// # Errors
    /// As [`Layout::plane`].
    pub(super) fn triple(self, of: impl Fn(usize, usize, usize) -> f32 + Sync) -> Result<Triple, NoMemory> {
        let plane = |c| self.plane(|i, at| of(i, at, c));
        Ok([plane(0)?, plane(1)?, plane(2)?])
    }
}

/// The values from a place on.
#[inline(always)]
pub(super) fn lanes<T>(plane: &[T], at: usize) -> &Lanes<T> {
    &plane[at..at + LANES].as_chunks().0[0]
}

/// The values of three planes from a place on.
#[inline(always)]
pub(super) fn three_lanes(planes: &Triple, at: usize) -> [&Lanes; 3] {
    [lanes(&planes[0], at), lanes(&planes[1], at), lanes(&planes[2], at)]
}
