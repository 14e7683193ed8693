// Colour formats: between linear RGBA floats and the words of a target.
#ifndef COLOR_GLSL
#define COLOR_GLSL

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

// Floats from 2^23 on are whole numbers: adding 2^23 rounds to the nearest of them, ties to even.
uint pack_unorm8(const vec4 c) {
    uvec4 u = floatBitsToUint(c * 255.0 + 8388608.0) & 0xffu;
    return u.r | u.g << 8 | u.b << 16 | u.a << 24;
}

vec4 unpack_unorm8(const uint w) {
    return vec4(w & 0xffu, (w >> 8) & 0xffu, (w >> 16) & 0xffu, w >> 24) * (1.0 / 255.0);
}

// Words of a texel.
uint color_words(const uint format) {
    return format == FORMAT_RGBA16_FLOAT ? 2u : 1u;
}

// The bits of a texel's words that belong to the channels of `mask`, red in its lowest bit.
uvec2 channel_bits(const uint format, const uint mask) {
    uvec4 on = -uvec4(mask & 1u, (mask >> 1) & 1u, (mask >> 2) & 1u, (mask >> 3) & 1u);
    if (format == FORMAT_RGBA16_FLOAT) {
        return uvec2((on.r & 0xffffu) | (on.g & 0xffff0000u), (on.b & 0xffffu) | (on.a & 0xffff0000u));
    }
    return uvec2((on.r & 0xffu) | (on.g & 0xff00u) | (on.b & 0xff0000u) | (on.a & 0xff000000u), 0u);
}

// The words of a texel; 8-bit formats use the first only.
uvec2 color_encode(const uint format, const vec4 c) {
    if (format == FORMAT_RGBA16_FLOAT) return uvec2(packHalf2x16(c.rg), packHalf2x16(c.ba));
    vec4 s = saturate(c);
    if (format == FORMAT_RGBA8_SRGB) s.rgb = srgb_encode(s.rgb);
    return uvec2(pack_unorm8(s), 0u);
}

vec4 color_decode(const uint format, const uvec2 w) {
    if (format == FORMAT_RGBA16_FLOAT) return vec4(unpackHalf2x16(w.x), unpackHalf2x16(w.y));
    vec4 c = unpack_unorm8(w.x);
    if (format == FORMAT_RGBA8_SRGB) c.rgb = srgb_decode(c.rgb);
    return c;
}
#endif
