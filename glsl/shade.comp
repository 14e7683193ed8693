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
// quads with one triangle do not wait for quads with four.
#version 460
#extension GL_KHR_shader_subgroup_ballot : require
#include "fragment.glsl"

layout(constant_id = SPEC_WIDTH) const uint WIDTH = 8u;
layout(constant_id = SPEC_FORMAT) const uint FORMAT = 0u;
layout(local_size_x_id = SPEC_WIDTH) in;
layout(scalar, binding = 5) readonly buffer ShadeBins { uint shade_bins[]; };
layout(scalar, binding = 6) readonly buffer Visibility { uint visibility[]; };
layout(scalar, binding = 7) writeonly buffer Color { uint color[]; };

// For each visible (quad, triangle) the first pixel of the quad that shows it, as numbered in the bin.
shared uint s_work[BIN_PIXELS];

// The key that a pixel of the bin shows, 0 if its triangle is another fragment kernel's.
uint key_at(const uint at) {
    uint key = visibility[at];
    if (key != 0u && batch.fragment_kernels > 1u) {
        uint piece = triangles[key_triangle(key, batch.extra_first)].piece;
        key = pieces[piece].fragment_kernel == batch.fragment_kernel ? key : 0u;
    }
    return key;
}

uint list_work(const uint first_pixel) {
    uint lane = gl_SubgroupInvocationID, in_quad = lane & 3u, count = 0u;
    [[dont_unroll]] for (uint first = 0u; first < BIN_PIXELS; first += WIDTH) {
        uint key = key_at(first_pixel + first + lane);
        uint a = subgroupQuadBroadcast(key, 0u), b = subgroupQuadBroadcast(key, 1u), c = subgroupQuadBroadcast(key, 2u);
        bool again = (in_quad > 0u && a == key) || (in_quad > 1u && b == key) || (in_quad > 2u && c == key);
        bool work = key != 0u && !again;
        uvec4 mask = subgroupBallot(work);
        if (work) s_work[count + subgroupBallotExclusiveBitCount(mask)] = first + lane;
        count += subgroupBallotBitCount(mask);
    }
    subgroupMemoryBarrierShared();
    subgroupBarrier();
    return count;
}

void main() {
    uint bin = shade_bins[batch.fragment_kernel * batch.bins + gl_WorkGroupID.x];
    uvec2 bin_origin = uvec2(bin % batch.bins_x, bin / batch.bins_x) << BIN_SIZE_LOG2;
    uint first_pixel = bin * BIN_PIXELS;
    uint count = list_work(first_pixel);
    uint lane = gl_SubgroupInvocationID;
    [[dont_unroll]] for (uint first = 0u; first < count; first += WIDTH / 4u) {
        // Quads for which there is nothing left help with the last: all lanes stay together, and none
        // holds an undefined table slot.
        uint n = first + (lane >> 2);
        uint i = s_work[min(n, count - 1u)];
        uint key = visibility[first_pixel + i];
        i = (i & ~3u) | (lane & 3u);
        bool mine = n < count && visibility[first_pixel + i] == key;
        uvec2 pixel = bin_origin + tile_pixel(i);
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
