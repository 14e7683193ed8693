// Binning, last step, for order-dependent work only: sorts the list of each cell by key, which is API
// order.
//
// Reads and writes: the lists. Reads: `cell_ends`.
// Contract: each list is ascending and keeps its entries.
// Kernel / Twin: src/compute/binning.rs, src/reference/binning.rs.
//
// Each workgroup is one subgroup and sorts one cell's list. It uses Batcher's merge network with every
// comparison ascending: if the length of a list is no power of two, comparisons with entries beyond its
// end are left out.
#version 460
#extension GL_KHR_shader_subgroup_basic : require
#include "abi.glsl"

layout(constant_id = SPEC_WIDTH) const uint SUBGROUP_WIDTH = 8u;
layout(local_size_x_id = SPEC_WIDTH) in;
layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 0) readonly buffer CellEnds { uint cell_ends[]; };
layout(scalar, binding = 1) coherent buffer Entries { uint entries[]; };

void exchange(const uint first, const uint a, const uint b, const uint count) {
    if (b >= count) return;
    uint low = entries[first + a], high = entries[first + b];
    if (low <= high) return;
    entries[first + a] = high;
    entries[first + b] = low;
}

void main() {
    uint cell = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (cell >= batch.cells) return;
    uint first = cell == 0u ? 0u : cell_ends[cell - 1u];
    uint count = cell_ends[cell] - first;
    // Runs of 2^log2, their pairs merged.
    for (uint log2 = 0u; (1u << log2) < count; log2++) {
        for (uint i = gl_LocalInvocationIndex; (i >> log2 << (log2 + 1u)) < count; i += SUBGROUP_WIDTH) {
            uint base = i >> log2 << (log2 + 1u), offset = i & ((1u << log2) - 1u);
            exchange(first, base + offset, base + (2u << log2) - 1u - offset, count);
        }
        memoryBarrierBuffer();
        barrier();
        for (uint step = log2; step > 0u; step--) {
            uint half_log2 = step - 1u, distance = 1u << half_log2;
            for (uint i = gl_LocalInvocationIndex; (i >> half_log2 << step) < count; i += SUBGROUP_WIDTH) {
                uint a = (i >> half_log2 << step) + (i & (distance - 1u));
                exchange(first, a, a + distance, count);
            }
            memoryBarrierBuffer();
            barrier();
        }
    }
}
