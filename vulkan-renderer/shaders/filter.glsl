// Offsets from a pixel's centre, distributed as the pixel filter: twin of transport/src/filter.rs.
#ifndef FILTER_GLSL
#define FILTER_GLSL

#include "layout.glsl"

// Offset in pixels for u in [0, 1), monotone in u.
float filter_sample(Filter table, float u) {
    if (table.steps == 0u) {
        precise float offset = (u - 0.5) * table.width;
        return offset;
    }
    precise float s = 2.0 * u - 1.0;
    precise float place = abs(s) * float(table.steps);
    uint i = min(uint(place), table.steps - 1u);
    Floats levels = Floats(table.inverse_table);
    float low = levels.at[i], high = levels.at[i + 1u];
    precise float x = low + (high - low) * (place - float(i));
    float signed_x = s < 0.0 ? -x : x;
    precise float offset = signed_x * table.width;
    return offset;
}

#endif
