// Vertex formats: one component of an attribute from the 32 bits it starts in.
#ifndef ATTRIBUTE_GLSL
#define ATTRIBUTE_GLSL

// Bytes of a component.
uint component_bytes(const uint component) {
    switch (component) {
        case COMPONENT_F32: case COMPONENT_U32: case COMPONENT_I32: return 4u;
        case COMPONENT_U16: case COMPONENT_I16: case COMPONENT_U16_NORM: case COMPONENT_I16_NORM: return 2u;
        default: return 1u;
    }
}

// The bits that the shader sees of a component; the component's bytes are the low ones of `bits`.
uint component_value(const uint component, const uint bits) {
    int low8 = bitfieldExtract(int(bits), 0, 8), low16 = bitfieldExtract(int(bits), 0, 16);
    switch (component) {
        case COMPONENT_U8: return bits & 0xffu;
        case COMPONENT_I8: return uint(low8);
        case COMPONENT_U16: return bits & 0xffffu;
        case COMPONENT_I16: return uint(low16);
        case COMPONENT_U8_NORM: return floatBitsToUint(float(bits & 0xffu) / 255.0);
        case COMPONENT_I8_NORM: return floatBitsToUint(max(float(low8) / 127.0, -1.0));
        case COMPONENT_U16_NORM: return floatBitsToUint(float(bits & 0xffffu) / 65535.0);
        case COMPONENT_I16_NORM: return floatBitsToUint(max(float(low16) / 32767.0, -1.0));
        default: return bits;
    }
}
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

uint attribute_count(const uint location) {
    return (attribute_format(location) >> ATTRIBUTE_COUNT_SHIFT) & 7u;
}
#endif
