/* runge_kutta.c -- moves any plant by a Runge-Kutta formula of order five with short enough substeps.
 *
 * Of Dormand and Prince, J. Comput. Appl. Math. 6 (1980) 19-26: six slopes see twice as far as four of order four.
 * How short follows from how fast the equations change where the plant is: at rest nothing tells of a machine's speed.
 * The sensitivities obey ds/dt = (drate/dx) s + drate/dp and are moved by the same formula, so that they are the exact
 * derivative of the computed motion.
 */
#include <math.h>
#include <string.h>

#include "advance.h"

#define MOST N_STATE
#include "fastest.h"

#define MOST_SUBSTEPS 512.0 /* of a row: a search that has gone as far astray as that is held up for nothing */
#define ROUNDED 1e-6 /* of a row: what is longer by that is no longer */
#define LONGEST 0.2  /* substep times how fast the equations change: a decay is then right to 1e-7 */
#define SLOPES 6

/* What of the slopes so far leads to where the next is taken; of all six, to the end. */
static const double SHARE[SLOPES][SLOPES] = {
    {1.0 / 5.0},
    {3.0 / 40.0, 9.0 / 40.0},
    {44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0},
    {19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0},
    {9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0},
    {35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0},
};

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

/* out = from + length * the shares of the first `count` slopes */
static void shift(const course_t *course, motion_t *out, const motion_t *from, const motion_t *by, int count,
                  double length) {
    const int total = (course->directions + (course->start ? N_STATE : 0)) * N_STATE;
    motion_t sum;
    memset(sum.x, 0, sizeof sum.x);
    memset(sum.s, 0, (size_t)total * sizeof(double));
    for (int k = 0; k < count; ++k) {
        const double share = SHARE[count - 1][k];
        for (int i = 0; i < N_STATE; ++i) {
            sum.x[i] += share * by[k].x[i];
        }
        for (int j = 0; j < total; ++j) {
            sum.s[j] += share * by[k].s[j];
        }
    }
    for (int i = 0; i < N_STATE; ++i) {
        out->x[i] = from->x[i] + length * sum.x[i];
    }
    for (int j = 0; j < total; ++j) {
        out->s[j] = from->s[j] + length * sum.s[j];
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

/* Move by a length over which how fast the equations change is that of its beginning. */
static void leap(const course_t *course, motion_t *motion, double length) {
    double by_x[N_STATE * N_STATE];
    plant_rate_by_state(motion->x, motion->u, course->p, by_x);
    for (int j = 0; j < N_STATE * N_STATE; ++j) {
        by_x[j] = isfinite(by_x[j]) ? by_x[j] : 0.0;
    }
    const double needed = ceil(length * fastest(N_STATE, by_x, MOST_SQUARED) / LONGEST);
    const int substeps = (int)fmin(fmax(needed, 1.0), MOST_SUBSTEPS);
    const double h = length / substeps;
    motion_t by[SLOPES], there;
    memcpy(there.u, motion->u, sizeof there.u);
    for (int step = 0; step < substeps; ++step) {
        slope(course, motion, &by[0]);
        for (int k = 1; k < SLOPES; ++k) {
            shift(course, &there, motion, by, k, h);
            slope(course, &there, &by[k]);
        }
        shift(course, motion, motion, by, SLOPES, h);
    }
}

static void advance(const course_t *course, motion_t *motion, double length) {
    const int rows = (int)fmin(fmax(ceil(length / course->step - ROUNDED), 1.0), MOST_SUBSTEPS);
    for (int row = 0; row < rows; ++row) {
        leap(course, motion, length / rows);
    }
}
