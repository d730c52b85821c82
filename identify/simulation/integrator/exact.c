/* exact.c -- moves a plant that is linear in state and input by matrix exponentials.
 *
 * With z = (x, u, 1), dx/dt = M z. The propagators exp(M h) and their derivatives for the constants are tabulated for
 * lengths h that double from a short one (scaling and squaring; the derivative of a square is E D + D E). A length is
 * composed of tabulated ones, and what is left is moved by a Taylor series of the vector itself, short because little
 * is left. Rows that are evenly spaced therefore cost one product each, however stiff the plant is.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "advance.h"

#define WIDTH (N_STATE + N_INPUT + 1)
#define SIZE (N_STATE * WIDTH)
#define AT(matrix, i, c) ((matrix)[(c)*N_STATE + (i)])
#define LARGEST_REST 0.5 /* norm of M h up to which the Taylor series is used: 16 terms then reach 1e-18 */
#define MOST_TERMS 16
#define MOST_LEVELS 60

static double norm(const double *m) {
    double largest = 0.0;
    for (int i = 0; i < N_STATE; ++i) {
        double sum = 0.0;
        for (int c = 0; c < N_STATE; ++c) {
            sum += fabs(AT(m, i, c));
        }
        largest = fmax(largest, sum);
    }
    return largest;
}

/* out += scale a[:, states] b */
static void add_product(double *out, const double *a, const double *b, double scale) {
    for (int c = 0; c < WIDTH; ++c) {
        for (int k = 0; k < N_STATE; ++k) {
            for (int i = 0; i < N_STATE; ++i) {
                AT(out, i, c) += scale * AT(a, i, k) * AT(b, k, c);
            }
        }
    }
}

static void tabulate_shortest(course_t *course) {
    double term[SIZE];
    double next[SIZE];
    double *e = course->ladder;
    const double h = course->ladder_step;
    for (int j = 0; j < SIZE; ++j) {
        term[j] = h * course->linear[j];
        e[j] = term[j] + (j / N_STATE == j % N_STATE ? 1.0 : 0.0);
    }
    for (int d = 0; d < course->directions; ++d) {
        const double *by_p = &course->linear_by_p[course->direction[d] * SIZE];
        double base[SIZE];
        double slope[SIZE];
        double *total = &e[(d + 1) * SIZE];
        for (int j = 0; j < SIZE; ++j) {
            base[j] = h * course->linear[j];
            slope[j] = h * by_p[j];
            total[j] = slope[j];
        }
        for (int q = 2; q <= MOST_TERMS; ++q) {
            double slope_next[SIZE] = {0.0};
            double base_next[SIZE] = {0.0};
            add_product(slope_next, by_p, base, h / q);
            add_product(slope_next, course->linear, slope, h / q);
            add_product(base_next, course->linear, base, h / q);
            memcpy(slope, slope_next, sizeof slope);
            memcpy(base, base_next, sizeof base);
            for (int j = 0; j < SIZE; ++j) {
                total[j] += slope[j];
            }
        }
    }
    for (int q = 2; q <= MOST_TERMS; ++q) {
        memset(next, 0, sizeof next);
        add_product(next, course->linear, term, h / q);
        memcpy(term, next, sizeof term);
        for (int j = 0; j < SIZE; ++j) {
            e[j] += term[j];
        }
    }
}

/* The columns of an input or of the constant meet the identity in the lower rows of the right factor. */
static void square(const double *from, double *to, int directions) {
    for (int d = 0; d <= directions; ++d) {
        double *out = &to[d * SIZE];
        const double *derivative = &from[d * SIZE];
        for (int j = 0; j < SIZE; ++j) {
            out[j] = j / N_STATE >= N_STATE ? derivative[j] : 0.0;
        }
        add_product(out, derivative, from, 1.0);
        if (d > 0) {
            add_product(out, from, derivative, 1.0);
        }
    }
}

static int prepare(course_t *course, double longest) {
    const int block = SIZE * (course->directions + 1);
    double top = course->step;
    double reach;
    course->levels = 1;
    plant_linear(course->p, course->linear, course->linear_by_p);
    reach = norm(course->linear);
    course->ladder_step = course->step;
    while (reach * course->ladder_step > LARGEST_REST && course->levels < MOST_LEVELS) {
        course->ladder_step *= 0.5;
        ++course->levels;
    }
    while (2.0 * top <= longest && course->levels < MOST_LEVELS) {
        top *= 2.0;
        ++course->levels;
    }
    course->ladder = malloc((size_t)(block * course->levels) * sizeof(double));
    if (course->ladder == NULL) {
        return 1;
    }
    tabulate_shortest(course);
    for (int level = 1; level < course->levels; ++level) {
        square(&course->ladder[(level - 1) * block], &course->ladder[level * block], course->directions);
    }
    return 0;
}

static void finish(course_t *course) {
    free(course->ladder);
    course->ladder = NULL;
}

/* out += a z */
static void add_full(double *out, const double *a, const double *x, const double *u, double scale) {
    for (int c = 0; c < N_STATE; ++c) {
        for (int i = 0; i < N_STATE; ++i) {
            out[i] += scale * AT(a, i, c) * x[c];
        }
    }
    for (int c = 0; c < N_INPUT; ++c) {
        for (int i = 0; i < N_STATE; ++i) {
            out[i] += scale * AT(a, i, N_STATE + c) * u[c];
        }
    }
    for (int i = 0; i < N_STATE; ++i) {
        out[i] += scale * AT(a, i, N_STATE + N_INPUT);
    }
}

static void add_state(double *out, const double *a, const double *x, double scale) {
    for (int c = 0; c < N_STATE; ++c) {
        for (int i = 0; i < N_STATE; ++i) {
            out[i] += scale * AT(a, i, c) * x[c];
        }
    }
}

static void apply(const course_t *course, motion_t *motion, const double *propagator) {
    const int total = course->directions + (course->start ? N_STATE : 0);
    double x[N_STATE] = {0.0};
    for (int d = 0; d < total; ++d) {
        double s[N_STATE] = {0.0};
        add_state(s, propagator, &motion->s[d * N_STATE], 1.0);
        if (d < course->directions) {
            add_full(s, &propagator[(d + 1) * SIZE], motion->x, motion->u, 1.0);
        }
        memcpy(&motion->s[d * N_STATE], s, sizeof s);
    }
    add_full(x, propagator, motion->x, motion->u, 1.0);
    memcpy(motion->x, x, sizeof x);
}

static void apply_rest(const course_t *course, motion_t *motion, double rest, int terms) {
    const int total = course->directions + (course->start ? N_STATE : 0);
    const double *m = course->linear;
    double v[N_STATE] = {0.0};
    double w[N_DIRECTION * N_STATE] = {0.0};
    add_full(v, m, motion->x, motion->u, rest);
    for (int d = 0; d < total; ++d) {
        add_state(&w[d * N_STATE], m, &motion->s[d * N_STATE], rest);
        if (d < course->directions) {
            add_full(&w[d * N_STATE], &course->linear_by_p[course->direction[d] * SIZE], motion->x, motion->u, rest);
        }
    }
    for (int q = 2;; ++q) {
        double v_next[N_STATE] = {0.0};
        for (int i = 0; i < N_STATE; ++i) {
            motion->x[i] += v[i];
        }
        for (int j = 0; j < total * N_STATE; ++j) {
            motion->s[j] += w[j];
        }
        if (q > terms) {
            return;
        }
        for (int d = 0; d < total; ++d) {
            double w_next[N_STATE] = {0.0};
            add_state(w_next, m, &w[d * N_STATE], rest / q);
            if (d < course->directions) {
                add_state(w_next, &course->linear_by_p[course->direction[d] * SIZE], v, rest / q);
            }
            memcpy(&w[d * N_STATE], w_next, sizeof w_next);
        }
        add_state(v_next, m, v, rest / q);
        memcpy(v, v_next, sizeof v);
    }
}

static void advance(const course_t *course, motion_t *motion, double length) {
    const int block = SIZE * (course->directions + 1);
    double rung = ldexp(course->ladder_step, course->levels - 1);
    double rest = length;
    for (int level = course->levels - 1; level >= 0; --level) {
        /* Half of the shortest length may be overshot: the series goes back as well as forth. */
        while (rest >= rung - 0.5 * course->ladder_step) {
            apply(course, motion, &course->ladder[level * block]);
            rest -= rung;
        }
        rung *= 0.5;
    }
    if (rest != 0.0) {
        double size = norm(course->linear) * fabs(rest);
        double term = size;
        int terms = 2;
        while (term > 1e-17 && terms < MOST_TERMS) {
            term *= size / terms;
            ++terms;
        }
        apply_rest(course, motion, rest, terms);
    }
}
