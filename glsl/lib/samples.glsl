// The samples of a pixel: how many there are, and where each of them is (`Samples` of src/samples.rs).
#ifndef SAMPLES_GLSL
#define SAMPLES_GLSL

layout(constant_id = SPEC_SAMPLES) const uint SAMPLES = 1u;
// A byte for each sample, four in each constant: column and row in 1/16 pixel, the column in the low half.
layout(constant_id = SPEC_POSITIONS_0) const uint POSITIONS_0 = 0x88888888u;
layout(constant_id = SPEC_POSITIONS_1) const uint POSITIONS_1 = 0x88888888u;
layout(constant_id = SPEC_POSITIONS_2) const uint POSITIONS_2 = 0x88888888u;
layout(constant_id = SPEC_POSITIONS_3) const uint POSITIONS_3 = 0x88888888u;

// A bit for each sample.
const uint ALL_SAMPLES = (1u << SAMPLES) - 1u;

// From the centre of a pixel to its sample `s`, in 1/16 pixel to the right and down.
ivec2 sample_offset(const uint s) {
    if (SAMPLES == 1u) return ivec2(0);
    uint four = s < 8u ? (s < 4u ? POSITIONS_0 : POSITIONS_1) : (s < 12u ? POSITIONS_2 : POSITIONS_3);
    uint own = four >> (8u * (s & 3u));
    return ivec2(own & 15u, (own >> 4) & 15u) - 8;
}

// The sample `s` of `pixel`, in pixels from the centre of pixel (0, 0).
vec2 sample_place(const ivec2 pixel, const uint s) {
    vec2 centre = vec2(pixel);
    return SAMPLES == 1u ? centre : centre + vec2(sample_offset(s)) / 16.0;
}
#endif
