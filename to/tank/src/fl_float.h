/* fl_float.h -- the few functions floating-point controllers need beside + - * / and comparison.
 *
 * Each names its operand order, because it decides what happens to a NaN: fl_clamp turns it into `low`.
 */
#ifndef FL_FLOAT_H
#define FL_FLOAT_H

#include <stdint.h>

static inline float fl_min_f32(float a, float b) {
    return (a < b) ? a : b;
}

static inline float fl_max_f32(float a, float b) {
    return (a > b) ? a : b;
}

static inline float fl_clamp_f32(float x, float low, float high) {
    return (x >= low) ? ((x > high) ? high : x) : low;
}

/* Whether fl_clamp changes `x`, or `x` is not a number. */
static inline int32_t fl_outside_f32(float x, float low, float high) {
    return (x >= low) ? ((x > high) ? 1 : 0) : 1;
}

/* The limit that `x` is beyond where fl_outside holds; `low` for what is not a number. */
static inline float fl_beyond_f32(float x, float low, float high) {
    return (x >= low) ? high : low;
}

/* Whether `a` is not a number. */
static inline int32_t fl_none_f32(float a) {
    return (a == a) ? 0 : 1;
}

/* 0, or not a number where `a` or `b` is not a number or infinite. */
static inline float fl_nought_f32(float a, float b) {
    return (a - a) * b;
}

/* Whether `a` is not a number, or infinite. */
static inline int32_t fl_lost_f32(float a) {
    const float none = a - a;
    return (none == none) ? 0 : 1;
}

/* Not a number: what a controller holds until its first sample. */
static inline float fl_unset_f32(void) {
    union {
        float value;
        uint32_t bits;
    } none;
    none.bits = 0xFFFFFFFFU;
    return none.value;
}

static inline float fl_abs_f32(float a) {
    return (a < 0.0F) ? -a : a;
}

/* The sine of x + ahead pi/2, in rad: pi/2 is subtracted in parts, a Taylor polynomial gives the rest. */
static inline float fl_wave_f32(float x, uint32_t ahead) {
    union {
        float value;
        uint32_t bits;
    } nearest; /* whole number, beside what makes its last bit that of the word */
    nearest.value = (x * 0.63661975F) + 1.2582912e+07F;
    const uint32_t quarter = (nearest.bits + ahead) & 3U;
    const float k = nearest.value - 1.2582912e+07F;
    const float r = ((x - (k * 1.5703125F)) - (k * 0.0004837513F)) - (k * 7.54979e-08F);
    const float z = r * r;
    float value;
    if ((quarter & 1U) != 0U) {
        value = 2.4801588e-05F;
        value = (value * z) - 0.0013888889F;
        value = (value * z) + 0.041666668F;
        value = (value * z) - 0.5F;
        value = 1.0F + (z * value);
    } else {
        value = 2.7557319e-06F;
        value = (value * z) - 0.0001984127F;
        value = (value * z) + 0.008333334F;
        value = (value * z) - 0.16666667F;
        value = r + (r * (z * value));
    }
    return ((quarter & 2U) != 0U) ? -value : value;
}

static inline float fl_sin_f32(float x) {
    return fl_wave_f32(x, 0U);
}

static inline float fl_cos_f32(float x) {
    return fl_wave_f32(x, 1U);
}

/* e^x; x is limited to what has a normal result. */
static inline float fl_exp_f32(float x) {
    const float within = fl_clamp_f32(x, -87.0F, 88.0F);
    const float k = ((within * 1.442695F) + 1.2582912e+07F) - 1.2582912e+07F;
    const float r = (within - (k * 0.69311523F)) - (k * 3.1946183e-05F);
    float value;
    value = 0.0001984127F;
    value = (value * r) + 0.0013888889F;
    value = (value * r) + 0.008333334F;
    value = (value * r) + 0.041666668F;
    value = (value * r) + 0.16666667F;
    value = (value * r) + 0.5F;
    union {
        uint32_t bits;
        float value;
    } power; /* 2^k */
    const int32_t exponent = (int32_t)k + 127;
    power.bits = (uint32_t)exponent << 23U;
    return (1.0F + (r + (r * (r * value)))) * power.value;
}

static inline float fl_tanh_f32(float x) {
    const float within = fl_clamp_f32(x, -10.0F, 10.0F);
    return 1.0F - (2.0F / (fl_exp_f32(within + within) + 1.0F));
}

static inline double fl_min_f64(double a, double b) {
    return (a < b) ? a : b;
}

static inline double fl_max_f64(double a, double b) {
    return (a > b) ? a : b;
}

static inline double fl_clamp_f64(double x, double low, double high) {
    return (x >= low) ? ((x > high) ? high : x) : low;
}

/* Whether fl_clamp changes `x`, or `x` is not a number. */
static inline int32_t fl_outside_f64(double x, double low, double high) {
    return (x >= low) ? ((x > high) ? 1 : 0) : 1;
}

/* The limit that `x` is beyond where fl_outside holds; `low` for what is not a number. */
static inline double fl_beyond_f64(double x, double low, double high) {
    return (x >= low) ? high : low;
}

/* Whether `a` is not a number. */
static inline int32_t fl_none_f64(double a) {
    return (a == a) ? 0 : 1;
}

/* 0, or not a number where `a` or `b` is not a number or infinite. */
static inline double fl_nought_f64(double a, double b) {
    return (a - a) * b;
}

/* Whether `a` is not a number, or infinite. */
static inline int32_t fl_lost_f64(double a) {
    const double none = a - a;
    return (none == none) ? 0 : 1;
}

/* Not a number: what a controller holds until its first sample. */
static inline double fl_unset_f64(void) {
    union {
        double value;
        uint64_t bits;
    } none;
    none.bits = 0xFFFFFFFFFFFFFFFFU;
    return none.value;
}

static inline double fl_abs_f64(double a) {
    return (a < 0.0) ? -a : a;
}

/* The sine of x + ahead pi/2, in rad: pi/2 is subtracted in parts, a Taylor polynomial gives the rest. */
static inline double fl_wave_f64(double x, uint64_t ahead) {
    union {
        double value;
        uint64_t bits;
    } nearest; /* whole number, beside what makes its last bit that of the word */
    nearest.value = (x * 0.6366197723675814) + 6755399441055744.0;
    const uint64_t quarter = (nearest.bits + ahead) & 3U;
    const double k = nearest.value - 6755399441055744.0;
    const double r = ((x - (k * 1.5707963267341256)) - (k * 6.077100506303966e-11)) - (k * 2.0222662487959506e-21);
    const double z = r * r;
    double value;
    if ((quarter & 1U) != 0U) {
        value = 4.779477332387385e-14;
        value = (value * z) - 1.1470745597729725e-11;
        value = (value * z) + 2.08767569878681e-09;
        value = (value * z) - 2.755731922398589e-07;
        value = (value * z) + 2.48015873015873e-05;
        value = (value * z) - 0.001388888888888889;
        value = (value * z) + 0.041666666666666664;
        value = (value * z) - 0.5;
        value = (0.75 + (z * value)) + 0.25; /* libgcc of Cortex-M rounds 1 - x wrongly for x about 2^-33 */
    } else {
        value = 2.8114572543455206e-15;
        value = (value * z) - 7.647163731819816e-13;
        value = (value * z) + 1.6059043836821613e-10;
        value = (value * z) - 2.505210838544172e-08;
        value = (value * z) + 2.7557319223985893e-06;
        value = (value * z) - 0.0001984126984126984;
        value = (value * z) + 0.008333333333333333;
        value = (value * z) - 0.16666666666666666;
        value = r + (r * (z * value));
    }
    return ((quarter & 2U) != 0U) ? -value : value;
}

static inline double fl_sin_f64(double x) {
    return fl_wave_f64(x, 0U);
}

static inline double fl_cos_f64(double x) {
    return fl_wave_f64(x, 1U);
}

/* e^x; x is limited to what has a normal result. */
static inline double fl_exp_f64(double x) {
    const double within = fl_clamp_f64(x, -708.0, 709.0);
    const double k = ((within * 1.4426950408889634) + 6755399441055744.0) - 6755399441055744.0;
    const double r = (within - (k * 0.6931471805592082)) - (k * 7.371002565167799e-13);
    double value;
    value = 1.6059043836821613e-10;
    value = (value * r) + 2.08767569878681e-09;
    value = (value * r) + 2.505210838544172e-08;
    value = (value * r) + 2.755731922398589e-07;
    value = (value * r) + 2.7557319223985893e-06;
    value = (value * r) + 2.48015873015873e-05;
    value = (value * r) + 0.0001984126984126984;
    value = (value * r) + 0.001388888888888889;
    value = (value * r) + 0.008333333333333333;
    value = (value * r) + 0.041666666666666664;
    value = (value * r) + 0.16666666666666666;
    value = (value * r) + 0.5;
    union {
        uint64_t bits;
        double value;
    } power; /* 2^k */
    const int32_t exponent = (int32_t)k + 1023;
    power.bits = (uint64_t)exponent << 52U;
    return (1.0 + (r + (r * (r * value)))) * power.value;
}

static inline double fl_tanh_f64(double x) {
    const double within = fl_clamp_f64(x, -20.0, 20.0);
    return (0.75 - (2.0 / (fl_exp_f64(within + within) + 1.0))) + 0.25; /* as above */
}

#endif
