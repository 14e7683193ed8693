// Narrow texels: between the rows of a target, where every texel has a word for itself, and memory as images are copied
// to and from, where texels of one or two bytes lie side by side.
//
// Reads: colour, or what was copied from an image. Writes: the other one.
// Contract: bits of a word that no texel has may be anything.
// Kernel / Twin: src/compute/narrow.rs; no twin, it moves bytes.
#version 460
#include "abi.glsl"

layout(local_size_x = GROUP) in;
layout(push_constant, scalar) uniform NarrowBlock { Narrow narrow; };
layout(scalar, binding = 0) buffer Color { uint color[]; };
layout(scalar, binding = 1) buffer Texels { uint texels[]; };

void main() {
    uint bits = 8u * narrow.texel_bytes, of_word = 4u / narrow.texel_bytes, mask = (1u << bits) - 1u;
    uint first = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP * CLEAR_ROUNDS;
    uint end = min(first + GROUP * CLEAR_ROUNDS, (narrow.pixels + of_word - 1u) / of_word);
    for (uint i = first + gl_LocalInvocationIndex; i < end; i += GROUP) {
        // A plane has room for whole words of texels (PLANE_PIXELS).
        uint at = narrow.first + i * of_word;
        if (narrow.to_rows != 0u) {
            uint word = texels[i];
            for (uint n = 0u; n < of_word; n++) color[at + n] = (word >> (n * bits)) & mask;
        } else {
            uint word = 0u;
            for (uint n = 0u; n < of_word; n++) word |= (color[at + n] & mask) << (n * bits);
            texels[i] = word;
        }
    }
}
