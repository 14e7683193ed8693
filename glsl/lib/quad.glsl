// Words that the four lanes of a quad need alike: each lane loads one, and the others get it from
// there. Loads are dear on CPUs, and shuffles are not.
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

bool any_of_quad(const bool own) {
    uint row = (own ? 1u : 0u) | subgroupQuadSwapHorizontal(own ? 1u : 0u);
    return (row | subgroupQuadSwapVertical(row)) != 0u;
}

// A `Piece` of abi.glsl as a quad fetches it.
struct QuadPiece {
    uvec4 numbers;  // first_in_draw, primitives_per_instance, first_primitive, fragment_resources
    uvec4 vertices; // varying_base, varying_stride, vertex_base, vertex_slots
    uvec4 window;   // scale, offset.x
    vec2 offset_yz;
    uint fragment_kernel, cull;
    uvec4 elements; // topology, first_element, index_slot, index_bytes
    uvec4 indices;  // base_vertex, first_instance, vertex_mode, vertex_min
    uvec4 stage;    // vertices_per_instance, instance_min, attribute_base, vertex_resources
    uint draw_id, front_face, cut, depth_test;
    ivec2 rect_min, rect_max;
    uint depth_write, depth_compare, blend, blend_color, blend_alpha;
};

// A `Triangle` of abi.glsl as a quad fetches it.
struct QuadTriangle {
    ivec3 x, y;
    uint bounds_min, bounds_max;
    uvec4 z_dzdx_dzdy_piece;
    uvec4 vertices_flags;
};
#endif
