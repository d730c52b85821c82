/* fl_rti_search.h -- the quadratic program of one real-time iteration, and the memory of the whole of it.
 *
 *     min 1/2 v'Hv + g'v,   low <= G v <= high,   H = L D L'
 *
 * The rows of the limits stand against their multipliers, y = y0 - T m, T = G H^-1 G'. The most violated row enters the
 * active set; rows whose multiplier would change its sign on the way leave (Goldfarb and Idnani, Mathematical
 * Programming 27, 1983). Each exchange is a pivot of the tableau T. What is found counts only where it meets the
 * conditions of its optimum. No product is added before it is rounded.
 */
#ifndef FL_RTI_SEARCH_H
#define FL_RTI_SEARCH_H

#include <stdint.h>

enum {
    FL_RTI_N = FL_RTI_STATES,
    FL_RTI_M = FL_RTI_INPUTS,
    FL_RTI_BOTH = FL_RTI_STATES + FL_RTI_INPUTS,
    FL_RTI_MODELED = FL_RTI_STATES * (FL_RTI_BOTH + 1),      /* numbers that the model gives: states and slopes */
    FL_RTI_SIZE = FL_RTI_LENGTH * FL_RTI_INPUTS,             /* unknowns, and limits of the moves */
    FL_RTI_EACH = (FL_RTI_LIMITED > 0) ? FL_RTI_LIMITED : 1, /* divides by no zero */
    FL_RTI_ROWS = FL_RTI_LENGTH * (FL_RTI_INPUTS + FL_RTI_LIMITED),
    FL_RTI_SPANS = FL_RTI_INPUTS + FL_RTI_LIMITED,
    FL_RTI_ALONE = (2 * FL_RTI_STATES) + FL_RTI_INPUTS, /* parameters in front of those of a plan, */
    FL_RTI_WARM = FL_RTI_PARAMETERS - FL_RTI_ALONE,     /* of which there are none where no sample has one */
    FL_RTI_MOVED = FL_RTI_INPUTS + 2,               /* in front of the plan in the results */
    FL_RTI_PLANNED = FL_RTI_LENGTH * FL_RTI_STATES, /* numbers of its states, */
    FL_RTI_LED = FL_RTI_MOVED + FL_RTI_PLANNED,     /* after which its moves come */
    FL_RTI_RESULTS = FL_RTI_INPUTS + 2 + (FL_RTI_LENGTH * (FL_RTI_STATES + FL_RTI_INPUTS))
};

typedef struct {
    fl_real q[FL_RTI_N * FL_RTI_N];
    fl_real r[FL_RTI_M * FL_RTI_M];
    fl_real p[FL_RTI_N * FL_RTI_N];
    fl_real change[FL_RTI_M]; /* diagonal of S */
    fl_real rest[FL_RTI_M];
    fl_real low[FL_RTI_SPANS]; /* of the moves, then of the limited states */
    fl_real high[FL_RTI_SPANS];
    fl_real weight[FL_RTI_SPANS];        /* one over the span between them */
    fl_real limited[FL_RTI_LIMITED + 1]; /* which states; the last is none */
    fl_real tolerance;                   /* a row is violated beyond this share of its span */
    fl_real trusted;                     /* an answer counts within this share of the spans */
    fl_real least;                       /* smallest pivot, over its first value */
    fl_real far;                         /* a step that nothing stops */
} fl_rti_t;

enum { FL_QP_SOLVED = 0, FL_QP_CAPPED = 1, FL_QP_INFEASIBLE = 2 };

typedef struct {
    fl_real move[FL_RTI_RESULTS]; /* outputs, whether there is a plan, largest change, states and moves of the plan */
    int32_t status;
} fl_plan_t;

typedef struct {
    const fl_real *target;
    const fl_real *last;
    fl_real both[FL_RTI_LENGTH + 1][FL_RTI_BOTH]; /* x[k], u[k] of the plan; no move at the end */
    fl_real model[FL_RTI_LENGTH][FL_RTI_MODELED]; /* what the model says beyond x[k+1], then its slopes */
    fl_real led[FL_RTI_LENGTH + 1][FL_RTI_N];     /* states that the plan's moves lead to, linearized */
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
    int8_t side[FL_RTI_ROWS];                                /* of an active row: 1 at high, -1 at low; else 0 */
    fl_real row[FL_RTI_ROWS - FL_RTI_SIZE + 1][FL_RTI_SIZE]; /* of G, for the limited states; the last is none */
} fl_rti_work_t;

/* H = L D L'; false where a pivot is not above zero. */
static int32_t fl_rti_factor(const fl_rti_t *q, fl_rti_work_t *s) {
    fl_real pivots[FL_RTI_SIZE];
    fl_real scaled[FL_RTI_SIZE];
    for (int32_t j = 0; j < FL_RTI_SIZE; j++) {
        fl_real pivot = s->h[j][j];
        for (int32_t k = 0; k < j; k++) {
            scaled[k] = s->factor[j][k] * pivots[k];
            pivot -= scaled[k] * s->factor[j][k];
        }
        if (!((pivot > (fl_real)0) && (pivot < q->far))) {
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
static inline int32_t fl_rti_first(int32_t row) {
    return (row < FL_RTI_SIZE) ? row : 0;
}

/* The limits of every row, L^-1 G', and the rows of the unlimited optimum. */
static void fl_rti_free(const fl_rti_t *q, fl_rti_work_t *s) {
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
        fl_real value = (fl_real)0;
        for (int32_t j = first; j < FL_RTI_SIZE; j++) {
            fl_real sum = (fl_real)0;
            if (row >= FL_RTI_SIZE) {
                sum = s->row[row - FL_RTI_SIZE][j];
            } else if (row == j) {
                sum = (fl_real)1;
            } else {
                /* an entry beside the diagonal is zero */
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
            s->low[(k * FL_RTI_M) + i] = q->low[i] - s->both[k][FL_RTI_N + i];
            s->high[(k * FL_RTI_M) + i] = q->high[i] - s->both[k][FL_RTI_N + i];
        }
        for (int32_t i = 0; i < FL_RTI_LIMITED; i++) {
            const fl_real led = s->led[k + 1][(int32_t)q->limited[i]];
            s->low[FL_RTI_SIZE + (k * FL_RTI_LIMITED) + i] = q->low[FL_RTI_M + i] - led;
            s->high[FL_RTI_SIZE + (k * FL_RTI_LIMITED) + i] = q->high[FL_RTI_M + i] - led;
        }
    }
}

static inline fl_real fl_rti_weight(const fl_rti_t *q, int32_t row) {
    return (row < FL_RTI_SIZE) ? q->weight[row % FL_RTI_M] : q->weight[FL_RTI_M + (row - FL_RTI_SIZE) % FL_RTI_EACH];
}

/* The most violated row outside the active set, in its span; -1 where none is. */
static int32_t fl_rti_select(const fl_rti_t *q, const fl_rti_work_t *s) {
    int32_t found = -1;
    fl_real most = q->tolerance;
    for (int32_t row = 0; row < FL_RTI_ROWS; row++) {
        const fl_real over = s->value[row] - s->high[row];
        const fl_real under = s->low[row] - s->value[row];
        const fl_real excess = ((over > under) ? over : under) * fl_rti_weight(q, row);
        if ((s->side[row] == 0) && (excess > most)) {
            most = excess;
            found = row;
        }
    }
    return found;
}

static void fl_rti_tableau(const fl_rti_t *q, fl_rti_work_t *s) {
    fl_real scaled[FL_RTI_SIZE];
    for (int32_t row = 0; row < FL_RTI_ROWS; row++) {
        const int32_t first = fl_rti_first(row);
        for (int32_t j = first; j < FL_RTI_SIZE; j++) {
            scaled[j] = s->v[row][j] * s->inverse[j];
        }
        for (int32_t other = row; other < FL_RTI_ROWS; other++) {
            fl_real sum = (fl_real)0;
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
static void fl_rti_pivot(fl_rti_work_t *s, int32_t row) {
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
static int32_t fl_rti_search(const fl_rti_t *q, fl_rti_work_t *s) {
    int32_t row = fl_rti_select(q, s);
    if (row < 0) {
        return FL_QP_SOLVED;
    }
    fl_rti_tableau(q, s);
    int32_t side = (s->value[row] > s->high[row]) ? 1 : -1;
    fl_real limit = (side > 0) ? s->high[row] : s->low[row];
    fl_real multiplier = (fl_real)0;
    for (int32_t work = 0; work < FL_RTI_BUDGET; work++) {
        const fl_real toward = (fl_real)side;
        const fl_real pivot = s->tableau[row][row];
        fl_real step = (pivot > s->least[row]) ? (((s->value[row] - limit) * toward) / pivot) : q->far;
        int32_t leaving = -1;
        for (int32_t i = 0; i < FL_RTI_ROWS; i++) {
            const fl_real held = (fl_real)s->side[i];
            const fl_real rate = s->tableau[i][row] * (toward * held);
            if ((s->side[i] != 0) && (rate > (fl_real)0)) {
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
            multiplier = (fl_real)0;
        }
    }
    return FL_QP_CAPPED;
}

/* Whether the step keeps the limits of the states, and the multipliers of the right sign meet its slope. */
static int32_t fl_rti_optimal(const fl_rti_t *q, const fl_rti_work_t *s) {
    fl_real held[FL_RTI_ROWS];
    for (int32_t row = 0; row < FL_RTI_ROWS; row++) {
        const fl_real toward = (fl_real)s->side[row];
        const fl_real size = s->value[row] * toward;
        held[row] = ((s->side[row] != 0) && (size > (fl_real)0)) ? (size * toward) : (fl_real)0;
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
        if (!((error < most) && (error > -most))) {
            return 0;
        }
    }
    for (int32_t row = FL_RTI_SIZE; row < FL_RTI_ROWS; row++) {
        fl_real y = (fl_real)0;
        for (int32_t j = 0; j < FL_RTI_SIZE; j++) {
            y += s->row[row - FL_RTI_SIZE][j] * s->step[j];
        }
        const fl_real weight = fl_rti_weight(q, row);
        if (!((((y - s->high[row]) * weight) < q->trusted) && (((s->low[row] - y) * weight) < q->trusted))) {
            return 0;
        }
    }
    return 1;
}

#endif
