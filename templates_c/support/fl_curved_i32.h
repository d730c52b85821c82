/* fl_curved_i32.h -- sine, square root and reciprocal in whole numbers: the same bits on every core.
 *
 * A whole turn is 2^32, so that an angle wraps by itself. No intermediate overflows for any argument that is allowed.
 */
#ifndef FL_CURVED_I32_H
#define FL_CURVED_I32_H

#include <stdint.h>

/* The upper word of a product. */
static inline int32_t fl_upper_i32(int32_t a, int32_t b) {
    return (int32_t)(((int64_t)a * b) >> 32U);
}

static inline uint32_t fl_upper_u32(uint32_t a, uint32_t b) {
    return (uint32_t)(((uint64_t)a * b) >> 32U);
}

/* An angle times `factor` / 2^s as share of a whole turn; s from 1 to 32. */
static inline int32_t fl_turn_i32(int32_t a, int32_t factor, uint32_t s) {
    return (int32_t)(uint32_t)((uint64_t)((int64_t)a * factor) >> s);
}

/* The sine of a share of a turn, Q30: mirrored into the quarters beside 0, then a polynomial of order 11. */
static inline int32_t fl_turn_sine_i32(int32_t turn) {
    const uint32_t u = (uint32_t)turn;
    const int32_t y = (int32_t)((((u ^ (u << 1U)) >> 31U) != 0U) ? (0x80000000U - u) : u);
    const int32_t z = (int32_t)(((int64_t)y * y) >> 30U);
    int32_t value = -1879182;
    value = fl_upper_i32(z, value) + 22020091;
    value = fl_upper_i32(z, value) - 160859250;
    value = fl_upper_i32(z, value) + 684554113;
    value = fl_upper_i32(z, value) - 1387197326;
    value = fl_upper_i32(z, value) + 843314857;
    return (int32_t)(((int64_t)y * value) >> 29U);
}

static inline int32_t fl_turn_cosine_i32(int32_t turn) {
    return fl_turn_sine_i32((int32_t)((uint32_t)turn + 0x40000000U));
}

/* sqrt(a 2^s), rounded down; a from 0, s odd and from 1 to 31. Shifts bring `a` to 1/4..1 of 2^31; the reciprocal root
 * of that is a polynomial of order 3, improved by two of Newton's steps. */
static inline int32_t fl_whole_root_i32(int32_t a, uint32_t s) {
    uint32_t m = (uint32_t)a;
    uint32_t k = (31U - s) / 2U;
    if (m < 0x8000U) {
        m <<= 16U;
        k += 8U;
    }
    if (m < 0x800000U) {
        m <<= 8U;
        k += 4U;
    }
    if (m < 0x8000000U) {
        m <<= 4U;
        k += 2U;
    }
    if (m < 0x20000000U) {
        m <<= 2U;
        k += 1U;
    }
    /* Both factors with the other sign: a compiler multiplies words of which it knows that one is not negative, and
     * nothing of the other, in three instructions for one. */
    const int32_t n = -(int32_t)m;
    int32_t start = 654565611;
    start = -836167627 - fl_upper_i32(n, start);
    start = 396673923 - fl_upper_i32(n, start);
    start = fl_upper_i32(n, start) + 104433954;
    uint32_t y = (uint32_t)start << 5U;
    y = (uint32_t)(((uint64_t)y * (0x18000000U - fl_upper_u32(m, fl_upper_u32(y, y)))) >> 28U);
    y = (uint32_t)(((uint64_t)y * (0x18000000U - fl_upper_u32(m, fl_upper_u32(y, y)))) >> 28U);
    return (int32_t)((uint32_t)(((uint64_t)m * y) >> 30U) >> k);
}

/* About 2^(31 + k + j) / x; x / 2^k rounds to 1 to 16 bits. A short division, and one of Newton's steps. */
static inline int32_t fl_inverse_i32(int32_t x, uint32_t k, uint32_t j) {
    const uint32_t few = ((uint32_t)x + (((uint32_t)1 << k) >> 1U)) >> k;
    /* Both factors with the other sign, as above; `left` is that of what is left of 2^(31 + k), over 2^k, rounded down. */
    const int32_t y = (int32_t)(0U - (0x80000000U / few));
    const int64_t reached = (int64_t)(-x) * y;
    const int32_t left = (int32_t)((uint32_t)((uint64_t)(reached - 1) >> k) - 0x7FFFFFFFU);
    return (int32_t)(((int64_t)y * left) >> (31U - j)) - (y * (int32_t)((uint32_t)1 << j));
}

#endif
