/* fl_qp.h -- a quadratic program with constant data, solved by a dual active-set method that keeps no state.
 *
 *     y = slope p - gram m,   low <= y <= high,   m_i > 0 only where y_i = high_i, m_i < 0 only where y_i = low_i
 *
 * p are the parameters of one solve, y the rows of its constraints, m their multipliers; `value` holds m of a row in
 * the active set and y of any other. Goldfarb and Idnani, Mathematical Programming 27, 1983. `fl_qp_tableau.h`
 * exchanges rows, `fl_qp_search.h` says which. No product is added before it is rounded.
 *
 * The file that includes this one gives its sizes, FL_QP_ROWS, FL_QP_WIDTH (the rows filled up to a multiple of 4),
 * FL_QP_PARAMETERS, FL_QP_MOVES, FL_QP_ROOM (rows of the active set at most), FL_QP_BUDGET (work of one search at most,
 * where a column taken costs FL_QP_COLUMN and 1 for each active row, and a row that leaves FL_QP_COLUMN and 2 for each
 * that came after it), FL_QP_CHECKED (0: answers are taken as they are; else the rows of all moves, which come first),
 * FL_QP_BEYOND and FL_QP_ONWARD (the other rows and those where answers are refined, else 1), and the type fl_real.
 */
#ifndef FL_QP_H
#define FL_QP_H

#include "fl_qp_refine.h"

#include "fl_qp_search.h"

#endif
