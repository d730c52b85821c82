/* fl_fixed.h -- the arithmetic of fixed-point controllers: 32-bit values, proven ranges, one rounding each.
 *
 * No function here checks for overflow: the generator has proven for every call that the result fits.
 */
#ifndef FL_FIXED_H
#define FL_FIXED_H

#include <stdint.h>

/* The shifts below need an arithmetic right shift of negative numbers, which C99 leaves to the compiler. */
typedef char fl_assert_arithmetic_shift[((-3) >> 1) == -2 ? 1 : -1];

/* a * 2^s; s from 0 to 30, the result fits. */
static inline int32_t fl_shl_i32(int32_t a, uint32_t s)
{
    return a * (int32_t)((uint32_t)1 << s);
}

/* a / 2^s, rounded to nearest, halves up; s from 1 to 30, a + 2^(s-1) fits. */
static inline int32_t fl_shr_i32(int32_t a, uint32_t s)
{
    return (a + (int32_t)((uint32_t)1 << (s - 1U))) >> s;
}

/* a * b / 2^s in 64 bits, rounded to nearest, halves up; s from 1 to 62, the result fits 32 bits. */
static inline int32_t fl_mul_shift_i32(int32_t a, int32_t b, uint32_t s)
{
    return (int32_t)(((int64_t)a * b + (int64_t)((uint64_t)1 << (s - 1U))) >> s);
}

/* a * b / 2^s in 64 bits, rounded down; s from 1 to 62, the result fits 32 bits. */
static inline int32_t fl_mul_down_i32(int32_t a, int32_t b, uint32_t s)
{
    return (int32_t)(((int64_t)a * b) >> s);
}

/* a / 2^s, rounded down; s from 1 to 31. */
static inline int32_t fl_asr_i32(int32_t a, uint32_t s)
{
    return a >> s;
}

/* A sum of products, rounded once: it starts as a * 2^s and the half that rounds it, s from 1 to 62; ... */
static inline int64_t fl_acc_i64(int32_t a, uint32_t s)
{
    const uint64_t power = (uint64_t)1 << s;
    const int64_t one = (int64_t)power;
    return (a * one) + (one / 2);
}

/* The start of one that is rounded down. */
static inline int64_t fl_acc_down_i64(int32_t a, uint32_t s)
{
    const uint64_t power = (uint64_t)1 << s;
    return a * (int64_t)power;
}

/* ... then come the products, each as it is; ... */
static inline int64_t fl_mac_i64(int64_t acc, int32_t a, int32_t b)
{
    return acc + (int64_t)a * b;
}

/* ... and sum / 2^s is its value, rounded as it was started; it fits 32 bits. */
static inline int32_t fl_high_i32(int64_t acc, uint32_t s)
{
    return (int32_t)(acc >> s);
}

static inline int32_t fl_min_i32(int32_t a, int32_t b)
{
    return (a < b) ? a : b;
}

static inline int32_t fl_max_i32(int32_t a, int32_t b)
{
    return (a > b) ? a : b;
}

static inline int32_t fl_clamp_i32(int32_t x, int32_t low, int32_t high)
{
    return fl_min_i32(fl_max_i32(x, low), high);
}

static inline int32_t fl_abs_i32(int32_t a)
{
    return (a < 0) ? -a : a;
}

#endif
