// Exact edge functions over fixed-point corners.
//
// Corners are in 1/256 pixel from pixel centres, clockwise on the screen (y down), within 2^23; an
// edge function is a 50-bit integer. From one pixel centre to the next it changes by a multiple of 256, so
// it can be divided by 256 and rounded down without changing a sign. The result changes by less than 2^30
// within a bin, so it can be saturated to 2^30 and still gives exact signs there.
#ifndef EDGE_GLSL
#define EDGE_GLSL
#include "lib/wide.glsl"

// The three edges as seen from one pixel: inside where all three of `at` are >= 0.
struct Edges {
    ivec3 at; // floor(value / 2^(SUBPIXEL_BITS + log2)) at the origin
    ivec3 dx; // change per 2^log2 pixels to the right
    ivec3 dy; // change per 2^log2 pixels down
};

// The top-left rule: 0 for an edge whose own points are covered, -1 for an edge whose own points are not.
// With clockwise corners and y down, a left edge goes up and a top edge goes right.
int edge_bias(const int dx, const int dy) {
    return dy < 0 || (dy == 0 && dx > 0) ? 0 : -1;
}

int edge_at(const ivec2 a, const ivec2 b, const ivec2 p, const uint shift) {
    ivec2 d = b - a;
    Wide value = wide_subtract(wide_product(d.x, p.y - a.y), wide_product(d.y, p.x - a.x));
    return wide_shift_saturate(wide_offset(value, edge_bias(d.x, d.y)), shift);
}

// Edges seen from the centre of pixel `origin`, in units of 2^log2 pixels.
Edges edges_from(const ivec3 x, const ivec3 y, const ivec2 origin, const uint log2) {
    ivec2 a = ivec2(x.x, y.x), b = ivec2(x.y, y.y), c = ivec2(x.z, y.z);
    ivec2 p = origin << SUBPIXEL_BITS;
    uint shift = SUBPIXEL_BITS + log2;
    return Edges(ivec3(edge_at(a, b, p, shift), edge_at(b, c, p, shift), edge_at(c, a, p, shift)),
                 y - y.yzx, x.yzx - x);
}

// Whether the triangle may touch the square of 2^log2 by 2^log2 pixels whose first pixel is `origin`: false
// only if the whole square lies outside some edge.
bool edges_touch(const ivec3 x, const ivec3 y, const ivec2 origin, const uint log2) {
    Edges e = edges_from(x, y, origin, log2);
    ivec3 most = e.at + max(e.dx, 0) + max(e.dy, 0);
    return (most.x | most.y | most.z) >= 0;
}
#endif
