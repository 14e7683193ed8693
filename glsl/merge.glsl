// What becomes of a fragment: the tests of depth and of stencil values, blending, logic operations and write masks.
//
// The file that includes this one includes `fragment.glsl`, declares the buffers `color`, `depth` and `stencil`, and defines
// DEPTH: when the tests happen.
#ifndef MERGE_GLSL
#define MERGE_GLSL
#include "lib/blend.glsl"
#include "lib/depth.glsl"
#include "lib/stencil.glsl"
#include "targets.glsl"

// Whether pipelines may have alpha cover samples, or be 1.
layout(constant_id = SPEC_BY_ALPHA) const bool BY_ALPHA = false;

// How the fragments of a triangle are tested.
struct Tests {
    uint state; // the piece's `fragment_state`
    vec2 bounds;
    vec3 plane, adjustment;
    uvec2 face; // the stencil test
};

// Whether a fragment of depth `z` passes the tests at the sample with the number `at`. If `writes`, its depth and the stencil
// value become what the tests say.
bool passes(const Tests tests, const uint at, const float z, const bool writes) {
    if ((tests.state & DEPTH_STATE_BOUNDS) != 0u && (depth[at] < tests.bounds.x || depth[at] > tests.bounds.y)) return false;
    bool passed = (tests.state & DEPTH_STATE_TEST) == 0u || compare(tests.state >> DEPTH_STATE_COMPARE_SHIFT, z, depth[at]);
    if (is_tested(tests.face)) {
        uint held = stencil[at], shift = passed ? STENCIL_PASS_SHIFT : STENCIL_DEPTH_FAIL_SHIFT;
        bool here = stencil_passes(tests.face, held);
        if (writes) stencil[at] = stencil_after(tests.face, here ? shift : STENCIL_FAIL_SHIFT, held);
        passed = passed && here;
    }
    if (passed && writes && (tests.state & DEPTH_STATE_WRITE) != 0u) depth[at] = z;
    return passed;
}

// The samples of `mask` that pass the tests; `mask` is not 0. They belong to the target's pixel `pixel`, which has the number
// `number` in the band. If `writes`, depth and stencil values change as the tests
// say. If all samples have the same depth, it is `one`.
uint passing(const Tests tests, const uint mask, const ivec2 pixel, const uint number, const float one, const bool writes) {
    uint passed = 0u;
    for (uint s = 0u; s < SAMPLES; s++) {
        uint at = number * SAMPLES + s;
        float z = one;
        if (SAMPLES > 1u && DEPTH != DEPTH_WRITTEN) z = depth_at(tests.plane, tests.adjustment, sample_place(pixel, s));
        bool is_drawn = SAMPLES == 1u || (mask >> s & 1u) != 0u;
        if (is_drawn && passes(tests, at, z, writes)) passed |= 1u << s;
    }
    return passed;
}

// The samples of `mask` that the alpha of a colour covers: as many as it is worth, all where it is 1.
uint covered_by(const uint mask, const float alpha) {
    // Not-a-number covers none.
    float worth = alpha > 0.0 ? min(alpha, 1.0) : 0.0;
    return mask & ((1u << uint(worth * float(SAMPLES) + 0.5)) - 1u);
}

// Writes the colour of a target, `bits`, to the sample with the number `at`; `state` is what the piece has of the target's state.
void write_color(const uint target, const uint at, const uint piece, const uint state, const uvec4 bits) {
    uint format = format_of(target), words = color_words(format), mask = state >> COLOR_MASK_SHIFT, first = color_place(target, at);
    if (mask == 0u) return;
    bool blends = (state & COLOR_BLENDS) != 0u, is_logic = !blends && (state & COLOR_LOGIC) != 0u;
    uvec4 value = bits, held = uvec4(0u);
    if (blends || is_logic || mask != 15u) {
        held.x = color[first];
        if (words > 1u) held.y = color[first + 1u];
        if (words > 2u) held.zw = uvec2(color[first + 2u], color[first + 3u]);
    }
    if (blends) {
        uvec2 equations = uvec2(state, state >> COLOR_ALPHA_SHIFT) & ((1u << BLEND_BITS) - 1u);
        vec4 source = limited(format, uintBitsToFloat(bits));
        // In real scenes, large parts of leaves, fences and glass are fully transparent. An infinite colour is not.
        if (numeric_of(format) != NUMERIC_FLOAT && source.a == 0.0 && blend_keeps(equations.x, equations.y)) return;
        vec4 constants = vec4(0.0);
        if ((state & COLOR_CONSTANTS) != 0u) constants = limited(format, pieces[piece].blend_constants);
        vec4 target_color = color_decode(format, held);
        value = floatBitsToUint(blend(equations.x, equations.y, source, target_color, constants, limited(format, uintBitsToFloat(second_bits)), has_sign(format)));
    }
    uvec4 texel = color_encode(format, value);
    if (is_logic) texel = logic(state, texel, held);
    if (mask != 15u) {
        uvec4 written = channel_bits(format, mask);
        texel = (texel & written) | (held & ~written);
    }
    store_color(target, at, texel);
}

// Writes the colours that the shader returned to the samples `mask` of pixel number `number` of the band; `mask` is not 0. `state` is the
// `fragment_state` of the piece, and `states` are its `color_states`.
void write_colors(const uint mask, const uint number, const uint piece, const uint state, const uvec4 states[MAX_COLORS / 4u]) {
    if (BY_ALPHA && (state & SAMPLE_STATE_ALPHA_ONE) != 0u) {
#define MAKE_OPAQUE(t) if (!is_integer(format_of(t))) color_bits_##t.a = floatBitsToUint(1.0);
        EACH_COLOR(MAKE_OPAQUE)
        second_bits.a = floatBitsToUint(1.0);
    }
    for (uint s = 0u; s < SAMPLES; s++) {
        if (SAMPLES > 1u && (mask >> s & 1u) == 0u) continue;
        uint at = number * SAMPLES + s;
#define WRITE(t) if (format_of(t) != NO_FORMAT) write_color(t, at, piece, states[t >> 2][t & 3u], color_bits_##t);
        EACH_COLOR(WRITE)
    }
}
#endif
