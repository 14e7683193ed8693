#version 450
// A textured, lit surface, as the benchmark's generated scenes draw it. The benchmark sets its cost: the
// number of waves is a specialization constant, and the number of further varyings is a macro, since
// varyings change the interface.
#ifndef VARYINGS
#define VARYINGS 0
#endif

// Waves added to the normal.
layout(constant_id = 0) const uint VERTEX_COST = 0;

layout(location = 0) in vec3 in_position;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec2 in_uv;

layout(set = 0, binding = 0) uniform Frame {
    mat4 view_projection;
    vec4 eye;
    vec4 light; // towards it
} frame;

layout(push_constant) uniform Draw {
    mat4 model; // turns, moves and scales alike in all directions
    vec4 tint;
} draw;

layout(location = 0) out vec3 out_position;
layout(location = 1) out vec3 out_normal;
layout(location = 2) out vec2 out_uv;
#if VARYINGS > 0
layout(location = 3) out vec4 out_more[VARYINGS];
#endif

void main() {
    // Precise: the classic pipeline and the kernels must compute the same bits of a position.
    precise vec4 world = draw.model * vec4(in_position, 1.0);
    precise vec4 clip = frame.view_projection * world;
    gl_Position = clip;

    vec3 normal = in_normal;
    for (uint i = 0u; i < VERTEX_COST; ++i) {
        float phase = dot(in_position, vec3(3.0, 5.0, 7.0)) + float(i);
        normal += 0.02 * vec3(sin(phase), cos(phase), sin(phase * 0.5));
    }
    out_position = world.xyz;
    out_normal = mat3(draw.model) * normal;
    out_uv = in_uv;
#if VARYINGS > 0
    for (int i = 0; i < VARYINGS; ++i) {
        out_more[i] = vec4(in_position, 1.0) * (float(i + 1) / float(VARYINGS));
    }
#endif
}
