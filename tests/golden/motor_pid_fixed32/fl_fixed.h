/* fl_fixed.h -- the arithmetic of fixed-point controllers: 32-bit values, proven ranges, one rounding each.
 *
 * No function here checks for overflow: the generator has proven for every call that the result fits.
 */
#ifndef FL_FIXED_H
#define FL_FIXED_H

#include <stdint.h>

#if defined(__ARM_FEATURE_SAT) && defined(__has_builtin)
#if __has_builtin(__builtin_arm_ssat)
#define FL_SSAT
#endif
#endif

/* Arm cores with these instructions multiply, round and add in one, which no compiler does by itself; likewise with a
 * number of 16 bits, which they need not widen. */
#if defined(__ARM_FEATURE_SIMD32) && defined(__GNUC__)
#define FL_SMMLAR
#endif

/* The shifts below need an arithmetic right shift of negative numbers, which C99 leaves to the compiler. */
typedef char fl_assert_arithmetic_shift[((-3) >> 1) == -2 ? 1 : -1];
/* ... and the conversion below keeps the lower 32 bits, which C99 leaves to it too. */
typedef char fl_assert_wrapping_conversion[(int32_t)0xFFFFFFFEU == -2 ? 1 : -1];

/* x / 2^s, rounded down; s from 1 to 62, the result fits 32 bits. Up to 32 its bits are those of an unsigned shift,
 * behind which a compiler still sees a 32-bit number: the next product is then one instruction, not three. */
static inline int32_t fl_low_i32(int64_t x, uint32_t s) {
    return (s <= 32U) ? (int32_t)(uint32_t)((uint64_t)x >> s) : (int32_t)(x >> s);
}

/* a * 2^s; s from 0 to 30, the result fits. */
static inline int32_t fl_shl_i32(int32_t a, uint32_t s) {
    return a * (int32_t)((uint32_t)1 << s);
}

/* a / 2^s, rounded to nearest, halves up; s from 1 to 30, a + 2^(s-1) fits. */
static inline int32_t fl_shr_i32(int32_t a, uint32_t s) {
    return (a + (int32_t)((uint32_t)1 << (s - 1U))) >> s;
}

/* a * b / 2^s in 64 bits, rounded down; s from 1 to 62, the result fits 32 bits. */
static inline int32_t fl_mul_down_i32(int32_t a, int32_t b, uint32_t s) {
    return fl_low_i32((int64_t)a * b, s);
}

/* a / 2^s, rounded down; s from 1 to 31. */
static inline int32_t fl_asr_i32(int32_t a, uint32_t s) {
    return a >> s;
}

/* x read as a number of 32 - s bits: what is above them is left out; s from 1 to 31. */
static inline int32_t fl_wrap_i32(int32_t x, uint32_t s) {
    return (int32_t)((uint32_t)x << s) >> s;
}

/* A sum of products, rounded once: it starts as a product, ... */
static inline int64_t fl_wide_i64(int32_t a, int32_t b) {
    return (int64_t)a * b;
}

/* ... then come the others; ... */
static inline int64_t fl_mac_i64(int64_t acc, int32_t a, int32_t b) {
    return acc + (int64_t)a * b;
}

/* ... and sum / 2^s is its value, rounded down; s from 1 to 62, it fits 32 bits; ... */
static inline int32_t fl_down_i32(int64_t acc, uint32_t s) {
    return fl_low_i32(acc, s);
}

/* ... or rounded to nearest, halves up; s from 1 to 62, it fits 32 bits. The half that rounds
 * is the last bit that is shifted out: so it costs nothing beside an addition. */
static inline int32_t fl_high_i32(int64_t acc, uint32_t s) {
    return fl_low_i32(acc, s) + (int32_t)((uint32_t)((uint64_t)acc >> (s - 1U)) & 1U);
}

/* a * b / 2^s in 64 bits, rounded to nearest, halves up; s from 1 to 62, the result fits 32 bits. */
static inline int32_t fl_mul_shift_i32(int32_t a, int32_t b, uint32_t s) {
#if defined(FL_SMMLAR)
    if (s == 32U) {
        int32_t high;
        __asm__("smmulr %0, %1, %2" : "=r"(high) : "r"(a), "r"(b));
        return high;
    }
#endif
    return fl_high_i32((int64_t)a * b, s);
}

/* first + a * b / 2^32, the product rounded to nearest, halves up; the result fits 32 bits. Other Arm cores add both in
 * the 64 bits of one instruction, cores without it behind the product. */
static inline int32_t fl_mul_add_i32(int32_t first, int32_t a, int32_t b) {
#if defined(FL_SMMLAR)
    int32_t sum;
    __asm__("smmlar %0, %1, %2, %3" : "=r"(sum) : "r"(a), "r"(b), "r"(first));
    return sum;
#elif defined(__ARM_ARCH_ISA_THUMB) && (__ARM_ARCH_ISA_THUMB == 2)
    return fl_low_i32((((int64_t)first * 4294967296) | 0x80000000) + ((int64_t)a * b), 32U);
#else
    return first + fl_mul_shift_i32(a, b, 32U);
#endif
}

/* first + x * b / 2^16, the product rounded down; x is a number of 16 bits, the result fits 32 bits. With 0 a core has
 * an instruction of its own. */
static inline int32_t fl_mul_add_short_i32(int32_t first, int32_t x, int32_t b) {
#if defined(FL_SMMLAR)
    int32_t sum;
    if (__builtin_constant_p(first) && first == 0) {
        __asm__("smulwb %0, %1, %2" : "=r"(sum) : "r"(b), "r"(x));
    } else {
        __asm__("smlawb %0, %1, %2, %3" : "=r"(sum) : "r"(b), "r"(x), "r"(first));
    }
    return sum;
#elif defined(__ARM_ARCH_ISA_THUMB) && (__ARM_ARCH_ISA_THUMB == 2)
    return fl_low_i32(((int64_t)first * 4294967296) + ((int64_t)(x * 65536) * b), 32U);
#else
    return first + fl_low_i32((int64_t)(x * 65536) * b, 32U);
#endif
}

static inline int32_t fl_min_i32(int32_t a, int32_t b) {
    return (a < b) ? a : b;
}

static inline int32_t fl_max_i32(int32_t a, int32_t b) {
    return (a > b) ? a : b;
}

/* Where the range is all that a number of some bits can hold, an Arm core may have one instruction for it. Compilers
 * know that, but not where two such limits stand in one function: they then keep the limits in registers and compare. */
static inline int32_t fl_clamp_i32(int32_t x, int32_t low, int32_t high) {
    int32_t limited = fl_min_i32(fl_max_i32(x, low), high);
#if defined(FL_SSAT)
    if (low == (-high - 1)) {
        switch (high) {
            case 0x3FFFFFFF: limited = (int32_t)__builtin_arm_ssat(x, 31); break;
            case 0x1FFFFFFF: limited = (int32_t)__builtin_arm_ssat(x, 30); break;
            case 0x0FFFFFFF: limited = (int32_t)__builtin_arm_ssat(x, 29); break;
            case 0x07FFFFFF: limited = (int32_t)__builtin_arm_ssat(x, 28); break;
            case 0x03FFFFFF: limited = (int32_t)__builtin_arm_ssat(x, 27); break;
            case 0x01FFFFFF: limited = (int32_t)__builtin_arm_ssat(x, 26); break;
            case 0x00FFFFFF: limited = (int32_t)__builtin_arm_ssat(x, 25); break;
            case 0x007FFFFF: limited = (int32_t)__builtin_arm_ssat(x, 24); break;
            case 0x003FFFFF: limited = (int32_t)__builtin_arm_ssat(x, 23); break;
            case 0x001FFFFF: limited = (int32_t)__builtin_arm_ssat(x, 22); break;
            case 0x000FFFFF: limited = (int32_t)__builtin_arm_ssat(x, 21); break;
            case 0x0007FFFF: limited = (int32_t)__builtin_arm_ssat(x, 20); break;
            case 0x0003FFFF: limited = (int32_t)__builtin_arm_ssat(x, 19); break;
            case 0x0001FFFF: limited = (int32_t)__builtin_arm_ssat(x, 18); break;
            case 0x0000FFFF: limited = (int32_t)__builtin_arm_ssat(x, 17); break;
            default: break;
        }
    }
#endif
    return limited;
}

static inline int32_t fl_abs_i32(int32_t a) {
    return (a < 0) ? -a : a;
}

#endif
