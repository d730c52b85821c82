/* problem.h -- what a simulation of segments is given, and where it is.
 *
 * terms.c, which is generated, defines view_t, term() and is_memory(). Everything is one translation unit.
 */
#ifndef PROBLEM_H
#define PROBLEM_H

#define MOST 24      /* states */
#define MOST_STUCK 6 /* coordinates that may stick */
#define MOST_FLANKS 3 /* forces of bodies that touch */
#define MOST_TERMS 64
#define LEVELS 44
#define OWN 4          /* lengths that come back and are tabulated besides */
#define FINEST 1e-3    /* norm(A) h of the shortest tabulated length */
#define BRIEF 0.03     /* norm(A) h up to which the classical formula is right to 1e-9 */
#define MOST_EVENTS 64 /* in one segment; more is chatter */
#define SQUARED 3      /* times, for how fast something can change: within some 2 times */
#define BOUNCE 0.125   /* of how fast a flank's force changes: no step may miss that bodies touch */
#define SHARPEST 10    /* level of the step in which bodies come to touch, or part */

/* Built for plants of one size, loops have a known length. */
#ifdef STATES
#define SIZE(k) STATES
#else
#define SIZE(k) ((k)->n)
#endif
#ifdef INPUTS
#define DRIVES(k) INPUTS
#else
#define DRIVES(k) ((k)->m)
#endif

enum { ADD, LEVEL, FACTOR, OUTPUT };
enum { CURRENT = 1, EFFORT = 2, TURN = 4, TOUCH = 8 };
enum { FRICTION, LIMIT };

typedef void (*nominal_t)(const double *x, const double *u, const double *p, double *dx);
typedef void (*slope_t)(const double *x, const double *u, const double *p, double *dx, double *by_x);

typedef struct {
    int what, code, target, constants; /* target: row (ADD, FACTOR), coordinate (LEVEL), output (OUTPUT) */
    int flank;                         /* a bit of its own, where it is linear as long as bodies touch; 0: it is not */
    int speed, position;               /* states of the body it acts on, -1 for none */
    double per;                        /* factor of the term in its row */
    double rate[6];                    /* 1/s: constant, per |w|, |dw/dt|, i^2, |theta|; while the current settles */
} term_t;

typedef struct {
    int what, row, to;
    double per, limit, share;
} coordinate_t;

/** Everything that does not change during a run; filled from Python. */
typedef struct {
    int n, m, r, terms, coordinates, segments, simple, speed, position, lags, settling;
    int asked;                      /* what the terms look at: CURRENT, EFFORT, TURN; TOUCH */
    const double *a, *b, *c;        /* n x n, n x m, n; row by row */
    const double *read_x, *read_u, *read_c; /* r x n, r x m, r */
    const double *current, *effort; /* n + m each */
    const term_t *term;
    const double *flanks; /* terms x n: d term / d x of those, while they touch */
    const double *q;
    const coordinate_t *coordinate;
    const int *lag;                            /* pairs (output, row): filters of outputs that are not linear */
    const double *lag_rate;                    /* 1/s */
    const double *begin, *length;              /* s, one per segment */
    const double *input, *ramp;                /* segments x m */
    const double *before;                      /* m: the input before the first segment */
    const int *reads, *read_row, *read_output; /* reads: segments + 2 offsets; output -1: all */
    double step;                               /* s: the longest tabulated length */
    nominal_t rate, reading, bent;             /* bent: an effort that is not linear */
    slope_t slope;
    const double *p;
    double longest;                 /* rate of change of N, times the step */
    double most_steps;              /* of a run, after which it counts as diverged; 0: any number */
    int turns;                      /* 0: waves per turn follow the simulated angle */
    const double *turn_time, *turn; /* s, rad: the angle they follow instead */
    double lost;                    /* rad: by which the simulated angle is off */
    double *taken;                  /* the steps of all runs are added to this; NULL: nobody counts them */
} problem_t;

typedef struct {
    const problem_t *k;
    int levels, flat; /* flat: A is zero, and the formula is the classical one */
    double *table[1 << (MOST_STUCK + MOST_FLANKS)];
    double *own[OWN], own_length[OWN];
    int owned;
    int touch, pressed; /* which way flanks push, and their bits */
    int s[MOST_STUCK]; /* direction; 0: sticks (FRICTION); 1 free, 0 at the limit (LIMIT) */
    double x[MOST], m[2];
    double t, begin, since; /* s: now, start of the segment */
    const double *input, *ramp;
    double steps;           /* taken since the start */
    double smallest, brief; /* s: the shortest tabulated length; what is left over and no longer is one step */
    double lengths[LEVELS]; /* s, of every level */
    double held[MOST];      /* c + B u at the start of the segment */
    double first[MOST];     /* N where the run is now */
    int holds, known;       /* whether the input is held; whether `first` is that of now */
    int moving;             /* whether how fast N changes depends on where the plant is */
    memo_t *memo;           /* of `remembered`, or of whoever set the run up */
    memo_t remembered;
} run_t;

#endif
