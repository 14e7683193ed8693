// Access to the index buffers of the batch's pieces, which are in the resource table.
#ifndef PIECES_GLSL
#define PIECES_GLSL
#extension GL_EXT_nonuniform_qualifier : require
#include "abi.glsl"
#include "lib/assembly.glsl"

layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, set = SET_TABLE, binding = TABLE_BUFFERS) readonly buffer Words { uint words[]; } table[];

// Division for a quotient that is nearly always 0, since most draws have one instance. CPUs divide lane by
// lane, in a hundred instructions. The second branch is there for lavapipe, which jumps over a branch only if
// it contains another one.
uint divide(const uint a, const uint b) {
    uint quotient = 0u;
    [[dont_flatten]] if (a >= b) {
        [[dont_flatten]] if (b != 0u) quotient = a / b;
    }
    return quotient;
}

// The vertex number of the draw's element `element`, before the base vertex is added.
uint fetch_index(const Piece piece, const uint element) {
    uint e = piece.first_element + element;
    if (piece.index_slot == NONE) return e;
    uint byte = e * piece.index_bytes, slot = piece.index_slot + (byte >> WINDOW_LOG2);
    uint word = table[nonuniformEXT(slot)].words[(byte & ((1u << WINDOW_LOG2) - 1u)) >> 2];
    if (piece.index_bytes == 4u) return word;
    return (e & 1u) != 0u ? word >> 16 : word & 0xffffu;
}
#endif
