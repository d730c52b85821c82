/* qp_search.h -- searches of a quadratic program with constant data: quantize/twins/qp_search.py compiled, one NUMBER.
 *
 * It shares nothing with the C that is generated. The order of every sum is that of the file above, and no product is
 * added before it is rounded.
 */

#define PROBLEM JOIN(problem_, KIND)
#define SEARCH JOIN(active_set_, KIND)
#define NAMED(name) JOIN(name##_, KIND)

/* A problem, as QpProblem has it. Its parameters stand in rows, as its moves and the status do from `target` on. */
typedef struct {
    int64_t count, room, budget, moves, many, column, told, parameter_count, target;
    const NUMBER *slope, *low, *high, *gram, *scale, *shift, *onward, *softness;
    double tolerance, share, trusted, kept, noise, least;
    const int32_t *parameters;
    NUMBER *memory;
    int64_t *places; /* room for `active` and `side` */
} PROBLEM;

/* One search, as QpSearch has it; `given` are the parameters. */
typedef struct {
    int64_t length, work, fresh, hard;
    int64_t *active, *side;
    NUMBER *value, *start, *spare, *given, *inverse, *toward, *multiplier, *rate, *along, *share, *lower, *eta;
    NUMBER tolerance, reached, pivot;
} SEARCH;

#include "qp_kept.h"

static NUMBER NAMED(multiplier)(const PROBLEM *q, const SEARCH *s, int64_t place)
{
    return q->many ? s->multiplier[place] : s->value[s->active[place]];
}

static NUMBER NAMED(own_pivot)(const PROBLEM *q, const SEARCH *s, int64_t row)
{
    return q->many ? s->pivot : NAMED(eta)(q, s, s->length)[row];
}

static int NAMED(is_free)(const PROBLEM *q, const SEARCH *s, int64_t row)
{
    const int filled = q->moves > 0 && s->hard == q->moves && NAMED(is_hard)(q, row);
    return NAMED(own_pivot)(q, s, row) > (NUMBER)q->least && s->length < q->room && !filled;
}

static NUMBER NAMED(held)(const PROBLEM *q, const SEARCH *s, int64_t row)
{
    return (s->side[row] == 0) ? s->value[row] : (s->side[row] > 0) ? q->high[row] : q->low[row];
}

/* A row behind those of the moves, from parameters and moves. */
static NUMBER NAMED(beyond)(const PROBLEM *q, const SEARCH *s, int64_t row, const NUMBER *moves)
{
    const NUMBER *shift = q->shift + row * q->parameter_count, *onward = q->onward + row * q->moves;
    NUMBER value = shift[0] * s->given[0];
    for (int64_t j = 1; j < q->parameter_count; j++) {
        value += shift[j] * s->given[j];
    }
    for (int64_t j = 0; j < q->moves; j++) {
        value += onward[j] * moves[j];
    }
    return value;
}

static void NAMED(residual)(const PROBLEM *q, const SEARCH *s, NUMBER *column)
{
    for (int64_t i = 0; i < q->moves; i++) {
        NUMBER value = q->slope[i] * s->given[0];
        for (int64_t j = 1; j < q->parameter_count; j++) {
            value += q->slope[j * q->count + i] * s->given[j];
        }
        for (int64_t k = 0; k < s->length; k++) {
            value -= q->gram[s->active[k] * q->count + i] * s->value[s->active[k]];
        }
        column[i] = value;
    }
    for (int64_t i = q->moves; i < q->count; i++) {
        column[i] = NAMED(beyond)(q, s, i - q->moves, column);
    }
    for (int64_t k = 0; k < s->length; k++) {
        const int64_t row = s->active[k];
        if (row >= q->moves) {
            column[row] -= q->softness[row - q->moves] * s->value[row];
        }
    }
    for (int64_t i = 0; i < q->count; i++) {
        column[i] -= NAMED(held)(q, s, i);
    }
}

static int NAMED(within)(NUMBER x, NUMBER most)
{
    return x < most && x > -most;
}

/* Returns whether every move is near and keeps the hard rows that are active, and the row to enter next. */
static int NAMED(refine)(const PROBLEM *q, SEARCH *s, int64_t *row)
{
    NUMBER *column = s->spare;
    int near = 1;
    s->work += 2 * s->length + q->moves + q->column;
    NAMED(residual)(q, s, column);
    NAMED(correct)(q, s, column);
    for (int64_t i = 0; i < q->count; i++) {
        s->value[i] += column[i];
        near &= i >= q->moves || s->side[i] != 0 || NAMED(within)(column[i], (NUMBER)q->trusted);
    }
    for (int64_t i = 0; i < q->moves; i++) {
        column[i] = NAMED(held)(q, s, i);
    }
    for (int64_t i = q->moves; i < q->count; i++) {
        const NUMBER value = NAMED(beyond)(q, s, i - q->moves, column);
        if (s->side[i] == 0) {
            s->value[i] = value;
        } else if (NAMED(is_hard)(q, i)) {
            near &= NAMED(within)(value - NAMED(held)(q, s, i), (NUMBER)q->kept);
        }
    }
    *row = NAMED(violated)(q, s, (NUMBER)q->tolerance);
    return near;
}

/* Returns how far to go, and the place of the row that leaves there, -1 for none. */
static NUMBER NAMED(far_to)(const PROBLEM *q, const SEARCH *s, NUMBER gap, int64_t row, NUMBER sign, int64_t *place)
{
    NUMBER step = NAMED(is_free)(q, s, row) ? gap * sign / NAMED(own_pivot)(q, s, row) : (NUMBER)FAR;
    const NUMBER *column = q->many ? s->rate : NAMED(eta)(q, s, s->length);
    *place = -1;
    for (int64_t k = 0; k < s->length; k++) {
        const NUMBER toward = s->toward[k], rate = column[q->many ? k : s->active[k]] * (sign * toward);
        if (rate > (NUMBER)q->least) {
            const NUMBER ratio = NAMED(multiplier)(q, s, k) * toward / rate;
            if (ratio < step) {
                step = ratio;
                *place = k;
            }
        }
    }
    return step;
}

/* Returns the status; `row` becomes the one to enter next. */
static int64_t NAMED(enter)(const PROBLEM *q, SEARCH *s, int64_t *row)
{
    const int64_t own = *row;
    const int above = s->value[own] > q->high[own];
    const NUMBER sign = (NUMBER)(above ? 1 : -1), limit = above ? q->high[own] : q->low[own];
    NUMBER multiplier = 0;
    if (q->many) {
        s->work += s->length + q->column;
        NAMED(rates)(q, s, own);
        s->reached = s->value[own];
    } else {
        NAMED(column)(q, s, own);
    }
    if (q->moves > 0 && !s->fresh && !NAMED(is_free)(q, s, own)) {
        s->fresh = NAMED(refine)(q, s, row);
        return (s->work < q->budget) ? SOLVED : CAPPED;
    }
    while (s->work < q->budget) {
        int64_t place;
        const NUMBER reached = q->many ? s->reached : s->value[own];
        const NUMBER step = NAMED(far_to)(q, s, reached - limit, own, sign, &place);
        if (step >= (NUMBER)FAR) {
            return INFEASIBLE;
        }
        multiplier += step * sign;
        if (place < 0) {
            if (q->moves > 0) {
                const NUMBER noise = multiplier * sign * (NUMBER)q->noise;
                s->tolerance = (noise > s->tolerance) ? noise : s->tolerance;
                s->fresh = 0;
                s->hard += NAMED(is_hard)(q, own);
            }
            s->side[own] = above ? 1 : -1;
            *row = q->many ? NAMED(join_factor)(q, s, own, step * sign, multiplier, sign)
                           : NAMED(join_tableau)(q, s, own, step * sign, multiplier, sign);
            return SOLVED;
        }
        if (q->many) {
            NAMED(go_rates)(s, step * sign);
            NAMED(leave_factor)(q, s, place, own);
        } else {
            NAMED(go_column)(q, s, step * sign);
            NAMED(leave_tableau)(q, s, place);
        }
    }
    return CAPPED;
}

static int64_t NAMED(sought)(const PROBLEM *q, SEARCH *s, int64_t row)
{
    int64_t status = SOLVED;
    s->length = s->work = s->fresh = s->hard = 0;
    memcpy(s->start, s->value, (size_t)q->count * sizeof(NUMBER));
    while (row >= 0 && status == SOLVED) {
        status = NAMED(enter)(q, s, &row);
        while (q->moves > 0 && status == SOLVED && row < 0) {
            if (NAMED(refine)(q, s, &row)) {
                break;
            }
            status = (s->work < q->budget) ? SOLVED : CAPPED;
        }
    }
    for (int64_t k = 0; q->moves == 0 && status == SOLVED && k < s->length; k++) {
        const NUMBER size = NAMED(multiplier)(q, s, k) * s->toward[k] * (NUMBER)q->noise;
        if ((NUMBER)q->kept < (NUMBER)FAR && !(size < (NUMBER)q->kept)) {
            status = CAPPED; /* its multipliers are too large to tell */
        }
    }
    return status;
}

/* Solves for the parameters of every lane. */
static void NAMED(solve)(const PROBLEM *q, NUMBER *rows, int64_t width)
{
    SEARCH s;
    NUMBER *memory = q->memory;
#define TAKE(to, size) ((to) = memory, memory += (size))
    TAKE(s.value, q->count);
    TAKE(s.start, q->count);
    TAKE(s.spare, q->count);
    TAKE(s.given, q->parameter_count);
    TAKE(s.inverse, q->room);
    TAKE(s.toward, q->room);
    TAKE(s.multiplier, q->room);
    TAKE(s.rate, q->room);
    TAKE(s.along, q->room);
    TAKE(s.share, q->room);
    TAKE(s.lower, q->many ? (q->room + 1) * q->room / 2 : 0);
    s.eta = memory;
#undef TAKE
    s.active = q->places;
    s.side = q->places + q->room;
    for (int64_t lane = 0; lane < width; lane++) {
        for (int64_t j = 0; j < q->parameter_count; j++) {
            s.given[j] = ROW(q->parameters[j])[lane];
        }
        for (int64_t i = 0; i < q->count; i++) {
            s.value[i] = q->slope[i] * s.given[0];
            s.side[i] = 0;
        }
        for (int64_t j = 1; j < q->parameter_count; j++) {
            for (int64_t i = 0; i < q->count; i++) {
                s.value[i] += q->slope[j * q->count + i] * s.given[j];
            }
        }
        const int64_t row = NAMED(violated)(q, &s, (NUMBER)q->tolerance);
        for (int64_t i = 0; i < q->told; i++) {
            ROW(q->target + i)[lane] = s.value[i] * q->scale[i];
        }
        int64_t status = SOLVED;
        if (row >= 0) {
            const NUMBER over = s.value[row] - q->high[row], under = q->low[row] - s.value[row];
            s.tolerance = (NUMBER)q->tolerance + ((over > under) ? over : under) * (NUMBER)q->share;
            status = NAMED(sought)(q, &s, row);
            for (int64_t i = 0; status == SOLVED && i < q->told; i++) {
                ROW(q->target + i)[lane] = NAMED(held)(q, &s, i) * q->scale[i];
            }
        }
        ROW(q->target + q->told)[lane] = (NUMBER)status;
    }
}

#undef PROBLEM
#undef SEARCH
#undef NAMED
