/* fl_rti.h -- one real-time iteration of nonlinear predictive control: a Gauss-Newton step of multiple shooting.
 *
 *     min 1/2 sum (x - t)'Q(x - t) + (u - r)'R(u - r) + d'S d,   d[k] = u[k] - u[k-1],   P instead of Q at the end
 *     x[k+1] = model(x[k], u[k]),   low <= u <= high,   limits of some states
 *
 * Bock and Plitt, IFAC World Congress 1984; Diehl, Bock and Schloeder, SIAM J. Control Optim. 43, 2005. The steps of
 * the states are eliminated; `fl_rti_search.h` solves the rest. No product is added before it is rounded.
 *
 * The file that includes this one gives its sizes, FL_RTI_STATES, FL_RTI_INPUTS, FL_RTI_LENGTH (samples of the
 * horizon), FL_RTI_LIMITED (states with limits), FL_RTI_PARAMETERS, FL_RTI_ITERATIONS, FL_RTI_BUDGET (pivots of one
 * iteration at most), and the type fl_real.
 */
#ifndef FL_RTI_H
#define FL_RTI_H

#include "fl_rti_search.h"

/* x and u -> x of the next sample, then its slopes by x and u, row by row */
typedef void (*fl_model_t)(const fl_real *both, fl_real *found);

/* The slopes of state `i` of sample k + 1 by the states and inputs of sample k. */
static inline const fl_real *fl_rti_slope(const fl_rti_work_t *s, int32_t k, int32_t i) {
    return &s->model[k][FL_RTI_N + (i * FL_RTI_BOTH)];
}

static inline void fl_rti_zero(fl_real *x) {
    volatile fl_real *cleared = x; /* volatile: no compiler may ask the C library to clear it */
    for (int32_t i = 0; i < FL_RTI_N; i++) {
        cleared[i] = (fl_real)0;
    }
}

/* Take the slopes along the plan and what it lacks; without a plan its states are those that the moves lead to. */
static void fl_rti_linearize(fl_rti_work_t *s, fl_model_t model, int32_t warm) {
    for (int32_t i = 0; i < FL_RTI_N; i++) {
        s->led[0][i] = s->both[0][i];
    }
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        fl_real *found = s->model[k];
        model(s->both[k], found);
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            if (warm == 0) {
                s->both[k + 1][i] = found[i];
            }
            found[i] -= s->both[k + 1][i];
        }
    }
    fl_real lag[FL_RTI_N];
    fl_rti_zero(lag);
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        fl_real after[FL_RTI_N];
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            fl_real sum = s->model[k][i];
            for (int32_t j = 0; j < FL_RTI_N; j++) {
                sum += fl_rti_slope(s, k, i)[j] * lag[j];
            }
            after[i] = sum;
        }
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            lag[i] = after[i];
            s->led[k + 1][i] = s->both[k + 1][i] + lag[i];
        }
    }
}

/* y = matrix x */
static void fl_rti_product(const fl_real *matrix, const fl_real *x, fl_real *y) {
    for (int32_t i = 0; i < FL_RTI_N; i++) {
        const fl_real *row = &matrix[i * FL_RTI_N];
        fl_real sum = row[0] * x[0];
        for (int32_t j = 1; j < FL_RTI_N; j++) {
            sum += row[j] * x[j];
        }
        y[i] = sum;
    }
}

/* y += A[k]' x */
static void fl_rti_back(const fl_rti_work_t *s, int32_t k, const fl_real *x, fl_real *y) {
    for (int32_t i = 0; i < FL_RTI_N; i++) {
        fl_real sum = y[i];
        for (int32_t j = 0; j < FL_RTI_N; j++) {
            sum += fl_rti_slope(s, k, j)[i] * x[j];
        }
        y[i] = sum;
    }
}

static void fl_rti_gradient(const fl_rti_t *q, fl_rti_work_t *s) {
    fl_real away[FL_RTI_N];
    fl_real slope[FL_RTI_N];
    for (int32_t j = 0; j < FL_RTI_N; j++) {
        away[j] = s->led[FL_RTI_LENGTH][j] - s->target[j];
    }
    fl_rti_product(q->p, away, slope);
    for (int32_t k = FL_RTI_LENGTH - 1; k >= 0; k--) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            fl_real sum = q->r[i * FL_RTI_M] * (s->both[k][FL_RTI_N] - q->rest[0]);
            for (int32_t j = 1; j < FL_RTI_M; j++) {
                sum += q->r[(i * FL_RTI_M) + j] * (s->both[k][FL_RTI_N + j] - q->rest[j]);
            }
            for (int32_t j = 0; j < FL_RTI_N; j++) {
                sum += fl_rti_slope(s, k, j)[FL_RTI_N + i] * slope[j];
            }
            s->g[(k * FL_RTI_M) + i] = sum;
        }
        fl_real before[FL_RTI_N];
        for (int32_t j = 0; j < FL_RTI_N; j++) {
            away[j] = s->led[k][j] - s->target[j];
        }
        fl_rti_product(q->q, away, before);
        fl_rti_back(s, k, slope, before);
        for (int32_t j = 0; j < FL_RTI_N; j++) {
            slope[j] = before[j];
        }
    }
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            const fl_real u = s->both[k][FL_RTI_N + i];
            const fl_real before = (k > 0) ? s->both[k - 1][FL_RTI_N + i] : s->last[i];
            fl_real sum = s->g[(k * FL_RTI_M) + i] + (q->change[i] * (u - before));
            if ((k + 1) < FL_RTI_LENGTH) {
                sum -= q->change[i] * (s->both[k + 1][FL_RTI_N + i] - u);
            }
            s->g[(k * FL_RTI_M) + i] = sum;
        }
    }
}

/* Column `input` of sample `at`: send the move through the horizon, and what it changes there back to the moves. */
static void fl_rti_column(const fl_rti_t *q, fl_rti_work_t *s, int32_t at, int32_t input) {
    const int32_t column = (at * FL_RTI_M) + input;
    fl_real changed[FL_RTI_LENGTH + 1][FL_RTI_N];
    fl_real slope[FL_RTI_N];
    for (int32_t k = at; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            fl_real sum = fl_rti_slope(s, k, i)[FL_RTI_N + input];
            if (k > at) {
                sum = fl_rti_slope(s, k, i)[0] * changed[k][0];
                for (int32_t j = 1; j < FL_RTI_N; j++) {
                    sum += fl_rti_slope(s, k, i)[j] * changed[k][j];
                }
            }
            changed[k + 1][i] = sum;
        }
    }
    for (int32_t row = 0; row < (FL_RTI_ROWS - FL_RTI_SIZE); row++) {
        const int32_t k = row / FL_RTI_EACH;
        const int32_t state = (int32_t)q->limited[row - (k * FL_RTI_EACH)];
        s->row[row][column] = (k >= at) ? changed[k + 1][state] : (fl_real)0;
    }
    fl_rti_product(q->p, changed[FL_RTI_LENGTH], slope);
    for (int32_t k = FL_RTI_LENGTH - 1; k >= at; k--) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            fl_real sum = fl_rti_slope(s, k, 0)[FL_RTI_N + i] * slope[0];
            for (int32_t j = 1; j < FL_RTI_N; j++) {
                sum += fl_rti_slope(s, k, j)[FL_RTI_N + i] * slope[j];
            }
            if (k == at) {
                sum += q->r[(i * FL_RTI_M) + input];
            }
            s->h[(k * FL_RTI_M) + i][column] = sum;
        }
        if (k > at) {
            fl_real before[FL_RTI_N];
            fl_rti_product(q->q, changed[k], before);
            fl_rti_back(s, k, slope, before);
            for (int32_t j = 0; j < FL_RTI_N; j++) {
                slope[j] = before[j];
            }
        }
    }
}

static void fl_rti_hessian(const fl_rti_t *q, fl_rti_work_t *s) {
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            fl_rti_column(q, s, k, i);
        }
    }
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            const int32_t at = (k * FL_RTI_M) + i;
            if ((k + 1) < FL_RTI_LENGTH) {
                s->h[at][at] += q->change[i] + q->change[i];
                s->h[at + FL_RTI_M][at] -= q->change[i];
            } else {
                s->h[at][at] += q->change[i];
            }
        }
    }
}

/* Take the step in moves and states; return the largest change of a move in its span. */
static fl_real fl_rti_advance(const fl_rti_t *q, fl_rti_work_t *s) {
    fl_real largest = (fl_real)0;
    fl_real moved[FL_RTI_N];
    fl_rti_zero(moved);
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        fl_real after[FL_RTI_N];
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            fl_real sum = s->model[k][i];
            for (int32_t j = 0; j < FL_RTI_N; j++) {
                sum += fl_rti_slope(s, k, i)[j] * moved[j];
            }
            for (int32_t j = 0; j < FL_RTI_M; j++) {
                sum += fl_rti_slope(s, k, i)[FL_RTI_N + j] * s->step[(k * FL_RTI_M) + j];
            }
            after[i] = sum;
        }
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            moved[i] = after[i];
            s->both[k + 1][i] += after[i];
        }
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            const fl_real step = s->step[(k * FL_RTI_M) + i];
            const fl_real size = ((step < (fl_real)0) ? -step : step) * q->weight[i];
            const fl_real u = s->both[k][FL_RTI_N + i] + step;
            largest = (size > largest) ? size : largest;
            s->both[k][FL_RTI_N + i] = (u >= q->low[i]) ? ((u > q->high[i]) ? q->high[i] : u) : q->low[i];
        }
    }
    return largest;
}

/* One Gauss-Newton step; where it fails, `plan` holds the unlimited outputs. */
static int32_t fl_rti_iterate(const fl_rti_t *q, fl_rti_work_t *s, fl_model_t model, int32_t warm, fl_plan_t *plan) {
    fl_rti_linearize(s, model, warm);
    fl_rti_gradient(q, s);
    fl_rti_hessian(q, s);
    fl_real lost = (fl_real)0; /* no number where a state is none */
    for (int32_t j = 0; j < FL_RTI_N; j++) {
        lost += s->both[0][j] - s->both[0][j];
    }
    for (int32_t i = 0; i < FL_RTI_M; i++) {
        plan->move[i] = s->both[0][FL_RTI_N + i] + lost;
    }
    if (fl_rti_factor(q, s) == 0) {
        return FL_QP_CAPPED;
    }
    fl_rti_free(q, s);
    for (int32_t i = 0; i < FL_RTI_M; i++) {
        plan->move[i] = s->both[0][FL_RTI_N + i] + s->value[i];
    }
    int32_t status = fl_rti_search(q, s);
    if (status == FL_QP_SOLVED) {
        for (int32_t i = 0; i < FL_RTI_SIZE; i++) {
            s->step[i] = s->value[i];
            if (s->side[i] != 0) {
                s->step[i] = (s->side[i] > 0) ? s->high[i] : s->low[i];
            }
        }
        if (fl_rti_optimal(q, s) == 0) {
            status = FL_QP_CAPPED;
        }
    }
    return status;
}

/* Write the plan that the next sample starts from: this one, moved up by a sample; zeros where it failed. */
static void fl_rti_keep(const fl_rti_work_t *s, fl_real largest, fl_plan_t *plan) {
    volatile fl_real *move = plan->move; /* volatile as above */
    const int32_t kept = (plan->status == FL_QP_SOLVED) ? 1 : 0;
    for (int32_t i = 0; (i < FL_RTI_M) && (kept != 0); i++) {
        move[i] = s->both[0][FL_RTI_N + i];
    }
    move[FL_RTI_M] = (fl_real)kept;
    move[FL_RTI_M + 1] = largest;
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        const int32_t next = ((k + 1) < FL_RTI_LENGTH) ? (k + 1) : k;
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            move[FL_RTI_MOVED + (k * FL_RTI_N) + i] = (kept != 0) ? s->both[next + 1][i] : (fl_real)0;
        }
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            move[FL_RTI_LED + (k * FL_RTI_M) + i] = (kept != 0) ? s->both[next][FL_RTI_N + i] : (fl_real)0;
        }
    }
}

/* Start from the plan of the sample before, if there is one, and say so. */
static inline int32_t fl_rti_resume(fl_rti_work_t *s, const fl_real *before) {
    const fl_real *states = &before[1];
    const fl_real *moves = &states[FL_RTI_PLANNED];
    const int32_t warm = (before[0] > (fl_real)0) ? 1 : 0;
    for (int32_t k = 0; (k < FL_RTI_LENGTH) && (warm != 0); k++) {
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            s->both[k + 1][i] = states[(k * FL_RTI_N) + i];
        }
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            s->both[k][FL_RTI_N + i] = moves[(k * FL_RTI_M) + i];
        }
    }
    return warm;
}

/* `parameters` are x[0], t, the last outputs and, unless every sample starts without a plan, 1 where there is one, and
 * its states x[1..N] and moves u[0..N-1]. */
static void fl_rti_run(const fl_rti_t *q, fl_model_t model, const fl_real *parameters, fl_plan_t *plan) {
    fl_rti_work_t s;
    int32_t warm = 0;
    s.target = &parameters[FL_RTI_N];
    s.last = &parameters[2 * FL_RTI_N];
    for (int32_t i = 0; i < FL_RTI_N; i++) {
        s.both[0][i] = parameters[i];
    }
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            s.both[k][FL_RTI_N + i] = (fl_real)0;
        }
    }
    if (FL_RTI_WARM > 0) {
        warm = fl_rti_resume(&s, &parameters[FL_RTI_ALONE]);
    }
    plan->status = FL_QP_SOLVED;
    fl_real largest = q->far;
    for (int32_t k = 0; (k < FL_RTI_ITERATIONS) && (plan->status == FL_QP_SOLVED); k++) {
        plan->status = fl_rti_iterate(q, &s, model, warm, plan);
        largest = q->far;
        if (plan->status == FL_QP_SOLVED) {
            largest = fl_rti_advance(q, &s);
        }
        warm = 1;
    }
    fl_rti_keep(&s, largest, plan);
}

static inline fl_plan_t fl_rti(const fl_rti_t *q, fl_model_t model, const fl_real *parameters) {
    fl_plan_t plan;
    fl_rti_run(q, model, parameters, &plan);
    return plan;
}

#endif
