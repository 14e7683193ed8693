// Distances of vertices from planes of the user: those that clip primitives and those that cull them.
//
// Each vertex has room for MAX_DISTANCES after its varyings. Clip distances are there from the first place on, cull distances
// from the last place back. Signs and sizes are taken from bits, so that all devices agree on them.
// The file that includes this one declares the buffer `positions` and, WITH_DISTANCES, the buffer `varyings`.
#ifndef DISTANCES_GLSL
#define DISTANCES_GLSL
#include "lib/window.glsl"

// What the distances of its vertices say of a primitive.
struct Verdict {
    bool hidden;   // nothing of it is drawn
    uvec3 outside; // for each vertex the planes that it is outside of, as outcodes have them
};

#ifdef WITH_DISTANCES
const uint FLOAT_SIGN = 0x80000000u;
const uint FLOAT_NORMAL = 0x00800000u;   // the least number that no device takes for 0
const uint FLOAT_FAR_OUT = 0x7e800000u;  // 2^126; infinity and what is no number come after it
const uint FLOAT_INFINITY = 0x7f800000u;

// The bits of the distances of the vertex in `slot`.
uvec4[2] distances_of(const Piece piece, const uint slot) {
    uint end = piece.varying_base + (slot - piece.vertex_base + 1u) * piece.varying_stride;
    return uvec4[2](varyings[end / 4u - 2u], varyings[end / 4u - 1u]);
}

// A bit for each distance that is negative or no number.
uint negative(const uvec4 distances[2]) {
    uint bits = 0u;
    for (uint i = 0u; i < MAX_DISTANCES; i++) {
        uint value = distances[i / 4u][i % 4u], size = value & ~FLOAT_SIGN;
        bits |= (value > FLOAT_SIGN && size >= FLOAT_NORMAL) || size > FLOAT_INFINITY ? 1u << i : 0u;
    }
    return bits;
}

// A bit for each distance that is too large to clip by.
uint unusable(const uvec4 distances[2]) {
    uint bits = 0u;
    for (uint i = 0u; i < MAX_DISTANCES; i++) {
        bits |= (distances[i / 4u][i % 4u] & ~FLOAT_SIGN) >= FLOAT_FAR_OUT ? 1u << i : 0u;
    }
    return bits;
}

Verdict judge(const Piece piece, const uvec3 slots) {
    uvec4 a[2] = distances_of(piece, slots.x), b[2] = distances_of(piece, slots.y), c[2] = distances_of(piece, slots.z);
    uint clips = piece.distances & ((1u << CULL_DISTANCES_SHIFT) - 1u), culls = piece.distances >> CULL_DISTANCES_SHIFT;
    uint clip_bits = (1u << clips) - 1u, cull_bits = ((1u << culls) - 1u) << (MAX_DISTANCES - culls);
    uvec3 outside = uvec3(negative(a), negative(b), negative(c));
    uint all = outside.x & outside.y & outside.z & (clip_bits | cull_bits);
    outside &= clip_bits;
    uint lost = (unusable(a) | unusable(b) | unusable(c)) & (outside.x | outside.y | outside.z);
    return Verdict(all != 0u || lost != 0u, outside << USER_PLANES);
}

Corner corner_at(const Piece piece, const uint slot) {
    uvec4 distances[2] = distances_of(piece, slot);
    return Corner(sanitized(positions[slot]), sanitized(uintBitsToFloat(distances[0])),
                  sanitized(uintBitsToFloat(distances[1])));
}
#else
Verdict judge(const Piece piece, const uvec3 slots) {
    return Verdict(false, uvec3(0u));
}

Corner corner_at(const Piece piece, const uint slot) {
    return sanitized(positions[slot]);
}
#endif
#endif
