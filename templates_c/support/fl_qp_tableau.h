/* fl_qp_tableau.h -- the numbers of a quadratic program, the memory of its search, and the tableau that both keep.
 *
 * See fl_qp.h, which says what the sizes are. The tableau is that of the multipliers and the rows; one exchange of a
 * row is a pivot, and its column is stored in product form (Dantzig and Orchard-Hays, 1954).
 */
#ifndef FL_QP_TABLEAU_H
#define FL_QP_TABLEAU_H

#include <stdint.h>

typedef struct {
    fl_real slope[FL_QP_PARAMETERS * FL_QP_WIDTH]; /* one parameter after the other */
    fl_real low[FL_QP_WIDTH];
    fl_real high[FL_QP_WIDTH];
    fl_real gram[FL_QP_ROWS * FL_QP_WIDTH];
    fl_real scale[FL_QP_MOVES]; /* from the first rows to the moves */
    fl_real tolerance;          /* a row is violated beyond this, */
    fl_real share;              /* and this share of what the unconstrained optimum violates most */
    fl_real trusted;            /* a move that is corrected by less is right, */
    fl_real kept;               /* and an active row that its moves miss by less */
    fl_real noise;              /* of a multiplier: what its roundings may do to a row, at most where it is checked */
    fl_real least;              /* smallest pivot */
    fl_real far;                /* a step that nothing stops */
    /* The rows behind those of the moves, of the parameters and the moves, less this share of their multipliers. */
    fl_real beyond[FL_QP_BEYOND * (FL_QP_PARAMETERS + FL_QP_ONWARD)];
    fl_real softness[FL_QP_BEYOND];
} fl_qp_t;

enum { FL_QP_SOLVED = 0, FL_QP_CAPPED = 1, FL_QP_INFEASIBLE = 2 };

typedef struct {
    fl_real move[FL_QP_MOVES];
    int32_t status;
} fl_plan_t;

typedef struct {
    fl_real value[FL_QP_WIDTH];
    fl_real eta[FL_QP_ROOM + 1][FL_QP_WIDTH]; /* the column that each active row came with; behind them the next */
    fl_real inverse[FL_QP_ROOM];              /* one over the pivot of each */
    fl_real toward[FL_QP_ROOM]; /* `side` of each active row */
    uint8_t active[FL_QP_ROOM];
    int8_t side[FL_QP_WIDTH]; /* 1 at high, -1 at low, else 0 */
    int32_t length;          /* of the active set */
    int32_t work;            /* so far */
    int32_t fresh;           /* refined since the last row that joined */
    int32_t hard;            /* active rows that are not soft, where answers are checked */
    fl_real tolerance;
} fl_search_t;

/* Four numbers that stand beside each other, in registers. */
typedef struct {
    fl_real a;
    fl_real b;
    fl_real c;
    fl_real d;
} fl_four_t;

static inline fl_four_t fl_qp_times(const fl_real *four, fl_real factor) {
    const fl_four_t x = {four[0] * factor, four[1] * factor, four[2] * factor, four[3] * factor};
    return x;
}

static inline fl_four_t fl_qp_less(fl_four_t x, const fl_real *four, fl_real factor) {
    const fl_four_t y = fl_qp_times(four, factor);
    const fl_four_t z = {x.a - y.a, x.b - y.b, x.c - y.c, x.d - y.d};
    return z;
}

static inline fl_four_t fl_qp_plus(fl_four_t x, const fl_real *four, fl_real factor) {
    const fl_four_t y = fl_qp_times(four, factor);
    const fl_four_t z = {x.a + y.a, x.b + y.b, x.c + y.c, x.d + y.d};
    return z;
}

static inline fl_four_t fl_qp_get(const fl_real *four) {
    const fl_four_t x = {four[0], four[1], four[2], four[3]};
    return x;
}

static inline void fl_qp_put(fl_real *four, fl_four_t x) {
    four[0] = x.a;
    four[1] = x.b;
    four[2] = x.c;
    four[3] = x.d;
}

/* The column of the row that enters, in the place of its eta. */
static inline fl_real *fl_qp_at(fl_search_t *s) {
    return s->eta[s->length];
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

/* Whether `row` is not soft; of those no more are independent than there are moves. */
static inline int32_t fl_qp_hard(const fl_qp_t *q, int32_t row) {
    return (row < FL_QP_CHECKED) || !(q->softness[row - FL_QP_CHECKED] > 0);
}

/* Put `row` into the active set by its column. */
static void fl_qp_store(fl_search_t *s, int32_t row, fl_real toward) {
    fl_real *eta = fl_qp_at(s);
    const fl_real pivot = eta[row];
    s->inverse[s->length] = (fl_real)1 / pivot;
    eta[row] = pivot - (fl_real)1; /* leaves pivot / pivot in that row */
    s->toward[s->length] = toward;
    s->active[s->length] = (uint8_t)row;
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
static void fl_qp_leave(const fl_qp_t *q, fl_search_t *s, int32_t place) {
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
        s->active[k - 1] = (uint8_t)at;
        out = eta;
    }
    const fl_real factor = column[row];
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        fl_qp_put(&out[i], fl_qp_plus(fl_qp_get(&column[i]), &out[i], factor));
    }
    out[row] = factor * rest;
}

/* The row that is violated by most of those seen so far; -1 where none is by more than `most` was at first. */
typedef struct {
    fl_real most;
    int32_t row;
} fl_violated_t;

static inline fl_violated_t fl_qp_see(const fl_qp_t *q, int32_t row, fl_real value, int32_t side, fl_violated_t seen) {
    fl_violated_t now = seen;
    if ((side == 0) && ((value > q->high[row]) || (value < q->low[row]))) {
        const fl_real excess = (value > q->high[row]) ? (value - q->high[row]) : (q->low[row] - value);
        if (excess > seen.most) {
            now.most = excess;
            now.row = row;
        }
    }
    return now;
}

/* Go `moved` along the column; return the most violated row outside the active set, -1 where none is. */
static int32_t fl_qp_move(const fl_qp_t *q, fl_search_t *s, fl_real moved) {
    const fl_real *column = fl_qp_at(s);
    fl_violated_t seen = {s->tolerance, -1};
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        const fl_four_t x = fl_qp_less(fl_qp_get(&s->value[i]), &column[i], moved);
        fl_qp_put(&s->value[i], x);
        seen = fl_qp_see(q, i, x.a, s->side[i], seen);
        seen = fl_qp_see(q, i + 1, x.b, s->side[i + 1], seen);
        seen = fl_qp_see(q, i + 2, x.c, s->side[i + 2], seen);
        seen = fl_qp_see(q, i + 3, x.d, s->side[i + 3], seen);
    }
    return seen.row;
}

/* Whether the row of this column does not depend on the active ones. */
static inline int32_t fl_qp_free(const fl_qp_t *q, const fl_search_t *s, int32_t row) {
    const int32_t filled = ((FL_QP_CHECKED != 0) && (s->hard == FL_QP_CHECKED)) ? fl_qp_hard(q, row) : 0;
    return (s->eta[s->length][row] > q->least) && (s->length < FL_QP_ROOM) && (filled == 0);
}

#endif
