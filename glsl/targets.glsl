// The colour targets as kernels write them: one after the other in one buffer, each pixel after pixel, sample after
// sample.
//
// The file that includes this one declares the buffer `color` and the push constants `batch`.
#ifndef TARGETS_GLSL
#define TARGETS_GLSL
#include "lib/color.glsl"
#include "lib/samples.glsl"

layout(constant_id = SPEC_FORMATS) const uint FORMATS = 0xffffff00u | FORMAT_RGBA8_UNORM;
layout(constant_id = SPEC_MORE_FORMATS) const uint MORE_FORMATS = 0xffffffffu;

// The format of a target, or NO_FORMAT.
uint format_of(const uint target) {
    return ((target < 4u ? FORMATS : MORE_FORMATS) >> (8u * (target & 3u))) & 0xffu;
}

// The first word of a sample of `target`, which has the number `at` among the samples of all pixels.
uint color_place(const uint target, const uint at) {
    uint before = 0u;
#define ADD_WORDS(t) if (t < target) before += color_words(format_of(t));
    EACH_COLOR(ADD_WORDS)
    uint plane = (batch.width * batch.height + PLANE_PIXELS - 1u) & ~(PLANE_PIXELS - 1u);
    return before * plane * SAMPLES + color_words(format_of(target)) * at;
}

void store_color(const uint target, const uint at, const uvec4 texel) {
    uint first = color_place(target, at), words = color_words(format_of(target));
    color[first] = texel.x;
    if (words > 1u) color[first + 1u] = texel.y;
    if (words > 2u) color[first + 2u] = texel.z;
    if (words > 2u) color[first + 3u] = texel.w;
}
#endif
