/* stepped.c -- moves a plant from rest period by period: its inputs are held for one, and tell then what it reads.
 *
 * plant_data.h, which is generated, holds the plant: PLANT and START, PERIOD, LATE, SLEW, BREAKS, REST, WHOLE and AFTER,
 * map_input(), the sizes STATES_OF, INPUTS_OF and OUTPUTS_OF, and how much is kept: PIECES, QUEUE, CUTS.
 */
#include "segments.c"
#include "plant_data.h"

#include "stepped.h"

#define SAME 1e-9          /* of the period: moments closer than this are one */
#define SHORTEST 0.015625  /* of it: shorter lengths are left as they are */
#define EVEN 1e-6          /* of it: lengths this close to a half, a quarter ... are exactly that */

typedef struct {
    double moment, value[INPUTS_OF], ramp[INPUTS_OF];
} piece_t;

struct plant {
    problem_t problem;
    run_t *run;
    double count, now[INPUTS_OF];
    piece_t piece[PIECES]; /* oldest first */
    int pieces, failed;
    double seen[OUTPUTS_OF][QUEUE]; /* oldest first */
    double moment[CUTS], length[CUTS], input[CUTS * INPUTS_OF], ramp[CUTS * INPUTS_OF], before[INPUTS_OF];
    int reads[CUTS + 1], row[OUTPUTS_OF], output[OUTPUTS_OF];
};

/* Run through the segments that are laid out; `node` says after which of them each output is read. */
static int move(plant_t *p, int segments, const int *node, double *y) {
    int filled = 0;
    for (int k = 0; k <= segments; ++k) {
        p->reads[k] = filled;
        for (int o = 0; o < OUTPUTS_OF; ++o) {
            if (node[o] == k) {
                p->row[filled] = 0;
                p->output[filled++] = o;
            }
        }
    }
    p->reads[segments + 1] = filled;
    p->problem.segments = segments;
    if (go_on(p->run, y) < segments) {
        return 1;
    }
    for (int o = 0; o < OUTPUTS_OF; ++o) {
        if (!isfinite(y[o])) {
            return 1;
        }
    }
    return 0;
}

static double snapped(double length) {
    const double share = exp2(rint(log2(fmax(length / PERIOD, SHORTEST))));
    const int exact = share >= SHORTEST && share <= 1.0 && fabs(length - share * PERIOD) < EVEN * share * PERIOD;
    return exact ? share * PERIOD : length;
}

/** Put the plant to rest; NULL without memory. */
plant_t *plant_new(void) {
    plant_t *p = calloc(1, sizeof *p);
    const int none[OUTPUTS_OF] = {0};
    double y[OUTPUTS_OF] = {0.0};
    if (p == NULL) {
        return NULL;
    }
    p->problem = PLANT;
    p->problem.begin = p->moment;
    p->problem.length = p->length;
    p->problem.input = p->input;
    p->problem.ramp = p->ramp;
    p->problem.before = p->before;
    p->problem.reads = p->reads;
    p->problem.read_row = p->row;
    p->problem.read_output = p->output;
    memcpy(p->now, REST, sizeof p->now);
    memcpy(p->before, REST, sizeof p->before);
    memcpy(p->piece[0].value, REST, sizeof p->now);
    p->piece[0].moment = -INFINITY;
    p->pieces = 1;
    p->run = begin_run(&p->problem, START);
    if (p->run == NULL) {
        free(p);
        return NULL;
    }
    p->failed = move(p, 0, none, y);
    for (int o = 0; o < OUTPUTS_OF; ++o) {
        for (int k = 0; k <= WHOLE[o]; ++k) {
            p->seen[o][k] = y[o];
        }
    }
    return p;
}

void plant_free(plant_t *p) {
    end_run(p->run);
    free(p);
}

double plant_output(const plant_t *p, int output) { return p->seen[output][0]; }

static piece_t *next_piece(plant_t *p, double moment) {
    piece_t *next = &p->piece[p->pieces++];
    memset(next, 0, sizeof *next);
    next->moment = moment;
    return next;
}

/* Note what the actuator does from `begin` on: it jumps, or its first input moves at the fastest slope. */
static void follow(plant_t *p, const double *target, double begin) {
    const double moment = begin + LATE, gap = target[0] - p->now[0], needed = fabs(gap) / SLEW;
    piece_t *next = next_piece(p, moment);
    memcpy(next->value, target, sizeof p->now);
    if (!isfinite(SLEW) || gap == 0.0) {
        memcpy(p->now, target, sizeof p->now);
        return;
    }
    next->value[0] = p->now[0];
    next->ramp[0] = copysign(SLEW, gap);
    if (needed < PERIOD) {
        memcpy(next_piece(p, moment + needed)->value, target, sizeof p->now);
        memcpy(p->now, target, sizeof p->now);
    } else {
        const double reached = p->now[0] + next->ramp[0] * PERIOD;
        memcpy(p->now, target, sizeof p->now);
        p->now[0] = reached;
    }
}

static int by_size(const void *one, const void *other) {
    const double a = *(const double *)one, b = *(const double *)other;
    return (a > b) - (a < b);
}

/** Hold the inputs (INPUTS_OF) for one period; 1 where the plant has grown without bound. */
int plant_step(plant_t *p, const double *given) {
    const double begin = p->count * PERIOD, end = (p->count + 1.0) * PERIOD, same = SAME * PERIOD;
    double cut[CUTS], target[INPUTS_OF], y[OUTPUTS_OF] = {0.0};
    int node[OUTPUTS_OF], cuts = 0, moments = 0, spent = 0;
    if (p->failed) {
        return 1;
    }
    memcpy(target, given, sizeof target);
    target[0] = map_input(target[0]);
    follow(p, target, begin);
    p->count += 1.0;
    cut[cuts++] = begin;
    cut[cuts++] = end;
    for (int o = 0; o < OUTPUTS_OF; ++o) {
        cut[cuts++] = begin + AFTER[o];
    }
    for (int k = 0; k < p->pieces; ++k) {
        cut[cuts++] = p->piece[k].moment;
    }
    for (int k = 0; k < N_BREAKS; ++k) {
        cut[cuts++] = BREAKS[k];
    }
    qsort(cut, (size_t)cuts, sizeof *cut, by_size);
    for (int k = 0, last = -1; k < cuts; ++k) {
        if (cut[k] < begin || cut[k] > end) {
            continue;
        }
        if (last < 0 || cut[k] - cut[last] > same) {
            p->moment[moments++] = cut[k];
        }
        last = k;
    }
    if (end - p->moment[moments - 1] > 0.0) {
        p->moment[moments - 1] = end; /* the one before it was within rounding of the end */
    }
    for (int k = 0; k + 1 < moments; ++k) {
        const piece_t *piece = p->piece;
        for (int j = 0; j < p->pieces; ++j) {
            piece = p->piece[j].moment <= p->moment[k] + same ? &p->piece[j] : piece;
        }
        for (int j = 0; j < INPUTS_OF; ++j) {
            const double since = isinf(piece->moment) ? 0.0 : p->moment[k] - piece->moment;
            p->input[k * INPUTS_OF + j] = piece->value[j] + piece->ramp[j] * since;
            p->ramp[k * INPUTS_OF + j] = piece->ramp[j];
        }
        p->length[k] = snapped(p->moment[k + 1] - p->moment[k]);
    }
    memcpy(p->before, p->input, sizeof p->before);
    while (spent + 1 < p->pieces && p->piece[spent + 1].moment <= end + same) {
        ++spent;
    }
    p->pieces -= spent;
    memmove(p->piece, &p->piece[spent], (size_t)p->pieces * sizeof *p->piece);
    for (int o = 0; o < OUTPUTS_OF; ++o) {
        node[o] = 0;
        for (int k = 1; k < moments; ++k) {
            const double at = begin + AFTER[o];
            node[o] = fabs(p->moment[k] - at) < fabs(p->moment[node[o]] - at) ? k : node[o];
        }
    }
    if (move(p, moments - 1, node, y)) {
        p->failed = 1;
        return 1;
    }
    for (int o = 0; o < OUTPUTS_OF; ++o) {
        memmove(p->seen[o], &p->seen[o][1], (size_t)WHOLE[o] * sizeof(double));
        p->seen[o][WHOLE[o]] = y[o];
    }
    return 0;
}
