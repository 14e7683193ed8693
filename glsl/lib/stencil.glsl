// The stencil test. `face` has what a piece says of a face at `STENCIL_*`: the comparison and the operations, then the
// reference and the masks.
#ifndef STENCIL_GLSL
#define STENCIL_GLSL
#include "lib/compare.glsl"

// Whether there may be a test.
layout(constant_id = SPEC_STENCIL) const bool STENCIL = false;

// Of a piece without a test.
const uvec2 NO_STENCIL_TEST = uvec2(COMPARE_ALWAYS, 0u);

// Whether some fragment may fail or change the target.
bool is_tested(const uvec2 face) {
    return STENCIL && face.x != COMPARE_ALWAYS;
}

// Whether a fragment passes where the target holds `held`.
bool stencil_passes(const uvec2 face, const uint held) {
    uint mask = (face.y >> STENCIL_COMPARE_MASK_SHIFT) & 255u;
    return compare(face.x, float(face.y & mask), float(held & mask));
}

// What the target holds after the operation whose bits begin at `shift`.
uint stencil_after(const uvec2 face, const uint shift, const uint held) {
    uint operation = (face.x >> shift) & 7u, value = held;
    if (operation == STENCIL_OP_ZERO) value = 0u;
    if (operation == STENCIL_OP_REPLACE) value = face.y & 255u;
    if (operation == STENCIL_OP_INCREMENT_AND_CLAMP) value = min(held + 1u, 255u);
    if (operation == STENCIL_OP_DECREMENT_AND_CLAMP) value = max(held, 1u) - 1u;
    if (operation == STENCIL_OP_INVERT) value = ~held;
    if (operation == STENCIL_OP_INCREMENT_AND_WRAP) value = held + 1u;
    if (operation == STENCIL_OP_DECREMENT_AND_WRAP) value = held - 1u;
    uint written = (face.y >> STENCIL_WRITE_MASK_SHIFT) & 255u;
    return (held & ~written) | (value & written);
}
#endif
