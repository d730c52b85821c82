/* fl_tree.h -- the solution of a quadratic program as a tree of planes and affine laws of its parameters p.
 *
 * From node 0: where a plane's sum over (p, 1) is above 0 it goes on at `above`, else at `below`; what is negative
 * there is -1 - the law, and the moves are its sums over (p, 1). No product is added before it is rounded. The last law
 * is for parameters that have no optimum. Tondel, Johansen and Bemporad, Automatica 39, 2003.
 *
 * The file that includes this one gives its sizes, FL_QP_PARAMETERS, FL_QP_MOVES, FL_TREE_NODES, FL_TREE_DEPTH (nodes
 * on the longest way), FL_TREE_LAWS, and the type fl_real.
 */
#ifndef FL_TREE_H
#define FL_TREE_H

#include <stdint.h>

typedef struct {
    fl_real plane[FL_TREE_NODES * (FL_QP_PARAMETERS + 1)];
    fl_real law[FL_TREE_LAWS * FL_QP_MOVES * (FL_QP_PARAMETERS + 1)];
    int16_t below[FL_TREE_NODES];
    int16_t above[FL_TREE_NODES];
} fl_tree_t;

enum { FL_QP_SOLVED = 0, FL_QP_CAPPED = 1, FL_QP_INFEASIBLE = 2 };

typedef struct {
    fl_real move[FL_QP_MOVES];
    int32_t status;
} fl_plan_t;

static inline fl_real fl_tree_sum(const fl_real *row, const fl_real *p) {
    fl_real sum = row[FL_QP_PARAMETERS];
    for (int32_t k = 0; k < FL_QP_PARAMETERS; k++) {
        sum += row[k] * p[k];
    }
    return sum;
}

static inline fl_plan_t fl_tree(const fl_tree_t *q, const fl_real *parameters) {
    fl_plan_t plan;
    int32_t node = 0;
    for (int32_t k = 0; k < FL_TREE_DEPTH; k++) {
        if (node >= 0) {
            const fl_real side = fl_tree_sum(&q->plane[node * (FL_QP_PARAMETERS + 1)], parameters);
            node = (side > (fl_real)0) ? q->above[node] : q->below[node];
        }
    }
    const int32_t law = -1 - node;
    for (int32_t i = 0; i < FL_QP_MOVES; i++) {
        const fl_real *row = &q->law[((law * FL_QP_MOVES) + i) * (FL_QP_PARAMETERS + 1)];
        plan.move[i] = fl_tree_sum(row, parameters);
    }
    plan.status = (law == (FL_TREE_LAWS - 1)) ? FL_QP_INFEASIBLE : FL_QP_SOLVED;
    return plan;
}

#endif
