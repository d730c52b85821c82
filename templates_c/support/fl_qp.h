/* fl_qp.h -- a quadratic program with constant data, solved by a dual active-set method that keeps no state.
 *
 *     y = slope p - gram m,   low <= y <= high,   m_i > 0 only where y_i = high_i, m_i < 0 only where y_i = low_i
 *
 * p are the parameters of one solve, y the rows of its constraints, m their multipliers; `value` holds m of a row in
 * the active set and y of any other. Goldfarb and Idnani, Mathematical Programming 27, 1983. `fl_qp_tableau.h`
 * exchanges rows, this file says which. No product is added before it is rounded.
 *
 * The file that includes this one gives its sizes, FL_QP_ROWS, FL_QP_WIDTH (the rows filled up to a multiple of 4),
 * FL_QP_PARAMETERS, FL_QP_MOVES, FL_QP_ROOM (rows of the active set at most), FL_QP_BUDGET (work of one search at most,
 * where a column taken costs FL_QP_COLUMN and 1 for each active row, and a row that leaves FL_QP_COLUMN and 2 for each
 * that came after it), FL_QP_CHECKED (0: answers are taken as they are; else the rows of all moves, which come first),
 * FL_QP_BEYOND and FL_QP_ONWARD (the other rows and those where answers are refined, else 1), and the type fl_real.
 */
#ifndef FL_QP_H
#define FL_QP_H

#include "fl_qp_tableau.h"

/* A row behind those of the moves, from the moves. */
static fl_real fl_qp_beyond(const fl_qp_t *q, int32_t row, const fl_real *parameters, const fl_real *moves) {
    const fl_real *own = &q->beyond[row * (FL_QP_PARAMETERS + FL_QP_ONWARD)];
    fl_real value = own[0] * parameters[0];
    for (int32_t j = 1; j < FL_QP_PARAMETERS; j++) {
        value += own[j] * parameters[j];
    }
    for (int32_t j = 0; j < FL_QP_ONWARD; j++) {
        value += own[FL_QP_PARAMETERS + j] * moves[j];
    }
    return value;
}

/* Where `row` is taken to be: an active one at its limit. */
static inline fl_real fl_qp_held(const fl_qp_t *q, const fl_search_t *s, int32_t row) {
    const fl_real limit = (s->side[row] > 0) ? q->high[row] : q->low[row];
    return (s->side[row] != 0) ? limit : s->value[row];
}

/* By how much each row is beyond where it is taken to be: the moves that the multipliers ask for, and what follows. */
static void fl_qp_residual(const fl_qp_t *q, fl_search_t *s, const fl_real *parameters) {
    fl_real *column = fl_qp_at(s);
    for (int32_t i = 0; i < FL_QP_CHECKED; i++) {
        fl_real value = q->slope[i] * parameters[0];
        for (int32_t j = 1; j < FL_QP_PARAMETERS; j++) {
            value += q->slope[(j * FL_QP_WIDTH) + i] * parameters[j];
        }
        for (int32_t k = 0; k < s->length; k++) {
            const int32_t at = s->active[k];
            value -= q->gram[(at * FL_QP_WIDTH) + i] * s->value[at];
        }
        column[i] = value;
    }
    for (int32_t i = FL_QP_CHECKED; i < FL_QP_ROWS; i++) {
        fl_real value = fl_qp_beyond(q, i - FL_QP_CHECKED, parameters, column);
        if (s->side[i] != 0) {
            value -= q->softness[i - FL_QP_CHECKED] * s->value[i];
        }
        column[i] = value - fl_qp_held(q, s, i);
    }
    for (int32_t i = 0; i < FL_QP_CHECKED; i++) {
        column[i] -= fl_qp_held(q, s, i);
    }
}

/* Correct moves and multipliers by what the problem's own numbers say of them, and select `*row` again; false where a
 * move was corrected by much, or where the moves miss an active row that is not soft. The residual goes through the
 * etas as a column does: what becomes of it in an active row is what its multiplier lacks, in any other what its value
 * lacks. */
static int32_t fl_qp_refine(const fl_qp_t *q, fl_search_t *s, const fl_real *parameters, int32_t *row) {
    s->work += (2 * s->length) + FL_QP_CHECKED + FL_QP_COLUMN;
    fl_qp_residual(q, s, parameters);
    fl_real *column = fl_qp_at(s);
    for (int32_t k = 0; k < s->length; k++) {
        const fl_real *eta = s->eta[k];
        const fl_real held = column[s->active[k]] * s->inverse[k];
        for (int32_t i = 0; i < FL_QP_ROWS; i++) {
            column[i] -= eta[i] * held;
        }
    }
    int32_t near = 1;
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        const fl_real error = column[i];
        s->value[i] += error;
        if ((i < FL_QP_CHECKED) && (s->side[i] == 0) && !((error < q->trusted) && (error > -q->trusted))) {
            near = 0;
        }
    }
    for (int32_t i = 0; i < FL_QP_CHECKED; i++) {
        column[i] = fl_qp_held(q, s, i);
    }
    fl_violated_t seen = {q->tolerance, -1};
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        fl_real value = column[i];
        if (i >= FL_QP_CHECKED) {
            value = fl_qp_beyond(q, i - FL_QP_CHECKED, parameters, column);
        }
        if (s->side[i] == 0) {
            s->value[i] = value;
            seen = fl_qp_see(q, i, value, 0, seen);
        } else if (fl_qp_hard(q, i) != 0) {
            const fl_real missed = value - fl_qp_held(q, s, i);
            if (!((missed < q->kept) && (missed > -q->kept))) {
                near = 0;
            }
        } else {
            /* a soft active row may be missed */
        }
    }
    *row = seen.row;
    return near;
}

/* Where a step along the column of `row` ends: at its limit (place -1), or at a multiplier that reaches zero. */
static fl_real fl_qp_step(const fl_qp_t *q, const fl_search_t *s, fl_real gap, int32_t row, fl_real sign,
                          int32_t *place) {
    const fl_real *column = s->eta[s->length];
    fl_real step = (fl_qp_free(q, s, row) != 0) ? ((gap * sign) / column[row]) : q->far;
    *place = -1;
    for (int32_t k = 0; k < s->length; k++) {
        const int32_t held = s->active[k];
        const fl_real toward = s->toward[k];
        const fl_real rate = column[held] * (sign * toward);
        if (rate > q->least) {
            const fl_real ratio = s->value[held] * toward / rate;
            if (ratio < step) {
                step = ratio;
                *place = k;
            }
        }
    }
    return step;
}

/* Drive the violated `*row` to its limit; let every row leave whose multiplier reaches zero on the way. Where
 * answers are checked, a row that depends on the active ones is believed only after a refinement. */
static int32_t fl_qp_enter(const fl_qp_t *q, fl_search_t *s, const fl_real *parameters, int32_t *row) {
    const int32_t entering = *row;
    const int32_t side = (s->value[entering] > q->high[entering]) ? 1 : -1;
    const fl_real sign = (fl_real)side;
    const fl_real limit = (side > 0) ? q->high[entering] : q->low[entering];
    fl_real multiplier = (fl_real)0;
    fl_qp_column(q, s, entering);
    if (FL_QP_CHECKED && !s->fresh && !fl_qp_free(q, s, entering)) {
        s->fresh = fl_qp_refine(q, s, parameters, row);
        return (s->work < FL_QP_BUDGET) ? FL_QP_SOLVED : FL_QP_CAPPED;
    }
    while (s->work < FL_QP_BUDGET) {
        int32_t place;
        const fl_real gap = s->value[entering] - limit;
        const fl_real step = fl_qp_step(q, s, gap, entering, sign, &place);
        if (step >= q->far) {
            return FL_QP_INFEASIBLE;
        }
        multiplier += step * sign;
        if (place < 0) {
            if (FL_QP_CHECKED != 0) {
                const fl_real noise = multiplier * sign * q->noise;
                s->tolerance = (noise > s->tolerance) ? noise : s->tolerance;
                s->fresh = 0;
                s->hard += fl_qp_hard(q, entering);
            }
            s->side[entering] = (int8_t)side;
            *row = fl_qp_move(q, s, step * sign);
            s->value[entering] = multiplier;
            fl_qp_store(s, entering, sign);
            return FL_QP_SOLVED;
        }
        (void)fl_qp_move(q, s, step * sign);
        fl_qp_leave(q, s, place);
    }
    return FL_QP_CAPPED;
}

/* What an answer that nothing checks is worth: none where a multiplier rounds by more than moves may miss a row. */
static int32_t fl_qp_believed(const fl_qp_t *q, const fl_search_t *s) {
    for (int32_t k = 0; (k < s->length) && (q->kept < q->far); k++) {
        const int32_t row = s->active[k];
        if (!((s->value[row] * s->toward[k] * q->noise) < q->kept)) {
            return FL_QP_CAPPED;
        }
    }
    return FL_QP_SOLVED;
}

/* `value` holds the unconstrained optimum, which violates `row`; `plan` keeps its moves where there is no better. */
static int32_t fl_qp_search(const fl_qp_t *q, fl_search_t *s, int32_t row, const fl_real *parameters, fl_plan_t *plan) {
    s->length = 0;
    s->work = 0;
    s->fresh = 0;
    s->hard = 0;
    volatile int8_t *side = s->side; /* volatile: no compiler may ask the C library to clear it */
    for (int32_t i = 0; i < FL_QP_WIDTH; i++) {
        side[i] = 0;
    }
    int32_t status = FL_QP_SOLVED;
    while ((row >= 0) && (status == FL_QP_SOLVED)) {
        status = fl_qp_enter(q, s, parameters, &row);
        while (FL_QP_CHECKED && (status == FL_QP_SOLVED) && (row < 0) && !fl_qp_refine(q, s, parameters, &row)) {
            status = (s->work < FL_QP_BUDGET) ? FL_QP_SOLVED : FL_QP_CAPPED;
        }
    }
    if (!FL_QP_CHECKED && (status == FL_QP_SOLVED)) {
        status = fl_qp_believed(q, s);
    }
    for (int32_t i = 0; (i < FL_QP_MOVES) && (status == FL_QP_SOLVED); i++) {
        if (s->side[i] != 0) {
            s->value[i] = (s->side[i] > 0) ? q->high[i] : q->low[i];
        }
        plan->move[i] = s->value[i] * q->scale[i];
    }
    return status;
}

static inline fl_plan_t fl_qp(const fl_qp_t *q, const fl_real *parameters) {
    fl_search_t s;
    fl_plan_t plan;
    fl_violated_t seen = {q->tolerance, -1};
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        const fl_real *slope = &q->slope[i];
        fl_four_t x = fl_qp_times(slope, parameters[0]);
        for (int32_t k = 2; k < FL_QP_PARAMETERS; k += 2) {
            x = fl_qp_plus(x, &slope[FL_QP_WIDTH], parameters[k - 1]);
            slope += 2 * FL_QP_WIDTH;
            x = fl_qp_plus(x, slope, parameters[k]);
        }
        if ((FL_QP_PARAMETERS % 2) == 0) {
            x = fl_qp_plus(x, &slope[FL_QP_WIDTH], parameters[FL_QP_PARAMETERS - 1]);
        }
        fl_qp_put(&s.value[i], x);
        seen = fl_qp_see(q, i, x.a, 0, seen);
        seen = fl_qp_see(q, i + 1, x.b, 0, seen);
        seen = fl_qp_see(q, i + 2, x.c, 0, seen);
        seen = fl_qp_see(q, i + 3, x.d, 0, seen);
    }
    for (int32_t i = 0; i < FL_QP_MOVES; i++) {
        plan.move[i] = s.value[i] * q->scale[i];
    }
    plan.status = FL_QP_SOLVED;
    if (seen.row >= 0) {
        s.tolerance = q->tolerance + (seen.most * q->share);
        plan.status = fl_qp_search(q, &s, seen.row, parameters, &plan);
    }
    return plan;
}

#endif
