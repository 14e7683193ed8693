// Resolve: between the samples of a target, which kernels draw to, and texels, one for each pixel.
//
// Reads: samples, or texels. Writes: the other ones.
// Contract: a texel of colours is the average of its samples, that of linear light if the format is sRGB-encoded. A texel
// of integers is sample 0. A texel of depth or of stencil values is what MODE says. The other way, all samples of a pixel become its texel.
// Kernel / Twin: src/compute/resolve.rs; no twin, tests compare with averages.
#version 460
#include "abi.glsl"
#include "lib/color.glsl"
#include "lib/samples.glsl"

// A format of colours, or NO_FORMAT for depths, which are floats here.
layout(constant_id = SPEC_FORMATS) const uint FORMAT = FORMAT_RGBA8_UNORM;
layout(constant_id = SPEC_RESOLVE_MODE) const uint MODE = RESOLVE_MODE_AVERAGE;
layout(local_size_x = GROUP) in;
layout(push_constant, scalar) uniform ResolveBlock { Resolve resolve; };
layout(scalar, binding = 0) buffer Samples { uint samples[]; };
layout(scalar, binding = 1) buffer Texels { uint texels[]; };

uvec4 sample_words(const uint at, const uint words) {
    uvec4 value = uvec4(samples[at], 0u, 0u, 0u);
    if (words > 1u) value.y = samples[at + 1u];
    if (words > 2u) value.zw = uvec2(samples[at + 2u], samples[at + 3u]);
    return value;
}

// Averages are those of pairs, and of pairs of these. So the average of equal samples is their value, whatever it is.
uvec4 resolved_color(const uint at, const uint words) {
    if (MODE == RESOLVE_MODE_SAMPLE_ZERO) return sample_words(at, words);
    vec4 all[SAMPLES];
    for (uint s = 0u; s < SAMPLES; s++) all[s] = color_decode(FORMAT, sample_words(at + s * words, words));
    for (uint count = SAMPLES / 2u; count > 0u; count /= 2u) {
        for (uint s = 0u; s < count; s++) all[s] = all[2u * s] * 0.5 + all[2u * s + 1u] * 0.5;
    }
    return color_encode(FORMAT, floatBitsToUint(all[0]));
}

uint resolved_stencil(const uint at) {
    uint value = samples[at];
    for (uint s = 1u; s < SAMPLES; s++) {
        if (MODE == RESOLVE_MODE_MIN) value = min(value, samples[at + s]);
        if (MODE == RESOLVE_MODE_MAX) value = max(value, samples[at + s]);
    }
    return value;
}

float resolved_depth(const uint at) {
    if (MODE == RESOLVE_MODE_SAMPLE_ZERO) return uintBitsToFloat(samples[at]);
    float all[SAMPLES];
    for (uint s = 0u; s < SAMPLES; s++) all[s] = uintBitsToFloat(samples[at + s]);
    for (uint count = SAMPLES / 2u; count > 0u; count /= 2u) {
        for (uint s = 0u; s < count; s++) {
            float a = all[2u * s], b = all[2u * s + 1u];
            float extreme = MODE == RESOLVE_MODE_MIN ? min(a, b) : max(a, b);
            all[s] = MODE == RESOLVE_MODE_AVERAGE ? a * 0.5 + b * 0.5 : extreme;
        }
    }
    return all[0];
}

void main() {
    uint words = FORMAT == NO_FORMAT || FORMAT == FORMAT_S8_UINT ? 1u : color_words(FORMAT);
    uint first = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP * CLEAR_ROUNDS;
    uint end = min(first + GROUP * CLEAR_ROUNDS, resolve.pixels);
    for (uint i = first + gl_LocalInvocationIndex; i < end; i += GROUP) {
        uint at = resolve.first_sample + i * SAMPLES * words, texel = resolve.first_texel + i * words;
        if (resolve.to_samples != 0u) {
            for (uint s = 0u; s < SAMPLES; s++) {
                for (uint w = 0u; w < words; w++) samples[at + s * words + w] = texels[texel + w];
            }
        } else if (FORMAT == NO_FORMAT) {
            texels[texel] = floatBitsToUint(resolved_depth(at));
        } else if (FORMAT == FORMAT_S8_UINT) {
            texels[texel] = resolved_stencil(at);
        } else {
            uvec4 value = resolved_color(at, words);
            texels[texel] = value.x;
            if (words > 1u) texels[texel + 1u] = value.y;
            if (words > 2u) texels[texel + 2u] = value.z;
            if (words > 2u) texels[texel + 3u] = value.w;
        }
    }
}
