/* rows.c -- runs a plant over the rows of a recording.
 *
 * Output k is read at time[k], before input k acts; input k acts from time[k] + delay until the next one does; before
 * the first row the input is zero. The integration is split where the delayed input switches, so that neither uneven
 * time stamps nor a delay that is no multiple of them costs accuracy. Where the switch moves with the delay, the
 * sensitivity for the delay jumps by rate(old input) - rate(new input).
 */
#include <math.h>
#include <string.h>

#include "advance.h"

static void switch_input(const course_t *course, motion_t *motion, const double *input) {
    for (int d = 0; d < course->directions; ++d) {
        if (course->direction[d] == DELAY) {
            double before[N_STATE];
            double after[N_STATE];
            plant_rate(motion->x, motion->u, course->p, before);
            plant_rate(motion->x, input, course->p, after);
            for (int i = 0; i < N_STATE; ++i) {
                motion->s[d * N_STATE + i] += before[i] - after[i];
            }
        }
    }
    memcpy(motion->u, input, sizeof motion->u);
}

static void read_row(const course_t *course, const motion_t *motion, double *y, double *dy) {
    double by_x[N_OUTPUT * N_STATE];
    double by_p[N_OUTPUT * N_CONSTANT];
    const int total = course->directions + (course->start ? N_STATE : 0);
    if (total == 0) {
        plant_reading(motion->x, motion->u, course->p, y);
        return;
    }
    plant_reading_slopes(motion->x, motion->u, course->p, y, by_x, by_p);
    for (int d = 0; d < total; ++d) {
        for (int o = 0; o < N_OUTPUT; ++o) {
            double sum = d < course->directions ? by_p[course->direction[d] * N_OUTPUT + o] : 0.0;
            for (int i = 0; i < N_STATE; ++i) {
                sum += by_x[i * N_OUTPUT + o] * motion->s[d * N_STATE + i];
            }
            dy[o * total + d] = sum;
        }
    }
}

/** Run from row `first` up to, not including, row `end`, starting there in state x; inputs of earlier rows may still be
 * on their way. Returns the rows that came out finite (all of them when it went well), or -1 when memory ran out.
 *
 * time (end), input (end x N_INPUT), p (N_CONSTANT), x (N_STATE), y (end - first x N_OUTPUT),
 * dy (end - first x N_OUTPUT x (directions + N_STATE if start)), usual (N_STATE): the mean of x over the rows.
 */
int run_rows(int first, int end, const double *time, const double *input, const double *p, const double *x,
             double delay, double step, double longest, int directions, const int *direction, int start, double *y,
             double *dy, double *usual) {
    course_t course = {.p = p, .directions = directions, .direction = direction, .start = start, .step = step};
    motion_t motion = {{0.0}, {0.0}, {0.0}};
    int waiting = 0; /* the next row whose input has not acted yet */
    const int per_row = N_OUTPUT * (directions + (start ? N_STATE : 0));
    if (prepare(&course, longest) != 0) {
        return -1;
    }
    memcpy(motion.x, x, sizeof motion.x);
    for (int i = 0; start && i < N_STATE; ++i) {
        motion.s[(directions + i) * N_STATE + i] = 1.0;
    }
    while (waiting < first && time[waiting] + delay < time[first]) {
        memcpy(motion.u, &input[waiting * N_INPUT], sizeof motion.u);
        ++waiting;
    }
    for (int row = first; row < end; ++row) {
        const int done = row - first;
        double now = time[row];
        read_row(&course, &motion, &y[done * N_OUTPUT], dy + (size_t)done * (size_t)per_row);
        for (int o = 0; o < N_OUTPUT; ++o) {
            if (!isfinite(y[done * N_OUTPUT + o])) {
                finish(&course);
                return done;
            }
        }
        for (int i = 0; i < N_STATE; ++i) {
            usual[i] += (motion.x[i] - usual[i]) / (done + 1);
        }
        if (row + 1 == end) {
            break;
        }
        while (waiting < end && time[waiting] + delay < time[row + 1]) {
            const double moment = time[waiting] + delay;
            if (moment > now) {
                advance(&course, &motion, moment - now);
                now = moment;
            }
            switch_input(&course, &motion, &input[waiting * N_INPUT]);
            ++waiting;
        }
        advance(&course, &motion, time[row + 1] - now);
    }
    finish(&course);
    return end - first;
}
