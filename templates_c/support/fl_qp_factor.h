/* fl_qp_factor.h -- the memory of a search that keeps a factor of the active rows alone.
 *
 * gram of the active rows = L D L', L with ones on its diagonal. What a step does to the multipliers is solved for by
 * it; what that does to all other rows follows from the gram, once for each row that enters. Rows join L as they enter,
 * and one that leaves is taken out of it (Gill, Golub, Murray and Saunders, Mathematics of Computation 28, 1974, method
 * C1). See fl_qp_many.h, which says what the sizes are.
 */
#ifndef FL_QP_FACTOR_H
#define FL_QP_FACTOR_H

#include "fl_qp_problem.h"

typedef struct {
    fl_real value[FL_QP_WIDTH];                         /* y of every row, when the last one entered */
    fl_real start[FL_QP_WIDTH];                         /* the same without multipliers */
    fl_real lower[((FL_QP_ROOM + 1) * FL_QP_ROOM) / 2]; /* L below its diagonal, row by row; behind it the next */
    fl_real inverse[FL_QP_ROOM];                        /* one over each of D */
    fl_real multiplier[FL_QP_ROOM];                     /* of each active row */
    fl_real rate[FL_QP_ROOM];                           /* of each, by the row that enters */
    fl_real toward[FL_QP_ROOM];                         /* `side` of each active row */
    const fl_real *gram[FL_QP_ROOM]; /* of each active row */
    uint16_t active[FL_QP_ROOM];
    int8_t side[FL_QP_WIDTH]; /* 1 at high, -1 at low, else 0 */
    int32_t length;           /* of the active set */
    int32_t work;             /* so far */
    int32_t fresh;            /* not used: answers are not checked */
    int32_t hard;             /* nor is this */
    fl_real reached;          /* y of the row that enters */
    fl_real pivot;            /* its own rate */
    fl_real tolerance;
} fl_search_t;

/* Where the unconstrained optimum stands. */
static inline void fl_qp_start(fl_search_t *s) {
    volatile fl_real *start = s->start; /* volatile: no compiler may ask the C library to copy it */
    for (int32_t i = 0; i < FL_QP_WIDTH; i += 4) {
        start[i] = s->value[i];
        start[i + 1] = s->value[i + 1];
        start[i + 2] = s->value[i + 2];
        start[i + 3] = s->value[i + 3];
    }
}

static inline fl_real fl_qp_multiplier(const fl_search_t *s, int32_t place) {
    return s->multiplier[place];
}

static inline fl_real fl_qp_rate(const fl_search_t *s, int32_t place) {
    return s->rate[place];
}

static inline fl_real fl_qp_pivot(const fl_search_t *s, int32_t row) {
    (void)row;
    return s->pivot;
}

static inline fl_real fl_qp_reached(const fl_search_t *s, int32_t row) {
    (void)row;
    return s->reached;
}

/* own[to] less the products of L's row and what stands before it. */
static inline fl_real fl_qp_row(const fl_real *line, const fl_real *own, int32_t to) {
    fl_real value = own[to];
    int32_t j = 0;
    for (; (j + 4) <= to; j += 4) {
        value -= line[j] * own[j];
        value -= line[j + 1] * own[j + 1];
        value -= line[j + 2] * own[j + 2];
        value -= line[j + 3] * own[j + 3];
    }
    for (; j < to; j++) {
        value -= line[j] * own[j];
    }
    return value;
}

/* Solve L' x = x for what `rate` holds. */
static void fl_qp_back(fl_search_t *s) {
    const fl_real *line = &s->lower[((s->length - 1) * (s->length - 2)) / 2];
    fl_real *rate = s->rate;
    for (int32_t k = s->length - 1; k > 0; k--) {
        const fl_real own = rate[k];
        int32_t j = 0;
        for (; (j + 4) <= k; j += 4) {
            rate[j] -= line[j] * own;
            rate[j + 1] -= line[j + 1] * own;
            rate[j + 2] -= line[j + 2] * own;
            rate[j + 3] -= line[j + 3] * own;
        }
        for (; j < k; j++) {
            rate[j] -= line[j] * own;
        }
        line -= k - 1;
    }
}

/* How the multipliers of the active rows follow that of `row`, and its own rate; behind L its row of it. */
static void fl_qp_rates(const fl_qp_t *q, fl_search_t *s, int32_t row) {
    const fl_real *gram = &q->gram[row * FL_QP_WIDTH];
    fl_real *own = &s->lower[(s->length * (s->length - 1)) / 2];
    const fl_real *line = s->lower;
    fl_real pivot = gram[row];
    for (int32_t k = 0; k < s->length; k++) {
        own[k] = gram[s->active[k]];
        own[k] = fl_qp_row(line, own, k);
        line += k;
    }
    for (int32_t k = 0; k < s->length; k++) {
        const fl_real rate = own[k] * s->inverse[k];
        pivot -= own[k] * rate;
        own[k] = rate;
        s->rate[k] = rate;
    }
    s->pivot = pivot;
    fl_qp_back(s);
}

/* Begin to let `row` enter. */
static void fl_qp_column(const fl_qp_t *q, fl_search_t *s, int32_t row) {
    s->work += s->length + FL_QP_COLUMN;
    fl_qp_rates(q, s, row);
    s->reached = s->value[row];
}

/* Go `moved` along the rates. */
static void fl_qp_go(const fl_qp_t *q, fl_search_t *s, fl_real moved) {
    (void)q;
    s->reached -= s->pivot * moved;
    for (int32_t k = 0; k < s->length; k++) {
        s->multiplier[k] -= s->rate[k] * moved;
    }
}

/* Every row by the multipliers; the most violated outside the active set, -1 where none is. */
static int32_t fl_qp_follow(const fl_qp_t *q, fl_search_t *s) {
    fl_violated_t seen = {s->tolerance, -1};
    int32_t i = 0;
    for (; (i + 12) <= FL_QP_WIDTH; i += 12) {
        fl_four_t x = fl_qp_get(&s->start[i]);
        fl_four_t y = fl_qp_get(&s->start[i + 4]);
        fl_four_t z = fl_qp_get(&s->start[i + 8]);
        for (int32_t k = 0; k < s->length; k++) {
            const fl_real *gram = &s->gram[k][i];
            x = fl_qp_less(x, gram, s->multiplier[k]);
            y = fl_qp_less(y, &gram[4], s->multiplier[k]);
            z = fl_qp_less(z, &gram[8], s->multiplier[k]);
        }
        fl_qp_put(&s->value[i], x);
        fl_qp_put(&s->value[i + 4], y);
        fl_qp_put(&s->value[i + 8], z);
    }
    for (; i < FL_QP_WIDTH; i += 4) {
        fl_four_t x = fl_qp_get(&s->start[i]);
        for (int32_t k = 0; k < s->length; k++) {
            x = fl_qp_less(x, &s->gram[k][i], s->multiplier[k]);
        }
        fl_qp_put(&s->value[i], x);
    }
    for (i = 0; i < FL_QP_WIDTH; i += 4) {
        seen = fl_qp_see_four(q, s->side, i, fl_qp_get(&s->value[i]), seen);
    }
    return seen.row;
}

/* Put `row` into the active set, at the end of a step along its rates; return the next row to enter, -1 for none. */
static int32_t fl_qp_join(const fl_qp_t *q, fl_search_t *s, int32_t row, fl_real moved, fl_real multiplier,
                          fl_real toward) {
    const int32_t last = s->length;
    fl_qp_go(q, s, moved);
    s->inverse[last] = (fl_real)1 / s->pivot;
    s->multiplier[last] = multiplier;
    s->toward[last] = toward;
    s->active[last] = (uint16_t)row;
    s->gram[last] = &q->gram[row * FL_QP_WIDTH];
    s->length = last + 1;
    return fl_qp_follow(q, s);
}

/* Take the row at `place` out of L, and out of all that stands in the same order. */
static void fl_qp_without(fl_search_t *s, int32_t place) {
    const fl_real *line = &s->lower[((place + 1) * place) / 2];
    fl_real *to = &s->lower[(place * (place - 1)) / 2];
    fl_real share[FL_QP_ROOM];
    fl_real along[FL_QP_ROOM];
    fl_real rest = (fl_real)1 / s->inverse[place];
    for (int32_t k = place + 1; k < s->length; k++) {
        fl_real left = line[place];
        for (int32_t j = 0; j < place; j++) {
            to[j] = line[j];
        }
        for (int32_t j = place + 1; j < k; j++) {
            left -= along[j] * line[j];
            to[j - 1] = line[j] + (share[j] * left);
        }
        const fl_real old = (fl_real)1 / s->inverse[k];
        const fl_real part = rest * left;
        const fl_real inverse = (fl_real)1 / (old + (part * left));
        along[k] = left;
        share[k] = part * inverse;
        rest = rest * (old * inverse);
        s->inverse[k - 1] = inverse;
        s->active[k - 1] = s->active[k];
        s->gram[k - 1] = s->gram[k];
        s->toward[k - 1] = s->toward[k];
        s->multiplier[k - 1] = s->multiplier[k];
        line += k;
        to += k - 1;
    }
    s->length--;
}

/* Take the row at `place` out of the active set, while `entering` is on its way in. */
static void fl_qp_leave(const fl_qp_t *q, fl_search_t *s, int32_t place, int32_t entering) {
    const int32_t row = s->active[place];
    s->side[row] = 0;
    s->work += (s->length + FL_QP_COLUMN) / 2;
    fl_qp_without(s, place);
    fl_qp_rates(q, s, entering);
}

#endif
