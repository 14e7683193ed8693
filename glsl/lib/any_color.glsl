// All colour formats: the functions of color.glsl that depend on them.
//
// Tables are looked up by selections, because drivers for CPUs turn a switch into a dozen branches and compile them all.
#ifndef ANY_COLOR_GLSL
#define ANY_COLOR_GLSL

// Words of a texel in the rows of a target. A texel of fewer bytes has a word for itself there.
uint color_words(const uint format) {
    uint of_halves = packing_of(format) == PACKING_BITS16 && channels_of(format) > 2u ? 2u : 1u;
    return packing_of(format) == PACKING_BITS32 ? channels_of(format) : of_halves;
}

// The greatest number of each channel.
uvec4 channel_masks(const uint format) {
#define BITS(r, g, b, a) (r | g << 6 | b << 12 | a << 18)
    uint packing = packing_of(format);
    uint of_channels = packing == PACKING_BITS16 ? BITS(16u, 16u, 16u, 16u) : BITS(8u, 8u, 8u, 8u);
    of_channels = packing == PACKING_BITS32 ? BITS(32u, 32u, 32u, 32u) : of_channels;
    of_channels = packing == PACKING_RGB10A2 ? BITS(10u, 10u, 10u, 2u) : of_channels;
    of_channels = packing == PACKING_RG11B10 ? BITS(11u, 11u, 10u, 0u) : of_channels;
    of_channels = packing == PACKING_R5G6B5 ? BITS(5u, 6u, 5u, 0u) : of_channels;
    of_channels = packing == PACKING_A1R5G5B5 ? BITS(5u, 5u, 5u, 1u) : of_channels;
    uvec4 bits = (uvec4(of_channels) >> uvec4(0u, 6u, 12u, 18u)) & 63u;
    return mix((uvec4(1u) << (bits & 31u)) - 1u, uvec4(0xffffffffu), equal(bits, uvec4(32u)));
}

// The bit of its word at which each channel begins.
uvec4 channel_shifts(const uint format) {
#define FIRST(r, g, b, a) (r | g << 5 | b << 10 | a << 15)
    uint packing = packing_of(format);
    uint of_channels = packing == PACKING_BITS16 ? FIRST(0u, 16u, 0u, 16u) : FIRST(0u, 8u, 16u, 24u);
    of_channels = packing == PACKING_BITS32 ? FIRST(0u, 0u, 0u, 0u) : of_channels;
    of_channels = packing == PACKING_BGRA8 ? FIRST(16u, 8u, 0u, 24u) : of_channels;
    of_channels = packing == PACKING_RGB10A2 ? FIRST(0u, 10u, 20u, 30u) : of_channels;
    of_channels = packing == PACKING_RG11B10 ? FIRST(0u, 11u, 22u, 0u) : of_channels;
    of_channels = packing == PACKING_R5G6B5 ? FIRST(11u, 5u, 0u, 0u) : of_channels;
    of_channels = packing == PACKING_A1R5G5B5 ? FIRST(10u, 5u, 0u, 15u) : of_channels;
    return (uvec4(of_channels) >> uvec4(0u, 5u, 10u, 15u)) & 31u;
}

// 1 divided by the number that stands for 1. Written out, because drivers round a division as they like.
vec4 channel_steps(const uint format) {
    uint packing = packing_of(format);
    bool has_sign = numeric_of(format) == NUMERIC_SNORM;
    float step = has_sign ? 1.0 / 127.0 : 1.0 / 255.0;
    step = packing == PACKING_BITS16 ? (has_sign ? 1.0 / 32767.0 : 1.0 / 65535.0) : step;
    step = packing == PACKING_RGB10A2 ? 1.0 / 1023.0 : step;
    bool has_5_bits = packing == PACKING_R5G6B5 || packing == PACKING_A1R5G5B5;
    step = has_5_bits ? 1.0 / 31.0 : step;
    return vec4(step, packing == PACKING_R5G6B5 ? 1.0 / 63.0 : step, step,
                has_5_bits ? 1.0 : (packing == PACKING_RGB10A2 ? 1.0 / 3.0 : step));
}

// The bits of a float's mantissa; all but 32-bit floats have 5 bits of exponent.
uvec4 mantissa_bits(const uint format) {
    return packing_of(format) == PACKING_RG11B10 ? uvec4(6u, 6u, 5u, 5u) : uvec4(10u);
}

// Brings the numbers of the channels, which are at most their masks, into words, and back.
uvec4 pack(const uint format, const uvec4 c) {
    uvec4 s = c << channel_shifts(format);
    uvec2 halves = uvec2(s.r | s.g, s.b | s.a);
    bool is_narrow = packing_of(format) != PACKING_BITS16;
    return packing_of(format) == PACKING_BITS32 ? c : uvec4(halves.x | (is_narrow ? halves.y : 0u), halves.y, 0u, 0u);
}

uvec4 unpack(const uint format, const uvec4 words) {
    uvec4 of_channel = packing_of(format) == PACKING_BITS16 ? words.xxyy : words.xxxx;
    uvec4 numbers = (of_channel >> channel_shifts(format)) & channel_masks(format);
    return packing_of(format) == PACKING_BITS32 ? words : numbers;
}

// The bits of a texel's words that belong to the channels of `mask`, red in its lowest bit.
uvec4 channel_bits(const uint format, const uint mask) {
    uvec4 on = -uvec4(mask & 1u, (mask >> 1) & 1u, (mask >> 2) & 1u, (mask >> 3) & 1u);
    return pack(format, channel_masks(format) & on);
}

// Whether channels may be negative and are no floats.
bool has_sign(const uint format) {
    return numeric_of(format) == NUMERIC_SNORM;
}

// A colour in the limits that Vulkan sets for the format before it is blended or written.
vec4 limited(const uint format, const vec4 c) {
    if (numeric_of(format) == NUMERIC_FLOAT) return c;
    uvec4 signs = has_sign(format) ? floatBitsToUint(c) & 0x80000000u : uvec4(0u);
    return uintBitsToFloat(floatBitsToUint(saturate(has_sign(format) ? abs(c) : c)) | signs);
}

// The words of a texel, of the bits of what a shader writes. Words beyond those of the format hold anything.
uvec4 color_encode(const uint format, const uvec4 bits) {
    uint numeric = numeric_of(format);
    uvec4 masks = channel_masks(format), numbers = bits;
    if (numeric == NUMERIC_UINT) {
        numbers = min(bits, masks);
    } else if (numeric == NUMERIC_SINT) {
        ivec4 most = ivec4(masks >> 1);
        numbers = uvec4(clamp(ivec4(bits), -most - 1, most));
    } else if (numeric != NUMERIC_FLOAT) {
        vec4 c = limited(format, uintBitsToFloat(bits));
        if (numeric == NUMERIC_SRGB) c.rgb = srgb_encode(c.rgb);
        // Floats from 2^23 on are whole numbers: adding 2^23 rounds to the nearest of them, ties to even. 1.5 * 2^23 does so
        // for negative numbers too, and leaves their last bits in place.
        vec4 greatest = vec4(has_sign(format) ? masks >> 1 : masks);
        numbers = floatBitsToUint(c * greatest + (has_sign(format) ? 12582912.0 : 8388608.0));
    } else if (packing_of(format) == PACKING_BITS16) {
        numbers = small_floats(uintBitsToFloat(bits), mantissa_bits(format)) | ((bits >> 16) & 0x8000u);
    } else if (packing_of(format) == PACKING_RG11B10) {
        // These have no sign: negative ones become 0, and NaN stays.
        vec4 c = uintBitsToFloat(bits);
        uvec4 m = mantissa_bits(format), infinity = uvec4(31u) << m;
        numbers = small_floats(mix(c, vec4(0.0), lessThan(c, vec4(0.0))), m);
        // What is finite stays finite.
        bvec4 is_too_large = equal(numbers, infinity);
        numbers -= uvec4(is_too_large) & uvec4(notEqual(bits, uvec4(0x7f800000u)));
    }
    return pack(format, numbers & masks);
}

// The colour of a texel, which holds no integers. A format without alpha is opaque.
vec4 color_decode(const uint format, const uvec4 words) {
    uint numeric = numeric_of(format);
    uvec4 bits = unpack(format, words);
    vec4 c = vec4(bits) * channel_steps(format);
    if (numeric == NUMERIC_SRGB) c.rgb = srgb_decode(c.rgb);
    if (numeric == NUMERIC_SNORM) {
        uvec4 signs = (channel_masks(format) >> 1) + 1u;
        c = max(vec4(ivec4(bits ^ signs) - ivec4(signs)) * channel_steps(format), -1.0);
    }
    if (numeric == NUMERIC_FLOAT) {
        c = uintBitsToFloat(bits);
        if (packing_of(format) == PACKING_RG11B10) c = from_small_floats(bits, mantissa_bits(format));
        if (packing_of(format) == PACKING_BITS16) {
            c = from_small_floats(bits & 0x7fffu, mantissa_bits(format));
            c = uintBitsToFloat(floatBitsToUint(c) | ((bits & 0x8000u) << 16));
        }
    }
    if (channels_of(format) < 4u) c.a = 1.0;
    return c;
}
#endif
