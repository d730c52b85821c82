/* segments.c -- moves a plant with effects through stretches of time in which its input is a straight line.
 *
 * dx/dt = A x + N(x, u, t): A is exact (matrix exponentials), N holds what is not linear. The matrices are tabulated
 * for lengths that halve from the row distance down to almost nothing, so that any length, and the moment at which a
 * friction sticks or lets go, is reached by steps of tabulated length.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terms.c"

#include "stick.c"

#include "propagate.c"

#include "glide.c"

#include "pace.c"

static int first_overdue(const run_t *run, const double *x, double t) {
    for (int c = 0; c < run->k->coordinates; ++c) {
        if (overdue(run, x, t, c) > 0.0) {
            return c;
        }
    }
    return -1;
}

/* Look which flanks touch now. */
static void feel(run_t *run) {
    run->touch = run->k->asked & TOUCH ? touching(run, run->x, run->t, &run->pressed) : 0;
}

static int advance(run_t *run, double length) {
    const problem_t *k = run->k;
    const int n = SIZE(k), finest = run->levels - 2;
    const size_t bytes = (size_t)n * sizeof(double);
    double rest = length, trial[MOST];
    int level = coarsest(run, length), start = level, events = 0;
    int bound = 0; /* the level that the search for an event has come to */
    const int bodies = k->asked & TOUCH, sharpest = finest < SHARPEST ? finest : SHARPEST;
    int pressed;
    feel(run);
    while (rest > 0.0) {
        double h = run->lengths[level];
        int c;
        run->steps += 1.0;
        if (k->most_steps > 0.0 && run->steps > k->most_steps) {
            return 1;
        }
        while (level < finest && h > rest + 1e-7 * run->smallest && rest > run->brief) {
            h = run->lengths[++level];
        }
        look_round(run);
        if (h > rest + 1e-7 * run->smallest) {
            h = rest;
            step_short(run, h, trial);
        } else if (run->flat) {
            step_short(run, h, trial);
        } else {
            const int mask = mode(run);
            if (run->table[mask] == NULL && (run->table[mask] = tabulate(run, mask, k->step, run->levels)) == NULL) {
                return -1;
            }
            step_table(run, run->table[mask], level, h, trial);
        }
        c = events < MOST_EVENTS ? first_overdue(run, trial, run->t + h) : -1;
        if (c >= 0 && level < finest) {
            bound = ++level; /* halve until the moment is known to the shortest length */
            continue;
        }
        if (c >= 0) {
            const double from = overdue(run, run->x, run->t, c), to = overdue(run, trial, run->t + h, c);
            const double part = from < 0.0 ? from / (from - to) : 1.0; /* on the edge: one step shows which way */
            h *= part;
            if (h > 0.0) {
                step_short(run, h, trial);
                memcpy(run->x, trial, bytes);
                run->t += h;
                rest -= h;
            }
            decide(run, c);
            ++events;
            run->known = 0;
            feel(run);
            bound = 0;
            level = run->moving ? coarsest(run, rest) : start;
            continue;
        }
        const int next = bodies ? touching(run, trial, run->t + h, &pressed) : 0;
        if (next != run->touch && level < sharpest && events < MOST_EVENTS) {
            bound = ++level;
            continue;
        }
        memcpy(run->x, trial, bytes);
        run->t += h;
        rest -= h;
        run->known = 0;
        if (next != run->touch) {
            run->touch = next;
            run->pressed = pressed;
            ++events;
            bound = 0;
            level = start;
        }
        if (fabs(rest) < 1e-7 * run->smallest) {
            break;
        }
        if (run->moving && rest > 0.0) {
            const int wanted = coarsest(run, rest);
            level = wanted > bound ? wanted : bound;
        }
    }
    return 0;
}

static void read_outputs(const run_t *run, const double *u, int segment, double *y) {
    const problem_t *k = run->k;
    for (int j = k->reads[segment]; j < k->reads[segment + 1]; ++j) {
        double whole[MOST];
        view_t v = {0};
        if (k->terms > 0) {
            v = look(run, run->x, u, run->t);
        }
        if (k->reading != NULL) {
            k->reading(run->x, u, k->p, whole);
        }
        for (int o = 0; o < k->r; ++o) {
            if (k->read_output[j] < 0 || k->read_output[j] == o) {
                double value =
                    dot(SIZE(k), &k->read_x[o * SIZE(k)], run->x) + dot(DRIVES(k), &k->read_u[o * DRIVES(k)], u);
                int lagged = 0;
                for (int l = 0; l < k->lags; ++l) {
                    lagged |= k->lag[2 * l] == o;
                }
                value += k->read_c[o];
                value += k->reading != NULL && !lagged ? whole[o] : 0.0;
                for (int f = 0; f < k->terms; ++f) {
                    if (k->term[f].what == OUTPUT && k->term[f].target == o) {
                        v.y = value;
                        value = term_of(run, &k->term[f], &v);
                    }
                }
                y[k->read_row[j] * k->r + o] = value;
            }
        }
    }
}

static const double STILL[MOST] = {0.0};

static void set_out(run_t *run, const problem_t *k, const double *x0) {
    const int n = SIZE(k);
    double reach = 0.0, whole[MOST * MOST];
    memset(run, 0, sizeof *run);
    run->k = k;
    run->memo = &run->remembered;
    run->flat = 1;
    for (int i = 0; i < n * n; ++i) {
        whole[i] = fabs(k->a[i]);
    }
    for (int j = 0; j < k->terms; ++j) {
        for (int i = 0; k->term[j].flank && i < n; ++i) {
            whole[k->term[j].target * n + i] += fabs(k->term[j].per * k->flanks[j * n + i]);
        }
    }
    for (int i = 0; i < n; ++i) {
        double sum = 0.0;
        for (int j = 0; j < n; ++j) {
            sum += whole[i * n + j];
        }
        reach = fmax(reach, sum);
        run->flat &= sum == 0.0;
        run->x[i] = x0[i];
    }
    run->levels = 11;
    while (run->levels < LEVELS && ldexp(k->step, 1 - run->levels) * reach > FINEST) {
        ++run->levels;
    }
    run->smallest = ldexp(k->step, 1 - run->levels);
    for (int level = 0; level < run->levels; ++level) {
        run->lengths[level] = ldexp(k->step, -level);
    }
    run->brief = reach > 0.0 ? BRIEF / (k->asked & TOUCH ? fastest(n, whole, SQUARED) : reach) : 0.0;
    run->moving = k->settling;
    for (int j = 0; j < k->terms; ++j) {
        run->moving |= k->term[j].rate[2] != 0.0 || (is_memory(k->term[j].code) && k->term[j].position >= 0);
    }
    for (int c = 0; c < k->coordinates; ++c) {
        const coordinate_t *held = &k->coordinate[c];
        const double value = run->x[held->row];
        run->s[c] = held->what == LIMIT ? held->per * (value - held->limit) < 0.0 : (value > 0.0) - (value < 0.0);
    }
    const int memory = remembering(k);
    run->m[1] = memory >= 0 ? place_of(run, &k->term[memory]) : 0.0;
    run->ramp = STILL;
}

static void tidy_up(run_t *run) {
    for (int mask = 0; mask < 1 << (MOST_STUCK + MOST_FLANKS); ++mask) {
        free(run->table[mask]);
    }
    for (int j = 0; j < run->owned; ++j) {
        free(run->own[j]);
    }
}

/* Sum up what the input alone drives at the start of a segment. */
static void set_drive(run_t *run) {
    const problem_t *k = run->k;
    run->holds = 1;
    for (int j = 0; j < DRIVES(k); ++j) {
        run->holds &= run->ramp[j] == 0.0;
    }
    for (int i = 0; i < SIZE(k); ++i) {
        double sum = k->c[i];
        for (int j = 0; j < DRIVES(k); ++j) {
            sum += k->b[i * DRIVES(k) + j] * run->input[j];
        }
        run->held[i] = sum;
    }
}

/** Go on through the segments that the problem holds now; y (rows x r) is filled by the reads. Returns segments done,
 * -1 without memory. */
int go_on(run_t *run, double *y) {
    const problem_t *k = run->k;
    double u[MOST];
    run->input = k->before;
    run->ramp = STILL;
    memcpy(u, k->before, (size_t)DRIVES(k) * sizeof(double));
    run->t = run->begin = run->since = k->segments > 0 ? k->begin[0] : 0.0;
    read_outputs(run, u, 0, y);
    const int linear = is_linear(run);
    for (int done = 0; done < k->segments; ++done) {
        run->input = &k->input[done * DRIVES(k)];
        run->ramp = &k->ramp[done * DRIVES(k)];
        run->t = run->begin = run->since = k->begin[done];
        run->known = 0;
        set_drive(run);
        if (!linear || !glide(run, done)) {
            for (int c = 0; c < k->coordinates; ++c) {
                if (run->s[c] == 0 && overdue(run, run->x, run->t, c) > 0.0) {
                    decide(run, c);
                    run->known = 0;
                }
            }
            const int status = advance(run, k->length[done]);
            if (status != 0) {
                return status < 0 ? status : done;
            }
        }
        for (int i = 0; i < SIZE(k); ++i) {
            if (!(fabs(run->x[i]) < 1e15)) {
                return done;
            }
        }
        input_at(run, k->begin[done] + k->length[done], u);
        read_outputs(run, u, done + 1, y);
    }
    return k->segments;
}

/** Run all segments from state x0, as `go_on` does. */
int run_segments(const problem_t *k, const double *x0, double *y) {
    run_t run;
    int done;
    set_out(&run, k, x0);
    done = go_on(&run, y);
    if (k->taken != NULL) {
        *k->taken += k->simple ? 0.5 * run.steps : run.steps; /* with what is done to its rows, about what it costs */
    }
    tidy_up(&run);
    return done;
}

/** Start a run from state x0 that goes on call by call, until `end_run`; NULL without memory. */
run_t *begin_run(const problem_t *k, const double *x0) {
    run_t *run = malloc(sizeof *run);
    if (run != NULL) {
        set_out(run, k, x0);
    }
    return run;
}

/** Give back what a run holds. */
void end_run(run_t *run) {
    tidy_up(run);
    free(run);
}

/** Rate and outputs at one point, as a segment that begins at time 0 would see them. */
void at_point(const problem_t *k, const double *x, const double *u, double *rate, double *y) {
    const double still[MOST] = {0.0};
    run_t run = {.k = k, .m = {0.0, 0.0}, .input = u, .ramp = still};
    run.memo = &run.remembered;
    memcpy(run.x, x, (size_t)SIZE(k) * sizeof(double));
    full_rate(&run, x, 0.0, rate);
    read_outputs(&run, u, 0, y);
}

/** Follow a target that is `target` (rows) at `time` and moves by `slope` per s until the next, no faster than `rate`,
 * from `value`; writes (time, value, slope) of each straight piece, at most two per row, and returns how many. */
int limit_slew(int rows, const double *time, const double *target, const double *slope, double rate, double value,
               double *pieces) {
    int count = 0;
    for (int k = 0; k < rows; ++k) {
        const double gap = target[k] - value, span = k + 1 < rows ? time[k + 1] - time[k] : INFINITY;
        const double along = copysign(fmin(fabs(slope[k]), rate), slope[k]); /* once the target is met */
        const double chase = copysign(rate, gap), closing = rate - copysign(1.0, gap) * slope[k];
        const double needed = gap == 0.0 ? 0.0 : closing > 0.0 ? fabs(gap) / closing : INFINITY;
        if (needed > 0.0) {
            double *piece = &pieces[3 * count++];
            piece[0] = time[k];
            piece[1] = value;
            piece[2] = chase;
        }
        if (needed < span) {
            double *piece = &pieces[3 * count++];
            piece[0] = time[k] + needed;
            piece[1] = target[k] + slope[k] * needed;
            piece[2] = along;
            value = along == slope[k] ? target[k] + slope[k] * span : piece[1] + along * (span - needed);
        } else {
            value += chase * span;
        }
    }
    return count;
}
