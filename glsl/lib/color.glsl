// Colour formats: between linear RGBA floats and the words of a target.
#ifndef COLOR_GLSL
#define COLOR_GLSL

// To 0..=1; NaN becomes 0 on every device.
vec4 saturate(const vec4 c) {
    return vec4(c.r > 0.0 ? min(c.r, 1.0) : 0.0, c.g > 0.0 ? min(c.g, 1.0) : 0.0,
                c.b > 0.0 ? min(c.b, 1.0) : 0.0, c.a > 0.0 ? min(c.a, 1.0) : 0.0);
}

vec3 srgb_encode(const vec3 c) {
    return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
}

vec3 srgb_decode(const vec3 c) {
    return mix(c * (1.0 / 12.92), pow((c + 0.055) * (1.0 / 1.055), vec3(2.4)), greaterThan(c, vec3(0.04045)));
}

uint pack_unorm8(const vec4 c) {
    uvec4 u = uvec4(c * 255.0 + 0.5);
    return u.r | u.g << 8 | u.b << 16 | u.a << 24;
}

vec4 unpack_unorm8(const uint w) {
    return vec4(w & 0xffu, (w >> 8) & 0xffu, (w >> 16) & 0xffu, w >> 24) * (1.0 / 255.0);
}

// The words of a pixel; 8-bit formats use the first only.
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
