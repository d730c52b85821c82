/* fl_qp_search.h -- the search of fl_qp.h and fl_qp_many.h, one of which has given it the memory that it keeps. */
#ifndef FL_QP_SEARCH_H
#define FL_QP_SEARCH_H

/* Whether the row that enters does not depend on the active ones. */
static inline int32_t fl_qp_free(const fl_qp_t *q, const fl_search_t *s, int32_t row) {
    const int32_t filled = ((FL_QP_CHECKED != 0) && (s->hard == FL_QP_CHECKED)) ? fl_qp_hard(q, row) : 0;
    return (fl_qp_pivot(s, row) > q->least) && (s->length < FL_QP_ROOM) && (filled == 0);
}

/* Where a step along the column of `row` ends: at its limit (place -1), or at a multiplier that reaches zero. */
static fl_real fl_qp_step(const fl_qp_t *q, const fl_search_t *s, fl_real gap, int32_t row, fl_real sign,
                          int32_t *place) {
    fl_real step = (fl_qp_free(q, s, row) != 0) ? ((gap * sign) / fl_qp_pivot(s, row)) : q->far;
    *place = -1;
    for (int32_t k = 0; k < s->length; k++) {
        const fl_real toward = s->toward[k];
        const fl_real rate = fl_qp_rate(s, k) * (sign * toward);
        if (rate > q->least) {
            const fl_real ratio = fl_qp_multiplier(s, k) * toward / rate;
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
        const fl_real gap = fl_qp_reached(s, entering) - limit;
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
            *row = fl_qp_join(q, s, entering, step * sign, multiplier, sign);
            return FL_QP_SOLVED;
        }
        fl_qp_go(q, s, step * sign);
        fl_qp_leave(q, s, place, entering);
    }
    return FL_QP_CAPPED;
}

/* What an answer that nothing checks is worth: none where a multiplier rounds by more than moves may miss a row. */
static int32_t fl_qp_believed(const fl_qp_t *q, const fl_search_t *s) {
    for (int32_t k = 0; (k < s->length) && (q->kept < q->far); k++) {
        if (!((fl_qp_multiplier(s, k) * s->toward[k] * q->noise) < q->kept)) {
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
    fl_qp_start(s);
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
