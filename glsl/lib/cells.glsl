// Which cells list a triangle. A triangle goes to the finest level at which it touches at most
// MAX_CELLS cells, so that the lists of a batch are bounded whatever the triangles are.
#ifndef CELLS_GLSL
#define CELLS_GLSL
#include "lib/edge.glsl"

const uint CELL_LOG2[CELL_LEVELS] = uint[](CELL_LOG2_0, CELL_LOG2_1, CELL_LOG2_2, CELL_LOG2_3);

// Columns and rows of cells, first and last, under the pixels `low..=high` of the band.
uvec4 cells_under(const uint level, const uvec2 low, const uvec2 high) {
    return uvec4(low >> CELL_LOG2[level], high >> CELL_LOG2[level]);
}

uint cells_count(const uvec4 range) {
    return (range.z - range.x + 1u) * (range.w - range.y + 1u);
}

// Whether the triangle is listed in the cell at `cell` (column, row). A box of one cell is listed
// untested. `reach` is how far samples are from the centres of their pixels at most, in 1/256 pixel.
bool cell_lists(const ivec3 x, const ivec3 y, const uint level, const uvec4 range, const uvec2 cell, const uint origin_y, const int reach) {
    if (range.xy == range.zw) return true;
    ivec2 origin = ivec2(cell << CELL_LOG2[level]) + ivec2(0, int(origin_y));
    return edges_touch(x, y, (origin << SUBPIXEL_BITS) - reach, CELL_LOG2[level]);
}

// The level at which a triangle is listed.
uint cell_level(const ivec3 x, const ivec3 y, const uvec2 low, const uvec2 high, const uint origin_y, const int reach) {
    [[dont_unroll]] for (uint level = 0u; level < CELL_LEVELS - 1u; level++) {
        uvec4 range = cells_under(level, low, high);
        uint count = cells_count(range);
        if (count <= MAX_CELLS) return level;
        if (count > MAX_CELLS_TESTED) continue;
        uint touched = 0u;
        uvec2 cell = range.xy;
        [[dont_unroll]] while (cell.y <= range.w) {
            touched += cell_lists(x, y, level, range, cell, origin_y, reach) ? 1u : 0u;
            cell = cell.x < range.z ? cell + uvec2(1u, 0u) : uvec2(range.x, cell.y + 1u);
        }
        if (touched <= MAX_CELLS) return level;
    }
    return CELL_LEVELS - 1u;
}
#endif
