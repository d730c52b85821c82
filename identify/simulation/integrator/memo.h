/* memo.h -- keeps what was computed last: a step asks for the same moment, and the same angle of a wave, twice. */
#ifndef MEMO_H
#define MEMO_H

#include <math.h>

#define SINES 4 /* of two waves, at two moments */

typedef struct {
    double angle[SINES], sine[SINES];
    double moment, turn; /* s, rad: the recorded angle at a moment */
    int next, turned;    /* where the next sine goes; whether there is a turn */
} memo_t;

static double remembered_sine(memo_t *memo, double angle) {
    for (int k = 0; k < SINES; ++k) {
        if (memo->angle[k] == angle) { /* zeroes are right from the start */
            return memo->sine[k];
        }
    }
    const int k = memo->next;
    memo->next = (k + 1) % SINES;
    memo->angle[k] = angle;
    memo->sine[k] = sin(angle);
    return memo->sine[k];
}

#endif
