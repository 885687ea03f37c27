// Sine, cosine and arctangent in floats. GLSL leaves the accuracy of its own almost open (2^−11 for sines, 4096 units in the last place for
// arctangents); these are correct to a few 2^−24 on any device. There is no twin, because the CPU has its language's functions.
#ifndef TRIGONOMETRY_GLSL
#define TRIGONOMETRY_GLSL

const float PI = 3.14159265358979;
const float FRAC_1_PI = 0.318309886183791;

// Sine and cosine of a within ±π/4: Taylor polynomials up to where the next term is below 2^−26.
vec2 small_sin_cos(float a) {
    precise float s = a * a;
    precise float sine = a
        + a * (s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s * (1.0 / 362880.0)))));
    precise float cosine =
        1.0 + s * (-0.5 + s * (1.0 / 24.0 + s * (-1.0 / 720.0 + s * (1.0 / 40320.0 + s * (-1.0 / 3628800.0)))));
    return vec2(sine, cosine);
}

// Sine and cosine of a, |a| up to a few turns. π/2 is subtracted in two parts; the first has few bits, so its multiples are exact.
vec2 sin_cos(float a) {
    float quarter = floor(a * (2.0 / PI) + 0.5);
    precise float first = a - quarter * 1.57079601287841796875;
    precise float rest = first - quarter * 3.139164786504813e-7;
    vec2 sc = small_sin_cos(rest);
    int q = int(quarter) & 3;
    vec2 turned = (q & 1) != 0 ? sc.yx : sc;
    return vec2((q & 2) != 0 ? -turned.x : turned.x, q == 1 || q == 2 ? -turned.y : turned.y);
}

// Arctangent of x in [0, 1]; the angle is halved once, so that 8 terms of the series suffice.
float small_atan(float x) {
    // tan(a/2) = x / (1 + √(1 + x²)), at most 0.4142.
    float h = x / (1.0 + sqrt(1.0 + x * x));
    float s = h * h;
    float series = 1.0
        + s * (-1.0 / 3.0
            + s * (1.0 / 5.0
                + s * (-1.0 / 7.0
                    + s * (1.0 / 9.0
                        + s * (-1.0 / 11.0 + s * (1.0 / 13.0 + s * (-1.0 / 15.0 + s * (1.0 / 17.0))))))));
    return 2.0 * h * series;
}

// Angle of the point (x, y), within ±π; 0 at the origin.
float atan2_of(float y, float x) {
    float low = min(abs(x), abs(y)), high = max(abs(x), abs(y));
    float a = high == 0.0 ? 0.0 : small_atan(low / high);
    a = abs(y) > abs(x) ? 0.5 * PI - a : a;
    a = x < 0.0 ? PI - a : a;
    return y < 0.0 ? -a : a;
}

#endif
