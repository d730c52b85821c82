/* runge_kutta.c -- moves any plant by the classical Runge-Kutta formula of order four with short enough substeps.
 *
 * The sensitivities obey ds/dt = (drate/dx) s + drate/dp and are moved by the same formula, so that they are the exact
 * derivative of the computed motion.
 */
#include <math.h>
#include <string.h>

#include "advance.h"

#define MOST_SUBSTEPS 4096.0

static void slope(const course_t *course, const motion_t *motion, motion_t *out) {
    const int total = course->directions + (course->start ? N_STATE : 0);
    double by_x[N_STATE * N_STATE];
    double by_p[N_STATE * N_CONSTANT];
    if (total == 0) {
        plant_rate(motion->x, motion->u, course->p, out->x);
        return;
    }
    plant_rate_slopes(motion->x, motion->u, course->p, out->x, by_x, by_p);
    for (int d = 0; d < total; ++d) {
        double *to = &out->s[d * N_STATE];
        for (int i = 0; i < N_STATE; ++i) {
            to[i] = d < course->directions ? by_p[course->direction[d] * N_STATE + i] : 0.0;
        }
        for (int c = 0; c < N_STATE; ++c) { /* column by column, so that the compiler can take rows together */
            const double share = motion->s[d * N_STATE + c];
            for (int i = 0; i < N_STATE; ++i) {
                to[i] += by_x[c * N_STATE + i] * share;
            }
        }
    }
}

static void shift(const course_t *course, motion_t *out, const motion_t *from, const motion_t *by, double length) {
    const int total = course->directions + (course->start ? N_STATE : 0);
    for (int i = 0; i < N_STATE; ++i) {
        out->x[i] = from->x[i] + length * by->x[i];
    }
    for (int j = 0; j < total * N_STATE; ++j) {
        out->s[j] = from->s[j] + length * by->s[j];
    }
}

static int prepare(course_t *course, double longest) {
    (void)course;
    (void)longest;
    return 0;
}

static void finish(course_t *course) {
    (void)course;
}

static void advance(const course_t *course, motion_t *motion, double length) {
    const int substeps = (int)fmin(fmax(ceil(length / course->step), 1.0), MOST_SUBSTEPS);
    const double h = length / substeps;
    motion_t k1;
    motion_t k2;
    motion_t k3;
    motion_t k4;
    motion_t middle;
    memcpy(middle.u, motion->u, sizeof middle.u);
    for (int step = 0; step < substeps; ++step) {
        slope(course, motion, &k1);
        shift(course, &middle, motion, &k1, 0.5 * h);
        slope(course, &middle, &k2);
        shift(course, &middle, motion, &k2, 0.5 * h);
        slope(course, &middle, &k3);
        shift(course, &middle, motion, &k3, h);
        slope(course, &middle, &k4);
        shift(course, motion, motion, &k1, h / 6.0);
        shift(course, motion, motion, &k2, h / 3.0);
        shift(course, motion, motion, &k3, h / 3.0);
        shift(course, motion, motion, &k4, h / 6.0);
    }
}
