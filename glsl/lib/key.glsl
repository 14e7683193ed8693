// The key of a triangle: the number of its primitive in the batch, from 1, and the number of the triangle
// among those that clipping made of the primitive. Keys compare in API order; the key 0 means no triangle.
#ifndef KEY_GLSL
#define KEY_GLSL

uint key_of(const uint primitive, const uint part) {
    return ((primitive + 1u) << KEY_LOG2) | part;
}

// The index of the triangle of `key` in the triangle buffer of a batch of so many primitives. The first triangles of all
// primitives come first, then their second ones, which clipping added, and so on.
uint key_triangle(const uint key, const uint primitives) {
    uint primitive = (key >> KEY_LOG2) - 1u;
    uint part = key & ((1u << KEY_LOG2) - 1u);
    return part * primitives + primitive;
}
#endif
