// Depth of a triangle at a pixel: a plane through the unsnapped corners, from its depth at the pixel
// (0, 0) on. A plane that starts at a corner is more accurate for steep triangles far from the
// origin, but devices compute it in this way; with another one, surfaces that coincide are won by
// other triangles than on the device's own pipeline, thousands of pixels in some rooms.
#ifndef DEPTH_GLSL
#define DEPTH_GLSL
#include "lib/exact.glsl"

// What is too small to change any depth is zero, so that no product is a denormal.
float settled(const float a) {
    return abs(a) < 1.0 / 18446744073709551616.0 ? 0.0 : a;
}

// Change of depth per pixel to the right and down, and the depth at the centre of the pixel (0, 0),
// from window positions. A triangle without area before snapping has the depth of its first corner.
vec3 depth_plane(const vec3 a, const vec3 b, const vec3 c) {
    vec3 ab = a - b, ca = c - a;
    float area = ab.x * ca.y - ab.y * ca.x;
    float inverse = exact_divide(1.0, area);
    vec2 ca_scaled = ca.xy * inverse, ab_scaled = ab.xy * inverse;
    vec2 gradient = vec2(ab.z * ca_scaled.y - ca.z * ab_scaled.y, ca.z * ab_scaled.x - ab.z * ca_scaled.x);
    float z = a.z - (gradient.x * (a.x - 0.5) + gradient.y * (a.y - 0.5));
    vec3 plane = vec3(gradient, z);
    // Not-a-number compares as unusable; beyond the bound `multiply_add` may overflow.
    bool usable = flush(area) != 0.0 && all(lessThan(abs(plane), vec3(18446744073709551616.0)));
    plane = usable ? plane : vec3(0.0, 0.0, a.z);
    return vec3(settled(plane.x), settled(plane.y), settled(plane.z));
}

// The same for a primitive that is clipped, from its clip-space vertices. New corners that lie near
// the eye are computed from vertices far from it and lose too many digits for a plane, so this one
// goes through the vertices as they came. It solves for w - z, which in a perspective projection is
// small and nearly the same for all vertices, by Cramer's rule: over device coordinates,
// 1 - z is the plane that has the value (w - z) / w at each vertex.
vec3 depth_plane_clipped(const vec4 a, const vec4 b, const vec4 c, const vec3 scale, const vec3 offset) {
    vec3 bc = vec3(b.y * c.w - c.y * b.w, c.x * b.w - b.x * c.w, b.x * c.y - c.x * b.y);
    vec3 ca = vec3(c.y * a.w - a.y * c.w, a.x * c.w - c.x * a.w, c.x * a.y - a.x * c.y);
    vec3 ab = vec3(a.y * b.w - b.y * a.w, b.x * a.w - a.x * b.w, a.x * b.y - b.x * a.y);
    float volume = a.x * bc.x + a.y * bc.y + a.w * bc.z;
    float inverse = exact_divide(1.0, volume);
    float pa = (a.w - a.z) * inverse, pb = (b.w - b.z) * inverse, pc = (c.w - c.z) * inverse;
    vec3 p = vec3(bc.x * pa + ca.x * pb + ab.x * pc, bc.y * pa + ca.y * pb + ab.y * pc, bc.z * pa + ca.z * pb + ab.z * pc);
    vec2 gradient = vec2(exact_divide(p.x, scale.x), exact_divide(p.y, scale.y));
    float z = 1.0 - (p.z + gradient.x * (0.5 - offset.x) + gradient.y * (0.5 - offset.y));
    vec3 plane = vec3(-gradient * scale.z, offset.z + z * scale.z);
    bool usable = flush(volume) != 0.0 && all(lessThan(abs(plane), vec3(18446744073709551616.0)));
    return usable ? vec3(settled(plane.x), settled(plane.y), settled(plane.z)) : vec3(0.0, 0.0, offset.z);
}

// Depth at the pixel, clamped to 0..1.
float depth_at(const float z, const float dzdx, const float dzdy, const ivec2 pixel) {
    float d = multiply_add(dzdy, float(pixel.y), multiply_add(dzdx, float(pixel.x), z));
    // Written so that every device picks +0 for anything not above zero.
    return d > 0.0 ? (d < 1.0 ? d : 1.0) : 0.0;
}
#endif
