// What pieces say of the triangles that raster takes from its lists.
//
// The file that includes this one declares the buffers `triangles` and `pieces`, and defines ADJUSTED.
#ifndef LISTED_GLSL
#define LISTED_GLSL
#include "lib/depth.glsl"
#include "lib/stencil.glsl"

// How the depths of the triangle at `at`, which lie in `plane`, are adjusted.
vec3 adjustment_of(const uint at, const vec3 plane) {
    if (!ADJUSTED || (triangles[at].shading[3].y & TRIANGLE_ADJUSTED) == 0u) return NO_ADJUSTMENT;
    uint piece = triangles[at].shading[1].y, exponent = triangles[at].shading[3].y >> TRIANGLE_EXPONENT_SHIFT;
    return vec3(bias_of(pieces[piece].depth_bias, plane.yz, exponent), pieces[piece].depth_limits);
}

// The stencil test of the triangle at `at`.
uvec2 face_of(const uint at) {
    if (!STENCIL) return NO_STENCIL_TEST;
    return pieces[triangles[at].shading[1].y].stencil[(triangles[at].shading[3].y & TRIANGLE_FRONT) != 0u ? 0u : 1u];
}
#endif
