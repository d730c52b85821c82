/* fl_qp_refine.h -- correct the moves and multipliers of a search by what the problem's own numbers say of them. */
#ifndef FL_QP_REFINE_H
#define FL_QP_REFINE_H

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
            value -= q->gram[(s->active[k] * FL_QP_WIDTH) + i] * fl_qp_multiplier(s, k);
        }
        column[i] = value;
    }
    for (int32_t i = FL_QP_CHECKED; i < FL_QP_ROWS; i++) {
        column[i] = fl_qp_beyond(q, i - FL_QP_CHECKED, parameters, column);
    }
    for (int32_t k = 0; k < s->length; k++) {
        const int32_t row = s->active[k];
        if (row >= FL_QP_CHECKED) {
            column[row] -= q->softness[row - FL_QP_CHECKED] * fl_qp_multiplier(s, k);
        }
    }
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
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
    fl_qp_through(q, s, column);
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

#endif
