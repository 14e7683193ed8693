// What the shading kernels keep bound: a draw, and the triangles that a quad shades.
//
// Loads are dear on CPUs, and shuffles are not. What a quad needs is the same for its four lanes: each
// of them loads a part and the others get it from there; and nothing is loaded again for the next quad
// if it is the same. What includes this defines WIDTH, the subgroup's.
#ifndef BOUND_GLSL
#define BOUND_GLSL
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_quad : require
#extension GL_EXT_nonuniform_qualifier : require
#include "abi.glsl"
#include "lib/key.glsl"

layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 0) readonly buffer Pieces { Piece pieces[]; };
// A `Triangle` of abi.glsl, whose second half the lanes of a quad fetch together.
struct QuadTriangle {
    ivec3 x;
    ivec3 y;
    uint bounds_min;
    uint bounds_max;
    uvec4 z_dzdx_dzdy_piece;
    uvec4 vertices_flags;
};
layout(scalar, binding = 1) readonly buffer Triangles { QuadTriangle triangles[]; };
layout(scalar, binding = 2) readonly buffer Positions { vec4 positions[]; };
layout(scalar, binding = 3) readonly buffer Varyings { uint varyings[]; };
layout(scalar, binding = 4) readonly buffer ResourceSlots { uint resource_slots[]; };

layout(scalar, set = SET_TABLE, binding = TABLE_BUFFERS) readonly buffer Words { uint words[]; } table[];

// What was bound last: a piece, its part of the fields of `Piece`, and the shader's resources.
uint bound_piece = NONE;
uint bound_resources = NONE;
vec2 window_scale, window_offset;
uint first_in_draw, primitives_per_instance;
uint piece_varyings, piece_vertices, varying_stride;

// What is kept of a triangle for the quad that shades it.
struct Bound {
    uint key;
    uint piece;
    vec3 plane; // depth at the pixel (0, 0), its change to the right and down
    uint flags;
    vec3 x, y, w; // clip-space positions of its vertices
};

// Quads of large triangles follow each other, and where two triangles meet, they alternate: narrow
// subgroups, which have few quads, keep two triangles. Wide ones need their registers for lanes.
const bool TWO = WIDTH <= 16u;
Bound bound_a = Bound(0u, NONE, vec3(0.0), 0u, vec3(0.0), vec3(0.0), vec3(0.0));
Bound bound_b = bound_a;
bool second = false; // whether the last one used is `b`

// Word `lane & 3` of each location the shader reads, for each vertex.
uvec3 parts_a[MAX_VARYINGS], parts_b[MAX_VARYINGS];
uvec3 varying_base; // first word of each vertex's varyings

// Replaced by the splicer.
void tw_user_bind();
void tw_user_bind_inputs();

// The words that the four lanes of the quad hold.
uvec4 of_quad(const uint own) {
    return uvec4(subgroupQuadBroadcast(own, 0u), subgroupQuadBroadcast(own, 1u),
                 subgroupQuadBroadcast(own, 2u), subgroupQuadBroadcast(own, 3u));
}

// Makes the piece and its resources those of the calls that follow. Most calls find them bound: what
// many fragments share is fetched once.
void bind(const uint piece) {
    if (piece == bound_piece) return;
    bound_piece = piece;
    window_scale = pieces[piece].scale.xy;
    window_offset = pieces[piece].offset.xy;
    first_in_draw = pieces[piece].first_in_draw - pieces[piece].first_primitive;
    primitives_per_instance = pieces[piece].primitives_per_instance;
    piece_varyings = pieces[piece].varying_base;
    piece_vertices = pieces[piece].vertex_base;
    varying_stride = pieces[piece].varying_stride;
    uint resources = pieces[piece].fragment_resources;
    if (resources == bound_resources) return;
    bound_resources = resources;
    tw_user_bind();
}

Bound last_bound() {
    if (TWO && second) return bound_b;
    return bound_a;
}

// Fetches the triangle of `key` and returns its vertex slots; all four lanes of a quad call it together.
uvec3 fetch_triangle(const uint key) {
    uint at = key_triangle(key, batch.extra_first), part = gl_SubgroupInvocationID & 3u;
    uvec4 fields = of_quad(triangles[at].z_dzdx_dzdy_piece[part]);
    uvec4 vertices = of_quad(triangles[at].vertices_flags[part]);
    vec3 parts = vec3(positions[vertices.x][part], positions[vertices.y][part], positions[vertices.z][part]);
    Bound bound = Bound(key, fields.w, uintBitsToFloat(fields.xyz), vertices.w,
                        subgroupQuadBroadcast(parts, 0u), subgroupQuadBroadcast(parts, 1u), subgroupQuadBroadcast(parts, 3u));
    if (second) bound_b = bound;
    else bound_a = bound;
    return vertices.xyz;
}

// The triangle of `key`, which is that of the hooks from here on.
Bound bind_triangle(const uint key) {
    if (key != last_bound().key) {
        second = TWO && !second;
        bool known = key == last_bound().key;
        uvec3 vertices = uvec3(0u);
        if (!known) vertices = fetch_triangle(key);
        bind(last_bound().piece);
        if (!known) {
            varying_base = piece_varyings + (vertices - piece_vertices) * varying_stride;
            tw_user_bind_inputs();
        }
    }
    return last_bound();
}
#endif
