// Clipping in clip space against near, far and a guard band wide enough that only triangles which
// reach far outside the viewport are touched.
//
// Two triangles that share an edge must agree on it. They do, because everything here is a function
// of single vertices or of an edge's two ends: a plane is applied only if one of the triangle's
// vertices is outside it, edges with both ends inside stay as they are, and the point where an edge
// leaves is computed from its inner end to its outer end, whichever way the triangle walks.
#ifndef CLIP_GLSL
#define CLIP_GLSL
#include "lib/exact.glsl"

const uint CLIP_PLANES = 6u;
const uint CLIP_CORNERS = 3u + CLIP_PLANES;

// Distance from plane `plane`, negative outside. The guard factors are powers of two, so only the
// sum rounds, and a correctly rounded sum has the right sign.
float clip_distance(const uint plane, const vec4 p, const vec2 guard) {
    switch (plane) {
        case 0u: return guard.x * p.w + p.x;
        case 1u: return guard.x * p.w - p.x;
        case 2u: return guard.y * p.w + p.y;
        case 3u: return guard.y * p.w - p.y;
        case 4u: return p.z;
        default: return p.w - p.z;
    }
}

// One bit for each plane that `p` is outside of.
uint clip_outcode(const vec4 p, const vec2 guard) {
    uint code = 0u;
    [[unroll]] for (uint plane = 0u; plane < CLIP_PLANES; plane++) {
        code |= clip_distance(plane, p, guard) < 0.0 ? 1u << plane : 0u;
    }
    return code;
}

// The point between `inside` and `outside` on plane `plane`; exactly on it for near and far.
vec4 clip_point(const uint plane, const vec4 inside, const float din, const vec4 outside, const float dout) {
    float t = exact_divide(din, din - dout);
    vec4 p = inside + (outside - inside) * t;
    if (plane == 4u) p.z = 0.0;
    if (plane == 5u) p.z = p.w;
    return p;
}

// Clips the polygon `corners[0..3]` by the planes of `code`; returns the corners left.
uint clip_polygon(inout vec4 corners[CLIP_CORNERS], const uint code, const vec2 guard) {
    uint count = 3u;
    for (uint plane = 0u; plane < CLIP_PLANES; plane++) {
        if ((code & (1u << plane)) == 0u || count == 0u) continue;
        vec4 from[CLIP_CORNERS] = corners;
        uint kept = 0u;
        vec4 a = from[count - 1u];
        float da = clip_distance(plane, a, guard);
        for (uint i = 0u; i < count; i++) {
            vec4 b = from[i];
            float db = clip_distance(plane, b, guard);
            if ((da < 0.0) != (db < 0.0) && kept < CLIP_CORNERS) {
                corners[kept++] = da < 0.0 ? clip_point(plane, b, db, a, da) : clip_point(plane, a, da, b, db);
            }
            if (db >= 0.0 && kept < CLIP_CORNERS) corners[kept++] = b;
            a = b;
            da = db;
        }
        count = kept;
    }
    return count < 3u ? 0u : count;
}
#endif
