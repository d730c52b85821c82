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
    fl_real low[FL_QP_ROWS];
    fl_real high[FL_QP_ROWS];
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
    fl_real column[FL_QP_WIDTH];
    fl_real eta[FL_QP_ROOM][FL_QP_WIDTH]; /* one for each active row */
    fl_real pivot[FL_QP_ROOM];
    uint8_t active[FL_QP_ROOM];
    int8_t side[FL_QP_ROWS]; /* 1 at high, -1 at low, else 0 */
    int32_t length;          /* of the active set */
    int32_t work;            /* so far */
    int32_t fresh;           /* refined since the last row that joined */
    int32_t hard;            /* active rows that are not soft, where answers are checked */
    fl_real tolerance;
} fl_search_t;

/* The tableau's column of a multiplier that is zero. The gram is symmetric, and so is what it becomes: what an eta
 * takes from this column in its pivot row is what it holds in this row. */
static void fl_qp_column(const fl_qp_t *q, fl_search_t *s, int32_t row) {
    const fl_real *gram = &q->gram[row * FL_QP_WIDTH];
    s->work += s->length + FL_QP_COLUMN;
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        fl_real a = gram[i];
        fl_real b = gram[i + 1];
        fl_real c = gram[i + 2];
        fl_real d = gram[i + 3];
        const fl_real *eta = &s->eta[0][i];
        for (int32_t k = 0; k < s->length; k++) {
            const fl_real factor = s->eta[k][row] * s->pivot[k];
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

/* Whether `row` is not soft; of those no more are independent than there are moves. */
static inline int32_t fl_qp_hard(const fl_qp_t *q, int32_t row) {
    return (row < FL_QP_CHECKED) || !(q->softness[row - FL_QP_CHECKED] > 0);
}

/* Put `row` into the active set by its column. */
static void fl_qp_store(fl_search_t *s, int32_t row) {
    const fl_real pivot = s->column[row];
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
    s->active[s->length] = (uint8_t)row;
    s->length++;
}

/* Take the row at `place` out of the active set: out of every eta after its own, and out of the column.
 *
 * `out`, the tableau's column of that row without it, moves through the places; the eta it meets is put before it. */
static void fl_qp_leave(const fl_qp_t *q, fl_search_t *s, int32_t place) {
    const int32_t row = s->active[place];
    const int32_t last = s->length - 1;
    s->value[row] = (s->side[row] > 0) ? q->high[row] : q->low[row];
    s->side[row] = 0;
    s->length = last;
    if (FL_QP_CHECKED != 0) {
        s->hard -= fl_qp_hard(q, row);
    }
    s->work += FL_QP_COLUMN + (2 * (last - place));
    fl_real *out = s->eta[place];
    for (int32_t i = 0; i < FL_QP_WIDTH; i++) {
        out[i] *= s->pivot[place];
    }
    out[row] = s->pivot[place];
    for (int32_t k = place + 1; k <= last; k++) {
        fl_real *eta = s->eta[k];
        const int32_t at = s->active[k];
        const fl_real held = eta[row];
        const fl_real taken = out[at];
        const fl_real rest = out[row];
        const fl_real pivot = s->pivot[k] + (taken * (held * s->pivot[k]));
        const fl_real share = s->pivot[k] / pivot;
        const fl_real inverse = (fl_real)1 / pivot;
        const fl_real left = held * rest * share;
        for (int32_t i = 0; i < FL_QP_WIDTH; i++) {
            const fl_real old = out[i];
            out[i] = (eta[i] + (old * held)) * share;
            eta[i] = old - (out[i] * taken);
        }
        out[at] = (fl_real)1 - inverse;
        eta[at] = taken * inverse;
        out[row] = left;
        eta[row] = rest - (left * taken);
        s->pivot[k - 1] = pivot;
        s->active[k - 1] = (uint8_t)at;
        out = eta;
    }
    const fl_real factor = s->column[row];
    for (int32_t i = 0; i < FL_QP_WIDTH; i++) {
        s->column[i] += out[i] * factor;
    }
    s->column[row] = factor * out[row];
}

static inline fl_real fl_qp_excess(const fl_qp_t *q, int32_t row, fl_real value) {
    const fl_real over = value - q->high[row];
    const fl_real under = q->low[row] - value;
    return (over > under) ? over : under;
}

/* Go `moved` along the column; return the most violated row outside the active set, -1 where none is. */
static int32_t fl_qp_move(const fl_qp_t *q, fl_search_t *s, fl_real moved) {
    int32_t row = -1;
    fl_real most = s->tolerance;
    for (int32_t i = 0; i < FL_QP_ROWS; i++) {
        const fl_real value = s->value[i] - (s->column[i] * moved);
        s->value[i] = value;
        if ((s->side[i] == 0) && ((value > q->high[i]) || (value < q->low[i]))) {
            const fl_real excess = fl_qp_excess(q, i, value);
            if (excess > most) {
                most = excess;
                row = i;
            }
        }
    }
    return row;
}

/* Whether the row of this column does not depend on the active ones. */
static inline int32_t fl_qp_free(const fl_qp_t *q, const fl_search_t *s, int32_t row) {
    const int32_t filled = ((FL_QP_CHECKED != 0) && (s->hard == FL_QP_CHECKED)) ? fl_qp_hard(q, row) : 0;
    return (s->column[row] > q->least) && (s->length < FL_QP_ROOM) && (filled == 0);
}

#endif
