// Doubles on any GPU: IEEE 754 binary64, rounded to nearest even, emulated with integers.
//
// Twin of the language's f64, with the same bits in every case except the payload of a NaN. The CPU computes positions and distances in
// doubles; a shader with other rounding would choose another voxel at edges and corners. GPUs may lack doubles, or have them at 1/64 of the
// speed of floats; the inner loops therefore use floats where these are exact enough (box_walk.glsl).
//
//     63   62        52 51                         0
//    ┌────┬────────────┬────────────────────────────┐
//    │sign│ exponent   │ fraction                   │   value = (-1)^sign · 1.fraction · 2^(exponent − 1023)
//    └────┴────────────┴────────────────────────────┘
//
// With NATIVE_F64 defined, sums and products are the device's own (Vulkan demands that they are correctly rounded). Quotients and roots
// stay emulated, because Vulkan allows the device's to be wrong in the last bits. With COUNTS_F64 defined, sums, products, comparisons and
// conversions from integers are counted: those that occupy a device's units for doubles.
#ifndef F64_GLSL
#define F64_GLSL

#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_control_flow_attributes : require
#ifdef NATIVE_F64
#extension GL_EXT_shader_explicit_arithmetic_types_float64 : require
#define f64 double
#define ROLLED
#else
#define f64 uint64_t
// An emulated operation is about a hundred instructions. Loops over the axes stay loops, or pipelines take minutes to compile.
#define ROLLED [[dont_unroll]]
#endif

#ifdef COUNTS_F64
uint f64_operations = 0u;
#define F64_COUNT f64_operations += 1u;
#else
#define F64_COUNT
#endif

const uint64_t F64_SIGN = 0x8000000000000000UL;
const uint64_t F64_MAGNITUDE = 0x7FFFFFFFFFFFFFFFUL;
const uint64_t F64_INFINITY_BITS = 0x7FF0000000000000UL;
const uint64_t F64_NAN_BITS = 0x7FF8000000000000UL;
const uint64_t F64_FRACTION = 0x000FFFFFFFFFFFFFUL;
const uint64_t F64_HIDDEN = 0x0010000000000000UL;

f64 f64_from_bits(uint64_t bits) {
#ifdef NATIVE_F64
    return uint64BitsToDouble(bits);
#else
    return bits;
#endif
}

uint64_t f64_bits(f64 a) {
#ifdef NATIVE_F64
    return doubleBitsToUint64(a);
#else
    return a;
#endif
}

#define F64_ZERO f64_from_bits(0UL)
#define F64_HALF f64_from_bits(0x3FE0000000000000UL)
#define F64_ONE f64_from_bits(0x3FF0000000000000UL)
#define F64_TWO f64_from_bits(0x4000000000000000UL)
#define F64_INFINITY f64_from_bits(F64_INFINITY_BITS)

// Number of zero bits above the highest set one; 64 for 0.
int leading_zeros64(uint64_t v) {
    uint high = uint(v >> 32);
    return high != 0u ? 31 - findMSB(high) : 63 - findMSB(uint(v));
}

// Shifts down; sets the lowest bit if a 1 is shifted out (sticky bit).
uint64_t shift_down_sticky(uint64_t v, int by) {
    if (by >= 64) {
        return v != 0UL ? 1UL : 0UL;
    }
    if (by <= 0) {
        return v;
    }
    return (v >> by) | ((v << (64 - by)) != 0UL ? 1UL : 0UL);
}

// The double nearest to significand · 2^(exponent − 1023 − 62), with this sign. The significand's leading bit is bit 62, or the significand
// is 0.
uint64_t f64_round(uint64_t sign, int exponent, uint64_t significand) {
    if (exponent >= 0x7FF) {
        return sign | F64_INFINITY_BITS;
    }
    if (exponent <= 0) {
        significand = shift_down_sticky(significand, 1 - exponent);
        exponent = 1;
    }
    uint low = uint(significand) & 0x3FFu;
    uint64_t rounded = (significand + 0x200UL) >> 10;
    if (low == 0x200u) {
        rounded &= ~1UL;
    }
    // The hidden bit, where there is one, adds 1 to the exponent. So does a carry out of the fraction, up to infinity.
    return sign | ((uint64_t(uint(exponent - 1)) << 52) + rounded);
}

// Exponent as if normal, and the significand with its leading bit at 62, of a number that is finite and not 0.
void f64_unpack(uint64_t a, out int exponent, out uint64_t significand) {
    exponent = int(uint(a >> 52) & 0x7FFu);
    significand = a & F64_FRACTION;
    if (exponent == 0) {
        int zeros = leading_zeros64(significand);
        significand <<= zeros - 1;
        exponent = 12 - zeros;
    } else {
        significand = (significand | F64_HIDDEN) << 10;
    }
}

bool f64_bits_are_nan(uint64_t a) {
    return (a & F64_MAGNITUDE) > F64_INFINITY_BITS;
}

uint64_t f64_add_bits(uint64_t a, uint64_t b) {
    // Swaps, so that a has the larger magnitude.
    if ((a & F64_MAGNITUDE) < (b & F64_MAGNITUDE)) {
        uint64_t other = a;
        a = b;
        b = other;
    }
    uint64_t magnitude_a = a & F64_MAGNITUDE, magnitude_b = b & F64_MAGNITUDE;
    if (magnitude_a >= F64_INFINITY_BITS) {
        bool opposite = magnitude_b == F64_INFINITY_BITS && a != b;
        return magnitude_a > F64_INFINITY_BITS || opposite ? F64_NAN_BITS : a;
    }
    if (magnitude_b == 0UL) {
        // −0 + −0 is −0, +0 + −0 is +0.
        return magnitude_a == 0UL ? (a & b) : a;
    }
    int exponent_a, exponent_b;
    uint64_t significand_a, significand_b;
    f64_unpack(a, exponent_a, significand_a);
    f64_unpack(b, exponent_b, significand_b);
    significand_b = shift_down_sticky(significand_b, exponent_a - exponent_b);
    uint64_t sign = a & F64_SIGN;
    if (((a ^ b) & F64_SIGN) == 0UL) {
        uint64_t sum = significand_a + significand_b;
        if (sum >> 63 != 0UL) {
            sum = shift_down_sticky(sum, 1);
            exponent_a += 1;
        }
        return f64_round(sign, exponent_a, sum);
    }
    uint64_t difference = significand_a - significand_b;
    if (difference == 0UL) {
        return 0UL;
    }
    // Where a bit was lost the exponents differ by 11 or more, and the shift is at most 1, so the sticky bit stays below the rounding.
    int zeros = leading_zeros64(difference) - 1;
    return f64_round(sign, exponent_a - zeros, difference << zeros);
}

uint64_t f64_mul_bits(uint64_t a, uint64_t b) {
    uint64_t sign = (a ^ b) & F64_SIGN;
    uint64_t magnitude_a = a & F64_MAGNITUDE, magnitude_b = b & F64_MAGNITUDE;
    if (magnitude_a >= F64_INFINITY_BITS || magnitude_b >= F64_INFINITY_BITS) {
        bool nan = magnitude_a > F64_INFINITY_BITS || magnitude_b > F64_INFINITY_BITS || magnitude_a == 0UL
            || magnitude_b == 0UL;
        return nan ? F64_NAN_BITS : sign | F64_INFINITY_BITS;
    }
    if (magnitude_a == 0UL || magnitude_b == 0UL) {
        return sign;
    }
    int exponent_a, exponent_b;
    uint64_t significand_a, significand_b;
    f64_unpack(a, exponent_a, significand_a);
    f64_unpack(b, exponent_b, significand_b);
    // 63 by 64 bits: the product's leading bit is its 125th or 126th, the 61st or 62nd of the upper half.
    significand_b <<= 1;
    uint a1 = uint(significand_a >> 32), a0 = uint(significand_a);
    uint b1 = uint(significand_b >> 32), b0 = uint(significand_b);
    uint64_t low = uint64_t(a0) * b0;
    uint64_t middle = uint64_t(a1) * b0 + (low >> 32);
    uint64_t middle2 = uint64_t(a0) * b1 + (middle & 0xFFFFFFFFUL);
    uint64_t product = uint64_t(a1) * b1 + (middle >> 32) + (middle2 >> 32);
    uint64_t lost = (middle2 << 32) | (low & 0xFFFFFFFFUL);
    if (lost != 0UL) {
        product |= 1UL;
    }
    int exponent = exponent_a + exponent_b - 1022;
    if (product >> 62 == 0UL) {
        product <<= 1;
        exponent -= 1;
    }
    return f64_round(sign, exponent, product);
}

uint64_t f64_div_bits(uint64_t a, uint64_t b) {
    uint64_t sign = (a ^ b) & F64_SIGN;
    uint64_t magnitude_a = a & F64_MAGNITUDE, magnitude_b = b & F64_MAGNITUDE;
    if (magnitude_a >= F64_INFINITY_BITS || magnitude_b >= F64_INFINITY_BITS) {
        bool nan = magnitude_a > F64_INFINITY_BITS || magnitude_b > F64_INFINITY_BITS || magnitude_a == magnitude_b;
        return nan ? F64_NAN_BITS : magnitude_b == F64_INFINITY_BITS ? sign : sign | F64_INFINITY_BITS;
    }
    if (magnitude_b == 0UL) {
        return magnitude_a == 0UL ? F64_NAN_BITS : sign | F64_INFINITY_BITS;
    }
    if (magnitude_a == 0UL) {
        return sign;
    }
    int exponent_a, exponent_b;
    uint64_t remainder, divisor;
    f64_unpack(a, exponent_a, remainder);
    f64_unpack(b, exponent_b, divisor);
    // Both as 53 bits. The first digit is 1.
    remainder >>= 10;
    divisor >>= 10;
    int exponent = exponent_a - exponent_b + 1023;
    if (remainder < divisor) {
        remainder <<= 1;
        exponent -= 1;
    }
    uint64_t quotient = 1UL;
    int64_t rest = int64_t(remainder - divisor);
    // Three digits of 20 bits follow. Each is guessed in floats, which is wrong by a few at most, then corrected by the remainder. The
    // remainder is far smaller than 2^63, so arithmetic modulo 2^64 finds it.
    float per_divisor = 1048576.0 / float(divisor);
    [[dont_unroll]] for (int round = 0; round < 3; round++) {
        int64_t digit = int64_t(float(rest) * per_divisor);
        rest = (rest << 20) - digit * int64_t(divisor);
        while (rest < 0L) {
            digit -= 1L;
            rest += int64_t(divisor);
        }
        while (rest >= int64_t(divisor)) {
            digit += 1L;
            rest -= int64_t(divisor);
        }
        quotient = (quotient << 20) + uint64_t(digit);
    }
    return f64_round(sign, exponent, (quotient << 2) | (rest != 0L ? 1UL : 0UL));
}

uint64_t f64_sqrt_bits(uint64_t a) {
    if ((a & F64_MAGNITUDE) == 0UL || a == F64_INFINITY_BITS) {
        return a;
    }
    if (a > F64_INFINITY_BITS) {
        return F64_NAN_BITS;
    }
    int exponent;
    uint64_t significand;
    f64_unpack(a, exponent, significand);
    // The value is m · 2^(2k), m within [1, 4). Each step finds one binary digit of the root; root and remainder are in units of the step's
    // digit (Woo's method).
    int power = exponent - 1023;
    int k = power >> 1;
    // The top two bits are the integer part, the first pair of digits.
    uint64_t m = significand;
    if ((power & 1) != 0) {
        m <<= 1;
    }
    uint64_t root = 0UL, rest = 0UL;
    [[dont_unroll]] for (int digit = 0; digit < 56; digit++) {
        rest = (rest << 2) | (m >> 62);
        m <<= 2;
        uint64_t trial = (root << 2) | 1UL;
        root <<= 1;
        if (rest >= trial) {
            rest -= trial;
            root |= 1UL;
        }
    }
    // 56 digits, the first before the point, moved to bit 62.
    return f64_round(0UL, k + 1023, (root << 7) | (rest != 0UL ? 1UL : 0UL));
}

f64 f64_add(f64 a, f64 b) {
    F64_COUNT
#ifdef NATIVE_F64
    precise double sum = a + b;
    return sum;
#else
    return f64_add_bits(a, b);
#endif
}

f64 f64_neg(f64 a) {
    return f64_from_bits(f64_bits(a) ^ F64_SIGN);
}

f64 f64_sub(f64 a, f64 b) {
    F64_COUNT
#ifdef NATIVE_F64
    precise double difference = a - b;
    return difference;
#else
    return f64_add_bits(a, b ^ F64_SIGN);
#endif
}

f64 f64_mul(f64 a, f64 b) {
    F64_COUNT
#ifdef NATIVE_F64
    precise double product = a * b;
    return product;
#else
    return f64_mul_bits(a, b);
#endif
}

f64 f64_div(f64 a, f64 b) {
    return f64_from_bits(f64_div_bits(f64_bits(a), f64_bits(b)));
}

f64 f64_sqrt(f64 a) {
    return f64_from_bits(f64_sqrt_bits(f64_bits(a)));
}

f64 f64_abs(f64 a) {
    return f64_from_bits(f64_bits(a) & F64_MAGNITUDE);
}

f64 f64_copysign(f64 a, f64 sign) {
    return f64_from_bits((f64_bits(a) & F64_MAGNITUDE) | (f64_bits(sign) & F64_SIGN));
}

bool f64_is_negative(f64 a) {
    return (f64_bits(a) >> 63) != 0UL;
}

bool f64_is_nan(f64 a) {
    return f64_bits_are_nan(f64_bits(a));
}

bool f64_is_finite(f64 a) {
    return (f64_bits(a) & F64_MAGNITUDE) < F64_INFINITY_BITS;
}

bool f64_eq(f64 a, f64 b) {
    uint64_t x = f64_bits(a), y = f64_bits(b);
    return (x == y && !f64_bits_are_nan(x)) || ((x | y) & F64_MAGNITUDE) == 0UL;
}

// An integer that orders as the numbers do: −0 and 0 are equal; callers exclude NaN.
int64_t f64_order(uint64_t a) {
    int64_t magnitude = int64_t(a & F64_MAGNITUDE);
    return (a & F64_SIGN) != 0UL ? -magnitude : magnitude;
}

bool f64_lt(f64 a, f64 b) {
    F64_COUNT
#ifdef NATIVE_F64
    return a < b;
#else
    return f64_order(a) < f64_order(b) && !f64_bits_are_nan(a) && !f64_bits_are_nan(b);
#endif
}

bool f64_le(f64 a, f64 b) {
    F64_COUNT
#ifdef NATIVE_F64
    return a <= b;
#else
    return f64_order(a) <= f64_order(b) && !f64_bits_are_nan(a) && !f64_bits_are_nan(b);
#endif
}

f64 f64_max(f64 a, f64 b) {
    return f64_lt(a, b) || f64_is_nan(a) ? b : a;
}

f64 f64_min(f64 a, f64 b) {
    return f64_lt(b, a) || f64_is_nan(a) ? b : a;
}

f64 f64_clamp(f64 a, f64 low, f64 high) {
    return f64_lt(a, low) ? low : f64_lt(high, a) ? high : a;
}

f64 f64_from_u32(uint a) {
    F64_COUNT
#ifdef NATIVE_F64
    return double(a);
#else
    if (a == 0u) {
        return 0UL;
    }
    int top = findMSB(a);
    return (uint64_t(uint(1022 + top)) << 52) + (uint64_t(a) << (52 - top));
#endif
}

f64 f64_from_i32(int a) {
    f64 magnitude = f64_from_u32(uint(abs(a)));
    return a < 0 ? f64_neg(magnitude) : magnitude;
}

f64 f64_from_f32(float a) {
    uint bits = floatBitsToUint(a);
    uint64_t sign = uint64_t(bits & 0x80000000u) << 32;
    uint magnitude = bits & 0x7FFFFFFFu;
    if (magnitude > 0x7F800000u) {
        return f64_from_bits(F64_NAN_BITS);
    }
    if (magnitude == 0x7F800000u) {
        return f64_from_bits(sign | F64_INFINITY_BITS);
    }
    if (magnitude < 0x00800000u) {
        // Subnormal float: a multiple of 2^−149.
        if (magnitude == 0u) {
            return f64_from_bits(sign);
        }
        int top = findMSB(magnitude);
        return f64_from_bits(sign | (uint64_t(uint(1022 + top - 149)) << 52) + (uint64_t(magnitude) << (52 - top)));
    }
    return f64_from_bits(sign | ((uint64_t(magnitude) << 29) + (896UL << 52)));
}

// The nearest float, ties to even.
float f64_to_f32(f64 value) {
    uint64_t a = f64_bits(value);
    uint sign = uint(a >> 32) & 0x80000000u;
    uint64_t magnitude = a & F64_MAGNITUDE;
    if (magnitude > F64_INFINITY_BITS) {
        return uintBitsToFloat(0x7FC00000u);
    }
    int exponent = int(uint(magnitude >> 52)) - 896;
    if (exponent >= 255) {
        return uintBitsToFloat(sign | 0x7F800000u);
    }
    uint64_t significand = magnitude & F64_FRACTION;
    if (exponent <= 0) {
        if (exponent < -24) {
            return uintBitsToFloat(sign);
        }
        significand = shift_down_sticky(significand | F64_HIDDEN, 1 - exponent);
        exponent = 0;
    }
    uint kept = uint(significand >> 29);
    uint low = uint(significand) & 0x1FFFFFFFu;
    uint up = low > 0x10000000u || (low == 0x10000000u && (kept & 1u) != 0u) ? 1u : 0u;
    return uintBitsToFloat(sign | ((uint(exponent) << 23) + kept + up));
}

// Converts towards zero, saturating; 0 for NaN, as Rust's `as u32`.
uint f64_to_u32(f64 value) {
    uint64_t a = f64_bits(value);
    if ((a & F64_SIGN) != 0UL || f64_bits_are_nan(a)) {
        return 0u;
    }
    int power = int(uint(a >> 52)) - 1023;
    if (power < 0) {
        return 0u;
    }
    if (power >= 32) {
        return 0xFFFFFFFFu;
    }
    return uint(((a & F64_FRACTION) | F64_HIDDEN) >> (52 - power));
}

f64 f64_floor(f64 value) {
    uint64_t a = f64_bits(value);
    int power = int(uint(a >> 52) & 0x7FFu) - 1023;
    if (power >= 52) {
        return value;
    }
    bool negative = (a & F64_SIGN) != 0UL;
    if (power < 0) {
        bool zero = (a & F64_MAGNITUDE) == 0UL;
        // Not `negative ? −1 : 0` as a choice between constants: Mesa takes both for floats, and negates 0 into −0.
        return zero ? value : f64_from_bits((a & F64_SIGN) | (negative ? 0x3FF0000000000000UL : 0UL));
    }
    uint64_t below = F64_FRACTION >> power;
    if (negative) {
        // A carry goes into the exponent, as it should.
        a += below;
    }
    return f64_from_bits(a & ~below);
}

// 2^k, for k within the exponents of normal numbers.
f64 f64_exp2(int k) {
    return f64_from_bits(uint64_t(uint(clamp(k, -1022, 1023) + 1023)) << 52);
}

#endif
