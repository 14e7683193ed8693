// Runs the user's fragment shader at one pixel of one triangle, for all shading kernels.
//
// The shader is spliced into the `tw_user_` functions; it sees the functions and globals called tw_*. Varyings are
// interpolated from the clip-space vertices of the whole triangle (`lib/interpolate.glsl`). So they need no
// per-triangle setup, and a part of a clipped triangle gets the same values as the whole triangle.
// `bound.glsl` fetches the inputs.
#ifndef FRAGMENT_GLSL
#define FRAGMENT_GLSL
#include "bound.glsl"
#include "lib/color.glsl"
#include "lib/depth.glsl"
#include "lib/interpolate.glsl"
#include "lib/tile.glsl"

vec4 tw_FragCoord;
bool tw_FrontFacing;
int tw_PrimitiveID;
vec2 tw_PointCoord;
float tw_FragDepth;
int tw_FragStencilRef;
bool tw_HelperInvocation;
int tw_SampleID;
vec2 tw_SamplePosition;
uint tw_SampleMaskIn, tw_SampleMask; // a bit for each sample

// Whether the shader runs for each sample that is covered, at its place, or once for all samples of a pixel.
layout(constant_id = SPEC_PER_SAMPLE) const bool PER_SAMPLE = false;

uint stencil_reference; // what stencil values are compared with, unless the shader says it
float surface_depth; // of the triangle where the shader runs, as the target keeps it
vec3 perspective;    // barycentric weights for smooth varyings
vec3 linear;         // for noperspective ones
vec2 inner_place;      // a place that the triangle covers, in pixels from the centre of pixel (0, 0)
// A statement for each output location, by its number. It is written out, and the file is compiled for one colour target
// and for all of them (COLORS): drivers take their time for code of targets that are not there.
#if COLORS == 1
#define EACH_COLOR(statement) statement(0u)
#else
#define EACH_COLOR(statement) \
    statement(0u) statement(1u) statement(2u) statement(3u) statement(4u) statement(5u) statement(6u) statement(7u)
#endif

#define DECLARE(t) uvec4 color_bits_##t;
EACH_COLOR(DECLARE)
uvec4 second_bits; // the second source of blending, which only a single target has

uint tw_resource(const in uint i) {
    return resource_slots[bound_resources + i];
}

uvec4 tw_block_words(const in uint slot, const in uint word, const in uint last) {
    return of_quad(table[nonuniformEXT(slot)].words[min(word + QUAD_LANE, last)]);
}

void tw_bind_inputs(const in uint location) {
    bool distance = location >= DISTANCE_LOCATION;
    uint number = distance ? varying_stride / 4u - DISTANCE_LOCATIONS : location, index = input_index(location);
    uvec3 at = varying_base + number * 2u + QUAD_LANE;
    uvec2 a = varyings[at.x], b = varyings[at.y], c = varyings[at.z];
    parts[index] = differences(uvec3(a.x, b.x, c.x));
    parts[index + 1u] = differences(uvec3(a.y, b.y, c.y));
    uvec2 own = varyings[provoking_base + number * 2u + QUAD_LANE];
    provoking[index] = own.x;
    provoking[index + 1u] = own.y;
}

// The four words of `location`; each lane of the quad passes its own two as `first` and `second`.
uvec4 input_words(const uint location, const uint first, const uint second) {
    if ((location & 1u) == 0u) return of_first_half(uvec2(first, second));
    return of_second_half(uvec2(first, second));
}

vec4 input_at(const vec3 weights, const uint location) {
    uint even = input_index(location) & ~1u;
    uvec3 first = parts[even], second = parts[even + 1u];
    return interpolate(weights, uintBitsToFloat(input_words(location, first.x, second.x)),
                       uintBitsToFloat(input_words(location, first.y, second.y)),
                       uintBitsToFloat(input_words(location, first.z, second.z)));
}

vec4 tw_input_smooth(const in uint location) {
    return input_at(perspective, location);
}

vec4 tw_input_noperspective(const in uint location) {
    return input_at(linear, location);
}

// Sets the weights of the corners of `triangle` at `place`, with perspective and without. Returns w, scaled as the corners are.
float weigh(const Bound triangle, const vec2 place, out vec3 with, out vec3 without) {
    vec2 ndc = (place + 0.5 - viewport_offset) / viewport_scale;
    if (PRIMITIVES == PRIMITIVE_KIND_POINT) with = vec3(1.0, 0.0, 0.0);
    else if (PRIMITIVES == PRIMITIVE_KIND_LINE) {
        vec2 axis = vec2((triangle.flags & TRIANGLE_ALONG_X) != 0u, (triangle.flags & TRIANGLE_ALONG_Y) != 0u);
        with = line_weights(triangle.x, triangle.y, triangle.w, ndc, viewport_scale, axis);
    }
    else with = perspective_weights(triangle.x, triangle.y, triangle.w, ndc);
    float w = interpolate(with, triangle.w);
    without = w != 0.0 ? with * triangle.w / w : vec3(1.0, 0.0, 0.0);
    return w;
}

// As the two above, at a place that the triangle covers.
vec4 tw_input_smooth_centroid(const in uint location) {
    vec3 with = perspective, without;
    if (SAMPLES > 1u) weigh(bound, inner_place, with, without);
    return input_at(with, location);
}

vec4 tw_input_noperspective_centroid(const in uint location) {
    vec3 with, without = linear;
    if (SAMPLES > 1u) weigh(bound, inner_place, with, without);
    return input_at(without, location);
}

uvec4 tw_input_flat(const in uint location) {
    uint even = location & ~1u;
    return input_words(location, provoking[even], provoking[even + 1u]);
}

void tw_output(const in uint location, const in uint component, const in uint count, const in uvec4 value) {
#define PUT(t) for (uint c = 0u; c < count && location == t; c++) color_bits_##t[component + c] = value[c];
    EACH_COLOR(PUT)
#if COLORS == 1
    for (uint c = 0u; c < count && location == SECOND_SOURCE; c++) second_bits[component + c] = value[c];
#endif
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

// The splicer replaces these bodies. They call every hook, so that the compiler keeps all hooks.
void tw_user_bind() {
    color_bits_0u = tw_block_words(tw_resource(0u), 0u, 0u);
}

void tw_user_bind_inputs() {
    tw_bind_inputs(0u);
}

void tw_user_main() {
    vec4 v = tw_input_smooth(0u) + tw_input_noperspective(1u) + uintBitsToFloat(tw_input_flat(0u));
    v += tw_input_smooth_centroid(0u) + tw_input_noperspective_centroid(1u);
    v += tw_ddx(v) + tw_ddy(v);
    v.xyz += tw_ddx(v.xyz) + tw_ddy(v.xyz);
    v.xy += tw_ddx(v.xy) + tw_ddy(v.xy);
    v.x += tw_ddx(v.x) + tw_ddy(v.x);
    tw_output(0u, 0u, 4u, floatBitsToUint(v));
}

// Runs the shader at the target's pixel `pixel` for `triangle`, which has to be the bound one. All four lanes
// of a quad call this together. `mask` has a bit for each sample of the pixel that is drawn to. A lane without any is a
// helper, which takes part in derivatives only. `coverage` has a bit for each sample that the triangle covers, hidden or
// not. PER_SAMPLE, the shader runs for sample `s`, the only one of both. Returns the bits of the samples that the shader
// keeps.
uint shade(const Bound triangle, const ivec2 pixel, const uint mask, const uint coverage, const uint s) {
    vec2 place = PER_SAMPLE ? sample_place(pixel, s) : vec2(pixel);
    float depth_w = weigh(triangle, place, perspective, linear);
    inner_place = place;
    if (SAMPLES > 1u && coverage != 0u && coverage != ALL_SAMPLES) inner_place = sample_place(pixel, uint(findLSB(coverage)));

    surface_depth = depth_at(triangle.plane, triangle.adjustment, place);
    float z = surface_depth, free = free_depth_at(triangle.plane, triangle.adjustment, place);
    if (DEPTH_BITS != 0u) z = kept_depth(free);
    if (ADJUSTED && (triangle.flags & TRIANGLE_ADJUSTED) != 0u) z = free;
    tw_FragCoord = vec4(place + 0.5, z, depth_w != 0.0 ? triangle.scale / depth_w : 0.0);
    tw_PointCoord = vec2(0.0);
    if (PRIMITIVES == PRIMITIVE_KIND_POINT) {
        vec2 centre = vec2(triangle.x.x, triangle.y.x) / triangle.w.x * viewport_scale + viewport_offset;
        tw_PointCoord = 0.5 + (place + 0.5 - centre) * float(1u << SUBPIXEL_BITS) / triangle.side;
    }
    tw_FragDepth = z;
    tw_FragStencilRef = int(stencil_reference);
    tw_FrontFacing = (triangle.flags & TRIANGLE_FRONT) != 0u;
    tw_PrimitiveID = int((first_in_draw + (triangle.key >> KEY_LOG2) - 1u) % primitives_per_instance);
    tw_HelperInvocation = mask == 0u;
    tw_SampleID = int(s);
    tw_SamplePosition = vec2(sample_offset(s) + 8) / 16.0;
    tw_SampleMaskIn = coverage;
    tw_SampleMask = 0xffffffffu;
#define RESET(t) color_bits_##t = uvec4(0u);
    EACH_COLOR(RESET)
    second_bits = uvec4(0u);
    tw_user_main();
    return tw_HelperInvocation ? 0u : mask & tw_SampleMask;
}
#endif
