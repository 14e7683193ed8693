// Floats of 5 bits of exponent: halves, and the channels of packed floats.
#ifndef SMALL_FLOAT_GLSL
#define SMALL_FLOAT_GLSL

// Floats without their signs, as ones of 5 bits of exponent and `bits` bits of mantissa, 10 in a half: the nearest ones, ties
// to even. Drivers round `packHalf2x16` as they like, and one makes not-a-number of infinity.
uvec4 small_floats(const vec4 values, const uvec4 bits) {
    uvec4 all = floatBitsToUint(values) & 0x7fffffffu, last = 23u - bits;
    uvec4 rounded = (all - 0x38000000u + (uvec4(1u) << (last - 1u)) - 1u + ((all >> last) & 1u)) >> last;
    // Below the normal ones, 2^-14, a step is 2^-14 / 2^bits. Adding 2^23 rounds to whole steps.
    uvec4 steps = floatBitsToUint(uintBitsToFloat(all) * vec4(uvec4(16384u) << bits) + 8388608.0) & 0x7fffffu;
    uvec4 numbers = mix(min(rounded, uvec4(31u) << bits), steps, lessThan(all, uvec4(0x38800000u)));
    return mix(numbers, (uvec4(63u) << bits) >> 1, greaterThan(all, uvec4(0x7f800000u)));
}

vec4 from_small_floats(const uvec4 small, const uvec4 bits) {
    uvec4 exponents = small >> bits, bias = mix(uvec4(0x38000000u), uvec4(0x70000000u), equal(exponents, uvec4(31u)));
    vec4 normal = uintBitsToFloat((small << (23u - bits)) + bias);
    return mix(normal, vec4(small) * uintBitsToFloat((113u - bits) << 23), equal(exponents, uvec4(0u)));
}
#endif
