// Depth formats of fewer bits than a float: the number that a target keeps of a depth in 0..1, and the depth of a number.
#ifndef DEPTH_FORMAT_GLSL
#define DEPTH_FORMAT_GLSL
#include "lib/exact.glsl"

// The nearest number of so many bits, 16 or 24, ties to even.
uint depth_number(const float d, const uint bits) {
    return uint(round_even(d * float((1u << bits) - 1u)));
}

// number / (2^bits - 1), rounded to the nearest float, for every number. With a = number / 2^bits the quotient is
// a + a / 2^bits + a / 4^bits + ...; a little more of the second term does for all that follow.
float number_depth(const uint number, const uint bits) {
    float unit = uintBitsToFloat((127u - bits) << 23), a = float(number) * unit;
    return a + a * unit * (1.0 + 1.0 / 8388608.0);
}
#endif
