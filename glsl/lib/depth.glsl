// Depth of a triangle at a pixel: a plane through the unsnapped corners of the triangle. It starts from its depth in the pixel
// (0, 0) of the target: in the centre of that pixel or, if pixels have several samples, at the upper left of it. A plane that
// starts at a corner of the triangle is more accurate for steep triangles far from there. But devices start in that pixel, and
// where two surfaces coincide, the winner depends on it: with the other plane, thousands of pixels in some rooms differ from the
// device's own pipeline.
// The file that includes this one defines ADJUSTED: whether triangles may have an adjustment, which is a bias and the least and
// the greatest depth. The bias is added at each pixel, as devices do: the plane has lost the last bits of small depths. The file
// also defines DEPTH_BITS: the bits of a depth in the target, 16 or 24, or 0 if the target holds floats.
#ifndef DEPTH_GLSL
#define DEPTH_GLSL
#include "lib/depth_format.glsl"
#include "lib/exact.glsl"
#include "lib/samples.glsl"

// A gradient that is too small to change any depth becomes zero, so that no product is a denormal.
float settled(const float a) {
    return abs(a) < 1.0 / 18446744073709551616.0 ? 0.0 : a;
}

// A plane, or that of the depth `z` if its numbers are too large.
vec3 usable_plane(const vec3 plane, const float z) {
    // Not-a-number compares as unusable; beyond the bound `multiply_add` may overflow.
    bool usable = all(lessThan(abs(plane), vec3(18446744073709551616.0)));
    vec3 used = usable ? plane : vec3(0.0, 0.0, z);
    return vec3(settled(used.x), settled(used.y), settled(used.z));
}

// Change of depth per pixel to the right and down, and the depth at the place (`start`, `start`) of pixel (0, 0), from window
// positions. `start` is 0.5 or, if pixels have several samples, 0. A triangle without area before snapping has the depth of its first corner.
vec3 depth_plane(const vec3 a, const vec3 b, const vec3 c, const float start) {
    vec3 ab = a - b, ca = c - a;
    float area = ab.x * ca.y - ab.y * ca.x;
    float inverse = exact_divide(1.0, area);
    vec2 ca_scaled = ca.xy * inverse, ab_scaled = ab.xy * inverse;
    vec2 gradient = vec2(ab.z * ca_scaled.y - ca.z * ab_scaled.y, ca.z * ab_scaled.x - ab.z * ca_scaled.x);
    float z = a.z - (gradient.x * (a.x - start) + gradient.y * (a.y - start));
    vec3 plane = vec3(gradient, z);
    return usable_plane(flush(area) != 0.0 ? plane : vec3(0.0, 0.0, a.z), a.z);
}

// What is added to the depths of a triangle (Vulkan 1.3, "Depth Bias"), from the constant factor, the slope factor and
// the clamp: `gradient` is the change of depth per pixel, `exponent` that of the largest depth of the corners, as its bits
// are. The least step of depth is that of the target or, of floats, a unit in the last place of the largest depth; it is no
// denormal. A bias of 2^60 moves every depth out of its limits, as a larger one would.
float bias_of(const vec3 bias, const vec2 gradient, const uint exponent) {
    float step = uintBitsToFloat((max(exponent, 24u) - 23u) << 23);
    if (DEPTH_BITS == 16u) step = 1.0 / 65535.0;
    if (DEPTH_BITS == 24u) step = 1.0 / 16777215.0;
    const float most = 1152921504606846976.0;
    float sum = clamp(step * bias.x, -most, most) + clamp(max(abs(gradient.x), abs(gradient.y)) * bias.y, -most, most);
    if (bias.z > 0.0) sum = min(sum, bias.z);
    if (bias.z < 0.0) sum = max(sum, bias.z);
    return clamp(sum, -most, most);
}

// What is done to the depths of a triangle that is not adjusted.
const vec3 NO_ADJUSTMENT = vec3(0.0, 0.0, 1.0);

// The depth `d`, brought into the limits of an adjustment. Not-a-number becomes the least depth.
float limited_depth(const float d, const vec3 adjustment) {
    return d > adjustment.y ? (d < adjustment.z ? d : adjustment.z) : adjustment.y;
}

// The depth that a target of floats keeps for the depth `d`. It never falls while `d` grows.
float kept_depth(const float d) {
    // Written so that every device picks +0 for anything not above zero.
    return d > 0.0 ? (d < 1.0 ? d : 1.0) : 0.0;
}

// The depth that the target keeps.
float stored_depth(const float d) {
    float kept = kept_depth(d);
    return DEPTH_BITS == 0u ? kept : number_depth(depth_number(kept, DEPTH_BITS), DEPTH_BITS);
}

// From where planes start, `x` being a place in pixels from the centre of pixel (0, 0).
float from_start(const float x) {
    return SAMPLES > 1u ? x + 0.5 : x;
}

// Depth in two steps at a place in pixels from the centre of pixel (0, 0): the first serves a whole column of pixels.
float depth_of_column(const float z, const float dzdx, const float x) {
    return multiply_add(dzdx, from_start(x), z);
}

// As the target keeps it.
float depth_in_column(const float column, const float dzdy, const vec3 adjustment, const float y) {
    float d = multiply_add(dzdy, from_start(y), column);
    return stored_depth(ADJUSTED ? limited_depth(d + adjustment.x, adjustment) : d);
}

float depth_at(const vec3 plane, const vec3 adjustment, const vec2 place) {
    return depth_in_column(depth_of_column(plane.x, plane.y, place.x), plane.z, adjustment, place.y);
}

// As shaders see it, beyond the limits too.
float free_depth_at(const vec3 plane, const vec3 adjustment, const vec2 place) {
    return multiply_add(plane.z, from_start(place.y), depth_of_column(plane.x, plane.y, place.x)) + adjustment.x;
}

// Bounds of the triangle's depth at the samples of the pixels from `origin` to `origin + last`: nothing is less than
// the first, nothing greater than the second.
vec2 depth_range(const vec3 plane, const vec3 adjustment, const ivec2 origin, const ivec2 last) {
    vec2 at = plane.yz * vec2(from_start(float(origin.x)), from_start(float(origin.y))), end = plane.yz * vec2(last);
    float slack = (abs(plane.x) + abs(at.x) + abs(at.y) + abs(end.x) + abs(end.y)) * (1.0 / 1048576.0);
    float start = plane.x + at.x + at.y;
    if (ADJUSTED) {
        slack += abs(adjustment.x) * (1.0 / 1048576.0);
        start += adjustment.x;
    }
    // No sample is farther than half a pixel from the centre.
    if (SAMPLES > 1u) slack += 0.50001 * (abs(plane.y) + abs(plane.z));
    float low = start + min(end.x, 0.0) + min(end.y, 0.0) - slack;
    float high = start + max(end.x, 0.0) + max(end.y, 0.0) + slack;
    if (ADJUSTED) {
        low = limited_depth(low, adjustment);
        high = limited_depth(high, adjustment);
    }
    return vec2(stored_depth(low), stored_depth(high));
}
#endif
