// Interpolation of attributes over a triangle, in homogeneous coordinates (Olano and Greer 1997).
//
// The value is a0 - (w1 (a0 - a1) + w2 (a0 - a2)), not w0 a0 + w1 a1 + w2 a2. Rounded weights rarely sum to 1, so the
// sum is a little off where all corners have one value; the differences are 0 there, and the value stays, bit for bit.
// The differences are subtracted rather than added, because -0 - 0 is -0 and -0 + 0 is not. A difference that overflows
// is infinite, as it is in hardware that interpolates by differences.
//
// Corner 0 is the corner nearest to the eye. Rounding leaves an error in proportion to a0 everywhere. If a0 were the
// value at a far corner, a floor that reaches to the horizon would have, at the viewer's feet, an error in proportion
// to the coordinates at the horizon.
#ifndef INTERPOLATE_GLSL
#define INTERPOLATE_GLSL

// The number of the corner nearest to the eye.
uint nearest(const vec3 w) {
    vec3 far = abs(w);
    return far.y < far.x ? (far.z < far.y ? 2u : 1u) : (far.z < far.x ? 2u : 0u);
}

// The same corners, rotated so that corner `first` comes first.
vec3 corners_from(const uint first, const vec3 corners) {
    return first == 0u ? corners : (first == 1u ? corners.yzx : corners.zxy);
}

uvec3 corners_from(const uint first, const uvec3 corners) {
    return first == 0u ? corners : (first == 1u ? corners.yzx : corners.zxy);
}

// The power of two that brings a number of the size of `largest`, which is below 2^126, to between 2^32 and 2^33, or as
// near as one factor can.
float scale_for(const float largest) {
    return uintBitsToFloat(min(0x8f000000u - (floatBitsToUint(largest) & 0x7f800000u), 0x7f000000u));
}

// The weight of each corner at `ndc`, with perspective. The caller multiplies the corners' clip-space positions by
// `scale_for` of the largest coordinate, so that scenes of a size of 1e30 or 1e-30 stay in the range of floats. If the
// triangle is seen edge-on, corner 0 has all the weight: weights are always finite, and a constant never becomes NaN.
vec3 perspective_weights(const vec3 x, const vec3 y, const vec3 w, const vec2 ndc) {
    vec3 px = x - ndc.x * w, py = y - ndc.y * w;
    vec3 weights = px.yzx * py.zxy - py.yzx * px.zxy;
    float sum = weights.x + weights.y + weights.z;
    return abs(sum) > 1.0 / 1125899906842624.0 ? weights / sum : vec3(1.0, 0.0, 0.0);
}

// The weights of the ends of a line at `ndc`, in the same way: the ends are corners 0 and 1. They are those of the nearest place on
// the line, beyond its ends too, or those of the place in the same column or row, if `axis` is that of x or y and not 0.
// `scale` is the viewport's: distances are those in pixels.
vec3 line_weights(const vec3 x, const vec3 y, const vec3 w, const vec2 ndc, const vec2 scale, const vec2 axis) {
    vec2 a = vec2(x.x, y.x) * scale, b = vec2(x.y, y.y) * scale;
    // Along the line, also if an end is behind the eye.
    float largest = max(abs(w.x), abs(w.y));
    vec2 way = b * (w.x / largest) - a * (w.y / largest);
    vec2 size = abs(way);
    float longest = max(size.x, size.y);
    if (axis != vec2(0.0)) way *= axis;
    way = longest > 0.0 ? way / longest : vec2(0.0);
    float at = dot(ndc * scale, way);
    float to_a = at * w.y - dot(b, way), to_b = dot(a, way) - at * w.x, sum = to_a + to_b;
    return abs(sum) > 1.0 / 1125899906842624.0 ? vec3(to_a, to_b, 0.0) / sum : vec3(1.0, 0.0, 0.0);
}

// The bits of an attribute at corner 0, and of its differences to corners 1 and 2. The difference of equal bits is 0,
// also if both are infinity.
uvec3 differences(const uvec3 corners) {
    vec3 a = uintBitsToFloat(corners);
    return uvec3(corners.x, corners.y == corners.x ? 0u : floatBitsToUint(a.x - a.y),
                 corners.z == corners.x ? 0u : floatBitsToUint(a.x - a.z));
}

// The interpolated value, from the value at corner 0 and its differences to corners 1 and 2.
vec4 interpolate(const vec3 weights, const vec4 a0, const vec4 to_1, const vec4 to_2) {
    return a0 - (weights.y * to_1 + weights.z * to_2);
}

float interpolate(const vec3 weights, const vec3 corners) {
    return corners.x - (weights.y * (corners.x - corners.y) + weights.z * (corners.x - corners.z));
}
#endif
