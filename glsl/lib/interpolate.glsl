// Interpolation of attributes over a triangle, in homogeneous coordinates (Olano and Greer 1997).
//
// The value is a0 - (w1 (a0 - a1) + w2 (a0 - a2)), not w0 a0 + w1 a1 + w2 a2. Rounded weights rarely sum to 1, so the
// sum is a little off where all corners have one value; the differences are 0 there, and the value stays, bit for bit.
// The differences are subtracted rather than added, because -0 - 0 is -0 and -0 + 0 is not. One that no float holds is
// infinite, as it is in hardware that interpolates by differences.
//
// Corner 0 is the one nearest to the eye. Rounding leaves an error of the size of a0 everywhere, and that corner
// counts most where it is large: a floor that reaches to the horizon would have at the viewer's feet the error of
// coordinates there.
#ifndef INTERPOLATE_GLSL
#define INTERPOLATE_GLSL

// How many corners come before the one nearest to the eye.
uint nearest(const vec3 w) {
    vec3 far = abs(w);
    return far.y < far.x ? (far.z < far.y ? 2u : 1u) : (far.z < far.x ? 2u : 0u);
}

// The same corners from number `first` on.
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

// How much each corner counts at `ndc`, with perspective. The corners' clip-space positions come times `scale_for` the
// largest of them: neither a scene of 1e30 nor one of 1e-30 leaves the range of floats. Corner 0 alone counts where a
// triangle is seen from its side: weights are always finite, and no constant becomes NaN.
vec3 perspective_weights(const vec3 x, const vec3 y, const vec3 w, const vec2 ndc) {
    vec3 px = x - ndc.x * w, py = y - ndc.y * w;
    vec3 weights = px.yzx * py.zxy - py.yzx * px.zxy;
    float sum = weights.x + weights.y + weights.z;
    return abs(sum) > 1.0 / 1125899906842624.0 ? weights / sum : vec3(1.0, 0.0, 0.0);
}

// The bits of an attribute at corner 0, and of its differences to corners 1 and 2. Equal bits have no difference, those
// of infinity included.
uvec3 differences(const uvec3 corners) {
    vec3 a = uintBitsToFloat(corners);
    return uvec3(corners.x, corners.y == corners.x ? 0u : floatBitsToUint(a.x - a.y),
                 corners.z == corners.x ? 0u : floatBitsToUint(a.x - a.z));
}

// From the value at corner 0 and its differences to corners 1 and 2.
vec4 interpolate(const vec3 weights, const vec4 a0, const vec4 to_1, const vec4 to_2) {
    return a0 - (weights.y * to_1 + weights.z * to_2);
}

float interpolate(const vec3 weights, const vec3 corners) {
    return corners.x - (weights.y * (corners.x - corners.y) + weights.z * (corners.x - corners.z));
}
#endif
