/* fl_root.h -- the square root from + - * / alone: the same bits on every core, with or without a square root of its
 * own, whatever its library.
 */
#ifndef FL_ROOT_H
#define FL_ROOT_H

#include <stdint.h>

/* Half the exponent is a root right to 4 %; each of Heron's steps squares that. What is below any normal number, or no
 * number, counts as 0. */
static inline float fl_sqrt_f32(float x) {
    union {
        uint32_t bits;
        float value;
    } root;
    root.value = x;
    root.bits = (root.bits >> 1U) + 0x1FBB4F2EU;
    float r = root.value;
    r = 0.5F * (r + (x / r));
    r = 0.5F * (r + (x / r));
    r = 0.5F * (r + (x / r));
    return (x >= 1.1754944e-38F) ? r : 0.0F;
}

static inline double fl_sqrt_f64(double x) {
    union {
        uint64_t bits;
        double value;
    } root;
    root.value = x;
    root.bits = (root.bits >> 1U) + 0x1FF769E5C0000000U;
    double r = root.value;
    r = 0.5 * (r + (x / r));
    r = 0.5 * (r + (x / r));
    r = 0.5 * (r + (x / r));
    r = 0.5 * (r + (x / r));
    return (x >= 2.2250738585072014e-308) ? r : 0.0;
}

#endif
