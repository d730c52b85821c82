/* advance.h -- what the row loop asks of an integrator.
 *
 * plant.h, which is generated, defines N_STATE, N_INPUT, N_OUTPUT, N_CONSTANT, DELAY (index of the delay among the
 * constants, -1 for none) and declares the plant's functions. Everything is one translation unit, all names static.
 * Matrices are column by column, as CasADi writes them.
 */
#ifndef ADVANCE_H
#define ADVANCE_H

#include "plant.h"

#define N_DIRECTION (N_CONSTANT + N_STATE) /* the most sensitivities there can be */

/** Where the plant is, and how that depends on what is differentiated for. */
typedef struct {
    double x[N_STATE];
    double u[N_INPUT];               /**< the input in force */
    double s[N_DIRECTION * N_STATE]; /**< dx/d(direction), one direction after the other */
} motion_t;

/** What stays the same over a recording. */
typedef struct {
    const double *p;      /**< constants */
    int directions;       /**< constants differentiated for; 0 together with start 0: no sensitivities */
    const int *direction; /**< their indices */
    int start;            /**< 1: also differentiate for the N_STATE initial states */
    double step;          /**< s; typical row distance */
    double ladder_step;   /**< s; shortest tabulated length */
    int levels;           /**< tabulated lengths, each twice the one before */
    double *ladder;       /**< their propagators */
    double linear[N_STATE * (N_STATE + N_INPUT + 1)];
    double linear_by_p[N_STATE * (N_STATE + N_INPUT + 1) * N_CONSTANT];
} course_t;

/** Prepare `course` for rows up to `longest` seconds apart; 0, or 1 when memory ran out. */
static int prepare(course_t *course, double longest);

/** Free what prepare() took. */
static void finish(course_t *course);

/** Move by `length` seconds while the input in force stays as it is. */
static void advance(const course_t *course, motion_t *motion, double length);

#endif
