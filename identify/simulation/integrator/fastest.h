/* fastest.h -- how fast a linear system can change. MOST, the most states there can be, is whose who takes this in. */
#ifndef FASTEST_H
#define FASTEST_H

#include <math.h>
#include <string.h>

#define MOST_SQUARED 5

static void multiply(int n, const double *a, const double *b, double *out) {
    memset(out, 0, (size_t)(n * n) * sizeof *out);
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
            const double f = a[i * n + j];
            if (f != 0.0) {
                for (int l = 0; l < n; ++l) {
                    out[i * n + l] += f * b[j * n + l];
                }
            }
        }
    }
}

/* How fast dx/dt = M x can change, 1/s: the largest sum of a row of M^(2^k), to the power 2^-k, M squared k times.
 *
 * It bounds the largest eigenvalue's magnitude whatever units the states are in, the closer the more often. M is
 * destroyed. */
static double fastest(int n, double *m, int times) {
    double squared[MOST * MOST], most[MOST_SQUARED + 1], scale = 1.0;
    for (int turn = 0;; ++turn) {
        most[turn] = 0.0;
        for (int i = 0; i < n; ++i) {
            double sum = 0.0;
            for (int j = 0; j < n; ++j) {
                sum += fabs(m[i * n + j]);
            }
            most[turn] = fmax(most[turn], sum);
        }
        if (!(most[turn] > 0.0) || !isfinite(most[turn])) {
            return 0.0;
        }
        if (turn == times) {
            break;
        }
        for (int i = 0; i < n * n; ++i) {
            m[i] /= most[turn];
        }
        multiply(n, m, m, squared);
        memcpy(m, squared, (size_t)(n * n) * sizeof *m);
    }
    for (int turn = times; turn > 0; --turn) {
        scale = sqrt(most[turn] * scale);
    }
    return most[0] * scale;
}

#endif
