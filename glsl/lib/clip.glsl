// Clipping in clip space against the six sides of the view volume, and by distances from planes of the user.
//
// Two triangles that share an edge must agree on it. They do, because everything here is a function
// of single vertices or of an edge's two ends: a plane is applied only if one of the triangle's
// vertices is outside it, edges with both ends inside stay as they are, and the point where an edge
// leaves is computed from its outer end to its inner end, whichever way the triangle walks.
//
// The alternative was a guard band, which does not clip triangles that reach only a little outside the
// viewport. But the depth of such a triangle is a plane through corners that may be thousands of pixels
// away: it was wrong by up to 0.005 in rooms seen from within.
#ifndef CLIP_GLSL
#define CLIP_GLSL
#include "lib/exact.glsl"

// Planes by their numbers: the sides of the view volume, then, after two numbers that are none, those of the user.
const uint VIEW_PLANES = 6u;
const uint USER_PLANES = 8u;

// A corner while it is clipped: its position and, WITH_DISTANCES, its clip distances.
#ifdef WITH_DISTANCES
#define Corner mat3x4
#define POSITION(corner) corner[0]
const uint CLIP_PLANES = USER_PLANES + MAX_DISTANCES;
const uint CLIP_CORNERS = 3u + VIEW_PLANES + MAX_DISTANCES;
#else
#define Corner vec4
#define POSITION(corner) corner
const uint CLIP_PLANES = VIEW_PLANES;
const uint CLIP_CORNERS = 3u + VIEW_PLANES;
#endif

// Distance from plane `plane`, negative outside: w - x, w + x, w - y, w + y, z, w - z. A correctly rounded
// difference has the right sign.
float view_distance(const uint plane, const vec4 p) {
    float along = plane < 2u ? p.x : (plane < 4u ? p.y : p.z);
    return plane == 4u ? along : (plane == 1u || plane == 3u ? p.w + along : p.w - along);
}

// The same, also of a plane of the user.
float clip_distance(const uint plane, const Corner corner) {
#ifdef WITH_DISTANCES
    if (plane >= USER_PLANES) return corner[1u + (plane - USER_PLANES) / 4u][plane % 4u];
#endif
    return view_distance(plane, POSITION(corner));
}

// One bit for each side of the view volume that `p` is outside of.
uint clip_outcode(const vec4 p) {
    uint code = 0u;
    [[unroll]] for (uint plane = 0u; plane < VIEW_PLANES; plane++) {
        code |= view_distance(plane, p) < 0.0 ? 1u << plane : 0u;
    }
    return code;
}

// Clips the polygon `corners[0..3]` by the planes of `code`; returns the number of corners left. `made` gets one
// bit for each corner that clipping made. Each array is read in one place and written in one place: on CPUs each
// such place becomes code for every lane, which takes long to compile.
uint clip_polygon(inout Corner corners[CLIP_CORNERS], const uint code, out uint made) {
    uint count = 3u;
    made = 0u;
    [[dont_unroll]] for (uint plane = 0u; plane < CLIP_PLANES; plane++) {
        if ((code & (1u << plane)) == 0u || count == 0u) continue;
        Corner from[CLIP_CORNERS] = corners;
        uint made_from = made, kept = 0u;
        made = 0u;
        Corner a = from[0];
        float da = clip_distance(plane, a);
        [[dont_unroll]] for (uint i = 0u; i < count; i++) {
            Corner b = from[i + 1u < count ? i + 1u : 0u];
            float db = clip_distance(plane, b);
            // Keeps the corner if it is inside. Then adds the point where the edge to the next corner crosses
            // the plane, if it does; the point is computed from the outer end to the inner end.
            bool leaves = da >= 0.0;
            float t = exact_divide(leaves ? db : da, leaves ? db - da : da - db);
            Corner outside = leaves ? b : a, crossing = outside + ((leaves ? a : b) - outside) * t;
            [[dont_unroll]] for (uint k = leaves ? 0u : 1u; k < (leaves != (db >= 0.0) ? 2u : 1u); k++) {
                if (kept == CLIP_CORNERS) break;
                made |= (k == 0u ? (made_from >> i) & 1u : 1u) << kept;
                corners[kept++] = k == 0u ? a : crossing;
            }
            a = b;
            da = db;
        }
        count = kept;
    }
    return count < 3u ? 0u : count;
}
#endif
