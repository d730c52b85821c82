/* fl_tree_i32.h -- the solution of a quadratic program as a tree of planes and affine laws of its parameters p in fixed
 * point: 32-bit values, 64-bit sums.
 *
 * From node 0: where a plane's sum over (p, 1) is above 0 it goes on at `above`, else at `below`; what is negative
 * there is -1 - the law, and the moves are its sums over (p, 1), rounded once to nearest, halves up. The 1 stands as
 * 2^30. No function here checks for overflow: the generator has proven, from the numbers of this table and the ranges
 * of p, that every sum fits. The last law is for parameters that have no optimum. Tondel, Johansen and Bemporad,
 * Automatica 39, 2003.
 *
 * The file that includes this one gives its sizes, FL_QP_PARAMETERS, FL_QP_MOVES, FL_TREE_NODES, FL_TREE_DEPTH (nodes
 * on the longest way), FL_TREE_LAWS, and FL_SHIFT_LAW behind the sums of a law.
 */
#ifndef FL_TREE_I32_H
#define FL_TREE_I32_H

#include <stdint.h>

typedef struct {
    int32_t plane[FL_TREE_NODES * (FL_QP_PARAMETERS + 1)];
    int32_t law[FL_TREE_LAWS * FL_QP_MOVES * (FL_QP_PARAMETERS + 1)];
    int32_t least[FL_QP_MOVES]; /* limits of the moves */
    int32_t most[FL_QP_MOVES];
    int16_t below[FL_TREE_NODES];
    int16_t above[FL_TREE_NODES];
} fl_tree_t;

enum { FL_QP_SOLVED = 0, FL_QP_CAPPED = 1, FL_QP_INFEASIBLE = 2 };

typedef struct {
    int32_t move[FL_QP_MOVES];
    int32_t status;
} fl_plan_t;

static inline int64_t fl_tree_sum(const int32_t *row, const int32_t *p) {
    int64_t sum = row[FL_QP_PARAMETERS] * ((int64_t)1 << 30);
    for (int32_t k = 0; k < FL_QP_PARAMETERS; k++) {
        sum += (int64_t)row[k] * p[k];
    }
    return sum;
}

static inline fl_plan_t fl_tree_i32(const fl_tree_t *q, const int32_t *parameters) {
    fl_plan_t plan;
    int32_t node = 0;
    for (int32_t k = 0; k < FL_TREE_DEPTH; k++) {
        if (node >= 0) {
            const int64_t side = fl_tree_sum(&q->plane[node * (FL_QP_PARAMETERS + 1)], parameters);
            node = (side > 0) ? q->above[node] : q->below[node];
        }
    }
    const int32_t law = -1 - node;
    for (int32_t i = 0; i < FL_QP_MOVES; i++) {
        const int32_t *row = &q->law[((law * FL_QP_MOVES) + i) * (FL_QP_PARAMETERS + 1)];
        const int64_t half = (int64_t)((uint64_t)1 << (FL_SHIFT_LAW - 1));
        const int64_t move = (fl_tree_sum(row, parameters) + half) >> FL_SHIFT_LAW;
        plan.move[i] = (move < q->least[i]) ? q->least[i] : ((move > q->most[i]) ? q->most[i] : (int32_t)move);
    }
    plan.status = (law == (FL_TREE_LAWS - 1)) ? FL_QP_INFEASIBLE : FL_QP_SOLVED;
    return plan;
}

#endif
