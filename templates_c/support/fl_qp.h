/* fl_qp.h -- a quadratic program with constant data, solved by a dual active-set method that keeps no state.
 *
 *     y = slope p - gram m,   low <= y <= high,   m_i > 0 only where y_i = high_i, m_i < 0 only where y_i = low_i
 *
 * p are the parameters of one solve, y the rows of its constraints, m their multipliers; `value` holds m of a row in
 * the active set and y of any other. Goldfarb and Idnani, Mathematical Programming 27, 1983; the tableau's columns in
 * product form (Dantzig and Orchard-Hays, 1954). No product is added before it is rounded.
 *
 * The file that includes this one gives its sizes, FL_QP_ROWS, FL_QP_WIDTH (the rows filled up to a multiple of 4),
 * FL_QP_PARAMETERS, FL_QP_MOVES, FL_QP_ROOM (pivots kept), FL_QP_CAP (pivots taken at most), and the type fl_real.
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
    fl_real eta[FL_QP_ROOM][FL_QP_WIDTH];
    fl_real inverse[FL_QP_ROOM];
    int16_t pivot[FL_QP_ROOM];
    int16_t active[FL_QP_ROOM];
    int8_t side[FL_QP_ROWS]; /* 1 at high, -1 at low, else 0 */
    int32_t count;           /* of etas */
    int32_t length;          /* of `active` */
} fl_search_t;

/* a -= b * factor */
static inline void fl_qp_reduce(fl_real *a, const fl_real *b, fl_real factor)
{
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        a[i] -= b[i] * factor;
        a[i + 1] -= b[i + 1] * factor;
        a[i + 2] -= b[i + 2] * factor;
        a[i + 3] -= b[i + 3] * factor;
    }
}

static inline void fl_qp_apply(const fl_search_t *s, int32_t k, fl_real *column)
{
    const int32_t at = s->pivot[k];
    const fl_real held = column[at];
    fl_qp_reduce(column, s->eta[k], held);
    column[at] = held * s->inverse[k];
}

static void fl_qp_through(const fl_search_t *s, fl_real *column)
{
    for (int32_t k = 0; k < s->count; k++) {
        fl_qp_apply(s, k, column);
    }
}

/* The tableau's column of a multiplier that is zero. */
static void fl_qp_column(const fl_qp_t *q, const fl_search_t *s, int32_t row, fl_real *column)
{
    const fl_real *entry = &q->gram[row * (row + 1) / 2];
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        column[i] = *entry;
        entry += (i < row) ? 1 : i + 1;
    }
    for (int32_t i = FL_QP_ROWS; i < FL_QP_WIDTH; i++) {
        column[i] = 0;
    }
    fl_qp_through(s, column);
}

/* Keep the pivot of `column` in `row`; false when it is too small. */
static int32_t fl_qp_store(const fl_qp_t *q, fl_search_t *s, int32_t row, const fl_real *column)
{
    const fl_real slope = column[row];
    if (!(slope > q->least)) {
        return 0;
    }
    const fl_real inverse = (fl_real)1 / slope;
    fl_real *eta = s->eta[s->count];
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        eta[i] = column[i] * inverse;
        eta[i + 1] = column[i + 1] * inverse;
        eta[i + 2] = column[i + 2] * inverse;
        eta[i + 3] = column[i + 3] * inverse;
    }
    s->inverse[s->count] = inverse;
    s->pivot[s->count] = (int16_t)row;
    s->count++;
    return 1;
}

/* Make the pivots afresh, one for each active row. */
static int32_t fl_qp_rebuild(const fl_qp_t *q, fl_search_t *s)
{
    fl_real column[FL_QP_WIDTH];
    s->count = 0;
    for (int32_t place = 0; place < s->length; place++) {
        const int32_t row = s->active[place];
        fl_qp_column(q, s, row, column);
        if (!fl_qp_store(q, s, row, column)) {
            return 0;
        }
    }
    return 1;
}

/* Move the row at `place` back to its limit, and the column of `entering` through that pivot. */
static int32_t fl_qp_leave(const fl_qp_t *q, fl_search_t *s, int32_t place, int32_t entering)
{
    const int32_t row = s->active[place];
    s->value[row] = (s->side[row] > 0) ? q->high[row] : q->low[row];
    s->side[row] = 0;
    s->length--;
    s->active[place] = s->active[s->length];
    if (s->count == FL_QP_ROOM) {
        if (!fl_qp_rebuild(q, s)) {
            return 0;
        }
        fl_qp_column(q, s, entering, s->column);
        return 1;
    }
    fl_real unit[FL_QP_WIDTH];
    for (int32_t i = 0; i < FL_QP_WIDTH; i++) {
        unit[i] = (i == row) ? (fl_real)1 : (fl_real)0;
    }
    fl_qp_through(s, unit);
    if (!fl_qp_store(q, s, row, unit)) {
        return 0;
    }
    fl_qp_apply(s, s->count - 1, s->column);
    return 1;
}

/* Put the entering row into the active set with its multiplier. */
static int32_t fl_qp_join(const fl_qp_t *q, fl_search_t *s, int32_t row, int32_t side, fl_real multiplier)
{
    if (s->length == FL_QP_ROOM) {
        return 0;
    }
    s->side[row] = (int8_t)side;
    s->value[row] = multiplier;
    s->active[s->length] = (int16_t)row;
    s->length++;
    return (s->count == FL_QP_ROOM) ? fl_qp_rebuild(q, s) : fl_qp_store(q, s, row, s->column);
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
    fl_qp_column(q, s, row, s->column);
    for (;;) {
        if (*pivots == FL_QP_CAP) {
            return FL_QP_CAPPED;
        }
        const fl_real slope = s->column[row];
        fl_real step = q->far;
        if (slope > q->least) {
            step = (s->value[row] - limit) * sign / slope;
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
        fl_qp_reduce(s->value, s->column, moved);
        multiplier += moved;
        (*pivots)++;
        if (place < 0) {
            return fl_qp_join(q, s, row, side, multiplier) ? FL_QP_SOLVED : FL_QP_CAPPED;
        }
        if (!fl_qp_leave(q, s, place, row)) {
            return FL_QP_CAPPED;
        }
    }
}

/* `search` holds the unconstrained optimum, which violates `row`. */
static int32_t fl_qp_search(const fl_qp_t *q, fl_search_t *s, int32_t row)
{
    int32_t pivots = 0;
    s->count = 0;
    s->length = 0;
    volatile int8_t *side = s->side; /* volatile: no compiler may ask the C library to clear it */
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        side[i] = 0;
    }
    for (int32_t i = FL_QP_ROWS; i < FL_QP_WIDTH; i++) {
        s->value[i] = 0;
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
