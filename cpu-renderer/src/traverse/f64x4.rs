//! Four f64 numbers at once: one for each axis, and a spare.
//!
//! The preparation of a ray is the same for each axis, and a processor with AVX2 does it for all of them in one instruction. The code is
//! written once, for [`F64x4`]. The instruction set ([`Instructions`]) is passed as a value; a value of a wide set exists only after the
//! processor has been asked for it. Neither fuses a product and a sum, so both give the same bits.

/// A number for each axis and a spare one.
pub(crate) type Lanes = [f64; 4];

/// `f` of the three axes and of the spare.
#[inline(always)]
pub(super) fn lanes(f: impl Fn(usize) -> f64) -> Lanes {
    [f(0), f(1), f(2), f(3)]
}

/// A set of instructions that operate on four numbers.
pub(super) trait Instructions: Copy {
    type F64x4: F64x4;

    fn f64x4(self, of: &Lanes) -> Self::F64x4;

    /// The same number in all four lanes.
    #[inline(always)]
    fn all(self, number: f64) -> Self::F64x4 {
        self.f64x4(&[number; 4])
    }
}

/// Operations lane by lane.
pub(super) trait F64x4: Copy {
    fn array(self) -> Lanes;
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    fn over(self, other: Self) -> Self;
    /// The lesser number of each lane; neither may be NaN.
    fn min(self, other: Self) -> Self;
    /// The greater number of each lane; neither may be NaN.
    fn max(self, other: Self) -> Self;
    /// Absolute values.
    fn size(self) -> Self;
    /// Mask in which bit a is set if lane a is below that of `other`.
    fn below(self, other: Self) -> u32;
}

/// Instructions of every processor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plain;

impl Instructions for Plain {
    type F64x4 = Lanes;

    #[inline(always)]
    fn f64x4(self, of: &Lanes) -> Lanes {
        *of
    }
}

impl F64x4 for Lanes {
    #[inline(always)]
    fn array(self) -> Lanes {
        self
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        lanes(|a| self[a] + other[a])
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        lanes(|a| self[a] - other[a])
    }
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        lanes(|a| self[a] * other[a])
    }
    #[inline(always)]
    fn over(self, other: Self) -> Self {
        lanes(|a| self[a] / other[a])
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        lanes(|a| if self[a] < other[a] { self[a] } else { other[a] })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        lanes(|a| if self[a] > other[a] { self[a] } else { other[a] })
    }
    #[inline(always)]
    fn size(self) -> Self {
        lanes(|a| self[a].abs())
    }
    #[inline(always)]
    fn below(self, other: Self) -> u32 {
        (0..4).map(|a| u32::from(self[a] < other[a]) << a).sum()
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use wide::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod wide {
    #![allow(unsafe_code)]

    use std::arch::x86_64::{
        __m256d, _CMP_LT_OQ, _mm256_add_pd, _mm256_andnot_pd, _mm256_cmp_pd, _mm256_div_pd, _mm256_loadu_pd,
        _mm256_max_pd, _mm256_min_pd, _mm256_movemask_pd, _mm256_mul_pd, _mm256_set1_pd, _mm256_storeu_pd,
        _mm256_sub_pd,
    };

    use std::sync::atomic::{AtomicU8, Ordering};

    use super::{F64x4, Instructions, Lanes};

    /// The instruction sets of the processor: none of these, AVX2 and what came with it, or AVX-512 in addition. Detected once: detection
    /// for every ray would take a tenth of the time of a ray that hits nothing.
    static HAS: AtomicU8 = AtomicU8::new(NOT_ASKED);
    const NOT_ASKED: u8 = 0;
    const PLAIN: u8 = 1;
    const AVX2: u8 = 2;
    const AVX512: u8 = 3;

    #[inline(always)]
    fn has() -> u8 {
        match HAS.load(Ordering::Relaxed) {
            NOT_ASKED => ask(),
            has => has,
        }
    }

    #[cold]
    fn ask() -> u8 {
        let wide = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        let widest = wide
            && is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl");
        let has = if widest {
            AVX512
        } else if wide {
            AVX2
        } else {
            PLAIN
        };
        HAS.store(has, Ordering::Relaxed);
        has
    }

    /// AVX2 and what came with it. A value exists only where the processor was asked and has them.
    #[derive(Clone, Copy, Debug)]
    pub(in super::super) struct Avx2(());

    impl Avx2 {
        /// `None` where the processor lacks some of these instructions.
        #[inline(always)]
        pub(in super::super) fn new() -> Option<Self> {
            (has() >= AVX2).then_some(Self(()))
        }
    }

    /// AVX-512 in addition. A value exists only where the processor was asked and has it.
    #[derive(Clone, Copy, Debug)]
    pub(in super::super) struct Avx512(Avx2);

    impl Avx512 {
        /// `None` where the processor lacks some of these instructions.
        #[inline(always)]
        pub(in super::super) fn new() -> Option<Self> {
            (has() >= AVX512).then_some(Self(Avx2(())))
        }
    }

    /// Only [`Avx2`] creates it, so the processor has AVX.
    #[derive(Clone, Copy, Debug)]
    pub(in super::super) struct Avx2F64x4(__m256d);

    impl Avx2F64x4 {
        /// The register that holds the four numbers.
        #[inline(always)]
        pub(in super::super) fn register(self) -> __m256d {
            self.0
        }
    }

    impl Instructions for Avx2 {
        type F64x4 = Avx2F64x4;

        #[inline(always)]
        fn f64x4(self, of: &Lanes) -> Avx2F64x4 {
            // SAFETY: `self` proves that the processor has AVX; four numbers are read from an array of four.
            Avx2F64x4(unsafe { _mm256_loadu_pd(of.as_ptr()) })
        }

        #[inline(always)]
        fn all(self, number: f64) -> Avx2F64x4 {
            // SAFETY: `self` proves that the processor has AVX.
            Avx2F64x4(unsafe { _mm256_set1_pd(number) })
        }
    }

    impl Instructions for Avx512 {
        type F64x4 = Avx2F64x4;

        #[inline(always)]
        fn f64x4(self, of: &Lanes) -> Avx2F64x4 {
            self.0.f64x4(of)
        }

        #[inline(always)]
        fn all(self, number: f64) -> Avx2F64x4 {
            self.0.all(number)
        }
    }

    /// Defines binary operations that are one instruction each.
    macro_rules! by_instruction {
        ($($method:ident $instruction:ident),*) => {
            $(
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    // SAFETY: there is no `Avx2F64x4` where the processor lacks AVX.
                    Self(unsafe { $instruction(self.0, other.0) })
                }
            )*
        };
    }

    impl F64x4 for Avx2F64x4 {
        by_instruction!(
            plus _mm256_add_pd, minus _mm256_sub_pd, times _mm256_mul_pd, over _mm256_div_pd,
            min _mm256_min_pd, max _mm256_max_pd
        );

        #[inline(always)]
        fn array(self) -> Lanes {
            let mut to = [0.0; 4];
            // SAFETY: there is no `Avx2F64x4` where the processor lacks AVX; four numbers are written to an array with room for four.
            unsafe { _mm256_storeu_pd(to.as_mut_ptr(), self.0) };
            to
        }

        #[inline(always)]
        fn size(self) -> Self {
            // SAFETY: there is no `Avx2F64x4` where the processor lacks AVX.
            Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
        }

        #[inline(always)]
        fn below(self, other: Self) -> u32 {
            // SAFETY: there is no `Avx2F64x4` where the processor lacks AVX.
            (unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0)) }) as u32
        }
    }
}

/// Calls a generic test with each instruction set that this processor has.
#[cfg(test)]
macro_rules! each_way {
    ($test:path) => {
        $test($crate::traverse::f64x4::Plain);
        #[cfg(target_arch = "x86_64")]
        {
            $crate::traverse::f64x4::Avx2::new().into_iter().for_each($test);
            $crate::traverse::f64x4::Avx512::new().into_iter().for_each($test);
        }
    };
}
#[cfg(test)]
pub(super) use each_way;

#[cfg(test)]
mod tests {
    use super::*;

    /// Each operation gives the bits of scalar operations, lane by lane, on numbers of all kinds.
    fn lanes_have_the_bits_of_plain_ones(by: impl Instructions) {
        let numbers = [0.0, -0.0, 1.0, -3.5, 1e-310, -1e-310, 1e300, 0.1, f64::INFINITY, f64::NEG_INFINITY];
        let mut compared = 0;
        for (i, &x) in numbers.iter().enumerate() {
            for (j, &y) in numbers.iter().enumerate() {
                let (a, b) = ([x, y, x + 1.0, 0.3 * y], [y, numbers[(i + j) % 10], x, -y]);
                let (p, w) = ((Plain.f64x4(&a), Plain.f64x4(&b)), (by.f64x4(&a), by.f64x4(&b)));
                let same = |p: Lanes, w: Lanes| {
                    let is_same = |(p, w): (f64, f64)| p.to_bits() == w.to_bits() || p.is_nan() && w.is_nan();
                    assert!(p.into_iter().zip(w).all(is_same), "{a:?}, {b:?}: {p:?}, {w:?}");
                };
                same(p.0.plus(p.1), w.0.plus(w.1).array());
                same(p.0.minus(p.1), w.0.minus(w.1).array());
                same(p.0.times(p.1), w.0.times(w.1).array());
                same(p.0.over(p.1), w.0.over(w.1).array());
                same(F64x4::min(p.0, p.1), w.0.min(w.1).array());
                same(F64x4::max(p.0, p.1), w.0.max(w.1).array());
                same(p.0.size(), w.0.size().array());
                same(Plain.all(x), by.all(x).array());
                assert_eq!(p.0.below(p.1), w.0.below(w.1), "{a:?}, {b:?}");
                compared += 1;
            }
        }
        assert_eq!(compared, 100);
    }

    #[test]
    fn lanes_have_the_bits_of_plain_ones_by_all_ways() {
        each_way!(lanes_have_the_bits_of_plain_ones);
    }
}
