// Binning, second step: turns the cells' counts into the positions of their lists, and finds the bins
// that have any work.
//
// Reads: counts of the cells.
// Writes: `cell_ends`, which holds the beginning of each list until scatter counts it up to the end; the
// non-empty bins in row order; the arguments of the dispatches over these bins.
// Contract: lists follow each other in cell order without gaps; a bin is listed exactly if it or a
// coarser cell around it has an entry.
// Kernel / Twin: src/compute/binning.rs, src/reference/binning.rs.
//
// One subgroup walks all cells, 9,000 of them at 1920x1080. A scan over workgroups would take several
// dispatches, which alone would cost more than this kernel.
#version 460
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "abi.glsl"
#include "lib/cells.glsl"
#include "lib/tile.glsl"

layout(constant_id = SPEC_WIDTH) const uint SUBGROUP_WIDTH = 8u;
layout(local_size_x_id = SPEC_WIDTH) in;
layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 0) readonly buffer CellCounts { uint cell_counts[]; };
layout(scalar, binding = 1) writeonly buffer CellEnds { uint cell_ends[]; };
layout(scalar, binding = 2) writeonly buffer Bins { uint bins[]; };
// Three words: the arguments of a dispatch with a workgroup for each non-empty bin.
layout(scalar, binding = 3) writeonly buffer BinArgs { uint bin_args[]; };

bool bin_has_work(const uvec2 position, const uint own) {
    uint around = own;
    [[unroll]] for (uint level = 1u; level < CELL_LEVELS; level++) {
        uvec2 cell = position >> (CELL_LOG2[level] - BIN_SIZE_LOG2);
        around |= cell_counts[batch.cell_first[level] + cell.y * batch.cell_columns[level] + cell.x];
    }
    return around != 0u;
}

void main() {
    uint lane = gl_SubgroupInvocationID;
    uint entries = 0u, listed = 0u;
    for (uint first = 0u; first < batch.cells; first += SUBGROUP_WIDTH) {
        uint cell = first + lane;
        uint count = cell < batch.cells ? cell_counts[cell] : 0u;
        uint place = entries + subgroupExclusiveAdd(count);
        uvec2 position = uvec2(cell % batch.bins_x, cell / batch.bins_x);
        bool work = cell < batch.bins && bin_has_work(position, count);
        uvec4 mask = subgroupBallot(work);
        if (cell < batch.cells) cell_ends[cell] = place;
        if (work) bins[listed + subgroupBallotExclusiveBitCount(mask)] = bin_packed(position);
        entries += subgroupAdd(count);
        listed += subgroupBallotBitCount(mask);
    }
    if (lane == 0u) {
        bin_args[0] = listed;
        bin_args[1] = 1u;
        bin_args[2] = 1u;
    }
}
