//! Compares `f64.glsl` with the CPU's doubles, bit for bit; any NaN equals any NaN.

use super::gpu::Gpu;
use super::words::{Random, Reader, Row};

/// Doubles of every kind: ordinary ones, neighbours of powers of two, subnormals, infinities, values half-way between two floats, and pairs
/// that nearly cancel.
fn operands(random: &mut Random) -> (f64, f64) {
    let special = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f64::MIN_POSITIVE,
        -f64::MIN_POSITIVE,
        5e-324,
        f64::MAX,
        f64::MIN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
        0.5,
        4_294_967_295.0,
        4_294_967_296.0,
        1e-40,
        3.402_823_5e38,
    ];
    let mut one = || {
        let bits = random.next();
        match random.below(8) {
            0 => special[random.below(special.len() as u32) as usize],
            1 => f64::from_bits(bits),
            // Few bits in the fraction: ties when rounded to floats, exact products and roots.
            2 => f64::from_bits(bits & 0xFFFF_FFFF_F000_0000),
            3 => f64::from_bits(bits & 0x800F_FFFF_FFFF_FFFF),
            4 => f64::from(random.below(1 << 23)) * f64::from(random.below(1 << 12)),
            _ => random.signed() * f64::from(random.below(1 << 24)),
        }
    };
    let (a, b) = (one(), one());
    match random.below(4) {
        0 => (a, f64::from_bits(a.to_bits() ^ 1 << 63).wrapping_near(random.below(5))),
        _ => (a, b),
    }
}

trait Near {
    fn wrapping_near(self, steps: u32) -> Self;
}

impl Near for f64 {
    fn wrapping_near(self, steps: u32) -> Self {
        f64::from_bits(self.to_bits().wrapping_add(u64::from(steps)))
    }
}

fn check(native: bool) {
    let gpu = Gpu::new();
    assert!(gpu.has_f64 || !native, "{} has no doubles of its own", gpu.name);
    let mut random = Random(11);
    let inputs: Vec<_> = (0..200_000).map(|_| (operands(&mut random), random.next() as u32)).collect();
    let rows: Vec<_> =
        inputs.iter().map(|&((a, b), c)| Row::default().double(a).double(b).word(c).0).collect();
    let out = gpu.probe(native, 0, 0, &rows, 23);
    for (&((a, b), c), row) in inputs.iter().zip(&out) {
        let mut r = Reader(row);
        let expected = [
            a + b,
            a - b,
            a * b,
            a / b,
            a.sqrt(),
            a.floor(),
            f64::from(c),
            f64::from(f32::from_bits(c)),
            a.max(b),
        ];
        let names = ["add", "sub", "mul", "div", "sqrt", "floor", "from_u32", "from_f32", "max"];
        for (name, e) in names.into_iter().zip(expected) {
            let got = r.double();
            let zeros = name == "max" && e == 0.0 && got == 0.0;
            let same = got.to_bits() == e.to_bits() || e.is_nan() && got.is_nan() || zeros;
            assert!(same, "{name} of {a:e} {b:e} {c:08x}: expected {e:e}, got {got:e}");
        }
        let (e, got) = (a as f32, r.float());
        assert!(
            got.to_bits() == e.to_bits() || e.is_nan() && got.is_nan(),
            "to_f32 of {a:e}: {e:e}, {got:e}"
        );
        assert_eq!(r.word(), a as u32, "to_u32 of {a:e}");
        assert_eq!([r.word(), r.word(), r.word()], [a < b, a <= b, a == b].map(u32::from), "{a:e} {b:e}");
    }
}

#[test]
fn doubles_in_integers_are_doubles() {
    check(false);
}

#[test]
fn native_doubles_are_doubles() {
    check(true);
}
