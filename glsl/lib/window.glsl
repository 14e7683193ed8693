// From clip space to the window: the steps for a single vertex, before primitives are assembled.
#ifndef WINDOW_GLSL
#define WINDOW_GLSL
#include "lib/clip.glsl"

// Bits of an outcode beyond the planes of clip.glsl. One marks a vertex at or behind the eye, which has no
// window position. The other marks a vertex that no triangle may use: it is not finite, or so far out that the
// difference of two such vertices might not be finite.
const uint OUT_BEHIND = 1u << VIEW_PLANES;
const uint OUT_UNUSABLE = 2u << VIEW_PLANES;
// The planes of the user, whose bits are added where primitives are assembled. Points have the side of their square there.
const uint OUT_USER = ((1u << CLIP_PLANES) - 1u) & ~((1u << USER_PLANES) - 1u);
const uint OUT_PLANES = (OUT_BEHIND - 1u) | OUT_USER;
const uint OUT_DEPTHS = 48u;
// All planes of the view volume but the near and the far one.
const uint OUT_SIDES = 15u;

// First bit of the side of a point's square, which has the bits above those of the outcode.
const uint OUT_SIDE_SHIFT = USER_PLANES;

// The side of a point's square in 1/256 pixel: 1 to 256 pixels.
uint point_side(const float size) {
    const float scale = float(1u << SUBPIXEL_BITS);
    return size > 1.0 ? uint(round_even(min(size, 256.0) * scale)) : 1u << SUBPIXEL_BITS;
}

// A viewport: pixels and depth = normalized device coordinates * scale + offset.
struct Viewport {
    vec3 scale;
    vec3 offset;
};

// Clip space without denormals, which devices may flush.
vec4 sanitized(const vec4 p) {
    return vec4(flush(p.x), flush(p.y), flush(p.z), flush(p.w));
}

uint outcode(const vec4 p) {
    const float far_out = 8.507059173023462e37; // 2^126
    bool usable = all(lessThan(abs(p), vec4(far_out)));
    return clip_outcode(p) | (p.w <= 0.0 ? OUT_BEHIND : 0u) | (usable ? 0u : OUT_UNUSABLE);
}

// Clip space to window: pixels and depth, unsnapped. Rasterizers fuse the viewport transform for the
// user's vertices but not for corners `made` by clipping, and so does this. A position inside the view volume
// exceeds the bound only by rounding, or if the viewport is larger than any target.
vec3 window_position(const Viewport viewport, const vec4 p, const bool made) {
    float inverse = exact_divide(1.0, p.w);
    vec3 ndc = p.xyz * inverse;
    // Without clipping, a depth may be anything. Far beyond 1 it makes no difference.
    ndc.z = clamp(ndc.z, -1099511627776.0, 1099511627776.0);
    vec3 scale = viewport.scale, offset = viewport.offset;
    vec3 window = ndc * scale + offset;
    if (!made) {
        window = vec3(multiply_add(ndc.x, scale.x, offset.x), multiply_add(ndc.y, scale.y, offset.y),
                      multiply_add(ndc.z, scale.z, offset.z));
    }
    const float far_out = float(1u << GUARD_LOG2);
    return vec3(clamp(window.xy, vec2(-far_out), vec2(far_out)), window.z);
}
#endif
