// The order of a bin's 256 pixels in memory and over lanes: four 8x8 quadrants, each of 4x4 quads of
// 2x2 pixels. Any power-of-two run of consecutive pixels from 4 on is a rectangle, four consecutive
// lanes are a quad, and a subgroup of any width works on a compact patch.
#ifndef TILE_GLSL
#define TILE_GLSL

// Quads of a bin.
const uint BIN_QUADS = BIN_PIXELS / 4u;

// A bin as lists name it: by column and row. Nothing has to divide by the columns of a band.
uint bin_packed(const uvec2 position) {
    return position.x | position.y << 16;
}

uvec2 bin_position(const uint packed) {
    return uvec2(packed & 0xffffu, packed >> 16);
}

// Position in the bin of its `i`th pixel. Bits do not mix: the position of a sum of disjoint bits is
// the sum of the positions.
uvec2 tile_pixel(const uint i) {
    uint x = (i & 1u) | ((i >> 1) & 6u) | ((i >> 3) & 8u);
    uint y = ((i >> 1) & 1u) | ((i >> 3) & 6u) | ((i >> 4) & 8u);
    return uvec2(x, y);
}

// The inverse of `tile_pixel`.
uint tile_index(const uvec2 p) {
    return (p.x & 1u) | ((p.y & 1u) << 1) | ((p.x & 6u) << 1) | ((p.y & 6u) << 3) | ((p.x & 8u) << 3) |
           ((p.y & 8u) << 4);
}
#endif
