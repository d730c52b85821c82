/* glide.c -- moves a plant in which nothing but the input is not linear: a segment is one exact step. */
#include "problem.h"

/* Whether nothing but A and what the input drives moves the plant. */
static int is_linear(const run_t *run) {
    const problem_t *k = run->k;
    int bent = run->flat || !k->simple || k->coordinates > 0;
    for (int j = 0; j < k->terms; ++j) {
        bent |= k->term[j].what != OUTPUT;
    }
    return !bent;
}

/* exp(Ah) - 1 and h phi1, n x n each, of one of the lengths that come back row by row, as where a delay cuts rows in
 * two; NULL for a length that is not known to. */
static const double *known_step(run_t *run, int segment) {
    const problem_t *k = run->k;
    const double same = 1e-7 * run->smallest, *length = &k->length[segment];
    int again = 0;
    if (fabs(*length - k->step) <= same) {
        return run->table[0];
    }
    for (int j = 0; j < run->owned; ++j) {
        if (fabs(*length - run->own_length[j]) <= same) {
            return run->own[j];
        }
    }
    for (int j = 1; j <= OWN && j <= segment; ++j) {
        again |= fabs(*length - length[-j]) <= same;
    }
    if (!again || run->owned == OWN || *length > k->step) {
        return NULL;
    }
    run->own_length[run->owned] = *length;
    run->own[run->owned] = tabulate(run, 0, *length, 1);
    return run->own[run->owned] == NULL ? NULL : run->own[run->owned++];
}

/* Through a segment of a linear plant: what `advance` does, without what that looks for. Returns 0 where its length is
 * not a known one. */
static int glide(run_t *run, int segment) {
    const problem_t *k = run->k;
    const int n = SIZE(k), m = DRIVES(k), nn = n * n;
    const double *f = known_step(run, segment);
    double next[MOST], change[MOST], u[MOST];
    if (f == NULL) {
        return 0;
    }
    input_at(run, run->t + k->length[segment], u);
    for (int i = 0; i < n; ++i) {
        change[i] = 0.0;
        for (int j = 0; j < m && !run->holds; ++j) {
            change[i] += k->b[i * m + j] * (u[j] - run->input[j]);
        }
    }
    for (int i = 0; i < n; ++i) {
        double sum = run->x[i];
        for (int j = 0; j < n; ++j) {
            sum += f[i * n + j] * run->x[j];
        }
        for (int j = 0; j < n; ++j) {
            sum += f[nn + i * n + j] * run->held[j];
        }
        for (int j = 0; j < n && !run->holds; ++j) {
            sum += f[2 * nn + i * n + j] * change[j];
        }
        next[i] = sum;
    }
    memcpy(run->x, next, (size_t)n * sizeof(double));
    run->t += k->length[segment];
    run->steps += 1.0;
    return 1;
}
