// Narrow texels: between the rows of a target, where every texel has a word for itself, and memory as images are copied
// to and from, where texels of one or two bytes lie side by side. Depths are floats in the rows and may be numbers in memory.
//
// Reads: rows, or what was copied from an image. Writes: the other one.
// Contract: bits of a word that no texel has may be anything.
// Kernel / Twin: src/compute/narrow.rs; no twin, it moves bytes.
#version 460
#include "abi.glsl"
#include "lib/depth_format.glsl"

layout(local_size_x = GROUP) in;
layout(push_constant, scalar) uniform NarrowBlock { Narrow narrow; };
layout(scalar, binding = 0) buffer Rows { uint rows[]; };
layout(scalar, binding = 1) buffer Texels { uint texels[]; };

uint to_row(const uint texel) {
    if (narrow.depth_bits == 0u) return texel;
    uint number = texel & ((1u << narrow.depth_bits) - 1u);
    return floatBitsToUint(number_depth(number, narrow.depth_bits));
}

uint from_row(const uint row) {
    return narrow.depth_bits == 0u ? row : depth_number(uintBitsToFloat(row), narrow.depth_bits);
}

void main() {
    uint bits = 8u * narrow.texel_bytes, of_word = 4u / narrow.texel_bytes, mask = 0xffffffffu >> (32u - bits);
    uint first = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP * CLEAR_ROUNDS;
    uint end = min(first + GROUP * CLEAR_ROUNDS, (narrow.pixels + of_word - 1u) / of_word);
    for (uint i = first + gl_LocalInvocationIndex; i < end; i += GROUP) {
        uint at = narrow.first + i * of_word, count = min(of_word, narrow.pixels - i * of_word);
        if (narrow.to_rows != 0u) {
            uint word = texels[i];
            for (uint n = 0u; n < count; n++) rows[at + n] = to_row((word >> (n * bits)) & mask);
        } else {
            uint word = 0u;
            for (uint n = 0u; n < count; n++) word |= (from_row(rows[at + n]) & mask) << (n * bits);
            texels[i] = word;
        }
    }
}
