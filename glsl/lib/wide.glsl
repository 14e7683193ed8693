// 64-bit integers from 32-bit ones: edge functions need 50 bits, and not every device has int64.
#ifndef WIDE_GLSL
#define WIDE_GLSL

// A signed 64-bit integer: hi * 2^32 + lo.
struct Wide {
    int hi;
    uint lo;
};

Wide wide_product(const int a, const int b) {
    int hi, lo;
    imulExtended(a, b, hi, lo);
    return Wide(hi, uint(lo));
}

Wide wide_subtract(const Wide a, const Wide b) {
    uint borrow = a.lo < b.lo ? 1u : 0u;
    return Wide(a.hi - b.hi - int(borrow), a.lo - b.lo);
}

// Adds a small signed number.
Wide wide_offset(const Wide a, const int b) {
    uint lo = a.lo + uint(b);
    uint carry = lo < a.lo ? 1u : 0u;
    return Wide(a.hi + (b >> 31) + int(carry), lo);
}

// -1, 0 or 1.
int wide_sign(const Wide a) {
    return a.hi < 0 ? -1 : ((a.hi | int(a.lo)) == 0 ? 0 : 1);
}

// floor(a / 2^shift) for 2 <= shift < 32, saturated to -2^30..=2^30.
int wide_shift_saturate(const Wide a, const uint shift) {
    const int limit = 1 << 30;
    // The bits of the result from bit 30 up; the result fits if they are all equal to the sign.
    int top = a.hi >> (shift - 2u);
    int value = int((uint(a.hi) << (32u - shift)) | (a.lo >> shift));
    return top == 0 || top == -1 ? value : (a.hi < 0 ? -limit : limit);
}
#endif
