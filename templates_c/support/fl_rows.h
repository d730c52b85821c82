/* fl_rows.h -- rows of sums: each row weighs the same values by constants of its own.
 *
 *     row_i = ((w_i0 x_0 + w_i1 x_1) + w_i2 x_2) + ...
 *
 * No product is added before it is rounded.
 *
 * The file that includes this one gives its sizes, FL_ROWS and FL_ROW_VALUES, and the type fl_real.
 */
#ifndef FL_ROWS_H
#define FL_ROWS_H

#include <stdint.h>

enum { FL_ROWS_BY_8 = FL_ROWS / 8 * 8, FL_ROWS_BY_4 = FL_ROWS / 4 * 4 }; /* rows that are taken together */

typedef struct {
    fl_real weight[FL_ROW_VALUES * FL_ROWS]; /* of all rows, one value after the other */
} fl_rows_t;

typedef struct {
    fl_real row[FL_ROWS];
} fl_sums_t;

static inline fl_sums_t fl_rows(const fl_rows_t *q, const fl_real *x) {
    fl_sums_t sums;
    for (int32_t i = 0; i < FL_ROWS_BY_8; i += 8) {
        const fl_real *w = &q->weight[i];
        fl_real a = w[0] * x[0];
        fl_real b = w[1] * x[0];
        fl_real c = w[2] * x[0];
        fl_real d = w[3] * x[0];
        fl_real e = w[4] * x[0];
        fl_real f = w[5] * x[0];
        fl_real g = w[6] * x[0];
        fl_real h = w[7] * x[0];
        for (int32_t k = 1; k < FL_ROW_VALUES; k++) {
            const fl_real value = x[k];
            w += FL_ROWS;
            a += w[0] * value;
            b += w[1] * value;
            c += w[2] * value;
            d += w[3] * value;
            e += w[4] * value;
            f += w[5] * value;
            g += w[6] * value;
            h += w[7] * value;
        }
        sums.row[i] = a;
        sums.row[i + 1] = b;
        sums.row[i + 2] = c;
        sums.row[i + 3] = d;
        sums.row[i + 4] = e;
        sums.row[i + 5] = f;
        sums.row[i + 6] = g;
        sums.row[i + 7] = h;
    }
    for (int32_t i = FL_ROWS_BY_8; i < FL_ROWS_BY_4; i += 4) {
        const fl_real *w = &q->weight[i];
        fl_real a = w[0] * x[0];
        fl_real b = w[1] * x[0];
        fl_real c = w[2] * x[0];
        fl_real d = w[3] * x[0];
        for (int32_t k = 1; k < FL_ROW_VALUES; k++) {
            const fl_real value = x[k];
            w += FL_ROWS;
            a += w[0] * value;
            b += w[1] * value;
            c += w[2] * value;
            d += w[3] * value;
        }
        sums.row[i] = a;
        sums.row[i + 1] = b;
        sums.row[i + 2] = c;
        sums.row[i + 3] = d;
    }
    for (int32_t i = FL_ROWS_BY_4; i < FL_ROWS; i++) {
        const fl_real *w = &q->weight[i];
        fl_real sum = *w * x[0];
        for (int32_t k = 1; k < FL_ROW_VALUES; k++) {
            w += FL_ROWS;
            sum += *w * x[k];
        }
        sums.row[i] = sum;
    }
    return sums;
}

#endif
