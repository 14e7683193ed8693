// Depth of a triangle at a pixel: a plane through the unsnapped corners, anchored at the pixel of
// the first corner so that it is accurate where the triangle is, whatever its place on the screen.
#ifndef DEPTH_GLSL
#define DEPTH_GLSL
#include "lib/exact.glsl"

// Change of depth per pixel to the right and down, from window positions. A triangle without area
// before snapping has none.
vec2 depth_gradient(const vec3 a, const vec3 b, const vec3 c) {
    vec3 ab = a - b, ca = c - a;
    float area = ab.x * ca.y - ab.y * ca.x;
    float inverse = exact_divide(1.0, area);
    vec2 ca_scaled = ca.xy * inverse, ab_scaled = ab.xy * inverse;
    vec2 gradient = vec2(ab.z * ca_scaled.y - ca.z * ab_scaled.y, ca.z * ab_scaled.x - ab.z * ca_scaled.x);
    bool usable = flush(area) != 0.0 && is_finite(gradient.x) && is_finite(gradient.y);
    return usable ? gradient : vec2(0.0);
}

// Depth `offset` pixels from where it is `z`, clamped to 0..1.
float depth_at(const float z, const float dzdx, const float dzdy, const ivec2 offset) {
    float d = z + (dzdx * float(offset.x) + dzdy * float(offset.y));
    // Written so that every device picks +0 for anything not above zero.
    return d > 0.0 ? (d < 1.0 ? d : 1.0) : 0.0;
}
#endif
