/* propagate.c -- moves the state by steps of tabulated length, or by a short one of any length.
 *
 * Exponential Runge-Kutta formula of order four (Cox and Matthews, J. Comput. Phys. 176, 2002): what is linear is exact.
 */
#include "problem.h"

#include "fastest.h"

/* What A is now: which coordinates stick, and which flanks touch. */
static int mode(const run_t *run) {
    int found = run->pressed << MOST_STUCK;
    for (int c = 0; c < run->k->coordinates; ++c) {
        found |= (run->s[c] == 0) << c;
    }
    return found;
}

static int sticks(const run_t *run, int row) {
    int held = 0;
    for (int c = 0; c < run->k->coordinates; ++c) {
        held |= run->s[c] == 0 && run->k->coordinate[c].row == row;
    }
    return held;
}

/* N without what A holds of the flanks that touch. */
static void loosen(const run_t *run, const double *x, double *n_out) {
    const problem_t *k = run->k;
    for (int j = 0; run->pressed && j < k->terms; ++j) {
        const term_t *f = &k->term[j];
        if (run->pressed & f->flank && !sticks(run, f->target)) {
            n_out[f->target] -= f->per * dot(SIZE(k), &k->flanks[j * SIZE(k)], x);
        }
    }
}

/* Per level, from `length` on by halves: exp(Ah) - 1, h phi1, h phi2 and the three weights of the formula, n x n each.
 * NULL without memory. */
#define F(level) (&table[(size_t)(level) * 6 * nn])
static double *tabulate(const run_t *run, int mask, double length, int levels) {
    const problem_t *k = run->k;
    const int n = SIZE(k), nn = n * n;
    double *table = malloc((size_t)(levels * 6 * nn) * sizeof(double));
    double phi[4][MOST * MOST], z[MOST * MOST], w[MOST * MOST], v[MOST * MOST];
    double h = ldexp(length, 1 - run->levels);
    if (table == NULL) {
        return NULL;
    }
    for (int j = 0; j < nn; ++j) {
        z[j] = h * k->a[j];
    }
    for (int j = 0; mask >> MOST_STUCK && j < k->terms; ++j) {
        const term_t *f = &k->term[j];
        for (int i = 0; mask >> MOST_STUCK & f->flank && i < n; ++i) {
            z[f->target * n + i] += h * f->per * k->flanks[j * n + i];
        }
    }
    for (int c = 0; c < k->coordinates; ++c) {
        for (int j = 0; mask >> c & 1 && j < n; ++j) {
            z[k->coordinate[c].row * n + j] = 0.0;
        }
    }
    for (int q = 1; q < 4; ++q) { /* phi_q = sum z^j / (j + q)!; norm(z) is at most FINEST */
        const double inverse[4] = {1.0, 1.0, 0.5, 1.0 / 6.0};
        double scale = inverse[q];
        memset(phi[q], 0, (size_t)nn * sizeof(double));
        memset(w, 0, (size_t)nn * sizeof(double));
        for (int i = 0; i < n; ++i) {
            w[i * n + i] = 1.0;
        }
        for (int j = 0; j < 6; ++j) {
            for (int i = 0; i < nn; ++i) {
                phi[q][i] += scale * w[i];
            }
            multiply(n, z, w, v);
            memcpy(w, v, (size_t)nn * sizeof(double));
            scale /= j + 1 + q;
        }
    }
    multiply(n, z, phi[1], phi[0]); /* exp - 1 = z phi1: what is small keeps its digits */
    for (int level = run->levels - 1; level >= 0; --level) {
        for (int i = 0; level < levels && i < nn; ++i) {
            double *f = &F(level)[i];
            f[0] = phi[0][i];
            f[nn] = h * phi[1][i];
            f[2 * nn] = h * phi[2][i];
            f[3 * nn] = h * (phi[1][i] - 3.0 * phi[2][i] + 4.0 * phi[3][i]);
            f[4 * nn] = h * (2.0 * phi[2][i] - 4.0 * phi[3][i]);
            f[5 * nn] = h * (4.0 * phi[3][i] - phi[2][i]);
        }
        multiply(n, phi[1], phi[2], v); /* doubling: Skaflestad and Wright, Appl. Numer. Math. 59, 2009 */
        for (int i = 0; i < nn; ++i) {
            phi[3][i] = (v[i] + 2.0 * phi[3][i] + phi[2][i]) / 8.0;
        }
        multiply(n, phi[1], phi[1], v);
        for (int i = 0; i < nn; ++i) {
            phi[2][i] = (v[i] + 2.0 * phi[2][i]) / 4.0;
        }
        multiply(n, phi[0], phi[1], v);
        for (int i = 0; i < nn; ++i) {
            phi[1][i] += 0.5 * v[i];
        }
        multiply(n, phi[0], phi[0], v);
        for (int i = 0; i < nn; ++i) {
            phi[0][i] = 2.0 * phi[0][i] + v[i];
        }
        h *= 2.0;
    }
    return table;
}

static inline void add(int n, const double *matrix, const double *x, double *out) {
    for (int i = 0; i < n; ++i) {
        double sum = out[i];
        for (int j = 0; j < n; ++j) {
            sum += matrix[i * n + j] * x[j];
        }
        out[i] = sum;
    }
}

static void step_table(const run_t *run, const double *table, int level, double h, double *out) {
    const int n = SIZE(run->k), nn = n * n;
    const size_t bytes = (size_t)n * sizeof(double);
    const double *whole = F(level), *half = F(level + 1);
    double n0[MOST], na[MOST], nb[MOST], nc[MOST], a[MOST], b[MOST], c[MOST];
    memcpy(out, run->x, bytes);
    memcpy(n0, run->first, bytes);
    loosen(run, run->x, n0);
    add(n, whole, run->x, out);
    if (run->k->simple) {
        add(n, &whole[nn], n0, out);
        for (int j = 0; j < DRIVES(run->k); ++j) {
            if (run->ramp[j] != 0.0) {
                drive(run, run->x, run->t + h, -1, na);
                for (int i = 0; i < n; ++i) {
                    na[i] -= run->first[i];
                }
                add(n, &whole[2 * nn], na, out);
                break;
            }
        }
        return;
    }
    memcpy(b, run->x, bytes);
    add(n, half, run->x, b);
    memcpy(a, b, bytes);
    add(n, &half[nn], n0, a);
    drive(run, a, run->t + 0.5 * h, -1, na);
    loosen(run, a, na);
    add(n, &half[nn], na, b);
    drive(run, b, run->t + 0.5 * h, -1, nb);
    loosen(run, b, nb);
    memcpy(c, a, bytes);
    add(n, half, a, c);
    for (int i = 0; i < n; ++i) {
        nc[i] = 2.0 * nb[i] - n0[i];
    }
    add(n, &half[nn], nc, c);
    drive(run, c, run->t + h, -1, nc);
    loosen(run, c, nc);
    for (int i = 0; i < n; ++i) {
        na[i] += nb[i];
    }
    add(n, &whole[3 * nn], n0, out);
    add(n, &whole[4 * nn], na, out);
    add(n, &whole[5 * nn], nc, out);
}

/* Add what is linear to N. */
static void whole_rate(const run_t *run, const double *x, double *out) {
    const problem_t *k = run->k;
    const int n = SIZE(k);
    for (int i = 0; i < n; ++i) {
        out[i] += run->flat || sticks(run, i) ? 0.0 : dot(n, &k->a[i * n], x);
    }
}

static void full_rate(const run_t *run, const double *x, double t, double *out) {
    drive(run, x, t, -1, out);
    whole_rate(run, x, out);
}

/* Classical Runge-Kutta, for lengths below the shortest tabulated one, and where nothing is linear. */
static void step_short(const run_t *run, double h, double *out) {
    const int n = SIZE(run->k);
    double k1[MOST], k2[MOST], k3[MOST], k4[MOST], y[MOST];
    memcpy(k1, run->first, (size_t)n * sizeof(double));
    whole_rate(run, run->x, k1);
    for (int i = 0; i < n; ++i) {
        y[i] = run->x[i] + 0.5 * h * k1[i];
    }
    full_rate(run, y, run->t + 0.5 * h, k2);
    for (int i = 0; i < n; ++i) {
        y[i] = run->x[i] + 0.5 * h * k2[i];
    }
    full_rate(run, y, run->t + 0.5 * h, k3);
    for (int i = 0; i < n; ++i) {
        y[i] = run->x[i] + h * k3[i];
    }
    full_rate(run, y, run->t + h, k4);
    for (int i = 0; i < n; ++i) {
        out[i] = run->x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    }
}
