/* fl_qp.h -- a quadratic program with constant data, solved by a dual active-set method that keeps no state.
 *
 *     y = slope p - gram m,   low <= y <= high,   m_i > 0 only where y_i = high_i, m_i < 0 only where y_i = low_i
 *
 * p are the parameters of one solve, y the rows of its constraints, m their multipliers; `value` holds m of a row in
 * the active set and y of any other. Goldfarb and Idnani, Mathematical Programming 27, 1983; the tableau's columns in
 * product form (Dantzig and Orchard-Hays, 1954). No product is added before it is rounded.
 *
 * The file that includes this one gives its sizes, FL_QP_ROWS, FL_QP_WIDTH (the rows filled up to a multiple of 4),
 * FL_QP_PARAMETERS, FL_QP_MOVES, FL_QP_ROOM (rows of the active set at most), FL_QP_CAP
 * (changes of it at most), and the type fl_real.
 */
#ifndef FL_QP_H
#define FL_QP_H

#include <stdint.h>

typedef struct {
    fl_real slope[FL_QP_ROWS * FL_QP_PARAMETERS];
    fl_real low[FL_QP_ROWS];
    fl_real high[FL_QP_ROWS];
    fl_real gram[FL_QP_ROWS * (FL_QP_ROWS + 1) / 2]; /* lower triangle, row by row */
    fl_real scale[FL_QP_MOVES];                      /* from the first rows to the moves */
    fl_real tolerance;                               /* a row is violated beyond this */
    fl_real least;                                   /* smallest pivot */
    fl_real far;                                     /* a step that nothing stops */
} fl_qp_t;

enum { FL_QP_SOLVED = 0, FL_QP_CAPPED = 1, FL_QP_INFEASIBLE = 2 };

typedef struct {
    fl_real move[FL_QP_MOVES];
    int32_t status;
} fl_plan_t;

typedef struct {
    fl_real value[FL_QP_WIDTH];
    fl_real column[FL_QP_WIDTH];
    fl_real factor[FL_QP_ROOM];
    fl_real eta[FL_QP_ROOM][FL_QP_WIDTH]; /* one for each active row */
    fl_real pivot[FL_QP_ROOM];
    int16_t active[FL_QP_ROOM];
    int8_t side[FL_QP_ROWS]; /* 1 at high, -1 at low, else 0 */
    int32_t length;          /* of the active set */
} fl_search_t;

/* The tableau's column of a multiplier that is zero. The gram is symmetric, and so is what it becomes: what an eta
 * takes from this column in its pivot row is what it holds in this row. */
static void fl_qp_column(const fl_qp_t *q, fl_search_t *s, int32_t row)
{
    const fl_real *entry = &q->gram[row * (row + 1) / 2];
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        s->column[i] = *entry;
        entry += (i < row) ? 1 : i + 1;
    }
    for (int32_t k = 0; k < s->length; k++) {
        s->factor[k] = s->eta[k][row] * s->pivot[k];
    }
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        fl_real a = s->column[i];
        fl_real b = s->column[i + 1];
        fl_real c = s->column[i + 2];
        fl_real d = s->column[i + 3];
        const fl_real *eta = &s->eta[0][i];
        for (int32_t k = 0; k < s->length; k++) {
            const fl_real factor = s->factor[k];
            a -= eta[0] * factor;
            b -= eta[1] * factor;
            c -= eta[2] * factor;
            d -= eta[3] * factor;
            eta += FL_QP_WIDTH;
        }
        s->column[i] = a;
        s->column[i + 1] = b;
        s->column[i + 2] = c;
        s->column[i + 3] = d;
    }
}

/* Put `row` into the active set by its column; false when its pivot is too small. */
static int32_t fl_qp_store(const fl_qp_t *q, fl_search_t *s, int32_t row)
{
    const fl_real pivot = s->column[row];
    if (!(pivot > q->least) || s->length == FL_QP_ROOM) {
        return 0;
    }
    const fl_real inverse = (fl_real)1 / pivot;
    fl_real *eta = s->eta[s->length];
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        eta[i] = s->column[i] * inverse;
        eta[i + 1] = s->column[i + 1] * inverse;
        eta[i + 2] = s->column[i + 2] * inverse;
        eta[i + 3] = s->column[i + 3] * inverse;
    }
    eta[row] = (fl_real)1 - inverse; /* leaves pivot / pivot in that row */
    s->pivot[s->length] = pivot;
    s->active[s->length] = (int16_t)row;
    s->length++;
    return 1;
}

/* Take the row at `place` out of the active set; those that came after it are put in again. */
static int32_t fl_qp_leave(const fl_qp_t *q, fl_search_t *s, int32_t place)
{
    const int32_t row = s->active[place];
    const int32_t last = s->length - 1;
    s->value[row] = (s->side[row] > 0) ? q->high[row] : q->low[row];
    s->side[row] = 0;
    s->length = place;
    while (s->length < last) {
        const int32_t again = s->active[s->length + 1];
        fl_qp_column(q, s, again);
        if (!fl_qp_store(q, s, again)) {
            return 0;
        }
    }
    return 1;
}

/* The most violated row outside the active set; -1 where none is. */
static int32_t fl_qp_select(const fl_qp_t *q, const fl_search_t *s)
{
    int32_t row = -1;
    fl_real most = q->tolerance;
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        const fl_real over = s->value[i] - q->high[i];
        const fl_real under = q->low[i] - s->value[i];
        if (s->side[i] == 0 && (over > most || under > most)) {
            most = (over > under) ? over : under;
            row = i;
        }
    }
    return row;
}

/* Drive one violated row to its limit: let every row leave whose multiplier reaches zero on the way. */
static int32_t fl_qp_enter(const fl_qp_t *q, fl_search_t *s, int32_t row, int32_t *pivots)
{
    const int32_t side = (s->value[row] > q->high[row]) ? 1 : -1;
    const fl_real sign = (fl_real)side;
    const fl_real limit = (side > 0) ? q->high[row] : q->low[row];
    fl_real multiplier = 0;
    for (;;) {
        if (*pivots == FL_QP_CAP) {
            return FL_QP_CAPPED;
        }
        (*pivots)++;
        fl_qp_column(q, s, row);
        const fl_real pivot = s->column[row];
        fl_real step = q->far;
        if (pivot > q->least) {
            step = (s->value[row] - limit) * sign / pivot;
        }
        int32_t place = -1;
        for (int32_t k = 0; k < s->length; k++) {
            const int32_t held = s->active[k];
            const fl_real toward = (fl_real)s->side[held];
            const fl_real rate = s->column[held] * (sign * toward);
            if (rate > q->least) {
                const fl_real ratio = s->value[held] * toward / rate;
                if (ratio < step) {
                    step = ratio;
                    place = k;
                }
            }
        }
        if (step >= q->far) {
            return FL_QP_INFEASIBLE;
        }
        const fl_real moved = step * sign;
        for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
            s->value[i] -= s->column[i] * moved;
            s->value[i + 1] -= s->column[i + 1] * moved;
            s->value[i + 2] -= s->column[i + 2] * moved;
            s->value[i + 3] -= s->column[i + 3] * moved;
        }
        multiplier += moved;
        if (place < 0) {
            if (!fl_qp_store(q, s, row)) {
                return FL_QP_CAPPED;
            }
            s->side[row] = (int8_t)side;
            s->value[row] = multiplier;
            return FL_QP_SOLVED;
        }
        if (!fl_qp_leave(q, s, place)) {
            return FL_QP_CAPPED;
        }
    }
}

/* `search` holds the unconstrained optimum, which violates `row`. */
static int32_t fl_qp_search(const fl_qp_t *q, fl_search_t *s, int32_t row)
{
    int32_t pivots = 0;
    s->length = 0;
    volatile int8_t *side = s->side; /* volatile: no compiler may ask the C library to clear it */
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        side[i] = 0;
    }
    for (int32_t i = FL_QP_ROWS; i < FL_QP_WIDTH; i++) {
        s->value[i] = 0;
        s->column[i] = 0;
    }
    int32_t status = FL_QP_SOLVED;
    while (row >= 0 && status == FL_QP_SOLVED) {
        status = fl_qp_enter(q, s, row, &pivots);
        row = fl_qp_select(q, s);
    }
    for (int32_t i = 0; i < FL_QP_MOVES; i++) {
        if (s->side[i] != 0) {
            s->value[i] = (s->side[i] > 0) ? q->high[i] : q->low[i];
        }
    }
    return status;
}

static inline fl_plan_t fl_qp(const fl_qp_t *q, const fl_real *parameters)
{
    fl_search_t s;
    fl_plan_t plan;
    const fl_real *slope = q->slope;
    int32_t row = -1;
    fl_real most = q->tolerance;
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        fl_real y = slope[0] * parameters[0];
        for (int32_t k = 1; k < FL_QP_PARAMETERS; k++) {
            y += slope[k] * parameters[k];
        }
        slope += FL_QP_PARAMETERS;
        s.value[i] = y;
        const fl_real over = y - q->high[i];
        const fl_real under = q->low[i] - y;
        if (over > most || under > most) {
            most = (over > under) ? over : under;
            row = i;
        }
    }
    plan.status = (row < 0) ? FL_QP_SOLVED : fl_qp_search(q, &s, row);
    for (int32_t i = 0; i < FL_QP_MOVES; i++) {
        plan.move[i] = s.value[i] * q->scale[i];
    }
    return plan;
}

#endif
