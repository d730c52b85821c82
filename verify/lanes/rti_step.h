/* rti_step.h -- the iterations of a nonlinear predictive controller: quantize/twins/rti.py compiled, for one NUMBER.
 *
 * It shares nothing with the C that is generated. The order of every sum is that of the file above, and no product is
 * added before it is rounded.
 */

#define COURSE JOIN(course_, KIND)
#define WORK JOIN(work_, KIND)
#define NAMED(name) JOIN(name##_, KIND)

/* A problem, as RtiCourse has it: n states, m inputs, c states with limits. Its parameters stand in rows, as its results
 * and the status do from `target` on; the model is a plan with rows of its own, from x and u to what `found` is. */
typedef struct {
    int64_t n, m, length, c, iterations, budget, parameter_count, target;
    const int64_t *limited;
    const NUMBER *q, *r, *p, *change, *rest, *low, *high, *weight;
    double tolerance, trusted, least;
    const int32_t *parameters;
    const plan_t *model;
    NUMBER *model_rows;
    NUMBER *room; /* of one lane's work, then of all their plans */
} COURSE;

/* The plans of WIDTH lanes: all of a lane stand one after the other, but `target` and `last`, which are read once. */
typedef struct {
    NUMBER *found; /* by the model: states, then slopes row by row, of each sample */
    NUMBER *target, *last, *x, *u, *fallback, *largest;
    int64_t status[WIDTH];
    uint8_t warm[WIDTH];
} JOIN(plans_, KIND);

#define PLANS JOIN(plans_, KIND)

static void JOIN(compute_, KIND)(const plan_t *plan, NUMBER *rows, int64_t width);

/* One lane: its plan, and what stands for it in rti.py and rti_search.py; `limits` is G, `w` is of each state by each
 * move. */
typedef struct {
    int64_t size, rows;
    const NUMBER *found, *target, *last;
    NUMBER *x, *u;
    NUMBER *e, *w, *slope, *g, *h, *factor, *inverse, *scaled, *right, *step;
    NUMBER *limits, *v, *low, *high, *value, *least, *weight, *held, *side, *column, *t;
} WORK;

static NUMBER NAMED(dot)(const NUMBER *one, const NUMBER *other, int64_t count)
{
    NUMBER sum = one[0] * other[0];
    for (int64_t j = 1; j < count; j++) {
        sum += one[j] * other[j];
    }
    return sum;
}

/* What the model gives for sample `k`. */
static const NUMBER *NAMED(after)(const COURSE *q, const WORK *s, int64_t k)
{
    return s->found + k * q->n * (1 + q->n + q->m);
}

/* The slopes of state `i` by the states and inputs of sample `k`. */
static const NUMBER *NAMED(slopes)(const COURSE *q, const WORK *s, int64_t k, int64_t i)
{
    return NAMED(after)(q, s, k) + q->n + i * (q->n + q->m);
}

/* What `k`'s plan lacks in state `i`. */
static NUMBER NAMED(lack)(const COURSE *q, const WORK *s, int64_t k, int64_t i)
{
    return NAMED(after)(q, s, k)[i] - s->x[(k + 1) * q->n + i];
}

/* Divides the room, and writes what is the same for all lanes; returns what is left. */
static NUMBER *NAMED(begin)(const COURSE *q, WORK *s)
{
    const int64_t size = q->length * q->m, rows = size + q->length * q->c;
    NUMBER *room = q->room;
    s->size = size;
    s->rows = rows;
#define TAKE(to, count) ((to) = room, room += (count))
    TAKE(s->e, (q->length + 1) * q->n);
    TAKE(s->w, (q->length + 1) * size * q->n);
    TAKE(s->slope, (size + 1) * q->n);
    TAKE(s->g, size);
    TAKE(s->h, size * size);
    TAKE(s->factor, size * size);
    TAKE(s->inverse, size);
    TAKE(s->scaled, size);
    TAKE(s->right, size);
    TAKE(s->step, size);
    TAKE(s->limits, rows * size);
    TAKE(s->v, rows * size);
    TAKE(s->low, rows);
    TAKE(s->high, rows);
    TAKE(s->value, rows);
    TAKE(s->least, rows);
    TAKE(s->weight, rows);
    TAKE(s->held, rows);
    TAKE(s->side, rows);
    TAKE(s->column, rows);
    TAKE(s->t, rows * rows);
    for (int64_t i = 0; i < rows; i++) {
        s->weight[i] = (i < size) ? q->weight[i % q->m] : q->weight[q->m + (i - size) % q->c];
    }
    for (int64_t i = 0; i < size * size; i++) {
        s->limits[i] = (NUMBER)((i % (size + 1) == 0) ? 1 : 0);
    }
    return room;
}

/* The states that the plan's moves lead to, linearized. */
static void NAMED(lead)(const COURSE *q, WORK *s)
{
    const int64_t n = q->n;
    NUMBER *lag = s->slope;
    for (int64_t i = 0; i < n; i++) {
        s->e[i] = s->x[i];
        lag[i] = 0;
    }
    for (int64_t k = 0; k < q->length; k++) {
        NUMBER *e = s->e + (k + 1) * n;
        for (int64_t i = 0; i < n; i++) {
            NUMBER sum = NAMED(lack)(q, s, k, i);
            for (int64_t j = 0; j < n; j++) {
                sum += NAMED(slopes)(q, s, k, i)[j] * lag[j];
            }
            e[i] = sum;
        }
        for (int64_t i = 0; i < n; i++) {
            lag[i] = e[i];
            e[i] = s->x[(k + 1) * n + i] + lag[i];
        }
    }
}

/* to = matrix (e[k] - target) */
static void NAMED(away)(const COURSE *q, const WORK *s, const NUMBER *matrix, int64_t k, NUMBER *to)
{
    for (int64_t i = 0; i < q->n; i++) {
        const NUMBER *row = matrix + i * q->n, *e = s->e + k * q->n;
        NUMBER sum = row[0] * (e[0] - s->target[0]);
        for (int64_t j = 1; j < q->n; j++) {
            sum += row[j] * (e[j] - s->target[j]);
        }
        to[i] = sum;
    }
}

/* to += A[k]' slope */
static void NAMED(back)(const COURSE *q, const WORK *s, int64_t k, const NUMBER *slope, NUMBER *to)
{
    for (int64_t j = 0; j < q->n; j++) {
        const NUMBER *a = NAMED(slopes)(q, s, k, j);
        for (int64_t i = 0; i < q->n; i++) {
            to[i] += a[i] * slope[j];
        }
    }
}

static void NAMED(gradient)(const COURSE *q, WORK *s)
{
    const int64_t n = q->n, m = q->m;
    NUMBER *slope = s->slope, *before = s->slope + n;
    NAMED(away)(q, s, q->p, q->length, slope);
    for (int64_t k = q->length - 1; k >= 0; k--) {
        for (int64_t i = 0; i < m; i++) {
            const NUMBER *r = q->r + i * m, *u = s->u + k * m;
            NUMBER sum = r[0] * (u[0] - q->rest[0]);
            for (int64_t j = 1; j < m; j++) {
                sum += r[j] * (u[j] - q->rest[j]);
            }
            for (int64_t j = 0; j < n; j++) {
                sum += NAMED(slopes)(q, s, k, j)[n + i] * slope[j];
            }
            s->g[k * m + i] = sum;
        }
        NAMED(away)(q, s, q->q, k, before);
        NAMED(back)(q, s, k, slope, before);
        NUMBER *old = slope;
        slope = before;
        before = old;
    }
    for (int64_t k = 0; k < q->length; k++) {
        for (int64_t i = 0; i < m; i++) {
            const NUMBER *u = s->u + k * m + i, *g = &s->g[k * m + i];
            NUMBER sum = *g + q->change[i] * (*u - ((k > 0) ? u[-m] : s->last[i]));
            if (k + 1 < q->length) {
                sum -= q->change[i] * (u[m] - *u);
            }
            s->g[k * m + i] = sum;
        }
    }
}

/* Sends every move through the horizon, and what it changes there back to the moves before. */
static void NAMED(hessian)(const COURSE *q, WORK *s)
{
    const int64_t n = q->n, m = q->m, size = s->size;
#define MOVED(k, c) (s->w + ((k) * size + (c)) * n)
    for (int64_t k = 0; k < q->length; k++) {
        const int64_t done = k * m;
        for (int64_t i = 0; i < n; i++) {
            const NUMBER *slopes = NAMED(slopes)(q, s, k, i);
            for (int64_t c = 0; c < done; c++) {
                MOVED(k + 1, c)[i] = NAMED(dot)(slopes, MOVED(k, c), n);
            }
            for (int64_t c = 0; c < m; c++) {
                MOVED(k + 1, done + c)[i] = slopes[n + c];
            }
        }
        for (int64_t i = 0; i < q->c; i++) {
            NUMBER *row = s->limits + (size + k * q->c + i) * size;
            for (int64_t c = 0; c < size; c++) {
                row[c] = (c < done + m) ? MOVED(k + 1, c)[q->limited[i]] : 0;
            }
        }
    }
    for (int64_t c = 0; c < size; c++) {
        NUMBER *slope = s->slope, *before = s->slope + n;
        for (int64_t i = 0; i < n; i++) {
            slope[i] = NAMED(dot)(q->p + i * n, MOVED(q->length, c), n);
        }
        for (int64_t k = q->length - 1; k >= c / m; k--) {
            for (int64_t i = 0; i < m; i++) {
                NUMBER sum = NAMED(slopes)(q, s, k, 0)[n + i] * slope[0];
                for (int64_t j = 1; j < n; j++) {
                    sum += NAMED(slopes)(q, s, k, j)[n + i] * slope[j];
                }
                if (k == c / m) {
                    sum += q->r[i * m + c % m];
                }
                s->h[(k * m + i) * size + c] = sum;
            }
            if (k > c / m) {
                for (int64_t i = 0; i < n; i++) {
                    before[i] = NAMED(dot)(q->q + i * n, MOVED(k, c), n);
                }
                NAMED(back)(q, s, k, slope, before);
                NUMBER *old = slope;
                slope = before;
                before = old;
            }
        }
    }
#undef MOVED
    for (int64_t at = 0; at < size; at++) {
        const NUMBER change = q->change[at % m];
        if (at + m < size) {
            s->h[at * size + at] += change + change;
            s->h[(at + m) * size + at] -= change;
        } else {
            s->h[at * size + at] += change;
        }
    }
}

#include "rti_search.h"

/* Takes the step in moves and states; returns the largest change of a move in its span. */
static NUMBER NAMED(advance)(const COURSE *q, WORK *s)
{
    const int64_t n = q->n, m = q->m;
    NUMBER largest = 0, *moved = s->slope, *after = s->slope + n;
    for (int64_t i = 0; i < n; i++) {
        moved[i] = 0;
    }
    for (int64_t k = 0; k < q->length; k++) {
        for (int64_t i = 0; i < n; i++) {
            const NUMBER *slopes = NAMED(slopes)(q, s, k, i);
            NUMBER sum = NAMED(lack)(q, s, k, i);
            for (int64_t j = 0; j < n; j++) {
                sum += slopes[j] * moved[j];
            }
            for (int64_t j = 0; j < m; j++) {
                sum += slopes[n + j] * s->step[k * m + j];
            }
            after[i] = sum;
        }
        for (int64_t i = 0; i < n; i++) {
            moved[i] = after[i];
            s->x[(k + 1) * n + i] += moved[i];
        }
        for (int64_t i = 0; i < m; i++) {
            const NUMBER step = s->step[k * m + i], u = s->u[k * m + i] + step;
            const NUMBER change = ((step < 0) ? -step : step) * q->weight[i];
            largest = (change > largest) ? change : largest;
            s->u[k * m + i] = (u >= q->low[i]) ? ((u > q->high[i]) ? q->high[i] : u) : q->low[i];
        }
    }
    return largest;
}

/* One step of the plan of a lane; writes the moves without limits, and returns the status. */
static int64_t NAMED(improve)(const COURSE *q, WORK *s, NUMBER *fallback)
{
    NUMBER lost = 0; /* no number where a state is none */
    for (int64_t i = 0; i < q->n; i++) {
        lost += s->x[i] - s->x[i];
    }
    NAMED(lead)(q, s);
    NAMED(gradient)(q, s);
    NAMED(hessian)(q, s);
    const int factored = NAMED(factor)(s);
    if (factored) {
        NAMED(unlimited)(q, s);
    }
    for (int64_t i = 0; i < q->m; i++) {
        fallback[i] = s->u[i] + (factored ? s->value[i] : lost);
    }
    int64_t status = factored ? NAMED(search)(q, s) : CAPPED;
    for (int64_t i = 0; factored && i < s->size; i++) {
        s->step[i] = (s->side[i] == 0) ? s->value[i] : (s->side[i] > 0) ? s->high[i] : s->low[i];
    }
    return (status == SOLVED && !NAMED(optimal)(q, s)) ? CAPPED : status;
}

#include "rti_lanes.h"

#undef TAKE
#undef COURSE
#undef PLANS
#undef WORK
#undef NAMED
