// A comparison is a sum of COMPARE_LESS, COMPARE_EQUAL and COMPARE_GREATER: the cases that pass. No operand is NaN.
#ifndef COMPARE_GLSL
#define COMPARE_GLSL

bool compare(const uint operation, const float a, const float b) {
    return (operation & ((a < b ? COMPARE_LESS : 0u) | (a == b ? COMPARE_EQUAL : 0u) | (a > b ? COMPARE_GREATER : 0u))) != 0u;
}
#endif
