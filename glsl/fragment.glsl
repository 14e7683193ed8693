// The user's fragment shader at one pixel of one triangle: what the shading kernels share.
//
// The shader is spliced into `tw_user_main`; the functions and globals called tw_* are what it sees.
// Varyings are interpolated in homogeneous coordinates (Olano and Greer 1997) from the clip-space
// vertices relative to the pixel, which needs no per-triangle setup and also serves triangles that
// were clipped: their parts interpolate as the whole does.
#ifndef FRAGMENT_GLSL
#define FRAGMENT_GLSL
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_quad : require
#include "abi.glsl"
#include "lib/color.glsl"
#include "lib/depth.glsl"
#include "lib/key.glsl"
#include "lib/tile.glsl"

layout(push_constant, scalar) uniform BatchBlock { Batch batch; };
layout(scalar, binding = 0) readonly buffer Pieces { Piece pieces[]; };
layout(scalar, binding = 1) readonly buffer Triangles { Triangle triangles[]; };
layout(scalar, binding = 2) readonly buffer Positions { vec4 positions[]; };
layout(scalar, binding = 3) readonly buffer Varyings { uint varyings[]; };
layout(scalar, binding = 4) readonly buffer ResourceSlots { uint resource_slots[]; };

vec4 tw_FragCoord;
bool tw_FrontFacing;
int tw_PrimitiveID;
float tw_FragDepth;
bool tw_HelperInvocation;

// What was bound last: a piece, its part of the fields of `Piece`, and the shader's resources.
uint bound_piece = NONE;
uint bound_resources = NONE;
vec2 window_scale, window_offset;
uint first_in_draw, primitives_per_instance;
uint piece_varyings, piece_vertices, varying_stride;

uvec3 varying_base; // first word of each vertex's varyings
vec3 perspective;   // barycentric weights for smooth varyings
vec3 linear;        // for noperspective ones
uvec4 color_bits;   // output location 0

uint tw_resource(const in uint i) {
    return resource_slots[bound_resources + i];
}

// Word `lane & 3` of a location of each vertex: the lanes of a quad shade the same triangle, so that
// each loads one component and the others get it from there. Loads are dear, shuffles are not.
uvec3 fetch_part(const uint location) {
    uvec3 at = varying_base + location * 4u + (gl_SubgroupInvocationID & 3u);
    return uvec3(varyings[at.x], varyings[at.y], varyings[at.z]);
}

vec4 interpolate(const vec3 weights, const uint location) {
    vec3 part = uintBitsToFloat(fetch_part(location));
    return vec4(dot(weights, subgroupQuadBroadcast(part, 0u)), dot(weights, subgroupQuadBroadcast(part, 1u)),
                dot(weights, subgroupQuadBroadcast(part, 2u)), dot(weights, subgroupQuadBroadcast(part, 3u)));
}

vec4 tw_input_smooth(const in uint location) {
    return interpolate(perspective, location);
}

vec4 tw_input_noperspective(const in uint location) {
    return interpolate(linear, location);
}

uvec4 tw_input_flat(const in uint location) {
    uint part = varyings[varying_base.x + location * 4u + (gl_SubgroupInvocationID & 3u)];
    return uvec4(subgroupQuadBroadcast(part, 0u), subgroupQuadBroadcast(part, 1u),
                 subgroupQuadBroadcast(part, 2u), subgroupQuadBroadcast(part, 3u));
}

void tw_output(const in uint location, const in uint component, const in uint count, const in uvec4 value) {
    for (uint c = 0u; c < count && location == 0u; c++) color_bits[component + c] = value[c];
}

#define DERIVATIVES(T) \
    T tw_ddx(const in T v) { \
        T other = subgroupQuadSwapHorizontal(v); \
        return (gl_SubgroupInvocationID & 1u) != 0u ? v - other : other - v; \
    } \
    T tw_ddy(const in T v) { \
        T other = subgroupQuadSwapVertical(v); \
        return (gl_SubgroupInvocationID & 2u) != 0u ? v - other : other - v; \
    }
DERIVATIVES(float)
DERIVATIVES(vec2)
DERIVATIVES(vec3)
DERIVATIVES(vec4)

// Both are replaced by the splicer; they call every hook, so that none is optimised away.
void tw_user_bind() {
    color_bits.x = tw_resource(0u);
}

void tw_user_main() {
    vec4 v = tw_input_smooth(0u) + tw_input_noperspective(1u) + uintBitsToFloat(tw_input_flat(0u));
    v += tw_ddx(v) + tw_ddy(v);
    v.xyz += tw_ddx(v.xyz) + tw_ddy(v.xyz);
    v.xy += tw_ddx(v.xy) + tw_ddy(v.xy);
    v.x += tw_ddx(v.x) + tw_ddy(v.x);
    tw_output(0u, 0u, 4u, floatBitsToUint(v));
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

// Runs the shader for the triangle of `key` at the target's pixel `pixel`; all four lanes of a quad
// call it together. `helper` lanes take part in derivatives only.
void shade(const uint key, const ivec2 pixel, const bool helper) {
    uint at = key_triangle(key, batch.extra_first);
    uvec3 vertices = triangles[at].vertices;
    bind(triangles[at].piece);

    vec2 ndc = (vec2(pixel) + 0.5 - window_offset) / window_scale;
    uint part = gl_SubgroupInvocationID & 3u;
    vec3 parts = vec3(positions[vertices.x][part], positions[vertices.y][part], positions[vertices.z][part]);
    vec3 x = subgroupQuadBroadcast(parts, 0u), y = subgroupQuadBroadcast(parts, 1u), w = subgroupQuadBroadcast(parts, 3u);
    vec3 px = x - ndc.x * w, py = y - ndc.y * w;
    vec3 weights = px.yzx * py.zxy - py.yzx * px.zxy;
    float sum = weights.x + weights.y + weights.z;
    perspective = sum != 0.0 ? weights / sum : vec3(1.0, 0.0, 0.0);
    float depth_w = dot(perspective, w);
    linear = depth_w != 0.0 ? perspective * w / depth_w : vec3(1.0, 0.0, 0.0);

    float z = depth_at(triangles[at].z, triangles[at].dzdx, triangles[at].dzdy, pixel);
    tw_FragCoord = vec4(vec2(pixel) + 0.5, z, depth_w != 0.0 ? 1.0 / depth_w : 0.0);
    tw_FragDepth = z;
    tw_FrontFacing = (triangles[at].flags & TRIANGLE_FRONT) != 0u;
    tw_PrimitiveID = int((first_in_draw + (key >> KEY_LOG2) - 1u) % primitives_per_instance);
    tw_HelperInvocation = helper;
    varying_base = piece_varyings + (vertices - piece_vertices) * varying_stride;
    color_bits = uvec4(0u);
    tw_user_main();
}
#endif
