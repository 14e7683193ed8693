// Raster and z-test of opaque work: which triangle each pixel of a bin shows.
//
// Reads: the non-empty bins, the lists of their cells, triangles, depth.
// Writes: `visibility`, the key of the triangle each pixel shows, 0 where the batch shows nothing;
// depth; for each fragment kernel of the batch the bins where it has pixels.
// Contract: the winner of a pixel is the triangle that the depth test would leave standing had all
// of the batch been drawn in API order; its order in the lists does not matter.
// Kernel / Twin: src/compute/raster.rs, src/reference/raster.rs.
//
// One subgroup is one workgroup is one bin: no barrier and no shared memory. Each lane looks at
// another triangle of the list; those that may touch a block of the bin are taken one by one, their
// edges handed to all lanes, and each lane tests its pixels, whose depth and key stay in registers.
#version 460
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "abi.glsl"
#include "lib/cells.glsl"
#include "lib/depth.glsl"
#include "lib/key.glsl"
#include "lib/tile.glsl"

layout(constant_id = SPEC_WIDTH) const uint WIDTH = 8u;
layout(constant_id = SPEC_COMPARE) const uint COMPARE = 1u;
layout(local_size_x_id = SPEC_WIDTH) in;
layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 0) readonly buffer Bins { uint bins[]; };
layout(scalar, binding = 1) readonly buffer CellEnds { uint cell_ends[]; };
layout(scalar, binding = 2) readonly buffer Entries { uint entries[]; };
layout(scalar, binding = 3) readonly buffer Triangles { Triangle triangles[]; };
layout(scalar, binding = 4) readonly buffer Pieces { Piece pieces[]; };
layout(scalar, binding = 5) buffer Depth { float depth[]; };
layout(scalar, binding = 6) writeonly buffer Visibility { uint visibility[]; };
// For each fragment kernel the arguments of its dispatch, one workgroup column per bin.
layout(scalar, binding = 7) buffer ShadeArgs { uvec3 shade_args[]; };
// `batch.bins` entries for each fragment kernel.
layout(scalar, binding = 8) writeonly buffer ShadeBins { uint shade_bins[]; };

// Pixels are tested in blocks that are at least as large as a subgroup.
const uint BLOCK = WIDTH > 64u ? WIDTH : 64u;
const uint BLOCKS = BIN_PIXELS / BLOCK;
const uint STEPS = BLOCK / WIDTH;
const int BLOCK_LAST_X = BLOCK == 64u ? 7 : 15;
const int BLOCK_LAST_Y = 7;

const bool GREATER = COMPARE == 4u || COMPARE == 6u;
const bool OR_EQUAL = COMPARE == 3u || COMPARE == 6u;

// Whether (z, key) beats what a pixel holds. Among equals the comparison decides whether the first
// or the last in API order stays; a key of 0 is what was there before the batch.
bool beats(const float z, const uint key, const float held_z, const uint held_key) {
    bool nearer = GREATER ? z > held_z : z < held_z;
    bool among_equals = OR_EQUAL ? key > held_key : key < held_key;
    return nearer || (z == held_z && among_equals);
}

// A bound that no depth of the triangle in the block at `origin` is nearer than.
float nearest_in_block(const float z, const float dzdx, const float dzdy, const ivec2 origin) {
    float sx = dzdx * float(origin.x), sy = dzdy * float(origin.y);
    float ex = dzdx * float(BLOCK_LAST_X), ey = dzdy * float(BLOCK_LAST_Y);
    float slack = (abs(z) + abs(sx) + abs(sy) + abs(ex) + abs(ey)) * (1.0 / 1048576.0);
    return GREATER ? z + sx + sy + max(ex, 0.0) + max(ey, 0.0) + slack
                   : z + sx + sy + min(ex, 0.0) + min(ey, 0.0) - slack;
}

void main() {
    uint lane = gl_SubgroupInvocationID;
    uint bin = bins[gl_WorkGroupID.x];
    uvec2 bin_position = uvec2(bin % batch.bins_x, bin / batch.bins_x);
    ivec2 local_origin = ivec2(bin_position << BIN_SIZE_LOG2);
    ivec2 origin = local_origin + ivec2(0, int(batch.origin_y));
    ivec2 lane_pixel = ivec2(tile_pixel(lane));

    float held_z[BLOCKS * STEPS];
    uint held_key[BLOCKS * STEPS];
    float farthest[BLOCKS];
    [[unroll]] for (uint b = 0u; b < BLOCKS; b++) {
        float far_z = GREATER ? 1.0 : 0.0;
        [[unroll]] for (uint s = 0u; s < STEPS; s++) {
            uint i = b * STEPS + s;
            held_z[i] = depth[bin * BIN_PIXELS + i * WIDTH + lane];
            held_key[i] = 0u;
            far_z = GREATER ? min(far_z, held_z[i]) : max(far_z, held_z[i]);
        }
        farthest[b] = GREATER ? subgroupMin(far_z) : subgroupMax(far_z);
    }

    for (uint level = 0u; level < CELL_LEVELS; level++) {
        uvec2 cell_position = bin_position >> (CELL_LOG2[level] - BIN_SIZE_LOG2);
        uint cell = batch.cell_first[level] + cell_position.y * batch.cell_columns[level] + cell_position.x;
        uint end = cell_ends[cell];
        for (uint first = cell == 0u ? 0u : cell_ends[cell - 1u]; first < end; first += WIDTH) {
            uint key = entries[min(first + lane, end - 1u)];
            uint at = key_triangle(key, batch.extra_first);
            ivec3 x = triangles[at].x, y = triangles[at].y;
            float z = triangles[at].z, dzdx = triangles[at].dzdx, dzdy = triangles[at].dzdy;
            uint low_bits = triangles[at].bounds_min, high_bits = triangles[at].bounds_max;
            uint cut = triangles[at].flags & TRIANGLE_CUT;
            ivec2 low = ivec2(low_bits & 0xffffu, low_bits >> 16) - local_origin;
            ivec2 high = ivec2(high_bits & 0xffffu, high_bits >> 16) - local_origin;
            Edges edges = edges_from(x, y, origin, 0u);
            bool live = first + lane < end;

            [[unroll]] for (uint b = 0u; b < BLOCKS; b++) {
                ivec2 block = ivec2(tile_pixel(b * BLOCK));
                ivec3 at_block = edges.at + edges.dx * block.x + edges.dy * block.y;
                ivec3 most = at_block + max(edges.dx, 0) * BLOCK_LAST_X + max(edges.dy, 0) * BLOCK_LAST_Y;
                float bound = nearest_in_block(z, dzdx, dzdy, origin + block);
                bool boxed = low.x <= block.x + BLOCK_LAST_X && low.y <= block.y + BLOCK_LAST_Y &&
                             high.x >= block.x && high.y >= block.y;
                bool hit = live && boxed && (most.x | most.y | most.z) >= 0 &&
                           (GREATER ? bound >= farthest[b] : bound <= farthest[b]);
                uvec4 mask = subgroupBallot(hit);
                if (mask == uvec4(0u)) continue;
                do {
                    uint j = subgroupBallotFindLSB(mask);
                    mask[j >> 5] &= mask[j >> 5] - 1u;
                    ivec3 dx = subgroupShuffle(edges.dx, j), dy = subgroupShuffle(edges.dy, j);
                    ivec3 start = subgroupShuffle(at_block, j) + dx * lane_pixel.x + dy * lane_pixel.y;
                    float zj = subgroupShuffle(z, j), xj = subgroupShuffle(dzdx, j), yj = subgroupShuffle(dzdy, j);
                    uint key_j = subgroupShuffle(key, j);
                    ivec2 at_lane = origin + block + lane_pixel;
                    bool cut_j = subgroupShuffle(cut, j) != 0u;
                    ivec2 low_j = subgroupShuffle(low, j), high_j = subgroupShuffle(high, j);
                    [[unroll]] for (uint s = 0u; s < STEPS; s++) {
                        ivec2 step = ivec2(tile_pixel(s * WIDTH));
                        ivec3 e = start + dx * step.x + dy * step.y;
                        bool wins = (e.x | e.y | e.z) >= 0;
                        if (cut_j) {
                            ivec2 p = block + lane_pixel + step;
                            wins = wins && all(greaterThanEqual(p, low_j)) && all(lessThanEqual(p, high_j));
                        }
                        float zp = depth_at(zj, xj, yj, at_lane + step);
                        uint i = b * STEPS + s;
                        wins = wins && beats(zp, key_j, held_z[i], held_key[i]);
                        held_z[i] = wins ? zp : held_z[i];
                        held_key[i] = wins ? key_j : held_key[i];
                    }
                } while (mask != uvec4(0u));
                float far_z = held_z[b * STEPS];
                [[unroll]] for (uint s = 1u; s < STEPS; s++) {
                    far_z = GREATER ? min(far_z, held_z[b * STEPS + s]) : max(far_z, held_z[b * STEPS + s]);
                }
                farthest[b] = GREATER ? subgroupMin(far_z) : subgroupMax(far_z);
            }
        }
    }

    uint shown = 0u;
    [[unroll]] for (uint i = 0u; i < BLOCKS * STEPS; i++) {
        uint pixel = bin * BIN_PIXELS + i * WIDTH + lane;
        visibility[pixel] = held_key[i];
        depth[pixel] = held_z[i];
        if (held_key[i] != 0u && batch.fragment_kernels > 1u) {
            uint piece = triangles[key_triangle(held_key[i], batch.extra_first)].piece;
            shown |= 1u << pieces[piece].fragment_kernel;
        }
        shown |= held_key[i] != 0u && batch.fragment_kernels == 1u ? 1u : 0u;
    }
    shown = subgroupOr(shown);
    while (shown != 0u) {
        uint kernel = uint(findLSB(shown));
        shown &= shown - 1u;
        if (lane == 0u) shade_bins[kernel * batch.bins + atomicAdd(shade_args[kernel].x, 1u)] = bin;
    }
}
