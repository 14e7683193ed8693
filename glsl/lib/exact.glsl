// Arithmetic that gives the same bits on every device and on the CPU. Vulkan requires correctly rounded
// float addition, subtraction and multiplication, and the build forbids contraction. But a division may be
// wrong by 2.5 ULP, and a fused multiply-add may or may not be fused; so both are made here of exact
// operations. Floats become integers by their bits, not by a conversion: its rules for numbers out of range
// cost CPUs a dozen instructions for each number of a vector.
#ifndef EXACT_GLSL
#define EXACT_GLSL

// Denormals are zero here, because devices may flush them.
float flush(const float a) {
    return (floatBitsToUint(a) & 0x7f800000u) == 0u ? 0.0 : a;
}

// a / b, rounded to nearest even, for normal or zero `a` and normal `b`. Results too small for a
// normal number are zero, too large ones infinite. The device's own division is a first guess whose
// last bits an integer remainder corrects.
float exact_divide(const float a, const float b) {
    uint ua = floatBitsToUint(a), ub = floatBitsToUint(b);
    uint sign = (ua ^ ub) & 0x80000000u;
    int exponent = int((ua >> 23) & 0xffu) - int((ub >> 23) & 0xffu) + 127;
    uint ma = (ua & 0x7fffffu) | 0x800000u, mb = (ub & 0x7fffffu) | 0x800000u;
    if (ma < mb) {
        ma <<= 1;
        exponent -= 1;
    }
    // quotient = floor(ma * 2^24 / mb), 25 bits. The guess is within 5 of it, 2.5 ULP of 2; 7 less is
    // surely below, and the remainder modulo 2^32 is then the true one.
    uint guess = floatBitsToUint(float(int(ma)) / float(int(mb)) * 16777216.0); // an integer from 2^23 on
    uint quotient = (((guess & 0x7fffffu) | 0x800000u) << ((guess >> 23) - 150u)) - 7u;
    uint remainder = (ma << 24) - quotient * mb;
    [[unroll]] for (uint step = 8u; step > 0u; step >>= 1) {
        bool enough = remainder >= step * mb;
        remainder -= enough ? step * mb : 0u;
        quotient += enough ? step : 0u;
    }
    uint mantissa = quotient >> 1;
    mantissa += quotient & (mantissa | (remainder != 0u ? 1u : 0u)) & 1u;
    uint bits = (uint(exponent) << 23) + mantissa - 0x800000u;
    bits = exponent <= 0 ? 0u : (exponent >= 255 ? 0x7f800000u : bits);
    return (ua & 0x7f800000u) == 0u ? 0.0 : uintBitsToFloat(bits | sign);
}

// The root of `a`, which is normal and positive, rounded to nearest. The device's own root is a guess whose last bits an integer
// remainder corrects.
float exact_sqrt(const float a) {
    uint bits = floatBitsToUint(a), exponent = bits >> 23, mantissa = (bits & 0x7fffffu) | 0x800000u;
    // a = mantissa * 2^(exponent - 150) = (mantissa << shift) * 4^half, and the root of the integer has 25 bits.
    uint shift = 26u - (exponent & 1u);
    int halved = (int(exponent) - 150 - int(shift)) / 2;
    // 12 less than the guess is surely below, and the remainder modulo 2^32 is then the true one.
    uint root = uint(sqrt(float(int(mantissa)) * float(1u << shift))) - 12u;
    uint remainder = (mantissa << shift) - root * root;
    for (uint n = 0u; n < 32u && remainder > 2u * root; n++) {
        remainder -= 2u * root + 1u;
        root += 1u;
    }
    uint rounded = root >> 1;
    rounded += root & (rounded | (remainder != 0u ? 1u : 0u)) & 1u;
    return uintBitsToFloat((uint(halved + 151) << 23) + rounded - 0x800000u);
}

// a * b + c with the product's and the sum's rounding errors added back: a fused multiply-add but
// for double rounding in rare ties. Products by Dekker, sums by Knuth.
float multiply_add(const float a, const float b, const float c) {
    float ta = 4097.0 * a, tb = 4097.0 * b;
    float ah = ta - (ta - a), bh = tb - (tb - b);
    float al = a - ah, bl = b - bh;
    float p = a * b;
    float product_error = ((ah * bh - p) + ah * bl + al * bh) + al * bl;
    float s = p + c;
    float part = s - p;
    float sum_error = (p - (s - part)) + (c - part);
    return s + (sum_error + product_error);
}

// The nearest integer, ties to even, for |a| < 2^24.
int round_even(const float a) {
    // The last place of a float from 2^23 on is 1; those of `a` itself are whole from there.
    float size = abs(a);
    uint rounded = floatBitsToUint(size + 8388608.0) - 0x4b000000u;
    uint whole = (floatBitsToUint(size) & 0x7fffffu) | 0x800000u;
    int magnitude = int(size < 8388608.0 ? rounded : whole);
    return a < 0.0 ? -magnitude : magnitude;
}
#endif
