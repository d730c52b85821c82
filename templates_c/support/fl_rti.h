/* fl_rti.h -- one real-time iteration of nonlinear predictive control: a Gauss-Newton step of multiple shooting.
 *
 *     min 1/2 sum (x - t)'Q(x - t) + (u - r)'R(u - r) + d'S d,   d[k] = u[k] - u[k-1],   P instead of Q at the end
 *     x[k+1] = model(x[k], u[k]),   low <= u <= high,   limits of some states
 *
 * Bock and Plitt, IFAC World Congress 1984; Diehl, Bock and Schloeder, SIAM J. Control Optim. 43, 2005. The steps of
 * the states are eliminated; the rest is solved by a dual active-set method on a tableau, whose every change of the
 * active set is a pivot. What is found counts only where it meets the conditions of its optimum. No product is added
 * before it is rounded.
 *
 * The file that includes this one gives its sizes, FL_RTI_STATES, FL_RTI_INPUTS, FL_RTI_LENGTH (samples of the
 * horizon), FL_RTI_LIMITED (states with limits), FL_RTI_ITERATIONS, FL_RTI_BUDGET (pivots of one iteration at most),
 * and the type fl_real.
 */
#ifndef FL_RTI_H
#define FL_RTI_H

#include <stdint.h>

enum {
    FL_RTI_N = FL_RTI_STATES,
    FL_RTI_M = FL_RTI_INPUTS,
    FL_RTI_BOTH = FL_RTI_STATES + FL_RTI_INPUTS,
    FL_RTI_SIZE = FL_RTI_LENGTH * FL_RTI_INPUTS, /* unknowns, and limits of the moves */
    FL_RTI_EACH = (FL_RTI_LIMITED > 0) ? FL_RTI_LIMITED : 1, /* divides by no zero */
    FL_RTI_ROWS = FL_RTI_LENGTH * (FL_RTI_INPUTS + FL_RTI_LIMITED),
    FL_RTI_MOVED = FL_RTI_INPUTS + 2,             /* in front of the plan in the results */
    FL_RTI_RESULTS = FL_RTI_INPUTS + 2 + FL_RTI_LENGTH * (FL_RTI_STATES + FL_RTI_INPUTS)
};

typedef struct {
    fl_real q[FL_RTI_N * FL_RTI_N];
    fl_real r[FL_RTI_M * FL_RTI_M];
    fl_real p[FL_RTI_N * FL_RTI_N];
    fl_real change[FL_RTI_M]; /* diagonal of S */
    fl_real rest[FL_RTI_M];
    fl_real low[FL_RTI_M + FL_RTI_LIMITED]; /* of the moves, then of the limited states */
    fl_real high[FL_RTI_M + FL_RTI_LIMITED];
    fl_real weight[FL_RTI_M + FL_RTI_LIMITED]; /* one over the span between them */
    fl_real limited[FL_RTI_LIMITED + 1];       /* which states; the last is none */
    fl_real tolerance;                         /* a row is violated beyond this share of its span */
    fl_real trusted;                           /* an answer counts within this share of the spans */
    fl_real least;                             /* smallest pivot, over its first value */
    fl_real far;                               /* a step that nothing stops */
} fl_rti_t;

enum { FL_QP_SOLVED = 0, FL_QP_CAPPED = 1, FL_QP_INFEASIBLE = 2 };

typedef struct {
    fl_real move[FL_RTI_RESULTS]; /* outputs, whether there is a plan, largest change, states and moves of the plan */
    int32_t status;
} fl_plan_t;

/* x and u -> x of the next sample, then its slopes by x and u, row by row */
typedef void (*fl_model_t)(const fl_real *both, fl_real *found);

typedef struct {
    const fl_real *target;
    const fl_real *last;
    fl_real both[FL_RTI_LENGTH + 1][FL_RTI_BOTH]; /* x[k], u[k] of the plan; no move at the end */
    fl_real slope[FL_RTI_LENGTH][FL_RTI_N][FL_RTI_BOTH];
    fl_real lack[FL_RTI_LENGTH][FL_RTI_N];     /* what the model says beyond x[k+1] */
    fl_real led[FL_RTI_LENGTH + 1][FL_RTI_N];  /* states that the plan's moves lead to, linearized */
    fl_real g[FL_RTI_SIZE];
    fl_real h[FL_RTI_SIZE][FL_RTI_SIZE];      /* on and below the diagonal */
    fl_real factor[FL_RTI_SIZE][FL_RTI_SIZE]; /* L of L D L', below the diagonal */
    fl_real inverse[FL_RTI_SIZE];             /* of D */
    fl_real v[FL_RTI_ROWS][FL_RTI_SIZE];      /* L^-1 G' */
    fl_real low[FL_RTI_ROWS];
    fl_real high[FL_RTI_ROWS];
    fl_real value[FL_RTI_ROWS]; /* of a row, or the multiplier of an active one */
    fl_real step[FL_RTI_SIZE];
    fl_real least[FL_RTI_ROWS];
    fl_real tableau[FL_RTI_ROWS][FL_RTI_ROWS];
    int8_t side[FL_RTI_ROWS]; /* of an active row: 1 at high, -1 at low; else 0 */
    fl_real row[FL_RTI_ROWS - FL_RTI_SIZE + 1][FL_RTI_SIZE]; /* of G, for the limited states; the last is none */
} fl_rti_work_t;

/* Take the slopes along the plan and what it lacks; without a plan its states are those that the moves lead to. */
static void fl_rti_linearize(fl_rti_work_t *s, fl_model_t model, int32_t warm)
{
    fl_real found[FL_RTI_N + FL_RTI_N * FL_RTI_BOTH];
    for (int32_t i = 0; i < FL_RTI_N; i++) {
        s->led[0][i] = s->both[0][i];
    }
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        model(s->both[k], found);
        const fl_real *slope = &found[FL_RTI_N];
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            if (warm == 0) {
                s->both[k + 1][i] = found[i];
            }
            s->lack[k][i] = found[i] - s->both[k + 1][i];
            for (int32_t j = 0; j < FL_RTI_BOTH; j++) {
                s->slope[k][i][j] = slope[j];
            }
            slope += FL_RTI_BOTH;
        }
    }
    fl_real lag[FL_RTI_N] = { 0 };
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        fl_real after[FL_RTI_N];
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            fl_real sum = s->lack[k][i];
            for (int32_t j = 0; j < FL_RTI_N; j++) {
                sum += s->slope[k][i][j] * lag[j];
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
static void fl_rti_product(const fl_real *matrix, const fl_real *x, fl_real *y)
{
    for (int32_t i = 0; i < FL_RTI_N; i++) {
        fl_real sum = matrix[0] * x[0];
        for (int32_t j = 1; j < FL_RTI_N; j++) {
            sum += matrix[j] * x[j];
        }
        matrix += FL_RTI_N;
        y[i] = sum;
    }
}

/* y += A[k]' x */
static void fl_rti_back(const fl_rti_work_t *s, int32_t k, const fl_real *x, fl_real *y)
{
    for (int32_t i = 0; i < FL_RTI_N; i++) {
        fl_real sum = y[i];
        for (int32_t j = 0; j < FL_RTI_N; j++) {
            sum += s->slope[k][j][i] * x[j];
        }
        y[i] = sum;
    }
}

static void fl_rti_gradient(const fl_rti_t *q, fl_rti_work_t *s)
{
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
                sum += q->r[i * FL_RTI_M + j] * (s->both[k][FL_RTI_N + j] - q->rest[j]);
            }
            for (int32_t j = 0; j < FL_RTI_N; j++) {
                sum += s->slope[k][j][FL_RTI_N + i] * slope[j];
            }
            s->g[k * FL_RTI_M + i] = sum;
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
            fl_real sum = s->g[k * FL_RTI_M + i] + q->change[i] * (u - before);
            if (k + 1 < FL_RTI_LENGTH) {
                sum -= q->change[i] * (s->both[k + 1][FL_RTI_N + i] - u);
            }
            s->g[k * FL_RTI_M + i] = sum;
        }
    }
}

/* Column `input` of sample `at`: send the move through the horizon, and what it changes there back to the moves. */
static void fl_rti_column(const fl_rti_t *q, fl_rti_work_t *s, int32_t at, int32_t input)
{
    const int32_t column = at * FL_RTI_M + input;
    fl_real changed[FL_RTI_LENGTH + 1][FL_RTI_N];
    fl_real slope[FL_RTI_N];
    for (int32_t k = at; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            fl_real sum = s->slope[k][i][FL_RTI_N + input];
            if (k > at) {
                sum = s->slope[k][i][0] * changed[k][0];
                for (int32_t j = 1; j < FL_RTI_N; j++) {
                    sum += s->slope[k][i][j] * changed[k][j];
                }
            }
            changed[k + 1][i] = sum;
        }
    }
    for (int32_t row = 0; row < FL_RTI_ROWS - FL_RTI_SIZE; row++) {
        const int32_t k = row / FL_RTI_EACH;
        const int32_t state = (int32_t)q->limited[row - k * FL_RTI_EACH];
        s->row[row][column] = (k >= at) ? changed[k + 1][state] : (fl_real)0;
    }
    fl_rti_product(q->p, changed[FL_RTI_LENGTH], slope);
    for (int32_t k = FL_RTI_LENGTH - 1; k >= at; k--) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            fl_real sum = s->slope[k][0][FL_RTI_N + i] * slope[0];
            for (int32_t j = 1; j < FL_RTI_N; j++) {
                sum += s->slope[k][j][FL_RTI_N + i] * slope[j];
            }
            if (k == at) {
                sum += q->r[i * FL_RTI_M + input];
            }
            s->h[k * FL_RTI_M + i][column] = sum;
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

static void fl_rti_hessian(const fl_rti_t *q, fl_rti_work_t *s)
{
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            fl_rti_column(q, s, k, i);
        }
    }
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            const int32_t at = k * FL_RTI_M + i;
            if (k + 1 < FL_RTI_LENGTH) {
                s->h[at][at] += q->change[i] + q->change[i];
                s->h[at + FL_RTI_M][at] -= q->change[i];
            } else {
                s->h[at][at] += q->change[i];
            }
        }
    }
}

/* H = L D L'; false where a pivot is not above zero. */
static int32_t fl_rti_factor(const fl_rti_t *q, fl_rti_work_t *s)
{
    fl_real pivots[FL_RTI_SIZE];
    fl_real scaled[FL_RTI_SIZE];
    for (int32_t j = 0; j < FL_RTI_SIZE; j++) {
        fl_real pivot = s->h[j][j];
        for (int32_t k = 0; k < j; k++) {
            scaled[k] = s->factor[j][k] * pivots[k];
            pivot -= scaled[k] * s->factor[j][k];
        }
        if (!(pivot > (fl_real)0 && pivot < q->far)) {
            return 0;
        }
        pivots[j] = pivot;
        s->inverse[j] = (fl_real)1 / pivot;
        for (int32_t i = j + 1; i < FL_RTI_SIZE; i++) {
            fl_real sum = s->h[i][j];
            for (int32_t k = 0; k < j; k++) {
                sum -= s->factor[i][k] * scaled[k];
            }
            s->factor[i][j] = sum * s->inverse[j];
        }
    }
    return 1;
}

/* Where the first of the products of a row of L^-1 G' stands that is not zero. */
static inline int32_t fl_rti_first(int32_t row)
{
    return (row < FL_RTI_SIZE) ? row : 0;
}

/* The limits of every row, L^-1 G', and the rows of the unlimited optimum. */
static void fl_rti_free(const fl_rti_t *q, fl_rti_work_t *s)
{
    fl_real scaled[FL_RTI_SIZE];
    for (int32_t j = 0; j < FL_RTI_SIZE; j++) {
        fl_real sum = -s->g[j];
        for (int32_t k = 0; k < j; k++) {
            sum -= s->factor[j][k] * scaled[k];
        }
        scaled[j] = sum;
    }
    for (int32_t j = 0; j < FL_RTI_SIZE; j++) {
        scaled[j] *= s->inverse[j];
    }
    for (int32_t row = 0; row < FL_RTI_ROWS; row++) {
        const int32_t first = fl_rti_first(row);
        fl_real *v = s->v[row];
        fl_real value = 0;
        for (int32_t j = first; j < FL_RTI_SIZE; j++) {
            fl_real sum = (fl_real)0;
            if (row >= FL_RTI_SIZE) {
                sum = s->row[row - FL_RTI_SIZE][j];
            } else if (row == j) {
                sum = (fl_real)1;
            }
            for (int32_t k = first; k < j; k++) {
                sum -= s->factor[j][k] * v[k];
            }
            v[j] = sum;
            value += sum * scaled[j];
        }
        s->value[row] = value;
        s->side[row] = 0;
    }
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            s->low[k * FL_RTI_M + i] = q->low[i] - s->both[k][FL_RTI_N + i];
            s->high[k * FL_RTI_M + i] = q->high[i] - s->both[k][FL_RTI_N + i];
        }
        for (int32_t i = 0; i < FL_RTI_LIMITED; i++) {
            const fl_real led = s->led[k + 1][(int32_t)q->limited[i]];
            s->low[FL_RTI_SIZE + k * FL_RTI_LIMITED + i] = q->low[FL_RTI_M + i] - led;
            s->high[FL_RTI_SIZE + k * FL_RTI_LIMITED + i] = q->high[FL_RTI_M + i] - led;
        }
    }
}

static inline fl_real fl_rti_weight(const fl_rti_t *q, int32_t row)
{
    return (row < FL_RTI_SIZE) ? q->weight[row % FL_RTI_M] : q->weight[FL_RTI_M + (row - FL_RTI_SIZE) % FL_RTI_EACH];
}

/* The most violated row outside the active set, in its span; -1 where none is. */
static int32_t fl_rti_select(const fl_rti_t *q, const fl_rti_work_t *s)
{
    int32_t found = -1;
    fl_real most = q->tolerance;
    for (int32_t row = 0; row < FL_RTI_ROWS; row++) {
        const fl_real over = s->value[row] - s->high[row];
        const fl_real under = s->low[row] - s->value[row];
        const fl_real excess = ((over > under) ? over : under) * fl_rti_weight(q, row);
        if (s->side[row] == 0 && excess > most) {
            most = excess;
            found = row;
        }
    }
    return found;
}

static void fl_rti_tableau(const fl_rti_t *q, fl_rti_work_t *s)
{
    fl_real scaled[FL_RTI_SIZE];
    for (int32_t row = 0; row < FL_RTI_ROWS; row++) {
        const int32_t first = fl_rti_first(row);
        for (int32_t j = first; j < FL_RTI_SIZE; j++) {
            scaled[j] = s->v[row][j] * s->inverse[j];
        }
        for (int32_t other = row; other < FL_RTI_ROWS; other++) {
            fl_real sum = 0;
            for (int32_t j = (other < FL_RTI_SIZE) ? other : first; j < FL_RTI_SIZE; j++) {
                sum += s->v[other][j] * scaled[j];
            }
            s->tableau[other][row] = sum;
            s->tableau[row][other] = sum;
        }
        s->least[row] = q->least * s->tableau[row][row];
    }
}

/* Exchange the multiplier and the value of a row. */
static void fl_rti_pivot(fl_rti_work_t *s, int32_t row)
{
    fl_real *across = s->tableau[row];
    const fl_real inverse = (fl_real)1 / across[row];
    for (int32_t j = 0; j < FL_RTI_ROWS; j++) {
        across[j] *= inverse;
    }
    for (int32_t i = 0; i < FL_RTI_ROWS; i++) {
        fl_real *other = s->tableau[i];
        const fl_real factor = other[row];
        if (i != row) {
            for (int32_t j = 0; j < FL_RTI_ROWS; j++) {
                other[j] -= factor * across[j];
            }
            other[row] = -(factor * inverse);
        }
    }
    across[row] = inverse;
}

/* Let violated rows enter the active set, and rows leave whose multiplier reaches zero, until none is violated. */
static int32_t fl_rti_search(const fl_rti_t *q, fl_rti_work_t *s)
{
    int32_t row = fl_rti_select(q, s);
    if (row < 0) {
        return FL_QP_SOLVED;
    }
    fl_rti_tableau(q, s);
    int32_t side = (s->value[row] > s->high[row]) ? 1 : -1;
    fl_real limit = (side > 0) ? s->high[row] : s->low[row];
    fl_real multiplier = 0;
    for (int32_t work = 0; work < FL_RTI_BUDGET; work++) {
        const fl_real toward = (fl_real)side;
        const fl_real pivot = s->tableau[row][row];
        fl_real step = (pivot > s->least[row]) ? (s->value[row] - limit) * toward / pivot : q->far;
        int32_t leaving = -1;
        for (int32_t i = 0; i < FL_RTI_ROWS; i++) {
            const fl_real held = (fl_real)s->side[i];
            const fl_real rate = s->tableau[i][row] * (toward * held);
            if (s->side[i] != 0 && rate > (fl_real)0) {
                const fl_real ratio = s->value[i] * held / rate;
                if (ratio < step) {
                    step = ratio;
                    leaving = i;
                }
            }
        }
        if (!(step < q->far)) {
            return FL_QP_INFEASIBLE;
        }
        const fl_real moved = step * toward;
        multiplier += moved;
        for (int32_t i = 0; i < FL_RTI_ROWS; i++) {
            s->value[i] -= s->tableau[i][row] * moved;
        }
        if (leaving >= 0) {
            s->value[leaving] = (s->side[leaving] > 0) ? s->high[leaving] : s->low[leaving];
            s->side[leaving] = 0;
            fl_rti_pivot(s, leaving);
        } else {
            s->value[row] = multiplier;
            s->side[row] = (int8_t)side;
            fl_rti_pivot(s, row);
            row = fl_rti_select(q, s);
            if (row < 0) {
                return FL_QP_SOLVED;
            }
            side = (s->value[row] > s->high[row]) ? 1 : -1;
            limit = (side > 0) ? s->high[row] : s->low[row];
            multiplier = 0;
        }
    }
    return FL_QP_CAPPED;
}

/* Whether the step keeps the limits of the states, and the multipliers of the right sign meet its slope. */
static int32_t fl_rti_optimal(const fl_rti_t *q, const fl_rti_work_t *s)
{
    fl_real held[FL_RTI_ROWS];
    for (int32_t row = 0; row < FL_RTI_ROWS; row++) {
        const fl_real toward = (fl_real)s->side[row];
        const fl_real size = s->value[row] * toward;
        held[row] = (s->side[row] != 0 && size > (fl_real)0) ? size * toward : (fl_real)0;
    }
    for (int32_t i = 0; i < FL_RTI_SIZE; i++) {
        fl_real error = s->g[i] + held[i];
        for (int32_t j = 0; j < FL_RTI_SIZE; j++) {
            error += ((j <= i) ? s->h[i][j] : s->h[j][i]) * s->step[j];
        }
        for (int32_t row = FL_RTI_SIZE; row < FL_RTI_ROWS; row++) {
            error += s->row[row - FL_RTI_SIZE][i] * held[row];
        }
        error *= fl_rti_weight(q, i);
        const fl_real most = q->trusted * s->h[i][i];
        if (!(error < most && error > -most)) {
            return 0;
        }
    }
    for (int32_t row = FL_RTI_SIZE; row < FL_RTI_ROWS; row++) {
        fl_real y = 0;
        for (int32_t j = 0; j < FL_RTI_SIZE; j++) {
            y += s->row[row - FL_RTI_SIZE][j] * s->step[j];
        }
        const fl_real weight = fl_rti_weight(q, row);
        if (!((y - s->high[row]) * weight < q->trusted && (s->low[row] - y) * weight < q->trusted)) {
            return 0;
        }
    }
    return 1;
}

/* Take the step in moves and states; return the largest change of a move in its span. */
static fl_real fl_rti_advance(const fl_rti_t *q, fl_rti_work_t *s)
{
    fl_real largest = 0;
    fl_real moved[FL_RTI_N] = { 0 };
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        fl_real after[FL_RTI_N];
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            fl_real sum = s->lack[k][i];
            for (int32_t j = 0; j < FL_RTI_N; j++) {
                sum += s->slope[k][i][j] * moved[j];
            }
            for (int32_t j = 0; j < FL_RTI_M; j++) {
                sum += s->slope[k][i][FL_RTI_N + j] * s->step[k * FL_RTI_M + j];
            }
            after[i] = sum;
        }
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            moved[i] = after[i];
            s->both[k + 1][i] += after[i];
        }
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            const fl_real step = s->step[k * FL_RTI_M + i];
            const fl_real size = ((step < (fl_real)0) ? -step : step) * q->weight[i];
            const fl_real u = s->both[k][FL_RTI_N + i] + step;
            largest = (size > largest) ? size : largest;
            s->both[k][FL_RTI_N + i] = (u >= q->low[i]) ? ((u > q->high[i]) ? q->high[i] : u) : q->low[i];
        }
    }
    return largest;
}

/* One Gauss-Newton step; where it fails, `plan` holds the unlimited outputs. */
static int32_t fl_rti_iterate(const fl_rti_t *q, fl_rti_work_t *s, fl_model_t model, int32_t warm, fl_plan_t *plan)
{
    fl_rti_linearize(s, model, warm);
    fl_rti_gradient(q, s);
    fl_rti_hessian(q, s);
    fl_real lost = 0; /* no number where a state is none */
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

/* Write the plan that the next sample starts from: this one, moved up by a sample. */
static void fl_rti_keep(const fl_rti_work_t *s, fl_plan_t *plan)
{
    fl_real *states = &plan->move[FL_RTI_MOVED];
    fl_real *moves = &plan->move[FL_RTI_MOVED + FL_RTI_LENGTH * FL_RTI_N];
    for (int32_t i = 0; i < FL_RTI_M; i++) {
        plan->move[i] = s->both[0][FL_RTI_N + i];
    }
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        const int32_t next = (k + 1 < FL_RTI_LENGTH) ? k + 1 : k;
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            states[k * FL_RTI_N + i] = s->both[next + 1][i];
        }
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            moves[k * FL_RTI_M + i] = s->both[next][FL_RTI_N + i];
        }
    }
}

/* `parameters` are x[0], t, the last outputs, 1 where there is a plan, and its states x[1..N] and moves u[0..N-1]. */
static inline fl_plan_t fl_rti(const fl_rti_t *q, fl_model_t model, const fl_real *parameters)
{
    fl_rti_work_t s;
    fl_plan_t plan;
    const fl_real *states = &parameters[2 * FL_RTI_N + FL_RTI_M + 1];
    const fl_real *moves = &states[FL_RTI_LENGTH * FL_RTI_N];
    int32_t warm = (parameters[2 * FL_RTI_N + FL_RTI_M] > (fl_real)0) ? 1 : 0;
    s.target = &parameters[FL_RTI_N];
    s.last = &parameters[2 * FL_RTI_N];
    for (int32_t i = 0; i < FL_RTI_N; i++) {
        s.both[0][i] = parameters[i];
    }
    for (int32_t k = 0; k < FL_RTI_LENGTH; k++) {
        for (int32_t i = 0; i < FL_RTI_N; i++) {
            s.both[k + 1][i] = states[k * FL_RTI_N + i];
        }
        for (int32_t i = 0; i < FL_RTI_M; i++) {
            s.both[k][FL_RTI_N + i] = (warm != 0) ? moves[k * FL_RTI_M + i] : (fl_real)0;
        }
    }
    plan.status = FL_QP_SOLVED;
    fl_real largest = q->far;
    for (int32_t k = 0; k < FL_RTI_ITERATIONS && plan.status == FL_QP_SOLVED; k++) {
        plan.status = fl_rti_iterate(q, &s, model, warm, &plan);
        largest = q->far;
        if (plan.status == FL_QP_SOLVED) {
            largest = fl_rti_advance(q, &s);
        }
        warm = 1;
    }
    for (int32_t k = FL_RTI_M; k < FL_RTI_RESULTS; k++) {
        plan.move[k] = 0;
    }
    plan.move[FL_RTI_M + 1] = largest;
    if (plan.status == FL_QP_SOLVED) {
        plan.move[FL_RTI_M] = (fl_real)1;
        fl_rti_keep(&s, &plan);
    }
    return plan;
}

#endif
