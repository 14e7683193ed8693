// Raster and z-test of opaque work: which triangle each pixel of a bin shows.
//
// Reads: the non-empty bins, the lists of their cells, triangles, depth.
// Writes: `visibility`, the key of the triangle each pixel shows, 0 where the batch shows nothing;
// depth; for each fragment kernel of the batch the bins where it has pixels.
// Contract: the winner of a pixel is the triangle that the depth test would leave standing had all
// of the batch been drawn in API order; its order in the lists does not matter.
// Kernel / Twin: src/compute/raster.rs, src/reference/raster.rs.
//
// One subgroup is one workgroup is one bin. Each lane looks at another triangle of the list; those that
// may touch a quadrant of the bin are taken one by one, their edges handed to all lanes, and each lane
// tests one pixel of every patch of the quadrant that the triangle's box touches. Depth and key of the
// bin's pixels are in shared memory, each pixel's touched by one lane only, so that there is no barrier.
//
// Everything in registers, all loops unrolled, was the arrangement before: it tested the 64 pixels
// of a quadrant for a triangle of three, and took lavapipe three seconds to compile.
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

// A block is a quadrant of the bin, or two of them where a subgroup is wider than one. It is tested in
// patches of as many pixels as a subgroup has lanes, numbered row by row.
const uint BLOCK = WIDTH > 64u ? WIDTH : 64u;
const uint BLOCKS = BIN_PIXELS / BLOCK;
const int BLOCK_LAST_X = BLOCK == 64u ? 7 : 15;
const int BLOCK_LAST_Y = 7;
const uint PATCH_X_LOG2 = WIDTH > 64u ? 4u : (WIDTH >= 16u ? 3u : (WIDTH == 8u ? 2u : 1u));
const uint PATCH_Y_LOG2 = WIDTH >= 64u ? 3u : (WIDTH == 32u ? 2u : 1u);
const uint COLUMNS = (uint(BLOCK_LAST_X) + 1u) >> PATCH_X_LOG2;
const uint ROWS = 8u >> PATCH_Y_LOG2;

shared float s_depth[BIN_PIXELS];
shared uint s_key[BIN_PIXELS];

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

// One bit for each patch of the block under the pixels `low..=high`, which are relative to it and
// overlap it.
uint patches_under(const ivec2 low, const ivec2 high) {
    uvec2 first = uvec2(max(low, 0)), last = uvec2(min(high, ivec2(BLOCK_LAST_X, BLOCK_LAST_Y)));
    uint columns = (2u << (last.x >> PATCH_X_LOG2)) - (1u << (first.x >> PATCH_X_LOG2));
    uint rows = 0u;
    [[unroll]] for (uint row = 0u; row < ROWS; row++) {
        bool under = row >= first.y >> PATCH_Y_LOG2 && row <= last.y >> PATCH_Y_LOG2;
        rows |= under ? columns << (row * COLUMNS) : 0u;
    }
    return rows;
}

// The farthest depth that a block holds.
float farthest_of(const uint block) {
    float far_z = GREATER ? 1.0 : 0.0;
    [[dont_unroll]] for (uint i = gl_SubgroupInvocationID; i < BLOCK; i += WIDTH) {
        float z = s_depth[block * BLOCK + i];
        far_z = GREATER ? min(far_z, z) : max(far_z, z);
    }
    return GREATER ? subgroupMin(far_z) : subgroupMax(far_z);
}

void main() {
    uint lane = gl_SubgroupInvocationID;
    uint bin = bins[gl_WorkGroupID.x];
    uvec2 bin_position = uvec2(bin % batch.bins_x, bin / batch.bins_x);
    ivec2 local_origin = ivec2(bin_position << BIN_SIZE_LOG2);
    ivec2 origin = local_origin + ivec2(0, int(batch.origin_y));
    ivec2 lane_pixel = ivec2(tile_pixel(lane));

    [[dont_unroll]] for (uint i = lane; i < BIN_PIXELS; i += WIDTH) {
        uvec2 p = uvec2(local_origin) + tile_pixel(i);
        // Pixels of the bin beyond the target hold what nothing beats.
        float z = GREATER ? 2.0 : -1.0;
        if (p.x < batch.width && p.y < batch.height) z = depth[p.y * batch.width + p.x];
        s_depth[i] = z;
        s_key[i] = 0u;
    }
    float farthest[BLOCKS];
    [[dont_unroll]] for (uint b = 0u; b < BLOCKS; b++) farthest[b] = farthest_of(b);

    [[dont_unroll]] for (uint level = 0u; level < CELL_LEVELS; level++) {
        uvec2 cell_position = bin_position >> (CELL_LOG2[level] - BIN_SIZE_LOG2);
        uint cell = batch.cell_first[level] + cell_position.y * batch.cell_columns[level] + cell_position.x;
        uint end = cell_ends[cell];
        [[dont_unroll]] for (uint first = cell == 0u ? 0u : cell_ends[cell - 1u]; first < end; first += WIDTH) {
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

            [[dont_unroll]] for (uint b = 0u; b < BLOCKS; b++) {
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
                uint patches = patches_under(low - block, high - block);
                do {
                    uint j = subgroupBallotFindLSB(mask);
                    mask[j >> 5] &= mask[j >> 5] - 1u;
                    ivec3 dx = subgroupShuffle(edges.dx, j), dy = subgroupShuffle(edges.dy, j);
                    ivec3 start = subgroupShuffle(at_block, j) + dx * lane_pixel.x + dy * lane_pixel.y;
                    float zj = subgroupShuffle(z, j), xj = subgroupShuffle(dzdx, j), yj = subgroupShuffle(dzdy, j);
                    uint key_j = subgroupShuffle(key, j);
                    bool cut_j = subgroupShuffle(cut, j) != 0u;
                    ivec2 low_j = subgroupShuffle(low, j), high_j = subgroupShuffle(high, j);
                    uint left = subgroupShuffle(patches, j);
                    do {
                        uint i = uint(findLSB(left)) * WIDTH;
                        left &= left - 1u;
                        ivec2 step = ivec2(tile_pixel(i));
                        ivec3 e = start + dx * step.x + dy * step.y;
                        bool wins = (e.x | e.y | e.z) >= 0;
                        ivec2 p = block + lane_pixel + step;
                        if (cut_j) wins = wins && all(greaterThanEqual(p, low_j)) && all(lessThanEqual(p, high_j));
                        if (subgroupBallot(wins) == uvec4(0u)) continue;
                        float zp = depth_at(zj, xj, yj, origin + p);
                        uint held = b * BLOCK + i + lane;
                        if (wins && beats(zp, key_j, s_depth[held], s_key[held])) {
                            s_depth[held] = zp;
                            s_key[held] = key_j;
                        }
                    } while (left != 0u);
                } while (mask != uvec4(0u));
                farthest[b] = farthest_of(b);
            }
        }
    }

    uint shown = 0u;
    [[dont_unroll]] for (uint i = lane; i < BIN_PIXELS; i += WIDTH) {
        uint key = s_key[i];
        visibility[bin * BIN_PIXELS + i] = key;
        if (key == 0u) continue;
        uvec2 p = uvec2(local_origin) + tile_pixel(i);
        depth[p.y * batch.width + p.x] = s_depth[i];
        if (batch.fragment_kernels > 1u) {
            uint piece = triangles[key_triangle(key, batch.extra_first)].piece;
            shown |= 1u << pieces[piece].fragment_kernel;
        } else {
            shown = 1u;
        }
    }
    shown = subgroupOr(shown);
    while (shown != 0u) {
        uint kernel = uint(findLSB(shown));
        shown &= shown - 1u;
        if (lane == 0u) shade_bins[kernel * batch.bins + atomicAdd(shade_args[kernel].x, 1u)] = bin;
    }
}
