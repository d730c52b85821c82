/* fl_float.h -- the few functions floating-point controllers need beside + - * and comparison.
 *
 * Each names its operand order, because it decides what happens to a NaN: fl_clamp turns it into `low`.
 */
#ifndef FL_FLOAT_H
#define FL_FLOAT_H

#include <stdint.h>

static inline float fl_min_f32(float a, float b)
{
    return (a < b) ? a : b;
}

static inline float fl_max_f32(float a, float b)
{
    return (a > b) ? a : b;
}

static inline float fl_clamp_f32(float x, float low, float high)
{
    return (x >= low) ? ((x > high) ? high : x) : low;
}

/* Whether fl_clamp changes `x`, or `x` is not a number. */
static inline int32_t fl_outside_f32(float x, float low, float high)
{
    return (x >= low) ? ((x > high) ? 1 : 0) : 1;
}

/* The limit that `x` is beyond where fl_outside holds; `low` for what is not a number. */
static inline float fl_beyond_f32(float x, float low, float high)
{
    return (x >= low) ? high : low;
}

/* Whether `a` is not a number. */
static inline int32_t fl_none_f32(float a)
{
    return (a == a) ? 0 : 1;
}

/* Whether `a` is not a number, or infinite. */
static inline int32_t fl_lost_f32(float a)
{
    const float none = a - a;
    return (none == none) ? 0 : 1;
}

/* Not a number: what a controller holds until its first sample. */
static inline float fl_unset_f32(void)
{
    const float zero = 0.0F;
    return zero / zero;
}

static inline float fl_abs_f32(float a)
{
    return (a < 0.0F) ? -a : a;
}

static inline double fl_min_f64(double a, double b)
{
    return (a < b) ? a : b;
}

static inline double fl_max_f64(double a, double b)
{
    return (a > b) ? a : b;
}

static inline double fl_clamp_f64(double x, double low, double high)
{
    return (x >= low) ? ((x > high) ? high : x) : low;
}

/* Whether fl_clamp changes `x`, or `x` is not a number. */
static inline int32_t fl_outside_f64(double x, double low, double high)
{
    return (x >= low) ? ((x > high) ? 1 : 0) : 1;
}

/* The limit that `x` is beyond where fl_outside holds; `low` for what is not a number. */
static inline double fl_beyond_f64(double x, double low, double high)
{
    return (x >= low) ? high : low;
}

/* Whether `a` is not a number. */
static inline int32_t fl_none_f64(double a)
{
    return (a == a) ? 0 : 1;
}

/* Whether `a` is not a number, or infinite. */
static inline int32_t fl_lost_f64(double a)
{
    const double none = a - a;
    return (none == none) ? 0 : 1;
}

/* Not a number: what a controller holds until its first sample. */
static inline double fl_unset_f64(void)
{
    const double zero = 0.0;
    return zero / zero;
}

static inline double fl_abs_f64(double a)
{
    return (a < 0.0) ? -a : a;
}

#endif
