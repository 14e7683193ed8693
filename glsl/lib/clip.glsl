// Clipping in clip space against the six sides of the view volume.
//
// Two triangles that share an edge must agree on it. They do, because everything here is a function
// of single vertices or of an edge's two ends: a plane is applied only if one of the triangle's
// vertices is outside it, edges with both ends inside stay as they are, and the point where an edge
// leaves is computed from its outer end to its inner end, whichever way the triangle walks.
//
// A guard band, which leaves triangles whole that reach only a little outside the viewport, was the
// alternative: it clips fewer of them, but their depth is a plane through corners that may be
// thousands of pixels away, and was wrong by up to 0.005 in rooms seen from within.
#ifndef CLIP_GLSL
#define CLIP_GLSL
#include "lib/exact.glsl"

const uint CLIP_PLANES = 6u;
const uint CLIP_CORNERS = 3u + CLIP_PLANES;

// Distance from plane `plane`, negative outside. A correctly rounded difference has the right sign.
float clip_distance(const uint plane, const vec4 p) {
    switch (plane) {
        case 0u: return p.w - p.x;
        case 1u: return p.w + p.x;
        case 2u: return p.w - p.y;
        case 3u: return p.w + p.y;
        case 4u: return p.z;
        default: return p.w - p.z;
    }
}

// One bit for each plane that `p` is outside of.
uint clip_outcode(const vec4 p) {
    uint code = 0u;
    [[unroll]] for (uint plane = 0u; plane < CLIP_PLANES; plane++) {
        code |= clip_distance(plane, p) < 0.0 ? 1u << plane : 0u;
    }
    return code;
}

// The point between `outside` and `inside` on a plane.
vec4 clip_point(const vec4 outside, const float dout, const vec4 inside, const float din) {
    float t = exact_divide(dout, dout - din);
    return outside + (inside - outside) * t;
}

// Clips the polygon `corners[0..3]` by the planes of `code`; returns the corners left. `made` gets one
// bit for each that is not one of the triangle's.
uint clip_polygon(inout vec4 corners[CLIP_CORNERS], const uint code, out uint made) {
    uint count = 3u;
    made = 0u;
    [[dont_unroll]] for (uint plane = 0u; plane < CLIP_PLANES; plane++) {
        if ((code & (1u << plane)) == 0u || count == 0u) continue;
        vec4 from[CLIP_CORNERS] = corners;
        uint made_from = made, kept = 0u;
        made = 0u;
        [[dont_unroll]] for (uint i = 0u; i < count; i++) {
            vec4 a = from[i], b = from[i + 1u < count ? i + 1u : 0u];
            float da = clip_distance(plane, a), db = clip_distance(plane, b);
            if (da >= 0.0 && kept < CLIP_CORNERS) {
                made |= ((made_from >> i) & 1u) << kept;
                corners[kept++] = a;
            }
            if ((da < 0.0) != (db < 0.0) && kept < CLIP_CORNERS) {
                made |= 1u << kept;
                corners[kept++] = da < 0.0 ? clip_point(a, da, b, db) : clip_point(b, db, a, da);
            }
        }
        count = kept;
    }
    return count < 3u ? 0u : count;
}
#endif
