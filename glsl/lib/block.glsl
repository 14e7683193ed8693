// Blocks: the parts of a bin that raster tests against a triangle at once, and bounds of depth in them.
// The file that includes this one defines SUBGROUP_WIDTH, and GREATER: whether the greater depth is nearer.
#ifndef BLOCK_GLSL
#define BLOCK_GLSL
#include "lib/depth.glsl"
#include "lib/patch.glsl"

// A block is a quadrant of the bin, or two of them where a subgroup is wider than one. It is tested in
// patches of as many pixels as a subgroup has lanes, numbered row by row.
const uint BLOCK = SUBGROUP_WIDTH > 64u ? SUBGROUP_WIDTH : 64u;
const uint BLOCKS = BIN_PIXELS / BLOCK;
const ivec2 BLOCK_LAST = ivec2(BLOCK == 64u ? 7 : 15, 7);
const uint COLUMNS = (uint(BLOCK_LAST.x) + 1u) >> PATCH_X_LOG2;
const uint ROWS = 8u >> PATCH_Y_LOG2;

bool in_front(const float a, const float b) {
    return GREATER ? a > b : a < b;
}

// `depth_range` as nearest and farthest: nothing is nearer than the first, nothing farther than the second.
vec2 depth_bounds(const vec3 plane, const vec3 adjustment, const ivec2 origin, const ivec2 last) {
    vec2 range = depth_range(plane, adjustment, origin, last);
    return GREATER ? range.yx : range;
}

// One bit for each patch of the block that a triangle may touch, row by row: under the pixels
// `low..=high`, which are relative to the block and overlap it, and inside of all edges at some pixel, as far
// as one edge after the other can tell. The edges are `at` the block's first pixel.
uint patches_touched(const ivec3 at, const ivec3 dx, const ivec3 dy, const ivec2 low, const ivec2 high) {
    uvec2 first = uvec2(max(low, 0)), last = uvec2(min(high, BLOCK_LAST));
    uint columns = (2u << (last.x >> PATCH_X_LOG2)) - (1u << (first.x >> PATCH_X_LOG2));
    ivec3 row_most = at + max(dx, 0) * ((1 << PATCH_X_LOG2) - 1) + max(dy, 0) * ((1 << PATCH_Y_LOG2) - 1);
    uint patches = 0u;
    [[unroll]] for (uint row = 0u; row < ROWS; row++) {
        bool under = row >= first.y >> PATCH_Y_LOG2 && row <= last.y >> PATCH_Y_LOG2;
        uint inside = 0u;
        ivec3 most = row_most;
        [[unroll]] for (uint column = 0u; column < COLUMNS; column++) {
            inside |= (most.x | most.y | most.z) >= 0 ? 1u << column : 0u;
            most += dx << PATCH_X_LOG2;
        }
        row_most += dy << PATCH_Y_LOG2;
        patches |= under ? (inside & columns) << (row * COLUMNS) : 0u;
    }
    return patches;
}
#endif
