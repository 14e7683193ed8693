// Clear: writes the clear colour to every pixel of a target of half floats. A target with one word per
// texel is filled without a kernel.
//
// Reads: nothing. Writes: colour.
// Contract: a cleared pixel holds the same words as after a shader that outputs the clear colour.
// Kernel / Twin: src/compute/clear.rs; no twin, it stores a constant.
#version 460
#include "abi.glsl"
#include "lib/color.glsl"

layout(local_size_x = GROUP) in;
layout(push_constant, scalar) uniform ClearBlock { Clear clear; };
layout(scalar, binding = 0) writeonly buffer Color { uvec2 color[]; };

void main() {
    uvec2 words = color_encode(FORMAT_RGBA16_FLOAT, clear.color);
    uint first = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP * CLEAR_PIXELS;
    uint end = min(first + GROUP * CLEAR_PIXELS, clear.pixels);
    for (uint i = first + gl_LocalInvocationIndex; i < end; i += GROUP) color[clear.first + i] = words;
}
