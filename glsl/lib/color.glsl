// Colour formats: between the values of shaders and the words of a target.
//
// The number of a format says what its bits mean, where its channels lie and how many there are (`Format` of format.rs). Most
// passes have targets of a few common formats (`COMMON` of src/compute/maker.rs). Kernels for these know no others, so that
// drivers compile them in a fraction of the time; kernels for any format define ANY_FORMAT.
#ifndef COLOR_GLSL
#define COLOR_GLSL
#include "lib/small_float.glsl"

uint numeric_of(const uint format) {
    return format & 7u;
}

uint packing_of(const uint format) {
    return (format >> 3) & 7u;
}

uint channels_of(const uint format) {
    return (format >> 6) + 1u;
}

bool is_integer(const uint format) {
    return numeric_of(format) == NUMERIC_UINT || numeric_of(format) == NUMERIC_SINT;
}

// To 0..=1; NaN becomes 0 on every device.
vec4 saturate(const vec4 c) {
    return vec4(c.r > 0.0 ? min(c.r, 1.0) : 0.0, c.g > 0.0 ? min(c.g, 1.0) : 0.0,
                c.b > 0.0 ? min(c.b, 1.0) : 0.0, c.a > 0.0 ? min(c.a, 1.0) : 0.0);
}

// The sRGB transfer functions, IEC 61966-2-1. Drivers round `pow` as they like; polynomials of exact
// operations give the same bytes on all of them, in half the time.

// The error is at most 0.004 of 255.
vec3 srgb_encode(const vec3 c) {
    // 1.055 c^(1 / 2.4), where c = m 2^-k: a polynomial of m, which is in 1..2, times the power of 2^-k,
    // bit by bit of k.
    uvec3 bits = floatBitsToUint(c);
    vec3 m = uintBitsToFloat((bits & 0x7fffffu) | 0x3f800000u);
    uvec3 k = 127u - (bits >> 23);
    vec3 power = 0.433846949 + m * (0.874447502 + m * (-0.335793064 + m * (0.0939347661 - m * 0.0114251725)));
    power *= mix(vec3(1.0), vec3(0.749153538), notEqual(k & 1u, uvec3(0u)));
    power *= mix(vec3(1.0), vec3(0.561231024), notEqual(k & 2u, uvec3(0u)));
    power *= mix(vec3(1.0), vec3(0.314980262), notEqual(k & 4u, uvec3(0u)));
    power *= mix(vec3(1.0), vec3(0.0992125657), notEqual(k & 8u, uvec3(0u)));
    return mix(power - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

// The error changes the encoded value by at most 0.014 of 255.
vec3 srgb_decode(const vec3 c) {
    vec3 light = 0.000916756933 + c * (0.0327492962 + c * (0.519358991 + c * (0.667225287
               + c * (-0.307453952 + c * 0.0873140775))));
    return mix(light, c * (1.0 / 12.92), lessThanEqual(c, vec3(0.04045)));
}

#ifdef ANY_FORMAT
#include "lib/any_color.glsl"
#else
// Words of a texel in the rows of a target.
uint color_words(const uint format) {
    return packing_of(format) == PACKING_BITS16 ? 2u : 1u;
}

// Whether channels may be negative and are no floats.
bool has_sign(const uint format) {
    return false;
}

// A colour in the limits that Vulkan sets for the format before it is blended or written.
vec4 limited(const uint format, const vec4 c) {
    return numeric_of(format) == NUMERIC_FLOAT ? c : saturate(c);
}

// Four channels of 8 bits in a word. Blue comes first in some formats.
uint pack_bytes(const uint format, const uvec4 c) {
    uvec4 u = packing_of(format) == PACKING_BGRA8 ? c.bgra : c;
    return u.x | u.y << 8 | u.z << 16 | u.w << 24;
}

// The bits of a texel's words that belong to the channels of `mask`, red in its lowest bit.
uvec4 channel_bits(const uint format, const uint mask) {
    uvec4 on = -uvec4(mask & 1u, (mask >> 1) & 1u, (mask >> 2) & 1u, (mask >> 3) & 1u), h = on & 0xffffu;
    if (packing_of(format) == PACKING_BITS16) return uvec4(h.r | h.g << 16, h.b | h.a << 16, 0u, 0u);
    return uvec4(pack_bytes(format, on & 0xffu), 0u, 0u, 0u);
}

// The words of a texel, of the bits of what a shader writes. Words beyond those of the format hold anything.
uvec4 color_encode(const uint format, const uvec4 bits) {
    vec4 c = uintBitsToFloat(bits);
    if (packing_of(format) == PACKING_BITS16) {
        uvec4 h = small_floats(c, uvec4(10u)) | ((bits >> 16) & 0x8000u);
        return uvec4(h.r | h.g << 16, h.b | h.a << 16, 0u, 0u);
    }
    c = saturate(c);
    if (numeric_of(format) == NUMERIC_SRGB) c.rgb = srgb_encode(c.rgb);
    // Floats from 2^23 on are whole numbers: adding 2^23 rounds to the nearest of them, ties to even.
    return uvec4(pack_bytes(format, floatBitsToUint(c * 255.0 + 8388608.0) & 0xffu), 0u, 0u, 0u);
}

// The colour of a texel.
vec4 color_decode(const uint format, const uvec4 words) {
    if (packing_of(format) == PACKING_BITS16) {
        uvec4 h = (words.xxyy >> uvec4(0u, 16u, 0u, 16u)) & 0xffffu;
        vec4 c = from_small_floats(h & 0x7fffu, uvec4(10u));
        return uintBitsToFloat(floatBitsToUint(c) | ((h & 0x8000u) << 16));
    }
    vec4 c = vec4((words.xxxx >> uvec4(0u, 8u, 16u, 24u)) & 0xffu) * (1.0 / 255.0);
    if (packing_of(format) == PACKING_BGRA8) c = c.bgra;
    if (numeric_of(format) == NUMERIC_SRGB) c.rgb = srgb_decode(c.rgb);
    return c;
}
#endif
#endif
