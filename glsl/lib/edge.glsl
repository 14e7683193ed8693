// Exact edge functions over fixed-point corners.
//
// Corners are in 1/256 pixel from pixel centres, clockwise on the screen (y down), within 2^23; an
// edge function is a 50-bit integer. From one pixel centre to the next it changes by a multiple of 256, so
// it can be divided by 256 and rounded down without changing a sign. The result changes by less than 2^30
// within a bin, so it can be saturated to 2^30 and still gives exact signs there.
// The samples of a pixel lie on a grid of 1/16 pixel. From there to there the function changes by a multiple of 16, so
// that the 4 bits above the lowest 4 are all that they need of what was rounded off.
#ifndef EDGE_GLSL
#define EDGE_GLSL
#include "lib/samples.glsl"
#include "lib/wide.glsl"

// The three edges as seen from one point: inside where all three of `at` are >= 0.
struct Edges {
    ivec3 at;   // floor(value / 2^(SUBPIXEL_BITS + log2))
    ivec3 dx;   // change per 2^log2 pixels to the right
    ivec3 dy;   // change per 2^log2 pixels down
    ivec3 rest; // 16ths that `at` has lost, if log2 is 0
};

// The top-left rule: 0 for an edge whose own points are covered, -1 for an edge whose own points are not.
// With clockwise corners and y down, a left edge goes up and a top edge goes right.
int edge_bias(const int dx, const int dy) {
    return dy < 0 || (dy == 0 && dx > 0) ? 0 : -1;
}

// The edge from `a` to `b` at `p`: the value, and the 16ths that it has lost.
ivec2 edge_at(const ivec2 a, const ivec2 b, const ivec2 p, const uint shift) {
    ivec2 d = b - a;
    Wide value = wide_subtract(wide_product(d.x, p.y - a.y), wide_product(d.y, p.x - a.x));
    value = wide_offset(value, edge_bias(d.x, d.y));
    return ivec2(wide_shift_saturate(value, shift), (value.lo >> (SUBPIXEL_BITS - 4u)) & 15u);
}

// Edges seen from `p`, which is in 1/256 pixel from the centre of pixel (0, 0), in units of 2^log2 pixels.
Edges edges_from(const ivec3 x, const ivec3 y, const ivec2 p, const uint log2) {
    ivec2 a = ivec2(x.x, y.x), b = ivec2(x.y, y.y), c = ivec2(x.z, y.z);
    uint shift = SUBPIXEL_BITS + log2;
    ivec2 ab = edge_at(a, b, p, shift), bc = edge_at(b, c, p, shift), ca = edge_at(c, a, p, shift);
    return Edges(ivec3(ab.x, bc.x, ca.x), y - y.yzx, x.yzx - x, ivec3(ab.y, bc.y, ca.y));
}

// Edges with log2 0 as they are at a sample, `offset` from where they are seen, in 1/16 pixel.
ivec3 edges_at(const Edges edges, const ivec2 offset) {
    if (SAMPLES == 1u) return edges.at;
    return edges.at + ((edges.rest + edges.dx * offset.x + edges.dy * offset.y) >> 4);
}

// By how much edges with log2 0 differ at most between the centre of a pixel and its samples.
ivec3 edges_reach(const ivec3 dx, const ivec3 dy) {
    return SAMPLES == 1u ? ivec3(0) : ((abs(dx) + abs(dy)) >> 1) + 1;
}

// Whether the triangle may touch the square of 2^log2 by 2^log2 pixels that begins at `p`: false only if the whole
// square lies outside some edge.
bool edges_touch(const ivec3 x, const ivec3 y, const ivec2 p, const uint log2) {
    Edges e = edges_from(x, y, p, log2);
    ivec3 most = e.at + max(e.dx, 0) + max(e.dy, 0);
    return (most.x | most.y | most.z) >= 0;
}
#endif
