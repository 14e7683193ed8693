// What the shading kernels keep bound: a draw, and the triangle that a quad shades.
//
// The lanes of a quad fetch together what they need alike (`lib/quad.glsl`), and nothing is fetched
// again for the next quad if it is the same.
#ifndef BOUND_GLSL
#define BOUND_GLSL
#extension GL_EXT_nonuniform_qualifier : require
#include "abi.glsl"
#include "lib/interpolate.glsl"
#include "lib/key.glsl"
#include "lib/quad.glsl"

layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 0) readonly buffer Pieces { QuadPiece pieces[]; };
layout(scalar, binding = 1) readonly buffer Triangles { QuadTriangle triangles[]; };
layout(scalar, binding = 2) readonly buffer Positions { vec4 positions[]; };
layout(scalar, binding = 3) readonly buffer Varyings { uint varyings[]; };
layout(scalar, binding = 4) readonly buffer ResourceSlots { uint resource_slots[]; };

layout(scalar, set = SET_TABLE, binding = TABLE_BUFFERS) readonly buffer Words { uint words[]; } table[];

// What was bound last: a piece, its part of the fields of `Piece`, and the shader's resources.
uint bound_piece = NONE;
uint bound_resources = NONE;
vec2 viewport_scale, viewport_offset; // of pixels
uint first_in_draw, primitives_per_instance;
uint piece_varyings, piece_vertices, varying_stride;

// The triangle that a quad shades, and what is kept of it.
struct Bound {
    uint key;
    vec3 plane; // depth at the pixel (0, 0), its change to the right and down
    uint flags;
    vec3 x, y, w; // clip-space positions of its vertices, the nearest first, times `scale`
    float scale;
};

Bound bound = Bound(0u, vec3(0.0), 0u, vec3(0.0), vec3(0.0), vec3(0.0), 1.0);

// Word `lane & 3` of each location the shader reads. Compilers leave out what nobody reads, mostly one of the two.
uvec3 parts[MAX_VARYINGS];    // as `differences` of `lib/interpolate.glsl`
uint provoking[MAX_VARYINGS]; // for flat varyings
uvec3 varying_base;           // first word of each vertex's varyings
uint provoking_base;

// Replaced by the splicer.
void tw_user_bind();
void tw_user_bind_inputs();

// Makes the piece and its resources those of the calls that follow. Most calls find them bound: what
// many fragments share is fetched once.
void bind(const uint piece) {
    if (piece == bound_piece) return;
    bound_piece = piece;
    vec4 viewport = uintBitsToFloat(of_quad(pieces[piece].viewport[QUAD_LANE]));
    viewport_scale = viewport.xy;
    viewport_offset = viewport.zw;
    uvec4 numbers = of_quad(pieces[piece].numbers[QUAD_LANE]);
    first_in_draw = numbers.x - numbers.z;
    primitives_per_instance = numbers.y;
    uvec4 vertices = of_quad(pieces[piece].vertices[QUAD_LANE]);
    piece_varyings = vertices.x;
    varying_stride = vertices.y;
    piece_vertices = vertices.z;
    if (numbers.w == bound_resources) return;
    bound_resources = numbers.w;
    tw_user_bind();
}

// The triangle of `key`, which is that of the hooks from here on; all four lanes of a quad call it
// together. Quads of large triangles follow each other and find it bound. (Two of them kept, for where
// triangles meet, were no faster, and none kept a fifth slower on large ones.)
Bound bind_triangle(const uint key) {
    if (key == bound.key) return bound;
    uint at = key_triangle(key, batch.extra_first), part = QUAD_LANE;
    uvec4 fields = of_quad(triangles[at].depth_piece[part]);
    uvec4 vertices = of_quad(triangles[at].vertices_flags[part]);
    vec3 corners = vec3(positions[vertices.x][part], positions[vertices.y][part], positions[vertices.z][part]);
    // Lanes hold x, y, z and w of the corners; z weighs nothing.
    float largest = part == 2u ? 0.0 : max(abs(corners.x), max(abs(corners.y), abs(corners.z)));
    largest = max(largest, subgroupQuadSwapHorizontal(largest));
    float scale = scale_for(max(largest, subgroupQuadSwapVertical(largest)));
    uint first = nearest(subgroupQuadBroadcast(corners, 3u));
    corners = corners_from(first, corners) * scale;
    bound = Bound(key, uintBitsToFloat(fields.xyz), vertices.w, subgroupQuadBroadcast(corners, 0u),
                  subgroupQuadBroadcast(corners, 1u), subgroupQuadBroadcast(corners, 3u), scale);
    bind(fields.w);
    uvec3 base = piece_varyings + (vertices.xyz - piece_vertices) * varying_stride;
    varying_base = corners_from(first, base);
    provoking_base = base.x;
    tw_user_bind_inputs();
    return bound;
}
#endif
