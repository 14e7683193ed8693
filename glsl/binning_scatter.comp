// Binning, third step: writes each triangle's key into the lists of the cells it touches.
//
// Reads: the cell of each primitive; the triangles of primitives that several cells list or that were
// clipped.
// Writes: the lists; `cell_ends`, which each entry counts up by one, from its list's beginning to its end.
// Contract: a cell's list holds the key of every valid triangle that `cells.glsl` lists there, each
// once, in no order.
// Kernel / Twin: src/compute/binning.rs, src/reference/binning.rs.
//
// An invocation takes PRIMITIVE_ROUNDS primitives, one after the other. Starting an invocation is
// expensive on CPUs, which compute its number by division.
#version 460
#include "pieces.glsl"
#include "lib/cells.glsl"
#include "lib/key.glsl"

layout(local_size_x = GROUP) in;
layout(scalar, binding = 1) readonly buffer Triangles { QuadTriangle triangles[]; };
layout(scalar, binding = 2) buffer CellEnds { uint cell_ends[]; };
layout(scalar, binding = 3) writeonly buffer Entries { uint entries[]; };
layout(scalar, binding = 4) readonly buffer PrimitiveCells { uint primitive_cells[]; };

void scatter(const uint key) {
    uint at = key_triangle(key, batch.primitives);
    uint flags = triangles[at].shading[3].y;
    if ((flags & TRIANGLE_VALID) == 0u) return;
    uint level = (flags >> TRIANGLE_LEVEL_SHIFT) & 3u;
    uvec4 x_low = uvec4(triangles[at].raster[0], triangles[at].raster[1]);
    uvec4 y_high = uvec4(triangles[at].raster[2], triangles[at].raster[3]);
    uint low = x_low.w, high = y_high.w;
    uvec4 range = cells_under(level, uvec2(low & 0xffffu, low >> 16), uvec2(high & 0xffffu, high >> 16));
    ivec3 x = ivec3(x_low.xyz), y = ivec3(y_high.xyz);
    for (uint row = range.y; row <= range.w; row++) {
        for (uint column = range.x; column <= range.z; column++) {
            if (!cell_lists(x, y, level, range, uvec2(column, row), batch.origin_y, batch.reach)) continue;
            uint cell = batch.cell_first[level] + row * batch.cell_columns[level] + column;
            entries[atomicAdd(cell_ends[cell], 1u)] = key;
        }
    }
}

void main() {
    uint first = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    first = first * GROUP * PRIMITIVE_ROUNDS + gl_LocalInvocationIndex;
    uint end = min(first + GROUP * PRIMITIVE_ROUNDS, batch.primitives);
    [[dont_unroll]] for (uint primitive = first; primitive < end; primitive += GROUP) {
        uint cell = primitive_cells[primitive];
        if (cell < SEVERAL_CELLS) entries[atomicAdd(cell_ends[cell], 1u)] = key_of(primitive, 0u);
        if (cell != SEVERAL_CELLS) continue;
        uint parts = 1u + ((triangles[primitive].shading[3].y >> TRIANGLE_EXTRA_SHIFT) & ((1u << TRIANGLE_EXTRA_BITS) - 1u));
        for (uint part = 0u; part < parts; part++) scatter(key_of(primitive, part));
    }
}
