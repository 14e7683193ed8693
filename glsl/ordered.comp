// Raster, z-test, shading and blending of order-dependent work: draws with blending, discard, depth
// export or side effects, and draws without the depth test and write that opaque work has (src/compute/mod.rs).
//
// Reads: the non-empty bins, the sorted lists of their cells, triangles, positions, varyings and
// whatever the shader binds.
// Writes: colour, depth and stencil values; for a trace `visibility`, the last triangle that wrote to each pixel.
// Contract: each pixel sees its fragments in API order, whatever the order of the bins.
// Kernel / Twin: src/compute/ordered.rs; src/reference/raster.rs gives the same coverage, depth and
// visibility if the shader neither discards nor writes depth.
//
// Each workgroup is one subgroup and draws one bin. It merges the four sorted lists of the bin's cells and
// takes one triangle at a time. It first tests all pixels under the triangle's box, then runs the shader
// in each quad in which a pixel passed; nothing has to be fetched between two quads. Of several samples of a
// pixel, it tests once more which of them passed. Colour and depth stay in memory, and only one lane touches each pixel. `docs/tried.md` lists the alternatives that were tried.
#version 460

layout(constant_id = SPEC_WIDTH) const uint SUBGROUP_WIDTH = 8u;

#include "fragment.glsl"
#include "lib/cells.glsl"
#include "lib/coverage.glsl"
#include "lib/patch.glsl"

layout(constant_id = SPEC_DEPTH) const uint DEPTH = DEPTH_EARLY_TEST;
layout(local_size_x_id = SPEC_WIDTH) in;
layout(scalar, binding = 5) readonly buffer Bins { uint bins[]; };
layout(scalar, binding = 6) readonly buffer CellEnds { uint cell_ends[]; };
layout(scalar, binding = 7) readonly buffer Entries { uint entries[]; };
layout(scalar, binding = 8) buffer Depth { float depth[]; };
layout(scalar, binding = 9) writeonly buffer Visibility { uvec4 visibility[]; };
layout(scalar, binding = 10) buffer Color { uint color[]; };
layout(scalar, binding = 11) writeonly buffer BinBounds { vec2 bin_bounds[]; };
layout(scalar, binding = 12) buffer Stencil { uint stencil[]; };
#include "merge.glsl"

// A patch has as many pixels as a subgroup has lanes. A lane keeps one bit for each patch of the bin, row by
// row. A narrow subgroup has more patches than a word has bits, so it takes the bin in parts.
const uint COLUMNS_LOG2 = BIN_SIZE_LOG2 - PATCH_X_LOG2;
const uint PARTS = SUBGROUP_WIDTH < 8u ? 2u : 1u;
const uint ROWS = (1u << (BIN_SIZE_LOG2 - PATCH_Y_LOG2)) / PARTS;
const bool EARLY = DEPTH == DEPTH_EARLY || DEPTH == DEPTH_EARLY_TEST;
// Whether pixels that fail are left out before quads are shaded. That first round writes nothing if pixels have several samples;
// but a stencil value may change where a test fails.
const bool FIRST = EARLY && !(STENCIL && SAMPLES > 1u && DEPTH == DEPTH_EARLY);

// Records for a trace that the samples `mask` of pixel `i` of the bin show the triangle of `key`.
void show(const uint mask, const uint bin, const uint i, const uint key) {
    for (uint s = 0u; s < SAMPLES; s++) {
        if (SAMPLES == 1u || (mask >> s & 1u) != 0u) visibility[(bin * BIN_QUADS + (i >> 2)) * SAMPLES + s][i & 3u] = key;
    }
}

// A bit for each sample of `pixel` that the triangle covers. Its edges are `at` the centre.
uint covered_samples(const Edges edges, const ivec3 at, const ivec2 pixel) {
    uint mask = 0u;
    for (uint s = 0u; s < SAMPLES; s++) {
        mask |= covered(edges_at(Edges(at, edges.dx, edges.dy, edges.rest), sample_offset(s)), pixel) ? 1u << s : 0u;
    }
    return mask;
}

void draw(const uint key, const uint bin, const ivec2 local_origin) {
    uint t = key_triangle(key, batch.primitives);
    uint lane = gl_SubgroupInvocationID;
    ivec2 origin = local_origin + ivec2(0, int(batch.origin_y));
    uvec2 own = triangles[t].raster[QUAD_LANE];
    uvec4 x_low = of_first_half(own), y_high = of_second_half(own);
    uint low_bits = x_low.w, high_bits = y_high.w;
    ivec2 low = ivec2(low_bits & 0xffffu, low_bits >> 16) - local_origin;
    ivec2 high = ivec2(high_bits & 0xffffu, high_bits >> 16) - local_origin;
    // A coarse cell lists triangles that miss some of its bins.
    if (any(lessThan(high, ivec2(0))) || any(greaterThan(low, BIN_LAST))) return;
    Edges edges = edges_from(ivec3(x_low.xyz), ivec3(y_high.xyz), origin << SUBPIXEL_BITS, 0u);
    ivec3 least = edges.at - edges_reach(edges.dx, edges.dy) + min(edges.dx, 0) * BIN_LAST.x + min(edges.dy, 0) * BIN_LAST.y;
    bool covers = COVERS_WHOLE_BINS && (least.x | least.y | least.z) >= 0 && all(lessThanEqual(low, ivec2(0))) && all(greaterThanEqual(high, BIN_LAST));
    uvec2 own_shading = triangles[t].shading[QUAD_LANE];
    uvec4 depth_piece = of_first_half(own_shading);
    uint piece = depth_piece.w;
    vec3 z_plane = uintBitsToFloat(depth_piece.xyz);
    uint state = pieces[piece].fragment_state;
    vec2 bounds = vec2(0.0);
    if ((state & DEPTH_STATE_BOUNDS) != 0u) bounds = pieces[piece].depth_bounds;
    vec3 adjustment = NO_ADJUSTMENT;
    if (ADJUSTED && (state & DEPTH_STATE_ADJUSTED) != 0u) {
        adjustment.x = bias_of(pieces[piece].depth_bias, z_plane.yz, of_second_half(own_shading).w >> TRIANGLE_EXPONENT_SHIFT);
        adjustment.yz = pieces[piece].depth_limits;
    }
    uvec2 face = NO_STENCIL_TEST;
    if (STENCIL) {
        face = pieces[piece].stencil[(of_second_half(own_shading).w & TRIANGLE_FRONT) != 0u ? 0u : 1u];
        stencil_reference = face.y & 255u;
    }
    Tests tests = Tests(state, bounds, z_plane, adjustment, face);
    bool test = (state & (DEPTH_STATE_TEST | DEPTH_STATE_BOUNDS)) != 0u || is_tested(face);
    // What is left to do for a sample that has passed.
    Tests done = Tests(state & ~(DEPTH_STATE_TEST | DEPTH_STATE_BOUNDS), bounds, z_plane, adjustment, face);
    uint enabled = ALL_SAMPLES & (state >> SAMPLE_STATE_MASK_SHIFT);
    uvec4 states[MAX_COLORS / 4u];
    states[0] = of_quad(pieces[piece].colors[0][QUAD_LANE]);
    if (MORE_FORMATS != 0xffffffffu) states[1] = of_quad(pieces[piece].colors[1][QUAD_LANE]);

    uvec2 first_patch = uvec2(max(low, 0)) >> uvec2(PATCH_X_LOG2, PATCH_Y_LOG2);
    uvec2 last_patch = uvec2(min(high, BIN_LAST)) >> uvec2(PATCH_X_LOG2, PATCH_Y_LOG2);
    ivec2 lane_pixel = ivec2(tile_pixel(lane));
    [[dont_unroll]] for (uint part = 0u; part < PARTS; part++) {
        // One bit for each patch of the part in which this lane's pixel passes.
        uint passed = 0u, first_row = max(first_patch.y, part * ROWS), end_row = min(last_patch.y + 1u, (part + 1u) * ROWS);
        [[dont_unroll]] for (uint column = first_patch.x; column <= last_patch.x; column++) {
            int x = int(column << PATCH_X_LOG2) + lane_pixel.x;
            bool across = x >= low.x && x <= high.x;
            ivec3 at_column = edges.at + edges.dx * x;
            float z_column = depth_of_column(z_plane.x, z_plane.y, float(origin.x + x));
            [[dont_unroll]] for (uint row = first_row; row < end_row; row++) {
                int y = int(row << PATCH_Y_LOG2) + lane_pixel.y;
                ivec2 pixel = origin + ivec2(x, y);
                uint mask = enabled;
                if (!covers) {
                    mask &= covered_samples(edges, at_column + edges.dy * y, pixel);
                    mask = across && y >= low.y && y <= high.y ? mask : 0u;
                }
                if (mask != 0u && test && FIRST) {
                    uint number = uint(local_origin.y + y) * batch.width + uint(local_origin.x + x);
                    float z = depth_in_column(z_column, z_plane.z, adjustment, float(pixel.y));
                    mask = passing(tests, mask, pixel, number, z, SAMPLES == 1u && DEPTH == DEPTH_EARLY);
                }
                passed |= mask != 0u ? 1u << (((row - part * ROWS) << COLUMNS_LOG2) + column) : 0u;
            }
        }
        // Where no colour is written, the tests may be all that there is to do.
        if (SAMPLES == 1u && DEPTH == DEPTH_EARLY && (state & FRAGMENT_STATE_COLORLESS) != 0u && batch.traced == 0u) continue;
        uint left = passed | subgroupQuadSwapHorizontal(passed);
        left |= subgroupQuadSwapVertical(left);
        if (left == 0u) continue;

        // Each quad takes its own patches, so that those with many of them do not wait for others.
        Bound triangle = bind_triangle(key);
        [[dont_unroll]] while (left != 0u) {
            uint patch_at = uint(findLSB(left));
            left &= left - 1u;
            uint mask = (passed >> patch_at) & 1u;
            uint column = patch_at & ((1u << COLUMNS_LOG2) - 1u), row = (patch_at >> COLUMNS_LOG2) + part * ROWS;
            ivec2 p = ivec2(column << PATCH_X_LOG2, row << PATCH_Y_LOG2) + lane_pixel;
            uint number = uint(local_origin.y + p.y) * batch.width + uint(local_origin.x + p.x);
            uint coverage = mask;
            if (SAMPLES > 1u && mask != 0u) {
                coverage = enabled;
                if (!covers) coverage &= covered_samples(edges, edges.at + edges.dx * p.x + edges.dy * p.y, origin + p);
                mask = coverage;
                if (test && EARLY) mask = passing(tests, mask, origin + p, number, 0.0, DEPTH == DEPTH_EARLY);
            }
            for (uint i = 0u; i < (PER_SAMPLE ? SAMPLES : 1u); i++) {
                uint own = PER_SAMPLE ? 1u << i : 0xffffffffu;
                if (PER_SAMPLE && !any_of_quad((mask & own) != 0u)) continue;
                uint kept = shade(triangle, origin + p, mask & own, coverage & own, i);
                if (BY_ALPHA && (state & SAMPLE_STATE_ALPHA_COVERS) != 0u) kept = covered_by(kept, uintBitsToFloat(color_bits_0u.a));
                float z = surface_depth;
                if (DEPTH == DEPTH_WRITTEN) z = stored_depth(ADJUSTED ? limited_depth(tw_FragDepth, adjustment) : tw_FragDepth);
                if (STENCIL && !EARLY) tests.face.y = (face.y & ~255u) | (uint(tw_FragStencilRef) & 255u);
                if (kept != 0u && test && !EARLY) kept = passing(tests, kept, origin + p, number, z, true);
                if (kept != 0u && test && DEPTH == DEPTH_EARLY_TEST) passing(done, kept, origin + p, number, z, true);
                // No `continue`: the lanes of the quad must be together again for the next sample.
                if (kept != 0u) {
                    if (batch.traced != 0u) show(kept, bin, tile_index(uvec2(p)), key);
                    write_colors(kept, number, piece, state, states);
                }
            }
        }
    }
}

void main() {
    uvec2 position = bin_position(bins[gl_WorkGroupID.x]);
    uint bin = position.y * batch.bins_x + position.x;
    // The lane that draws to a pixel also resets it: no barrier orders the writes of two lanes.
    if (batch.traced != 0u) {
        for (uint i = gl_SubgroupInvocationID; i < BIN_PIXELS; i += SUBGROUP_WIDTH) show(ALL_SAMPLES, bin, i, 0u);
    }
    // Ordered work may move depth either way, so the widest bounds are the only safe ones.
    if (gl_SubgroupInvocationID == 0u) bin_bounds[bin] = vec2(0.0, 1.0);
    uint at[CELL_LEVELS], end[CELL_LEVELS];
    for (uint level = 0u; level < CELL_LEVELS; level++) {
        uvec2 cell_position = position >> (CELL_LOG2[level] - BIN_SIZE_LOG2);
        uint cell = batch.cell_first[level] + cell_position.y * batch.cell_columns[level] + cell_position.x;
        at[level] = cell == 0u ? 0u : cell_ends[cell - 1u];
        end[level] = cell_ends[cell];
    }
    for (;;) {
        uint next = 0xffffffffu, from = 0u;
        for (uint level = 0u; level < CELL_LEVELS; level++) {
            uint key = at[level] < end[level] ? entries[at[level]] : 0xffffffffu;
            from = key < next ? level : from;
            next = min(next, key);
        }
        if (next == 0xffffffffu) break;
        at[from]++;
        draw(next, bin, ivec2(position << BIN_SIZE_LOG2));
    }
}
