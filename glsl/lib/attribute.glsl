// Vertex formats: the values that shaders see of an attribute's components.
//
// Most pipelines have attributes of 32-bit components alone. Vertex kernels for these know no others, so that drivers compile
// them in a fraction of the time; kernels for any format define ANY_FORMAT.
#ifndef ATTRIBUTE_GLSL
#define ATTRIBUTE_GLSL

#ifdef ANY_FORMAT
#include "lib/small_float.glsl"

// Tables are looked up by selections, because drivers for CPUs turn a switch into a dozen branches and compile them all.

bool has_10_bits(const uint packing) {
    return packing == PACKING_RGB10A2 || packing == PACKING_BGR10A2;
}

bool has_5_bits(const uint packing) {
    return packing == PACKING_R5G6B5 || packing == PACKING_A1R5G5B5;
}

// The bytes of a component, or of the word that components share.
uint component_bytes(const uint packing) {
    uint of_packing = packing <= PACKING_BITS32 ? 1u << packing : 4u;
    of_packing = has_5_bits(packing) ? 2u : of_packing;
    return packing == PACKING_BGRA8 ? 1u : of_packing;
}

// The byte of the attribute at which component `c` begins.
uint component_byte(const uint packing, const uint c) {
    uint of_packing = packing <= PACKING_BITS32 ? c << packing : 0u;
    return packing == PACKING_BGRA8 ? (c < 3u ? 2u - c : c) : of_packing;
}

// The bits of each component.
uvec4 component_bits(const uint packing) {
    uvec4 bits = uvec4(packing == PACKING_BITS16 ? 16u : 8u);
    bits = has_10_bits(packing) ? uvec4(10u, 10u, 10u, 2u) : bits;
    bits = packing == PACKING_RG11B10 ? uvec4(11u, 11u, 10u, 0u) : bits;
    bits = packing == PACKING_R5G6B5 ? uvec4(5u, 6u, 5u, 0u) : bits;
    return packing == PACKING_A1R5G5B5 ? uvec4(5u, 5u, 5u, 1u) : bits;
}

// The bit at which each component begins, from the byte of `component_byte` on.
uvec4 component_shifts(const uint packing) {
    uvec4 shifts = packing == PACKING_RGB10A2 ? uvec4(0u, 10u, 20u, 30u) : uvec4(0u);
    shifts = packing == PACKING_BGR10A2 ? uvec4(20u, 10u, 0u, 30u) : shifts;
    shifts = packing == PACKING_RG11B10 ? uvec4(0u, 11u, 22u, 0u) : shifts;
    shifts = packing == PACKING_R5G6B5 ? uvec4(11u, 5u, 0u, 0u) : shifts;
    return packing == PACKING_A1R5G5B5 ? uvec4(10u, 5u, 0u, 15u) : shifts;
}

// 1 divided by the number that stands for 1. Written out, because drivers round a division as they like.
vec4 component_steps(const uint packing, const bool has_sign) {
    float step = has_sign ? 1.0 / 127.0 : 1.0 / 255.0, last = has_sign ? 1.0 : 1.0 / 3.0;
    step = packing == PACKING_BITS16 ? (has_sign ? 1.0 / 32767.0 : 1.0 / 65535.0) : step;
    step = has_10_bits(packing) ? (has_sign ? 1.0 / 511.0 : 1.0 / 1023.0) : step;
    step = has_5_bits(packing) ? 1.0 / 31.0 : step;
    return vec4(step, packing == PACKING_R5G6B5 ? 1.0 / 63.0 : step, step,
                has_5_bits(packing) ? 1.0 : (has_10_bits(packing) ? last : step));
}

// The bits that the shader sees of components. `words` has each component where it begins in memory. The number that stands
// for 1 becomes exactly 1.
uvec4 attribute_decode(const uint numeric, const uint packing, const uvec4 words) {
    uvec4 bits = component_bits(packing), shifts = component_shifts(packing), unused = 32u - bits;
    uvec4 u = (words >> shifts) & ((uvec4(1u) << bits) - 1u);
    ivec4 s = ivec4(words << (unused - shifts)) >> (unused & 31u);
    bool has_sign = numeric == NUMERIC_SNORM || numeric == NUMERIC_SINT || numeric == NUMERIC_SSCALED;
    bool is_scaled = numeric == NUMERIC_USCALED || numeric == NUMERIC_SSCALED;
    vec4 c = has_sign ? vec4(s) : vec4(u);
    vec4 normalized = c * component_steps(packing, has_sign);
    uvec4 value = floatBitsToUint(is_scaled ? c : max(normalized, -1.0));
    bool is_half = packing == PACKING_BITS16;
    vec4 floats = from_small_floats(is_half ? u & 0x7fffu : u, is_half ? uvec4(10u) : uvec4(6u, 6u, 5u, 5u));
    uvec4 signs = is_half ? (u & 0x8000u) << 16 : uvec4(0u);
    value = numeric == NUMERIC_FLOAT ? floatBitsToUint(floats) | signs : value;
    value = numeric == NUMERIC_UINT ? u : value;
    value = numeric == NUMERIC_SINT ? uvec4(s) : value;
    return packing == PACKING_BITS32 ? words : value;
}
#else
uint component_bytes(const uint packing) {
    return 4u;
}

uint component_byte(const uint packing, const uint c) {
    return 4u * c;
}

uvec4 attribute_decode(const uint numeric, const uint packing, const uvec4 words) {
    return words;
}
#endif

// The pipeline's vertex format: for each location a format as SPEC_ATTRIBUTE of abi.rs
// defines it, or 0 if the pipeline has no attribute there.
#define ATTRIBUTE(n) layout(constant_id = SPEC_ATTRIBUTE + n) const uint ATTRIBUTE_##n = 0u;
ATTRIBUTE(0) ATTRIBUTE(1) ATTRIBUTE(2) ATTRIBUTE(3) ATTRIBUTE(4) ATTRIBUTE(5) ATTRIBUTE(6) ATTRIBUTE(7)
ATTRIBUTE(8) ATTRIBUTE(9) ATTRIBUTE(10) ATTRIBUTE(11) ATTRIBUTE(12) ATTRIBUTE(13) ATTRIBUTE(14) ATTRIBUTE(15)
ATTRIBUTE(16) ATTRIBUTE(17) ATTRIBUTE(18) ATTRIBUTE(19) ATTRIBUTE(20) ATTRIBUTE(21) ATTRIBUTE(22) ATTRIBUTE(23)
ATTRIBUTE(24) ATTRIBUTE(25) ATTRIBUTE(26) ATTRIBUTE(27) ATTRIBUTE(28) ATTRIBUTE(29) ATTRIBUTE(30) ATTRIBUTE(31)

uint attribute_format(const uint location) {
    uint formats[MAX_ATTRIBUTES] = uint[](
        ATTRIBUTE_0, ATTRIBUTE_1, ATTRIBUTE_2, ATTRIBUTE_3, ATTRIBUTE_4, ATTRIBUTE_5, ATTRIBUTE_6, ATTRIBUTE_7,
        ATTRIBUTE_8, ATTRIBUTE_9, ATTRIBUTE_10, ATTRIBUTE_11, ATTRIBUTE_12, ATTRIBUTE_13, ATTRIBUTE_14, ATTRIBUTE_15,
        ATTRIBUTE_16, ATTRIBUTE_17, ATTRIBUTE_18, ATTRIBUTE_19, ATTRIBUTE_20, ATTRIBUTE_21, ATTRIBUTE_22, ATTRIBUTE_23,
        ATTRIBUTE_24, ATTRIBUTE_25, ATTRIBUTE_26, ATTRIBUTE_27, ATTRIBUTE_28, ATTRIBUTE_29, ATTRIBUTE_30, ATTRIBUTE_31);
    return formats[location];
}

uint attribute_numeric(const uint location) {
    return attribute_format(location) & ((1u << ATTRIBUTE_PACKING_SHIFT) - 1u);
}

uint attribute_packing(const uint location) {
    return (attribute_format(location) >> ATTRIBUTE_PACKING_SHIFT) & ((1u << (ATTRIBUTE_COUNT_SHIFT - ATTRIBUTE_PACKING_SHIFT)) - 1u);
}

uint attribute_count(const uint location) {
    return (attribute_format(location) >> ATTRIBUTE_COUNT_SHIFT) & 7u;
}
#endif
