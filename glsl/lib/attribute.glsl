// Vertex formats: one component of an attribute from the 32 bits it starts in.
#ifndef ATTRIBUTE_GLSL
#define ATTRIBUTE_GLSL

// Bytes of a component, by `Component` of format.rs.
uint component_bytes(const uint component) {
    switch (component) {
        case 0u: case 5u: case 6u: return 4u;
        case 3u: case 4u: case 9u: case 10u: return 2u;
        default: return 1u;
    }
}

// The bits the shader sees of a component whose bytes are the low ones of `bits`.
uint component_value(const uint component, const uint bits) {
    int low8 = bitfieldExtract(int(bits), 0, 8), low16 = bitfieldExtract(int(bits), 0, 16);
    switch (component) {
        case 1u: return bits & 0xffu;
        case 2u: return uint(low8);
        case 3u: return bits & 0xffffu;
        case 4u: return uint(low16);
        case 7u: return floatBitsToUint(float(bits & 0xffu) / 255.0);
        case 8u: return floatBitsToUint(max(float(low8) / 127.0, -1.0));
        case 9u: return floatBitsToUint(float(bits & 0xffffu) / 65535.0);
        case 10u: return floatBitsToUint(max(float(low16) / 32767.0, -1.0));
        default: return bits;
    }
}
#endif
