/* stick.c -- evaluates what is not linear, and decides when a coordinate sticks, goes or turns round.
 *
 * A friction is set-valued: its coordinate (a speed, a current) has a direction s = -1 or +1, or it sticks, and then its
 * row of A and N is zero. A level at its limit is the same with one side only, `per`.
 */
#include "problem.h"

static void input_at(const run_t *run, double t, double *u) {
    for (int j = 0; j < DRIVES(run->k); ++j) {
        u[j] = run->input[j] + run->ramp[j] * (t - run->since);
    }
}

static inline double form(const double *row, int n, const double *x, int m, const double *u) {
    double sum = 0.0;
    for (int j = 0; j < n; ++j) {
        sum += row[j] * x[j];
    }
    for (int j = 0; j < m; ++j) {
        sum += row[n + j] * u[j];
    }
    return sum;
}

static inline double dot(int n, const double *a, const double *x) {
    double sum = 0.0;
    for (int j = 0; j < n; ++j) {
        sum += a[j] * x[j];
    }
    return sum;
}

/* The slope of the recorded angle in a row: that of the parabola through it and its neighbours. */
static double turning(const problem_t *k, int row) {
    const double *t = k->turn_time, *angle = k->turn;
    if (row == 0 || row == k->turns - 1) {
        const int first = row == 0 ? 0 : row - 1;
        return (angle[first + 1] - angle[first]) / (t[first + 1] - t[first]);
    }
    const double before = t[row] - t[row - 1], after = t[row + 1] - t[row];
    const double gone = (angle[row] - angle[row - 1]) / before, goes = (angle[row + 1] - angle[row]) / after;
    return (gone * after + goes * before) / (before + after);
}

/* The recorded angle at time t, by a cubic between the rows and straight beyond them: a wave of many periods a turn
 * sees how the shaft gathers speed from row to row. */
static double turned(const run_t *run, double t) {
    const problem_t *k = run->k;
    memo_t *memo = run->memo;
    if (memo->turned && memo->moment == t) {
        return memo->turn;
    }
    const double span = k->turn_time[k->turns - 1] - k->turn_time[0];
    int row = (int)((t - k->turn_time[0]) / span * (k->turns - 1));
    row = row < 0 ? 0 : (row > k->turns - 2 ? k->turns - 2 : row);
    while (row > 0 && k->turn_time[row] > t) {
        --row;
    }
    while (row < k->turns - 2 && k->turn_time[row + 1] < t) {
        ++row;
    }
    const double step = k->turn_time[row + 1] - k->turn_time[row], whole = k->turn[row + 1] - k->turn[row];
    const double share = (t - k->turn_time[row]) / step;
    memo->turned = 1;
    memo->moment = t;
    memo->turn = k->turn[row] + share * whole;
    if (share > 0.0 && share < 1.0) {
        const double first = step * turning(k, row) - whole, last = step * turning(k, row + 1) - whole;
        memo->turn += share * (1.0 - share) * (first * (1.0 - share) - last * share);
    }
    return memo->turn;
}

static view_t look(const run_t *run, const double *x, const double *u, double t) {
    const problem_t *k = run->k;
    view_t v = {.x = x, .u = u, .t = t, .begin = run->begin, .m = run->m, .memo = run->memo};
    v.w = k->speed >= 0 ? x[k->speed] : 0.0;
    v.th = k->position >= 0 ? x[k->position] : 0.0;
    v.turn = k->turns > 1 && k->asked & TURN ? turned(run, t) : v.th;
    v.lost = k->lost;
    if (k->asked & CURRENT) {
        v.i = form(k->current, SIZE(k), x, DRIVES(k), u);
    }
    if (k->bent != NULL) {
        k->bent(x, u, k->p, &v.effort);
    } else if (k->asked & EFFORT) {
        v.effort = form(k->effort, SIZE(k), x, DRIVES(k), u);
    }
    for (int c = 0; c < k->coordinates; ++c) {
        if (k->coordinate[c].what == FRICTION && k->coordinate[c].row == k->speed) {
            v.s = run->s[c];
        }
    }
    return v;
}

/* A term as it sees its own body; `at` is what those see that act on the first one. */
static double term_of(const run_t *run, const term_t *f, const view_t *at) {
    const problem_t *k = run->k;
    if (f->speed == k->speed && f->position == k->position) {
        return term(f->code, at, &k->q[f->constants]);
    }
    view_t own = *at;
    own.w = f->speed >= 0 ? at->x[f->speed] : 0.0;
    own.turn = own.th = f->position >= 0 ? at->x[f->position] : 0.0;
    for (int c = 0; f->what != LEVEL && c < k->coordinates; ++c) {
        if (k->coordinate[c].what == FRICTION && k->coordinate[c].row == f->speed) {
            own.s = run->s[c];
        }
    }
    return term(f->code, &own, &k->q[f->constants]);
}

/* Sum of the levels of a coordinate that would move in direction s. */
static double level_of(const run_t *run, view_t v, int c, int s) {
    const problem_t *k = run->k;
    double sum = 0.0;
    v.s = s;
    for (int j = 0; j < k->terms; ++j) {
        if (k->term[j].what == LEVEL && k->term[j].target == c) {
            sum += term_of(run, &k->term[j], &v);
        }
    }
    return sum;
}

/* N without the friction of the coordinate `but`, and without zeroing rows where `but` is given. */
static void drive(const run_t *run, const double *x, double t, int but, double *n_out) {
    const problem_t *k = run->k;
    const int n = SIZE(k), m = DRIVES(k);
    double u[MOST];
    view_t v;
    input_at(run, t, u);
    if (k->rate != NULL) {
        memset(n_out, 0, (size_t)n * sizeof(double));
        k->rate(x, u, k->p, n_out);
    }
    if (run->holds && k->rate == NULL) {
        memcpy(n_out, run->held, (size_t)n * sizeof(double));
    } else {
        for (int i = 0; i < n; ++i) {
            double sum = (k->rate != NULL ? n_out[i] : 0.0) + k->c[i];
            for (int j = 0; j < m; ++j) {
                sum += k->b[i * m + j] * u[j];
            }
            n_out[i] = sum;
        }
    }
    if (k->terms == 0 && k->coordinates == 0) {
        return;
    }
    v = look(run, x, u, t);
    if (k->lags > 0) {
        double y[MOST];
        k->reading(x, u, k->p, y);
        for (int j = 0; j < k->lags; ++j) {
            n_out[k->lag[2 * j + 1]] += k->lag_rate[j] * y[k->lag[2 * j]];
        }
    }
    for (int j = 0; j < k->terms; ++j) {
        const term_t *f = &k->term[j];
        if (f->what == ADD) {
            n_out[f->target] += f->per * term_of(run, f, &v);
        } else if (f->what == LEVEL && f->target != but) {
            const coordinate_t *c = &k->coordinate[f->target];
            view_t moved = v;
            moved.s = run->s[f->target];
            if (moved.s != 0) {
                n_out[c->row] -= c->per * moved.s * term_of(run, f, &moved);
            }
        }
    }
    for (int j = 0; j < k->terms; ++j) {
        const term_t *f = &k->term[j];
        if (f->what == FACTOR) {
            const double whole = n_out[f->target] + dot(n, &k->a[f->target * n], x);
            n_out[f->target] += f->per * whole * term_of(run, f, &v);
        }
    }
    for (int c = 0; c < k->coordinates; ++c) {
        const coordinate_t *held = &k->coordinate[c];
        if (held->what == LIMIT && run->s[c] == 0 && held->to >= 0) {
            n_out[held->to] += held->share * fmax(n_out[held->row] + dot(n, &k->a[held->row * n], x), 0.0);
        }
    }
    for (int c = 0; but < 0 && c < k->coordinates; ++c) {
        if (run->s[c] == 0) {
            n_out[k->coordinate[c].row] = 0.0;
        }
    }
}

/* What pulls at a coordinate, apart from its own friction: in units of its level. */
static double pull(const run_t *run, const double *x, double t, int c) {
    const int row = run->k->coordinate[c].row;
    double rate[MOST];
    drive(run, x, t, c, rate);
    return (rate[row] + dot(SIZE(run->k), &run->k->a[row * SIZE(run->k)], x)) / run->k->coordinate[c].per;
}

static double level_at(const run_t *run, const double *x, double t, int c, int s) {
    double u[MOST];
    input_at(run, t, u);
    return level_of(run, look(run, x, u, t), c, s);
}

/* How far beyond its event a coordinate is: positive means that it has happened. */
static double overdue(const run_t *run, const double *x, double t, int c) {
    const coordinate_t *held = &run->k->coordinate[c];
    if (held->what == LIMIT) {
        return run->s[c] == 0 ? -pull(run, x, t, c) : held->per * (x[held->row] - held->limit);
    }
    if (run->s[c] == 0) {
        const double torque = pull(run, x, t, c);
        return fabs(torque) - level_at(run, x, t, c, torque > 0.0 ? 1 : -1);
    }
    return -run->s[c] * x[held->row];
}

static double place_of(const run_t *run, const term_t *f) {
    return f->position >= 0 ? run->x[f->position] : 0.0;
}

/* The body that a force with a memory acts on. */
static int remembering(const problem_t *k) {
    for (int j = 0; j < k->terms; ++j) {
        if (is_memory(k->term[j].code)) {
            return j;
        }
    }
    return -1;
}

static void remember(run_t *run) {
    double u[MOST];
    view_t v;
    input_at(run, run->t, u);
    v = look(run, run->x, u, run->t);
    for (int j = 0; j < run->k->terms; ++j) {
        if (is_memory(run->k->term[j].code)) {
            const double held = term_of(run, &run->k->term[j], &v);
            run->m[0] = -held;
            run->m[1] = place_of(run, &run->k->term[j]);
            return;
        }
    }
}

/* Let a coordinate stick, go, or turn round, as what pulls at it decides. */
static void decide(run_t *run, int c) {
    const coordinate_t *held = &run->k->coordinate[c];
    if (held->what == LIMIT) {
        if (run->s[c] != 0) {
            run->x[held->row] = held->limit;
        }
        run->s[c] = pull(run, run->x, run->t, c) < 0.0;
        return;
    }
    run->x[held->row] = 0.0;
    const int memory = remembering(run->k);
    if (memory >= 0 && held->row == run->k->term[memory].speed) {
        remember(run);
    }
    {
        const double torque = pull(run, run->x, run->t, c);
        const int way = torque > 0.0 ? 1 : -1;
        run->s[c] = fabs(torque) <= level_at(run, run->x, run->t, c, way) ? 0 : way;
    }
}

/* Which way each force pushes that is there only where bodies touch; the bits of those that do are `pressed`. */
static int touching(const run_t *run, const double *x, double t, int *pressed) {
    const problem_t *k = run->k;
    int found = 0;
    double u[MOST];
    input_at(run, t, u);
    const view_t v = look(run, x, u, t);
    *pressed = 0;
    for (int j = 0; j < k->terms; ++j) {
        if (touches(k->term[j].code)) {
            const double force = term_of(run, &k->term[j], &v);
            found = 3 * found + (force > 0.0) - (force < 0.0);
            *pressed |= force != 0.0 ? k->term[j].flank : 0;
        }
    }
    return found;
}
