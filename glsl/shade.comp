// Shading of opaque work: the user's fragment shader, once for each visible (quad, triangle).
//
// Reads: the bins where this fragment kernel has pixels, visibility, triangles, positions, varyings
// and whatever the shader binds.
// Writes: colour of the pixels whose visible triangle belongs to this fragment kernel.
// Contract: hidden fragments are never shaded; a quad that shows several triangles runs the shader
// for each of them with its other pixels as helpers, as hardware does, so derivatives are the same.
// Kernel / Twin: src/compute/shade.rs; no twin, the shader is the user's.
//
// One subgroup is one workgroup is one bin.
#version 460
#extension GL_KHR_shader_subgroup_ballot : require
#include "fragment.glsl"

layout(constant_id = SPEC_WIDTH) const uint WIDTH = 8u;
layout(constant_id = SPEC_FORMAT) const uint FORMAT = 0u;
layout(local_size_x_id = SPEC_WIDTH) in;
layout(scalar, binding = 5) readonly buffer ShadeBins { uint shade_bins[]; };
layout(scalar, binding = 6) readonly buffer Visibility { uint visibility[]; };
layout(scalar, binding = 7) writeonly buffer Color { uint color[]; };

void main() {
    uint bin = shade_bins[batch.fragment_kernel * batch.bins + gl_WorkGroupID.x];
    uvec2 bin_origin = uvec2(bin % batch.bins_x, bin / batch.bins_x) << BIN_SIZE_LOG2;
    [[dont_unroll]] for (uint first = 0u; first < BIN_PIXELS; first += WIDTH) {
        uint i = first + gl_SubgroupInvocationID;
        uvec2 pixel = bin_origin + tile_pixel(i);
        uint key = visibility[bin * BIN_PIXELS + i];
        if (key != 0u && batch.fragment_kernels > 1u) {
            uint piece = triangles[key_triangle(key, batch.extra_first)].piece;
            key = pieces[piece].fragment_kernel == batch.fragment_kernel ? key : 0u;
        }
        // `key` is what this lane still waits for; the quad takes the largest of its four.
        for (;;) {
            uint chosen = max(key, subgroupQuadSwapHorizontal(key));
            chosen = max(chosen, subgroupQuadSwapVertical(chosen));
            if (chosen == 0u) break;
            bool mine = key == chosen;
            shade(chosen, ivec2(pixel) + ivec2(0, int(batch.origin_y)), !mine);
            if (mine) {
                uvec2 words = color_encode(FORMAT, uintBitsToFloat(color_bits));
                uint at = pixel.y * batch.width + pixel.x;
                if (FORMAT == FORMAT_RGBA16_FLOAT) {
                    color[2u * at] = words.x;
                    color[2u * at + 1u] = words.y;
                } else {
                    color[at] = words.x;
                }
                key = 0u;
            }
        }
    }
}
