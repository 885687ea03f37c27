// Area lamps: twin of transport/src/lamp/area.rs.
#ifndef LAMP_AREA_GLSL
#define LAMP_AREA_GLSL

#include "lamp_ball.glsl"
#include "spherical_rectangle.glsl"

const float LEAST_SOLID_ANGLE = 4e-3;
const float LEAST_THROUGH_SPREAD = 0.05;

// The part of an area lamp that is sampled from a receiver: a rectangle in its plane, or the whole ellipse.
struct Part {
    bool found;
    vec2 lo;
    vec2 hi;
    vec2 size;
    float height;
    bool ellipse;
};

// The part of an area lamp that lights a receiver, as far as it matters for choosing among lights.
struct LitPart {
    bool found;
    vec3 way;
    float radius;
    vec2 share;
};

// Whether a position relative to the centre, along the sides, is within the outline.
bool within_outline(Lamp lamp, vec2 place) {
    vec2 p = place / vec2(lamp.half_extent[0], lamp.half_extent[1]);
    return lamp.kind == LAMP_ELLIPSE ? dot(p, p) <= 1.0 : max(abs(p.x), abs(p.y)) <= 1.0;
}

// A vector in the coordinates of the sides.
vec2 along_sides(Lamp lamp, vec3 v) {
    return vec2(dot(v, vec3_of(lamp.sides[0])), dot(v, vec3_of(lamp.sides[1])));
}

// Fraction of the light that the spread lets through along a ray towards the lamp.
float through_spread(Lamp lamp, vec3 direction) {
    vec3 axis = vec3_of(lamp.axis);
    float tangent = length(cross(direction, axis)) / -dot(direction, axis);
    return max(lamp.tan_half_spread - tangent, 0.0) * lamp.spread_factor;
}

// Chooses the part to sample.
Part part(Lamp lamp, vec3 to_middle) {
    Part result;
    result.found = false;
    result.height = -dot(to_middle, vec3_of(lamp.axis));
    if (result.height <= 0.0) {
        return result;
    }
    vec2 half_extent = vec2(lamp.half_extent[0], lamp.half_extent[1]);
    vec2 foot = along_sides(lamp, -to_middle);
    vec2 reach = vec2(result.height * lamp.tan_half_spread);
    vec2 lo = max(foot - reach, -half_extent), hi = min(foot + reach, half_extent);
    if (lo.x >= hi.x || lo.y >= hi.y) {
        return result;
    }
    result.size = hi - lo;
    float wide = result.size.x * result.size.y;
    result.ellipse = lamp.kind == LAMP_ELLIPSE && wide >= PI * half_extent.x * half_extent.y;
    // From here on relative to the receiver's foot point in the plane.
    result.lo = lo - foot;
    result.hi = hi - foot;
    result.found = true;
    return result;
}

// What lights a receiver above the plane of the lamp.
LitPart lit_part(Lamp lamp, vec3 to_middle) {
    vec3 axis = vec3_of(lamp.axis);
    LitPart lit;
    if (lamp.tan_half_spread == 0.0) {
        lit.way = axis * dot(to_middle, axis);
        lit.radius = 0.0;
        lit.share = vec2(1.0);
        lit.found = within_outline(lamp, along_sides(lamp, -to_middle));
        return lit;
    }
    Part seen = part(lamp, to_middle);
    lit.found = seen.found;
    if (!seen.found) {
        return lit;
    }
    vec2 middle = 0.5 * (seen.lo + seen.hi), size = seen.size;
    vec2 of_lamp = 0.5 * size / vec2(lamp.half_extent[0], lamp.half_extent[1]);
    float from_foot = sqrt(dot(middle, middle) + dot(size, size) / 12.0);
    float through = 1.0 - from_foot / (seen.height * lamp.tan_half_spread);
    lit.way = vec3_of(lamp.sides[0]) * middle.x + vec3_of(lamp.sides[1]) * middle.y - axis * seen.height;
    lit.radius = 0.5 * length(size);
    lit.share = vec2(of_lamp.x, of_lamp.y * max(through, LEAST_THROUGH_SPREAD));
    return lit;
}

// Density per solid angle with which a direction to the sampled part is drawn.
float pdf_area(Lamp lamp, Part seen, vec3 direction, float distance_to) {
    float per_area = distance_to * distance_to / -dot(direction, vec3_of(lamp.axis));
    if (seen.ellipse) {
        return per_area / (PI * lamp.half_extent[0] * lamp.half_extent[1]);
    }
    float solid_angle = spherical_rectangle_new(seen.lo, seen.hi, seen.height).solid_angle;
    if (solid_angle < LEAST_SOLID_ANGLE) {
        return per_area / (seen.size.x * seen.size.y);
    }
    return 1.0 / solid_angle;
}

// A sample of the light along a direction.
LampSample area_along(Lamp lamp, Part seen, vec3 direction, float distance_to) {
    LampSample s;
    s.direction = direction;
    s.distance_to = distance_to;
    s.radiance = vec3_of(lamp.radiance) * through_spread(lamp, direction);
    s.pdf = pdf_area(lamp, seen, direction, distance_to);
    s.found = greatest(s.radiance) > 0.0 && s.pdf > 0.0 && !isinf(s.pdf);
    return s;
}

LampSample sample_area(Lamp lamp, vec3 to_middle, vec2 u) {
    vec3 axis = vec3_of(lamp.axis);
    LampSample s = no_lamp_sample();
    vec2 foot = along_sides(lamp, -to_middle);
    if (lamp.tan_half_spread == 0.0) {
        // Without spread the light is a parallel beam.
        s.direction = -axis;
        s.distance_to = -dot(to_middle, axis);
        s.radiance = vec3_of(lamp.radiance);
        s.found = s.distance_to > 0.0 && within_outline(lamp, foot) && lamp_is_lit(lamp);
        return s;
    }
    Part seen = part(lamp, to_middle);
    if (!seen.found) {
        return s;
    }
    vec2 place;
    if (seen.ellipse) {
        vec2 sc = sin_cos(2.0 * PI * u.y);
        place = vec2(lamp.half_extent[0], lamp.half_extent[1]) * sc.yx * sqrt(u.x) - foot;
    } else {
        SphericalRectangle rectangle = spherical_rectangle_new(seen.lo, seen.hi, seen.height);
        if (rectangle.solid_angle < LEAST_SOLID_ANGLE) {
            place = seen.lo + seen.size * u;
        } else {
            place = spherical_rectangle_sample(rectangle, u);
        }
    }
    if (lamp.kind == LAMP_ELLIPSE && !within_outline(lamp, place + foot)) {
        return s;
    }
    vec3 way = vec3_of(lamp.sides[0]) * place.x + vec3_of(lamp.sides[1]) * place.y - axis * seen.height;
    float distance_to = length(way);
    return area_along(lamp, seen, way / distance_to, distance_to);
}

LampSample meet_area(Lamp lamp, vec3 to_middle, vec3 direction) {
    float facing = -dot(direction, vec3_of(lamp.axis));
    if (facing <= 0.0 || lamp.tan_half_spread == 0.0) {
        return no_lamp_sample();
    }
    Part seen = part(lamp, to_middle);
    if (!seen.found) {
        return no_lamp_sample();
    }
    float distance_to = seen.height / facing;
    if (!within_outline(lamp, along_sides(lamp, direction * distance_to - to_middle))) {
        return no_lamp_sample();
    }
    return area_along(lamp, seen, direction, distance_to);
}

#endif
