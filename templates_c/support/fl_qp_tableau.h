/* fl_qp_tableau.h -- the memory of a search that keeps the tableau of the multipliers and all rows.
 *
 * One exchange of a row is a pivot, and its column is stored in product form (Dantzig and Orchard-Hays, 1954). See
 * fl_qp.h, which says what the sizes are.
 */
#ifndef FL_QP_TABLEAU_H
#define FL_QP_TABLEAU_H

#include "fl_qp_problem.h"

typedef struct {
    fl_real value[FL_QP_WIDTH];
    fl_real eta[FL_QP_ROOM + 1][FL_QP_WIDTH]; /* the column that each active row came with; behind them the next */
    fl_real inverse[FL_QP_ROOM];              /* one over the pivot of each */
    fl_real toward[FL_QP_ROOM]; /* `side` of each active row */
    uint16_t active[FL_QP_ROOM];
    int8_t side[FL_QP_WIDTH]; /* 1 at high, -1 at low, else 0 */
    int32_t length;          /* of the active set */
    int32_t work;            /* so far */
    int32_t fresh;           /* refined since the last row that joined */
    int32_t hard;            /* active rows that are not soft, where answers are checked */
    fl_real tolerance;
} fl_search_t;

/* The column of the row that enters, in the place of its eta. */
static inline fl_real *fl_qp_at(fl_search_t *s) {
    return s->eta[s->length];
}

/* The unconstrained optimum stands in the tableau already. */
static inline void fl_qp_start(fl_search_t *s) {
    (void)s;
}

static inline fl_real fl_qp_multiplier(const fl_search_t *s, int32_t place) {
    return s->value[s->active[place]];
}

static inline fl_real fl_qp_rate(const fl_search_t *s, int32_t place) {
    return s->eta[s->length][s->active[place]];
}

static inline fl_real fl_qp_pivot(const fl_search_t *s, int32_t row) {
    return s->eta[s->length][row];
}

static inline fl_real fl_qp_reached(const fl_search_t *s, int32_t row) {
    return s->value[row];
}

/* The tableau's column of a multiplier that is zero. The gram is symmetric, and so is what it becomes: what an eta
 * takes from this column in its pivot row is what it holds in this row. */
static void fl_qp_column(const fl_qp_t *q, fl_search_t *s, int32_t row) {
    const fl_real *gram = &q->gram[row * FL_QP_WIDTH];
    fl_real *column = fl_qp_at(s);
    fl_real factor[FL_QP_ROOM];
    int32_t i = 0;
    s->work += s->length + FL_QP_COLUMN;
    for (int32_t k = 0; k < s->length; k++) {
        factor[k] = s->eta[k][row] * s->inverse[k];
    }
    for (; (i + 8) <= FL_QP_WIDTH; i += 8) {
        const fl_real *eta = &s->eta[0][i];
        fl_four_t x = fl_qp_get(&gram[i]);
        fl_four_t y = fl_qp_get(&gram[i + 4]);
        for (int32_t k = 0; k < s->length; k++) {
            x = fl_qp_less(x, eta, factor[k]);
            y = fl_qp_less(y, &eta[4], factor[k]);
            eta += FL_QP_WIDTH;
        }
        fl_qp_put(&column[i], x);
        fl_qp_put(&column[i + 4], y);
    }
    if (i < FL_QP_WIDTH) {
        const fl_real *eta = &s->eta[0][i];
        fl_four_t x = fl_qp_get(&gram[i]);
        for (int32_t k = 0; k < s->length; k++) {
            x = fl_qp_less(x, eta, factor[k]);
            eta += FL_QP_WIDTH;
        }
        fl_qp_put(&column[i], x);
    }
}

/* Put `row` into the active set by its column. */
static void fl_qp_store(fl_search_t *s, int32_t row, fl_real toward) {
    fl_real *eta = fl_qp_at(s);
    const fl_real pivot = eta[row];
    s->inverse[s->length] = (fl_real)1 / pivot;
    eta[row] = pivot - (fl_real)1; /* leaves pivot / pivot in that row */
    s->toward[s->length] = toward;
    s->active[s->length] = (uint16_t)row;
    s->length++;
}

/* In one row: put the eta without the row that leaves into the place of `out`, and `out` past it into that of `eta`. */
static inline void fl_qp_swap(fl_real *out, fl_real *eta, fl_real held, fl_real share) {
    const fl_real old = *out;
    const fl_real now = *eta + (old * held);
    *out = now;
    *eta = old - (now * share);
}

/* Take the row at `place` out of the active set: out of every eta after its own, and out of the column.
 *
 * `out`, the tableau's column of that row without it, moves through the places; the eta it meets is put before it. */
static void fl_qp_leave(const fl_qp_t *q, fl_search_t *s, int32_t place, int32_t entering) {
    (void)entering;
    const int32_t row = s->active[place];
    const int32_t last = s->length - 1;
    const fl_real *column = fl_qp_at(s);
    s->value[row] = (s->side[row] > 0) ? q->high[row] : q->low[row];
    s->side[row] = 0;
    s->length = last;
    if (FL_QP_CHECKED != 0) {
        s->hard -= fl_qp_hard(q, row);
    }
    s->work += FL_QP_COLUMN + (2 * (last - place));
    fl_real *out = s->eta[place];
    fl_real rest = (fl_real)1 / s->inverse[place];
    for (int32_t k = place + 1; k <= last; k++) {
        fl_real *eta = s->eta[k];
        const int32_t at = s->active[k];
        const fl_real held = eta[row];
        const fl_real taken = out[at];
        const fl_real pivot = ((fl_real)1 / s->inverse[k]) + (taken * held);
        const fl_real inverse = (fl_real)1 / pivot;
        const fl_real share = taken * inverse;
        for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
            fl_qp_swap(&out[i], &eta[i], held, share);
            fl_qp_swap(&out[i + 1], &eta[i + 1], held, share);
            fl_qp_swap(&out[i + 2], &eta[i + 2], held, share);
            fl_qp_swap(&out[i + 3], &eta[i + 3], held, share);
        }
        out[at] = pivot - (fl_real)1;
        eta[at] = share;
        out[row] = held * rest;
        rest -= out[row] * share;
        s->inverse[k - 1] = inverse;
        s->toward[k - 1] = s->toward[k];
        s->active[k - 1] = (uint16_t)at;
        out = eta;
    }
    const fl_real factor = column[row];
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        fl_qp_put(&out[i], fl_qp_plus(fl_qp_get(&column[i]), &out[i], factor));
    }
    out[row] = factor * rest;
}

/* Go `moved` along the column; return the most violated row outside the active set, -1 where none is. */
static int32_t fl_qp_move(const fl_qp_t *q, fl_search_t *s, fl_real moved) {
    const fl_real *column = fl_qp_at(s);
    fl_violated_t seen = {s->tolerance, -1};
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        const fl_four_t x = fl_qp_less(fl_qp_get(&s->value[i]), &column[i], moved);
        fl_qp_put(&s->value[i], x);
        seen = fl_qp_see_four(q, s->side, i, x, seen);
    }
    return seen.row;
}

static inline void fl_qp_go(const fl_qp_t *q, fl_search_t *s, fl_real moved) {
    (void)fl_qp_move(q, s, moved);
}

/* Put `row` into the active set, at the end of a step along its column; return the next row to enter, -1 for none. */
static int32_t fl_qp_join(const fl_qp_t *q, fl_search_t *s, int32_t row, fl_real moved, fl_real multiplier,
                          fl_real toward) {
    const int32_t next = fl_qp_move(q, s, moved);
    s->value[row] = multiplier;
    fl_qp_store(s, row, toward);
    return next;
}

/* Correct multipliers and values by what becomes of a residual of the rows, which takes its place. */
static void fl_qp_through(const fl_qp_t *q, fl_search_t *s, fl_real *column) {
    (void)q;
    for (int32_t k = 0; k < s->length; k++) {
        const fl_real *eta = s->eta[k];
        const fl_real held = column[s->active[k]] * s->inverse[k];
        for (int32_t i = 0; i < FL_QP_ROWS; i++) {
            column[i] -= eta[i] * held;
        }
    }
}

#endif
