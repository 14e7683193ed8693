// The order of a bin's 256 pixels in memory and over lanes, as PIXEL_COLUMN_BITS of abi.rs defines it: four 8x8
// quadrants, each of 4x4 quads of 2x2 pixels. If 4 or more consecutive pixels are a power of two in number and begin
// at a multiple of it, they are a rectangle. So four consecutive lanes are a quad, and a subgroup of any width works
// on a compact patch.
#ifndef TILE_GLSL
#define TILE_GLSL

// Quads of a bin.
const uint BIN_QUADS = BIN_PIXELS / 4u;

// A bin as lists name it: by column and row, so that no kernel has to divide by the columns of a band.
uint bin_packed(const uvec2 position) {
    return position.x | position.y << 16;
}

uvec2 bin_position(const uint packed) {
    return uvec2(packed & 0xffffu, packed >> 16);
}

// Position in the bin of its `i`th pixel. If `a` and `b` have no bit in common, the position of `a + b` is
// the sum of their positions.
uvec2 tile_pixel(const uint i) {
    return uvec2(PIXEL_COLUMN(i), PIXEL_ROW(i));
}

// The inverse of `tile_pixel`.
uint tile_index(const uvec2 p) {
    return PIXEL_NUMBER(p.x, p.y);
}
#endif
