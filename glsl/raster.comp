// Raster, z-test and stencil test of opaque work: finds the triangle that each sample of a bin shows.
//
// Reads: the non-empty bins, the lists of their cells, triangles, depth, stencil values.
// Writes: depth and its bounds, and stencil values, for the bins in which the batch shows a triangle; for each fragment kernel
// of the batch a list of the bins in which it has pixels. An entry of a list has the key of the triangle that
// covers the whole bin, or else 0: then `visibility` has the key of the triangle that each sample shows, or 0.
// Visibility of other bins may be overwritten by zeros.
// Contract: the winner of a sample is the triangle that the depth test would leave standing if the whole
// batch were drawn in API order; the order of triangles in the lists does not matter.
// Kernel / Twin: src/compute/raster.rs, src/reference/raster.rs.
//
// Each workgroup is one subgroup and rasters one bin. Each lane loads a different triangle of the list. The
// triangles that may touch a block of the bin (`lib/block.glsl`) are then taken one by one: all lanes get
// the triangle's edges, and each lane tests one pixel of every patch that the triangle may touch. Two kinds
// of bin skip these tests: a bin that one triangle covers in front of everything else, and a bin in which
// everything is hidden. The bounds of each bin's depth, which are kept from batch to batch, tell them.
//
// If the device is a CPU, depth and key of a sample stay in the targets' own memory (IN_PLACE).
// `docs/tried.md` lists the alternatives that were tried.
#version 460
#extension GL_KHR_shader_subgroup_basic : require
#include "abi.glsl"

layout(constant_id = SPEC_WIDTH) const uint SUBGROUP_WIDTH = 8u;
layout(constant_id = SPEC_COMPARE) const uint COMPARE = COMPARE_LESS;
layout(constant_id = SPEC_ADJUSTED) const bool ADJUSTED = false;
layout(constant_id = SPEC_DEPTH_BITS) const uint DEPTH_BITS = 0u;

#include "bin.glsl"
#include "lib/cells.glsl"
#include "lib/coverage.glsl"

layout(local_size_x_id = SPEC_WIDTH) in;
layout(scalar, binding = 0) readonly buffer Bins { uint bins[]; };
layout(scalar, binding = 1) readonly buffer CellEnds { uint cell_ends[]; };
layout(scalar, binding = 2) readonly buffer Entries { uint entries[]; };
layout(scalar, binding = 3) readonly buffer Triangles { QuadTriangle triangles[]; };
layout(scalar, binding = 4) readonly buffer Pieces { Piece pieces[]; };
#include "listed.glsl"
#include "shade_lists.glsl"

// The least and the greatest depth that a pixel of each bin may have; if they are equal, all pixels have that
// depth. They are kept for the batches of opaque work that follow.
layout(scalar, binding = 9) buffer BinBounds { vec2 bin_bounds[]; };

void main() {
    uint lane = gl_SubgroupInvocationID;
    uint entry = bins[gl_WorkGroupID.x];
    uvec2 position = bin_position(entry);
    ivec2 local_origin = ivec2(position << BIN_SIZE_LOG2);
    Bin bin = Bin(position.y * batch.bins_x + position.x, local_origin);
    ivec2 origin = local_origin + ivec2(0, int(batch.origin_y));
    ivec2 lane_pixel = ivec2(tile_pixel(lane));
    bool inside = in_target(bin, BIN_LAST);

    // While `single` is set, no pixel is looked at: the bin shows either what it held before the batch,
    // whose bounds are known, or one triangle that covers the bin in front of all that.
    bool single = true;
    vec2 held = bin_bounds[bin.number];
    bool flat_before = held.x == held.y;
    uint base_key = 0u;
    vec3 base = vec3(held.x, 0.0, 0.0), base_adjustment = NO_ADJUSTMENT;
    vec2 base_bounds = GREATER ? held.yx : held; // nearest, farthest
    // For each block a bound of its farthest depth. The bound of a `touched` block may be out of date; it is
    // computed anew in the round `due`. If that changes no bound, the next time comes after twice as many rounds.
    vec4 farthest = vec4(0.0);
    uint touched = 0u, round = 0u, due = 1u, pause = 1u, any = 0u;

    [[dont_unroll]] for (uint level = 0u; level < CELL_LEVELS; level++) {
        uvec2 cell_position = position >> (CELL_LOG2[level] - BIN_SIZE_LOG2);
        uint cell = batch.cell_first[level] + cell_position.y * batch.cell_columns[level] + cell_position.x;
        uint end = cell_ends[cell];
        // The triangles of the next level have another size: they may hide more, or be hidden.
        pause = 1u;
        due = max(round, 1u);
        [[dont_unroll]] for (uint first = cell == 0u ? 0u : cell_ends[cell - 1u]; first < end; first += SUBGROUP_WIDTH) {
            uint key = entries[min(first + lane, end - 1u)];
            uint at = key_triangle(key, batch.primitives);
            uvec4 x_low = uvec4(triangles[at].raster[0], triangles[at].raster[1]);
            uvec4 y_high = uvec4(triangles[at].raster[2], triangles[at].raster[3]);
            ivec3 x = ivec3(x_low.xyz), y = ivec3(y_high.xyz);
            vec3 plane = uintBitsToFloat(uvec3(triangles[at].shading[0], triangles[at].shading[1].x));
            vec3 adjustment = adjustment_of(at, plane);
            uvec2 face = face_of(at);
            // A bin that reaches beyond the target is cut at the target's border.
            uint cut = inside ? triangles[at].shading[3].y & TRIANGLE_CUT : TRIANGLE_CUT;
            ivec2 low = ivec2(x_low.w & 0xffffu, x_low.w >> 16) - local_origin;
            ivec2 high = ivec2(y_high.w & 0xffffu, y_high.w >> 16) - local_origin;
            Edges edges = edges_from(x, y, origin << SUBPIXEL_BITS, 0u);
            ivec3 reach = edges_reach(edges.dx, edges.dy);
            bool live = first + lane < end && all(lessThanEqual(low, BIN_LAST)) && all(greaterThanEqual(high, ivec2(0)));

            if (single) {
                ivec3 least = edges.at - reach + min(edges.dx, 0) * BIN_LAST.x + min(edges.dy, 0) * BIN_LAST.y;
                ivec3 most = edges.at + reach + max(edges.dx, 0) * BIN_LAST.x + max(edges.dy, 0) * BIN_LAST.y;
                vec2 bounds = depth_bounds(plane, adjustment, origin, BIN_LAST);
                bool covers = COVERS_WHOLE_BINS && !is_tested(face) && (least.x | least.y | least.z) >= 0 && inside && all(lessThanEqual(low, ivec2(0))) &&
                              all(greaterThanEqual(high, BIN_LAST));
                uvec4 mask = lanes_where(live && (most.x | most.y | most.z) >= 0), covering = lanes_where(covers);
                while (single && has_lanes(mask)) {
                    uint j = first_lane(mask);
                    mask = without_first_lane(mask);
                    vec2 bounds_j = subgroupShuffle(bounds, j);
                    if (in_front(base_bounds.y, bounds_j.x)) continue;
                    if (has_lane(covering, j) && in_front(bounds_j.y, base_bounds.x)) {
                        base_key = subgroupShuffle(key, j);
                        base = subgroupShuffle(plane, j);
                        if (ADJUSTED) base_adjustment = subgroupShuffle(adjustment, j);
                        base_bounds = bounds_j;
                    } else {
                        single = false;
                    }
                }
                if (single) continue;
                // From here on pixels are tested one by one. This round starts again: no triangle can win twice.
                fill(bin, base_key != 0u || (flat_before && !IN_PLACE), base_key, base, base_adjustment);
                any = base_key;
                farthest = vec4(base_bounds.y);
            }

            bool look = round++ >= due, looked = false, nearer = false;
            [[dont_unroll]] for (uint b = 0u; b < BLOCKS; b++) {
                ivec2 block = ivec2(tile_pixel(b * BLOCK));
                ivec3 at_block = edges.at + edges.dx * block.x + edges.dy * block.y;
                ivec3 most = at_block + reach + max(edges.dx, 0) * BLOCK_LAST.x + max(edges.dy, 0) * BLOCK_LAST.y;
                bool near = all(lessThanEqual(low, block + BLOCK_LAST)) && all(greaterThanEqual(high, block));
                bool hit = live && near && (most.x | most.y | most.z) >= 0;
                if (!has_lanes(lanes_where(hit))) continue;
                if (look && (touched >> b & 1u) != 0u) {
                    float found = farthest_of(bin, b);
                    looked = true;
                    nearer = nearer || found != farthest[b];
                    farthest[b] = found;
                    touched &= ~(1u << b);
                }
                uint patches = patches_touched(at_block + reach, edges.dx, edges.dy, low - block, high - block);
                hit = hit && patches != 0u && !in_front(farthest[b], depth_bounds(plane, adjustment, origin + block, BLOCK_LAST).x);
                uvec4 mask = lanes_where(hit);
                if (!has_lanes(mask)) continue;
                touched |= 1u << b;
                do {
                    uint j = first_lane(mask);
                    mask = without_first_lane(mask);
                    ivec3 dx = subgroupShuffle(edges.dx, j), dy = subgroupShuffle(edges.dy, j), rest = ivec3(0);
                    if (SAMPLES > 1u) rest = subgroupShuffle(edges.rest, j);
                    ivec3 start = subgroupShuffle(at_block, j) + dx * lane_pixel.x + dy * lane_pixel.y;
                    vec3 plane_j = subgroupShuffle(plane, j);
                    vec3 adjustment_j = NO_ADJUSTMENT;
                    if (ADJUSTED) adjustment_j = subgroupShuffle(adjustment, j);
                    uint key_j = subgroupShuffle(key, j);
                    uvec2 face_j = NO_STENCIL_TEST;
                    if (STENCIL) face_j = subgroupShuffle(face, j);
                    bool cut_j = subgroupShuffle(cut, j) != 0u;
                    ivec2 low_j = subgroupShuffle(low, j), high_j = subgroupShuffle(high, j);
                    uint left = subgroupShuffle(patches, j);
                    do {
                        uint i = uint(findLSB(left)) * SUBGROUP_WIDTH;
                        left &= left - 1u;
                        ivec2 step = ivec2(tile_pixel(i));
                        ivec3 e = start + dx * step.x + dy * step.y;
                        ivec2 p = block + lane_pixel + step; // in the bin
                        uint pixel = b * BLOCK + i + lane;
                        bool boxed = true;
                        if (cut_j) boxed = all(greaterThanEqual(p, low_j)) && all(lessThanEqual(p, high_j));
                        for (uint s = 0u; s < SAMPLES; s++) {
                            if (boxed && covered(edges_at(Edges(e, dx, dy, rest), sample_offset(s)), origin + p)) {
                                float z = depth_at(plane_j, adjustment_j, place_of(bin, p, s));
                                if (beats(bin, pixel, p, s, z, key_j) && stencil_takes(bin, p, s, face_j)) {
                                    hold(bin, pixel, p, s, z, key_j);
                                    any |= key_j;
                                }
                            }
                        }
                    } while (left != 0u);
                } while (has_lanes(mask));
            }
            if (looked) {
                pause = nearer ? 1u : 2u * pause;
                due = round + pause - 1u;
            }
        }
    }

    uint shown = 0u;
    vec2 bounds = base_bounds;
    if (single) {
        if (base_key == 0u) return;
        cover(bin, base, base_adjustment);
        if (base.yz == vec2(0.0)) bounds = vec2(depth_at(base, base_adjustment, vec2(0.0)));
        shown = 1u << fragment_kernel_of(base_key);
    } else {
        if (!has_lanes(lanes_where(any != 0u))) return;
        // `finish` copies the pixels out and finds `shown` and `bounds`. It is not needed if the pixels are in
        // place, the batch has one fragment kernel and no later batch reads the bounds.
        shown = 1u;
        if (!IN_PLACE || !inside || batch.fragment_kernels > 1u || batch.followed != 0u) finish(bin, shown, bounds);
    }
    if (lane == 0u && batch.followed != 0u) bin_bounds[bin.number] = vec2(min(bounds.x, bounds.y), max(bounds.x, bounds.y));
    list_for_shading(shown, uvec2(entry, single ? base_key : 0u));
}
