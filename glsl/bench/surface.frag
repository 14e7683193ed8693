#version 450
// Textures, a sun with a highlight, and as many lamps as the scene asks for. See surface.vert.
#ifndef VARYINGS
#define VARYINGS 0
#endif

// Lamps beside the sun.
layout(constant_id = 1) const uint FRAGMENT_COST = 0;
// Textures that are read, 0 to 8.
layout(constant_id = 2) const uint FETCHES = 1;
// Pipelines differ in this constant: it sets how the highlight falls off.
layout(constant_id = 3) const uint GLOSS = 0;
#ifdef SEVERAL_TARGETS // A file of its own, so that one target is drawn by a shader that declares no other.
// Colour targets that are written, up to 8.
layout(constant_id = 4) const uint TARGETS = 8;
#endif

layout(location = 0) in vec3 in_position;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec2 in_uv;
#if VARYINGS > 0
layout(location = 3) in vec4 in_more[VARYINGS];
#endif

layout(set = 0, binding = 0) uniform Frame {
    mat4 view_projection;
    vec4 eye;
    vec4 light; // towards it
} frame;

layout(push_constant) uniform Draw {
    mat4 model; // turns, moves and scales alike in all directions
    vec4 tint;
} draw;

layout(set = 1, binding = 0) uniform sampler2D map0;
layout(set = 1, binding = 1) uniform sampler2D map1;
layout(set = 1, binding = 2) uniform sampler2D map2;
layout(set = 1, binding = 3) uniform sampler2D map3;
layout(set = 1, binding = 4) uniform sampler2D map4;
layout(set = 1, binding = 5) uniform sampler2D map5;
layout(set = 1, binding = 6) uniform sampler2D map6;
layout(set = 1, binding = 7) uniform sampler2D map7;

layout(location = 0) out vec4 out_color;
#ifdef SEVERAL_TARGETS
// The targets behind the first; there are as many as TARGETS says.
layout(location = 1) out vec4 out_more1;
layout(location = 2) out vec4 out_more2;
layout(location = 3) out vec4 out_more3;
layout(location = 4) out vec4 out_more4;
layout(location = 5) out vec4 out_more5;
layout(location = 6) out vec4 out_more6;
layout(location = 7) out vec4 out_more7;
#endif

// Each further map at another scale, as detail maps are, averaged towards the first.
void detail(inout vec4 base, vec4 texel) {
    base.rgb *= 0.6 + 0.8 * texel.rgb;
}

void main() {
    vec4 base = draw.tint;
    if (FETCHES > 0u) { base *= texture(map0, in_uv); }
    if (FETCHES > 1u) { detail(base, texture(map1, in_uv * 1.5)); }
    if (FETCHES > 2u) { detail(base, texture(map2, in_uv * 2.0)); }
    if (FETCHES > 3u) { detail(base, texture(map3, in_uv * 2.5)); }
    if (FETCHES > 4u) { detail(base, texture(map4, in_uv * 3.0)); }
    if (FETCHES > 5u) { detail(base, texture(map5, in_uv * 3.5)); }
    if (FETCHES > 6u) { detail(base, texture(map6, in_uv * 4.0)); }
    if (FETCHES > 7u) { detail(base, texture(map7, in_uv * 4.5)); }
#if VARYINGS > 0
    vec4 more = vec4(0.0);
    for (int i = 0; i < VARYINGS; ++i) {
        more += in_more[i];
    }
    base.rgb *= 0.9 + 0.1 * clamp(more.rgb / float(VARYINGS), -1.0, 1.0);
#endif

    vec3 n = normalize(in_normal);
    vec3 v = normalize(frame.eye.xyz - in_position);
    vec3 sun = frame.light.xyz;
    float diffuse = max(dot(n, sun), 0.0);
    float highlight = pow(max(dot(n, normalize(v + sun)), 0.0), 16.0 + float(GLOSS));
    vec3 color = base.rgb * (0.25 + 0.6 * diffuse) + 0.2 * highlight;
    for (uint i = 0u; i < FRAGMENT_COST; ++i) {
        float turn = float(i) * 2.4;
        vec3 lamp = vec3(2.0 * cos(turn), 0.5 + 0.1 * float(i), 2.0 * sin(turn));
        vec3 to_lamp = lamp - in_position;
        float square = dot(to_lamp, to_lamp) + 0.1;
        float reach = max(dot(n, to_lamp), 0.0) * inversesqrt(square) / (1.0 + square);
        color += base.rgb * (reach * 0.2);
    }
    out_color = vec4(color, base.a);
#ifdef SEVERAL_TARGETS
    // Mixtures of the colour without light and the direction of the surface: no two targets are the same.
    vec3 facing = n * 0.5 + 0.5;
    if (TARGETS > 1u) { out_more1 = vec4(mix(base.rgb, facing, 1.0 / 7.0), base.a); }
    if (TARGETS > 2u) { out_more2 = vec4(mix(base.rgb, facing, 2.0 / 7.0), base.a); }
    if (TARGETS > 3u) { out_more3 = vec4(mix(base.rgb, facing, 3.0 / 7.0), base.a); }
    if (TARGETS > 4u) { out_more4 = vec4(mix(base.rgb, facing, 4.0 / 7.0), base.a); }
    if (TARGETS > 5u) { out_more5 = vec4(mix(base.rgb, facing, 5.0 / 7.0), base.a); }
    if (TARGETS > 6u) { out_more6 = vec4(mix(base.rgb, facing, 6.0 / 7.0), base.a); }
    if (TARGETS > 7u) { out_more7 = vec4(mix(base.rgb, facing, 7.0 / 7.0), base.a); }
#endif
}
