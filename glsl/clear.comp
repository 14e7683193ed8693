// Clear: gives every pixel of the band's working buffers the targets' clear values.
//
// Reads: nothing. Writes: colour and depth, bin by bin, partial bins included.
// Contract: a cleared pixel holds what a shader that outputs the clear colour would leave there.
// Kernel / Twin: src/compute/clear.rs; no twin, it stores two constants.
#version 460
#include "abi.glsl"
#include "lib/color.glsl"

layout(constant_id = SPEC_FORMAT) const uint FORMAT = 0u;
layout(local_size_x = GROUP) in;
layout(push_constant, scalar) uniform ClearBlock { Clear clear; };
layout(scalar, binding = 0) writeonly buffer Color { uint color[]; };
layout(scalar, binding = 1) writeonly buffer Depth { float depth[]; };

void main() {
    uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP + gl_LocalInvocationIndex;
    if (i >= clear.pixels) return;
    uvec2 words = color_encode(FORMAT, clear.color);
    depth[i] = clear.depth;
    if (FORMAT == FORMAT_RGBA16_FLOAT) {
        color[2u * i] = words.x;
        color[2u * i + 1u] = words.y;
    } else {
        color[i] = words.x;
    }
}
