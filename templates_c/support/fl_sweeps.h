/* fl_sweeps.h -- a quadratic program with constant data, solved near enough by a fixed number of sweeps.
 *
 *     s = slope p;   FL_SWEEPS times:  c = limited s,  y = mix (2 c - s) + push p,  s = s + 7/4 (y - c)
 *
 * p are the parameters of one solve; the first y, limited, times `scale` are the moves. Lions and Mercier, SIAM Journal
 * on Numerical Analysis 16, 1979. Every solve takes the same time. No product is added before it is rounded.
 *
 * The file that includes this one gives its sizes, FL_QP_ROWS, FL_QP_WIDTH (the rows filled up to a multiple of 4),
 * FL_QP_PARAMETERS, FL_QP_MOVES, FL_SWEEPS, and the type fl_real.
 */
#ifndef FL_SWEEPS_H
#define FL_SWEEPS_H

#include <stdint.h>

typedef struct {
    fl_real slope[FL_QP_PARAMETERS * FL_QP_WIDTH]; /* one parameter after the other */
    fl_real push[FL_QP_PARAMETERS * FL_QP_WIDTH];
    fl_real mix[FL_QP_ROWS * FL_QP_WIDTH]; /* symmetric */
    fl_real low[FL_QP_ROWS];
    fl_real high[FL_QP_ROWS];
    fl_real scale[FL_QP_MOVES]; /* from the first rows to the moves */
    fl_real reach;              /* s stays within this */
    fl_real tolerance;          /* a row that misses its limits by more at the end: the moves are not trusted */
} fl_sweeps_t;

enum { FL_QP_SOLVED = 0, FL_QP_CAPPED = 1, FL_QP_INFEASIBLE = 2 };

typedef struct {
    fl_real move[FL_QP_MOVES];
    int32_t status;
} fl_plan_t;

/* What is no number stays none. */
static inline fl_real fl_sweeps_limited(fl_real x, fl_real low, fl_real high) {
    return (x < low) ? low : ((x > high) ? high : x);
}

/* sum = start + columns x, four rows at a time; `start` may be `sum`. */
static inline void fl_sweeps_add(fl_real *sum, const fl_real *start, const fl_real *columns, const fl_real *x,
                                 int32_t count) {
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        const fl_real *column = &columns[i];
        fl_real a = start[i];
        fl_real b = start[i + 1];
        fl_real c = start[i + 2];
        fl_real d = start[i + 3];
        for (int32_t k = 0; k < count; k++) {
            const fl_real factor = x[k];
            a += column[0] * factor;
            b += column[1] * factor;
            c += column[2] * factor;
            d += column[3] * factor;
            column += FL_QP_WIDTH;
        }
        sum[i] = a;
        sum[i + 1] = b;
        sum[i + 2] = c;
        sum[i + 3] = d;
    }
}

static inline fl_plan_t fl_sweeps(const fl_sweeps_t *q, const fl_real *parameters) {
    fl_real s[FL_QP_WIDTH];
    fl_real push[FL_QP_WIDTH];
    fl_real y[FL_QP_WIDTH];
    fl_real mirrored[FL_QP_ROWS];
    fl_plan_t plan;
    for (int32_t i = 0; i < FL_QP_WIDTH; i++) {
        s[i] = q->slope[i] * parameters[0];
        push[i] = q->push[i] * parameters[0];
    }
    fl_sweeps_add(s, s, &q->slope[FL_QP_WIDTH], &parameters[1], FL_QP_PARAMETERS - 1);
    fl_sweeps_add(push, push, &q->push[FL_QP_WIDTH], &parameters[1], FL_QP_PARAMETERS - 1);
    int32_t times = FL_SWEEPS;
    for (;;) {
        for (int32_t i = 0; i < FL_QP_ROWS; i++) {
            s[i] = fl_sweeps_limited(s[i], -q->reach, q->reach);
            const fl_real c = fl_sweeps_limited(s[i], q->low[i], q->high[i]);
            mirrored[i] = (c + c) - s[i];
        }
        fl_sweeps_add(y, push, q->mix, mirrored, FL_QP_ROWS);
        times--;
        if (times == 0) {
            break;
        }
        for (int32_t i = 0; i < FL_QP_ROWS; i++) {
            const fl_real c = fl_sweeps_limited(s[i], q->low[i], q->high[i]);
            s[i] += (fl_real)1.75 * (y[i] - c);
        }
    }
    plan.status = FL_QP_SOLVED;
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        const fl_real missed = y[i] - fl_sweeps_limited(s[i], q->low[i], q->high[i]);
        if (!((missed <= q->tolerance) && (missed >= -q->tolerance))) {
            plan.status = FL_QP_CAPPED;
        }
    }
    for (int32_t i = 0; i < FL_QP_MOVES; i++) {
        plan.move[i] = fl_sweeps_limited(y[i], q->low[i], q->high[i]) * q->scale[i];
    }
    return plan;
}

#endif
