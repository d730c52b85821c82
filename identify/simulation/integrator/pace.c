/* pace.c -- chooses the length of a step: short enough for how fast N changes, and for bodies that may touch in it. */
#include <math.h>

#include "problem.h"

/* N where the run is; computed once per place. */
static void look_round(run_t *run) {
    if (!run->known) {
        drive(run, run->x, run->t, -1, run->first);
        run->known = 1;
    }
}

/* How far a force that remembers where the motion turned round still is from what it will be: 1 there, 0 far away. */
static double unsettled(const run_t *run, const term_t *f) {
    const double *q = &run->k->q[f->constants];
    return is_memory(f->code) && q[1] > 0.0 ? exp(-0.5 * q[0] * fabs(run->x[f->position] - run->m[1]) / q[1])
                                            : 1.0;
}

/* The coarsest level whose step resolves how fast N changes. */
static int coarsest(run_t *run, double length) {
    const problem_t *k = run->k;
    const int n = SIZE(k), m = DRIVES(k);
    double rate = 0.0, u[MOST], now[MOST], own[MOST_TERMS];
    int level = 0;
    if (k->simple) {
        for (int j = 0; j < k->terms; ++j) {
            rate = fmax(rate, BOUNCE * k->term[j].rate[0]);
        }
        while (level < run->levels - 2 && run->lengths[level] * rate > k->longest) {
            ++level;
        }
        return level;
    }
    input_at(run, run->t, u);
    if (k->slope != NULL) {
        double by_x[MOST * MOST];
        k->slope(run->x, u, k->p, now, by_x);
        for (int j = 0; j < n * n; ++j) {
            by_x[j] = isfinite(by_x[j]) ? by_x[j] : 0.0;
        }
        rate = 4.0 * fastest(n, by_x, SQUARED); /* nothing of it is in A */
    }
    look_round(run);
    memcpy(now, run->first, (size_t)n * sizeof(double));
    whole_rate(run, run->x, now);
    for (int j = 0; j < k->terms; ++j) {
        const double *r = k->term[j].rate;
        const int body = k->term[j].speed, place = k->term[j].position;
        const double w = body >= 0 ? fabs(run->x[body]) : 0.0, dw = body >= 0 ? fabs(now[body]) : 0.0;
        own[j] = r[0] * (k->term[j].flank ? BOUNCE : unsettled(run, &k->term[j])) + r[1] * (w + 0.5 * dw * length);
        if (r[3] != 0.0) {
            const double i = form(k->current, n, run->x, m, u);
            own[j] += r[3] * i * i;
        }
        own[j] += r[4] * (place >= 0 ? fabs(run->x[place]) : 0.0);
        if (r[5] > 0.0) {
            /* A current that settles does so at this rate; what is left of it decides how much that matters. */
            const double i = fabs(form(k->current, n, run->x, m, u));
            const double still[MOST] = {0.0};
            const double left = fabs(form(k->current, n, now, m, still)) / r[5];
            own[j] += left > 0.0 ? r[5] * cbrt(left / (left + i)) : 0.0;
        }
        if (r[2] == 0.0) {
            rate = fmax(rate, own[j]);
        }
    }
    for (; level < run->levels - 2; ++level) {
        double most = rate;
        for (int j = 0; j < k->terms; ++j) {
            const double steep = k->term[j].rate[2];
            const int body = k->term[j].speed;
            if (steep != 0.0 && body >= 0) { /* far from rest nothing of it changes */
                const double w = fabs(run->x[body]), dw = fabs(now[body]);
                const int leaves = run->x[body] * now[body] > 0.0;
                const double h = fmin(run->lengths[level], length), near = leaves ? w : fmax(w - dw * h, 0.0);
                const double away = 1.0 + near * steep * near * steep;
                most = fmax(most, own[j] / (away * away) + steep * dw / away);
            }
        }
        if (!(run->lengths[level] * most > k->longest)) {
            break;
        }
    }
    return level;
}
