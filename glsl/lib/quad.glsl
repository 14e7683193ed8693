// Words that all four lanes of a quad need: each lane loads one or two of them, and the other lanes get them by
// shuffles. Loads are expensive on CPUs, and shuffles are not. If a lane loads two words, they are a `uvec2`
// at a multiple of 8 bytes, which CPUs load at once (`src/vk/address/pairs.rs`).
#ifndef QUAD_GLSL
#define QUAD_GLSL
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_quad : require

// This lane's number in its quad.
#define QUAD_LANE (gl_SubgroupInvocationID & 3u)

// The words that the lanes of the quad hold.
uvec4 of_quad(const uint own) {
    return uvec4(subgroupQuadBroadcast(own, 0u), subgroupQuadBroadcast(own, 1u),
                 subgroupQuadBroadcast(own, 2u), subgroupQuadBroadcast(own, 3u));
}

// The words that the first two lanes of the quad hold, and those that the last two do.
uvec4 of_first_half(const uvec2 own) {
    return uvec4(subgroupQuadBroadcast(own, 0u), subgroupQuadBroadcast(own, 1u));
}

uvec4 of_second_half(const uvec2 own) {
    return uvec4(subgroupQuadBroadcast(own, 2u), subgroupQuadBroadcast(own, 3u));
}

bool any_of_quad(const bool own) {
    uint row = (own ? 1u : 0u) | subgroupQuadSwapHorizontal(own ? 1u : 0u);
    return (row | subgroupQuadSwapVertical(row)) != 0u;
}
#endif
