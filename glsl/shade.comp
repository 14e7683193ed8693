// Shading of opaque work: the user's fragment shader, once for each visible (quad, triangle).
//
// Reads: the bins where this fragment kernel has pixels, visibility, triangles, positions, varyings
// and whatever the shader binds.
// Writes: colour of the pixels whose visible triangle belongs to this fragment kernel.
// Contract: hidden fragments are never shaded; a quad that shows several triangles runs the shader
// for each of them with its other pixels as helpers, as hardware does, so derivatives are the same.
// Kernel / Twin: src/compute/shade.rs; no twin, the shader is the user's.
//
// One subgroup is one workgroup is one bin. It first lists what there is to shade, a quad and one of the
// triangles that the quad shows, and then takes as many of these at a time as it has quads, so that
// quads with one triangle do not wait for quads with four. A bin that shows one triangle in all of its
// pixels needs no list.
#version 460
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require

layout(constant_id = SPEC_WIDTH) const uint WIDTH = 8u;

#include "fragment.glsl"

layout(constant_id = SPEC_FORMAT) const uint FORMAT = 0u;
layout(local_size_x_id = SPEC_WIDTH) in;
layout(scalar, binding = 5) readonly buffer ShadeBins { uint shade_bins[]; };
layout(scalar, binding = 6) readonly buffer Visibility { uvec4 visibility[]; };
layout(scalar, binding = 7) writeonly buffer Color { uint color[]; };

// For each visible (quad, triangle) the first pixel of the quad that shows it, as numbered in the bin.
shared uint s_work[BIN_PIXELS];

// A key that a pixel shows, 0 if its triangle is another fragment kernel's.
uint own_key(const uint key) {
    if (key == 0u) return key;
    uint piece = triangles[key_triangle(key, batch.extra_first)].z_dzdx_dzdy_piece.w;
    return pieces[piece].fragment_kernel == batch.fragment_kernel ? key : 0u;
}

uint list_work(const uint first_quad) {
    uint count = 0u;
    [[dont_unroll]] for (uint first = 0u; first < BIN_QUADS; first += WIDTH) {
        uint quad = first + gl_SubgroupInvocationID;
        uvec4 keys = uvec4(0u);
        if (quad < BIN_QUADS) keys = visibility[first_quad + quad];
        if (batch.fragment_kernels > 1u) {
            keys = uvec4(own_key(keys.x), own_key(keys.y), own_key(keys.z), own_key(keys.w));
        }
        bool shows[4] = bool[](
            keys.x != 0u,
            keys.y != 0u && keys.y != keys.x,
            keys.z != 0u && keys.z != keys.x && keys.z != keys.y,
            keys.w != 0u && keys.w != keys.x && keys.w != keys.y && keys.w != keys.z);
        uint mine = uint(shows[0]) + uint(shows[1]) + uint(shows[2]) + uint(shows[3]);
        uint at = count + subgroupExclusiveAdd(mine);
        [[unroll]] for (uint i = 0u; i < 4u; i++) {
            if (shows[i]) {
                s_work[at] = quad * 4u + i;
                at++;
            }
        }
        count += subgroupAdd(mine);
    }
    subgroupMemoryBarrierShared();
    subgroupBarrier();
    return count;
}

void main() {
    uint entry = shade_bins[batch.fragment_kernel * batch.bins + gl_WorkGroupID.x];
    bool whole = (entry & BIN_WHOLE) != 0u;
    uvec2 position = bin_position(entry), bin_origin = position << BIN_SIZE_LOG2;
    uint first_quad = (position.y * batch.bins_x + position.x) * BIN_QUADS;
    uint key = visibility[first_quad].x, count = BIN_QUADS;
    if (!whole) count = list_work(first_quad);
    uint lane = gl_SubgroupInvocationID;
    [[dont_unroll]] for (uint first = 0u; first < count; first += WIDTH / 4u) {
        // Quads for which there is nothing left help with the last: all lanes stay together, and none
        // holds an undefined table slot.
        uint n = first + (lane >> 2);
        uint i = min(n, count - 1u) * 4u;
        bool mine = n < count;
        if (!whole) {
            i = s_work[i / 4u];
            uint own = visibility[first_quad + (i >> 2)][lane & 3u];
            key = subgroupShuffle(own, (lane & ~3u) | (i & 3u));
            mine = mine && own == key;
        }
        uvec2 pixel = bin_origin + tile_pixel((i & ~3u) | (lane & 3u));
        shade(key, ivec2(pixel) + ivec2(0, int(batch.origin_y)), !mine);
        // No `continue`: the lanes of the quad must be together again for the next one.
        if (mine) {
            uvec2 words = color_encode(FORMAT, uintBitsToFloat(color_bits));
            uint at = pixel.y * batch.width + pixel.x;
            if (FORMAT == FORMAT_RGBA16_FLOAT) {
                color[2u * at] = words.x;
                color[2u * at + 1u] = words.y;
            } else {
                color[at] = words.x;
            }
        }
    }
}
