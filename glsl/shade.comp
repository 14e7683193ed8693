// Shading of opaque work: runs the user's fragment shader once for each visible (quad, triangle).
//
// Reads: the bins in which this fragment kernel has pixels, with the triangles that cover whole bins; visibility,
// triangles, positions, varyings and whatever the shader binds.
// Writes: colour of the pixels whose visible triangle belongs to this fragment kernel.
// Contract: hidden fragments are never shaded. A quad that shows several triangles runs the shader once
// for each of them, with its other pixels as helpers. Hardware does the same, so derivatives are the same.
// Kernel / Twin: src/compute/shade.rs; no twin, the shader is the user's.
//
// Each workgroup is one subgroup and shades one bin. Each lane takes a different quad of the bin and counts
// the triangles that the quad shows. The pairs of a quad and one of its triangles are then numbered, and
// the subgroup shades as many pairs at a time as it has quads of lanes. So a quad that shows one triangle
// does not wait for a quad that shows four. `docs/tried.md` lists the alternatives that were tried. If pixels
// have several samples, each four lanes take a quad of the bin, and its triangles in the order of their keys.
#version 460
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require

layout(constant_id = SPEC_WIDTH) const uint SUBGROUP_WIDTH = 8u;

#include "fragment.glsl"

layout(local_size_x_id = SPEC_WIDTH) in;
layout(scalar, binding = 5) readonly buffer ShadeBins { uvec2 shade_bins[]; };
layout(scalar, binding = 6) readonly buffer Visibility { uvec4 visibility[]; };
layout(scalar, binding = 7) writeonly buffer Color { uint color[]; };
#include "targets.glsl"

// `key`, or 0 if another fragment kernel shades its triangle.
uint own_key(const uint key) {
    if (key == 0u) return key;
    uint piece = triangles[key_triangle(key, batch.primitives)].shading[1].y;
    return pieces[piece].fragment_kernel == batch.fragment_kernel ? key : 0u;
}

// One bit for each pixel of the quad that shows a triangle which no earlier pixel of the quad shows.
uint first_shown(const uvec4 keys) {
    bool y = keys.y != keys.x, z = keys.z != keys.x && keys.z != keys.y;
    bool w = keys.w != keys.x && keys.w != keys.y && keys.w != keys.z;
    return (keys.x != 0u ? 1u : 0u) | (y && keys.y != 0u ? 2u : 0u) | (z && keys.z != 0u ? 4u : 0u) |
           (w && keys.w != 0u ? 8u : 0u);
}

// Shades the target's pixel `pixel`, number `number` of the band, whose samples `mask` show the triangle of `key`.
void shade_samples(const uint key, const ivec2 pixel, const uint number, const uint mask) {
    for (uint i = 0u; i < (PER_SAMPLE ? SAMPLES : 1u); i++) {
        uint own = PER_SAMPLE ? mask & (1u << i) : mask;
        shade(bind_triangle(key), pixel, own, own, i);
        for (uint s = 0u; s < SAMPLES; s++) {
            if ((mask >> s & 1u) == 0u || (PER_SAMPLE && s != i)) continue;
            uint at = number * SAMPLES + s;
#define STORE(t) if (format_of(t) != NO_FORMAT) store_color(t, at, color_encode(format_of(t), color_bits_##t));
            EACH_COLOR(STORE)
        }
    }
}

// Shades the bin at `position`. If `covering` is not 0, all samples show its triangle.
void shade_all_samples(const uvec2 position, const uint first_quad, const uint covering) {
    [[dont_unroll]] for (uint quad = gl_SubgroupInvocationID >> 2; quad < BIN_QUADS; quad += SUBGROUP_WIDTH / 4u) {
        uint own[SAMPLES];
        for (uint s = 0u; s < SAMPLES; s++) {
            own[s] = covering != 0u ? covering : visibility[(first_quad + quad) * SAMPLES + s][QUAD_LANE];
            if (batch.fragment_kernels > 1u && covering == 0u) own[s] = own_key(own[s]);
        }
        uvec2 pixel = (position << BIN_SIZE_LOG2) + tile_pixel(quad * 4u + QUAD_LANE);
        uint shaded = 0u;
        for (;;) {
            uint next = NONE;
            for (uint s = 0u; s < SAMPLES; s++) next = own[s] > shaded ? min(next, own[s]) : next;
            next = min(next, subgroupQuadSwapHorizontal(next));
            next = min(next, subgroupQuadSwapVertical(next));
            // All lanes stay together, and none holds an undefined table slot: a quad that is done takes the triangle of
            // another one, for nothing.
            uint least = subgroupMin(next);
            if (least == NONE) break;
            uint mask = 0u;
            for (uint s = 0u; s < SAMPLES; s++) mask |= next != NONE && own[s] == next ? 1u << s : 0u;
            shade_samples(next == NONE ? least : next, ivec2(pixel) + ivec2(0, int(batch.origin_y)), pixel.y * batch.width + pixel.x, mask);
            shaded = next == NONE ? shaded : next;
        }
    }
}

void main() {
    uvec2 entry = shade_bins[batch.fragment_kernel * batch.bins + gl_WorkGroupID.x];
    uvec2 position = bin_position(entry.x);
    uint covering = entry.y, first_quad = (position.y * batch.bins_x + position.x) * BIN_QUADS;
    if (SAMPLES > 1u) {
        shade_all_samples(position, first_quad, covering);
        return;
    }
    uint lane = gl_SubgroupInvocationID;
    [[dont_unroll]] for (uint first = 0u; first < BIN_QUADS; first += SUBGROUP_WIDTH) {
        uvec4 keys = uvec4(covering);
        uint shown = 1u, through = lane + 1u, count = min(SUBGROUP_WIDTH, BIN_QUADS - first);
        if (covering == 0u) {
            if (first + lane < BIN_QUADS) keys = visibility[first_quad + first + lane];
            if (batch.fragment_kernels > 1u) {
                keys = uvec4(own_key(keys.x), own_key(keys.y), own_key(keys.z), own_key(keys.w));
            }
            shown = first_shown(keys);
            through = subgroupInclusiveAdd(bitCount(shown));
            count = subgroupShuffle(through, SUBGROUP_WIDTH - 1u);
        }
        [[dont_unroll]] for (uint next = 0u; next < count; next += SUBGROUP_WIDTH / 4u) {
            // If fewer pairs than quads of lanes are left, the spare lanes repeat the last pair. So all lanes
            // stay together, and none holds an undefined table slot.
            uint n = min(next + (lane >> 2), count - 1u), from = n, key = covering;
            bool mine = next + (lane >> 2) < count;
            if (covering == 0u) {
                // Finds the lane that counted the `n`th pair, and the pixel that stands for it in that lane's quad.
                from = 0u;
                [[unroll]] for (uint step = SUBGROUP_WIDTH / 2u; step > 0u; step >>= 1) {
                    if (subgroupShuffle(through, from + step - 1u) <= n) from += step;
                }
                uint bits = subgroupShuffle(shown, from);
                uint skip = n + bitCount(bits) - subgroupShuffle(through, from);
                if (skip > 0u) bits &= bits - 1u;
                if (skip > 1u) bits &= bits - 1u;
                if (skip > 2u) bits &= bits - 1u;
                uvec4 quad_keys = subgroupShuffle(keys, from);
                key = quad_keys[findLSB(bits)];
                mine = mine && quad_keys[QUAD_LANE] == key;
            }

            uvec2 pixel = (position << BIN_SIZE_LOG2) + tile_pixel((first + from) * 4u + QUAD_LANE);
            shade_samples(key, ivec2(pixel) + ivec2(0, int(batch.origin_y)), pixel.y * batch.width + pixel.x, mine ? 1u : 0u);
        }
    }
}
