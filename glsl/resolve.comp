// Resolve: from the working order of pixels, bin by bin, to rows.
//
// Reads: colour and depth of the band, bin by bin.
// Writes: the same pixels row by row, without those of partial bins.
// Contract: pixel (x, y) of the band is at y * width + x.
// Kernel / Twin: src/compute/resolve.rs; no twin, it moves words.
#version 460
#include "abi.glsl"
#include "lib/tile.glsl"

layout(constant_id = SPEC_FORMAT) const uint FORMAT = 0u;
layout(local_size_x = GROUP) in;
layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 0) readonly buffer Color { uint color[]; };
layout(scalar, binding = 1) readonly buffer Depth { uint depth[]; };
layout(scalar, binding = 2) writeonly buffer ColorRows { uint color_rows[]; };
layout(scalar, binding = 3) writeonly buffer DepthRows { uint depth_rows[]; };

void main() {
    uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP + gl_LocalInvocationIndex;
    if (i >= batch.width * batch.height) return;
    uvec2 p = uvec2(i % batch.width, i / batch.width);
    uvec2 bin = p >> BIN_SIZE_LOG2;
    uint at = (bin.y * batch.bins_x + bin.x) * BIN_PIXELS + tile_index(p & ((1u << BIN_SIZE_LOG2) - 1u));
    depth_rows[i] = depth[at];
    if (FORMAT == FORMAT_RGBA16_FLOAT) {
        color_rows[2u * i] = color[2u * at];
        color_rows[2u * i + 1u] = color[2u * at + 1u];
    } else {
        color_rows[i] = color[at];
    }
}
