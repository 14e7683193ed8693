// The key of a triangle: its primitive's number in the batch, from 1, and which of the parts that
// clipping made of it. Keys compare in API order; 0 is nothing.
#ifndef KEY_GLSL
#define KEY_GLSL

uint key_of(const uint primitive, const uint part) {
    return ((primitive + 1u) << KEY_LOG2) | part;
}

// Where the triangle of `key` lies in the triangle buffer: the first part of each primitive at the
// primitive's number, the other parts in a region of their own.
uint key_triangle(const uint key, const uint extra_first) {
    uint primitive = (key >> KEY_LOG2) - 1u;
    uint part = key & ((1u << KEY_LOG2) - 1u);
    return part == 0u ? primitive : extra_first + primitive * (MAX_CLIPPED - 1u) + part - 1u;
}
#endif
