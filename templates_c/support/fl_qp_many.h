/* fl_qp_many.h -- as fl_qp.h, for a program with many more rows than can be active: the search keeps no tableau of
 * them, but a factor of the active ones. Its answers are taken as they are.
 *
 * The sizes are those of fl_qp.h, but that FL_QP_CHECKED is 0, and a row that leaves costs half of one that enters.
 */
#ifndef FL_QP_MANY_H
#define FL_QP_MANY_H

#include "fl_qp_factor.h"

/* Nothing is refined. */
static inline int32_t fl_qp_refine(const fl_qp_t *q, fl_search_t *s, const fl_real *parameters, int32_t *row) {
    (void)q;
    (void)s;
    (void)parameters;
    (void)row;
    return 1;
}

#include "fl_qp_search.h"

#endif
