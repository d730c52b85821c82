/* fl_sweeps_i32.h -- a quadratic program with constant data, solved near enough by a fixed number of sweeps, in fixed
 * point: 32-bit values, 64-bit sums, each rounded once to nearest, halves up.
 *
 *     s = slope p;   FL_SWEEPS times:  c = limited s,  y = mix (2 c - s) + push p,  s = s + 7/4 (y - c)
 *
 * p are the parameters of one solve; the first y, limited, times `scale` are the moves. Lions and Mercier, SIAM Journal
 * on Numerical Analysis 16, 1979. Every solve takes the same time. No function here checks for overflow: the generator
 * has proven, from the numbers of this table and the ranges of p, that every sum fits.
 *
 * The file that includes this one gives its sizes, FL_QP_ROWS, FL_QP_WIDTH (the rows filled up to a multiple of 4),
 * FL_QP_PARAMETERS, FL_QP_MOVES, FL_SWEEPS, and the shifts behind its sums, FL_SHIFT_SLOPE, _PUSH, _MIX and _SCALE.
 */
#ifndef FL_SWEEPS_I32_H
#define FL_SWEEPS_I32_H

#include <stdint.h>

typedef struct {
    int32_t slope[FL_QP_ROWS * FL_QP_PARAMETERS]; /* one row after the other */
    int32_t push[FL_QP_ROWS * FL_QP_PARAMETERS];
    int32_t mix[FL_QP_WIDTH * FL_QP_ROWS]; /* symmetric; rows of 0 to fill up */
    int32_t low[FL_QP_ROWS];
    int32_t high[FL_QP_ROWS];
    int32_t scale[FL_QP_MOVES]; /* from the first rows to the moves */
    int32_t least[FL_QP_MOVES]; /* limits of the moves */
    int32_t most[FL_QP_MOVES];
    int32_t reach;     /* s stays within this */
    int32_t tolerance; /* a row that misses its limits by more at the end: the moves are not trusted */
} fl_sweeps_t;

enum { FL_QP_SOLVED = 0, FL_QP_CAPPED = 1, FL_QP_INFEASIBLE = 2 };

typedef struct {
    int32_t move[FL_QP_MOVES];
    int32_t status;
} fl_plan_t;

static inline int32_t fl_sweeps_limited(int64_t x, int32_t low, int32_t high) {
    return (x < low) ? low : ((x > high) ? high : (int32_t)x);
}

static inline int64_t fl_sweeps_half(uint32_t shift) {
    return (int64_t)((uint64_t)1 << (shift - 1U));
}

/* row x / 2^shift */
static inline int64_t fl_sweeps_sum(const int32_t *row, const int32_t *x, uint32_t shift) {
    int64_t sum = fl_sweeps_half(shift);
    for (int32_t k = 0; k < FL_QP_PARAMETERS; k++) {
        sum += (int64_t)row[k] * x[k];
    }
    return sum >> shift;
}

/* y = push + mix x / 2^shift, two rows at a time */
static inline void fl_sweeps_mix(int32_t *y, const int32_t *push, const int32_t *mix, const int32_t *x) {
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 2) {
        const int32_t *row = &mix[i * FL_QP_ROWS];
        const int32_t *other = &row[FL_QP_ROWS];
        int64_t a = fl_sweeps_half(FL_SHIFT_MIX);
        int64_t b = a;
        for (int32_t k = 0; k < FL_QP_ROWS; k++) {
            a += (int64_t)row[k] * x[k];
            b += (int64_t)other[k] * x[k];
        }
        y[i] = push[i] + (int32_t)(a >> FL_SHIFT_MIX);
        y[i + 1] = push[i + 1] + (int32_t)(b >> FL_SHIFT_MIX);
    }
}

static inline fl_plan_t fl_sweeps_i32(const fl_sweeps_t *q, const int32_t *parameters) {
    int32_t s[FL_QP_ROWS];
    int32_t push[FL_QP_WIDTH];
    int32_t y[FL_QP_WIDTH];
    int32_t mirrored[FL_QP_ROWS];
    fl_plan_t plan;
    push[FL_QP_WIDTH - 1] = 0;
    push[FL_QP_WIDTH - 2] = 0;
    push[FL_QP_WIDTH - 3] = 0;
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        const int64_t free = fl_sweeps_sum(&q->slope[i * FL_QP_PARAMETERS], parameters, FL_SHIFT_SLOPE);
        s[i] = fl_sweeps_limited(free, -q->reach, q->reach);
        push[i] = (int32_t)fl_sweeps_sum(&q->push[i * FL_QP_PARAMETERS], parameters, FL_SHIFT_PUSH);
    }
    int32_t times = FL_SWEEPS;
    for (;;) {
        for (int32_t i = 0; i < FL_QP_ROWS; i++) {
            const int32_t c = fl_sweeps_limited(s[i], q->low[i], q->high[i]);
            mirrored[i] = (c + c) - s[i];
        }
        fl_sweeps_mix(y, push, q->mix, mirrored);
        times--;
        if (times == 0) {
            break;
        }
        for (int32_t i = 0; i < FL_QP_ROWS; i++) {
            const int32_t c = fl_sweeps_limited(s[i], q->low[i], q->high[i]);
            s[i] = fl_sweeps_limited(s[i] + ((7 * (y[i] - c) + 2) >> 2), -q->reach, q->reach);
        }
    }
    plan.status = FL_QP_SOLVED;
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        const int32_t missed = y[i] - fl_sweeps_limited(s[i], q->low[i], q->high[i]);
        if ((missed > q->tolerance) || (missed < -q->tolerance)) {
            plan.status = FL_QP_CAPPED;
        }
    }
    for (int32_t i = 0; i < FL_QP_MOVES; i++) {
        const int64_t c = fl_sweeps_limited(y[i], q->low[i], q->high[i]);
        const int64_t move = (c * q->scale[i] + fl_sweeps_half(FL_SHIFT_SCALE)) >> FL_SHIFT_SCALE;
        plan.move[i] = fl_sweeps_limited(move, q->least[i], q->most[i]);
    }
    return plan;
}

#endif
