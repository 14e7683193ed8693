// Clear: writes the clear colour to every pixel of a target whose texels are no repetition of one word. All other
// targets are filled without a kernel.
//
// Reads: nothing. Writes: colour.
// Contract: a cleared pixel holds the same words as after a shader that outputs the clear colour.
// Kernel / Twin: src/compute/clear.rs; no twin, it stores a constant.
#version 460
#include "abi.glsl"

layout(local_size_x = GROUP) in;
layout(push_constant, scalar) uniform ClearBlock { Clear clear; };
layout(scalar, binding = 0) writeonly buffer Color { uvec4 color[]; };

void main() {
    uint first = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP * CLEAR_ROUNDS;
    uint end = min(first + GROUP * CLEAR_ROUNDS, clear.count);
    for (uint i = first + gl_LocalInvocationIndex; i < end; i += GROUP) color[clear.first + i] = clear.texels;
}
