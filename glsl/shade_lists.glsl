// The results that raster leaves for shading: the samples in `depth` and `visibility`, and for each fragment
// kernel of the batch a list of the bins in which it has pixels. The file that includes this one declares
// `triangles` and `pieces`.
#ifndef SHADE_LISTS_GLSL
#define SHADE_LISTS_GLSL
#include "bin.glsl"
#include "lib/key.glsl"

// The arguments of each fragment kernel's dispatch: one workgroup for each bin.
layout(scalar, binding = 7) buffer ShadeArgs { uvec3 shade_args[]; };
// `batch.bins` entries for each fragment kernel: a bin, and the key of the triangle that covers all of it, or 0.
layout(scalar, binding = 8) writeonly buffer ShadeBins { uvec2 shade_bins[]; };

// The fragment kernel that shades the triangle of `key`, as its number in the batch.
uint fragment_kernel_of(const uint key) {
    if (batch.fragment_kernels == 1u) return 0u;
    return pieces[triangles[key_triangle(key, batch.primitives)].shading[1].y].fragment_kernel;
}

// Copies the depth and the keys of the bin's samples to `depth` and `visibility`. Returns a bit in `shown` for
// each fragment kernel that has pixels in the bin, and the bounds of the bin's depth.
void finish(const Bin bin, out uint shown, out vec2 bounds) {
    shown = 0u;
    bounds = vec2(2.0, -1.0);
    [[dont_unroll]] for (uint i = gl_SubgroupInvocationID; i < BIN_PIXELS; i += SUBGROUP_WIDTH) {
        ivec2 p = ivec2(tile_pixel(i));
        for (uint s = 0u; s < SAMPLES; s++) {
            uint key = 0u;
            if (in_target(bin, p)) {
                key = held_key(bin, i, s);
                float z = held_depth(bin, i, p, s);
                if (key != 0u && !IN_PLACE) depth[depth_place(bin, p, s)] = z;
                bounds = vec2(min(bounds.x, z), max(bounds.y, z));
            }
            if (!IN_PLACE || !in_target(bin, BIN_LAST)) visibility[key_place(bin, i, s)][i & 3u] = key;
            if (key != 0u) shown |= 1u << fragment_kernel_of(key);
        }
    }
    bounds = vec2(lanes_min(bounds.x), lanes_max(bounds.y));
    shown = subgroupOr(shown);
}

// Adds the entry `listed` to the list of each fragment kernel that has a bit in `kernels`; all lanes have the same arguments.
void list_for_shading(uint kernels, const uvec2 listed) {
    while (kernels != 0u) {
        uint kernel = uint(findLSB(kernels));
        kernels &= kernels - 1u;
        if (gl_SubgroupInvocationID == 0u) shade_bins[kernel * batch.bins + atomicAdd(shade_args[kernel].x, 1u)] = listed;
    }
}
#endif
