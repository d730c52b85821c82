/* fl_qp_problem.h -- the numbers of a quadratic program, and what any search of it needs.
 *
 * See fl_qp.h, which says what the sizes are.
 */
#ifndef FL_QP_PROBLEM_H
#define FL_QP_PROBLEM_H

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

/* Whether `row` is not soft; of those no more are independent than there are moves. */
static inline int32_t fl_qp_hard(const fl_qp_t *q, int32_t row) {
    return (row < FL_QP_CHECKED) || !(q->softness[row - FL_QP_CHECKED] > 0);
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

static inline fl_violated_t fl_qp_see_four(const fl_qp_t *q, const int8_t *side, int32_t row, fl_four_t x,
                                           fl_violated_t seen) {
    fl_violated_t now = fl_qp_see(q, row, x.a, side[row], seen);
    now = fl_qp_see(q, row + 1, x.b, side[row + 1], now);
    now = fl_qp_see(q, row + 2, x.c, side[row + 2], now);
    return fl_qp_see(q, row + 3, x.d, side[row + 3], now);
}

#endif
