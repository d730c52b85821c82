/* qp_kept.h -- what a search keeps of the rows: a tableau, or a factor of the active ones; qp_tableau.py, qp_factor.py. */

static void NAMED(take)(NUMBER *restrict to, const NUMBER *restrict from, NUMBER by, int64_t count)
{
    for (int64_t i = 0; i < count; i++) {
        to[i] -= from[i] * by;
    }
}

/* The most violated row outside the active set, -1 where none is by more than `most`. */
static int64_t NAMED(violated)(const PROBLEM *q, const SEARCH *s, NUMBER most)
{
    int64_t row = -1;
    for (int64_t i = 0; i < q->count; i++) {
        const NUMBER over = s->value[i] - q->high[i], under = q->low[i] - s->value[i];
        const NUMBER excess = (over > under) ? over : under;
        if (s->side[i] == 0 && excess > most) {
            most = excess;
            row = i;
        }
    }
    return row;
}

static int NAMED(is_hard)(const PROBLEM *q, int64_t row)
{
    return row < q->moves || !(q->softness[row - q->moves] > 0);
}

static NUMBER *NAMED(eta)(const PROBLEM *q, const SEARCH *s, int64_t place)
{
    return s->eta + place * q->count;
}

/* Takes the column of the row that enters. */
static void NAMED(column)(const PROBLEM *q, SEARCH *s, int64_t row)
{
    NUMBER *column = NAMED(eta)(q, s, s->length);
    s->work += s->length + q->column;
    memcpy(column, q->gram + row * q->count, (size_t)q->count * sizeof(NUMBER));
    for (int64_t k = 0; k < s->length; k++) {
        const NUMBER *eta = NAMED(eta)(q, s, k);
        NAMED(take)(column, eta, eta[row] * s->inverse[k], q->count);
    }
}

static void NAMED(go_column)(const PROBLEM *q, SEARCH *s, NUMBER moved)
{
    NAMED(take)(s->value, NAMED(eta)(q, s, s->length), moved, q->count);
}

/* Takes the row at `place` out of the active set, out of every eta after its own, and out of the column. */
static void NAMED(leave_tableau)(const PROBLEM *q, SEARCH *s, int64_t place)
{
    const int64_t row = s->active[place], last = s->length - 1;
    const NUMBER *column = NAMED(eta)(q, s, s->length);
    s->value[row] = (s->side[row] > 0) ? q->high[row] : q->low[row];
    s->side[row] = 0;
    s->length = last;
    s->hard -= q->moves > 0 && NAMED(is_hard)(q, row);
    s->work += q->column + 2 * (last - place);
    NUMBER *out = NAMED(eta)(q, s, place), rest = 1 / s->inverse[place];
    for (int64_t k = place + 1; k <= last; k++) {
        NUMBER *eta = NAMED(eta)(q, s, k);
        const int64_t at = s->active[k];
        const NUMBER held = eta[row], taken = out[at];
        const NUMBER pivot = 1 / s->inverse[k] + taken * held;
        const NUMBER inverse = 1 / pivot, share = taken * inverse;
        for (int64_t i = 0; i < q->count; i++) {
            const NUMBER old = out[i];
            out[i] = eta[i] + old * held;
            eta[i] = old - out[i] * share;
        }
        out[at] = pivot - 1;
        eta[at] = share;
        out[row] = held * rest;
        rest -= out[row] * share;
        s->inverse[k - 1] = inverse;
        s->toward[k - 1] = s->toward[k];
        s->active[k - 1] = at;
        out = eta;
    }
    const NUMBER factor = column[row];
    for (int64_t i = 0; i < q->count; i++) {
        out[i] = column[i] + out[i] * factor;
    }
    out[row] = factor * rest;
}

/* Puts `row` into the active set; returns the next row to enter, -1 for none. */
static int64_t NAMED(join_tableau)(const PROBLEM *q, SEARCH *s, int64_t row, NUMBER moved, NUMBER multiplier,
                                   NUMBER toward)
{
    NUMBER *eta = NAMED(eta)(q, s, s->length);
    NAMED(go_column)(q, s, moved);
    const int64_t following = NAMED(violated)(q, s, s->tolerance);
    s->value[row] = multiplier;
    s->inverse[s->length] = 1 / eta[row];
    eta[row] -= 1;
    s->toward[s->length] = toward;
    s->active[s->length++] = row;
    return following;
}

/* Turns a residual of the rows into what multipliers and values lack. */
static void NAMED(correct)(const PROBLEM *q, const SEARCH *s, NUMBER *column)
{
    for (int64_t k = 0; k < s->length; k++) {
        NAMED(take)(column, NAMED(eta)(q, s, k), column[s->active[k]] * s->inverse[k], q->count);
    }
}

/* Where row `k` of L stands. */
static NUMBER *NAMED(line)(const SEARCH *s, int64_t k)
{
    return s->lower + k * (k - 1) / 2;
}

static void NAMED(rates)(const PROBLEM *q, SEARCH *s, int64_t row)
{
    const NUMBER *gram = q->gram + row * q->count;
    NUMBER *own = NAMED(line)(s, s->length);
    s->pivot = gram[row];
    for (int64_t k = 0; k < s->length; k++) {
        const NUMBER *line = NAMED(line)(s, k);
        NUMBER value = gram[s->active[k]];
        for (int64_t j = 0; j < k; j++) {
            value -= line[j] * own[j];
        }
        own[k] = value;
    }
    for (int64_t k = 0; k < s->length; k++) {
        const NUMBER rate = own[k] * s->inverse[k];
        s->pivot -= own[k] * rate;
        own[k] = rate;
        s->rate[k] = rate;
    }
    for (int64_t k = s->length - 1; k > 0; k--) {
        NAMED(take)(s->rate, NAMED(line)(s, k), s->rate[k], k);
    }
}

static void NAMED(go_rates)(SEARCH *s, NUMBER moved)
{
    s->reached -= s->pivot * moved;
    NAMED(take)(s->multiplier, s->rate, moved, s->length);
}

static int64_t NAMED(join_factor)(const PROBLEM *q, SEARCH *s, int64_t row, NUMBER moved, NUMBER multiplier,
                                  NUMBER toward)
{
    const int64_t last = s->length;
    NAMED(go_rates)(s, moved);
    s->inverse[last] = 1 / s->pivot;
    s->multiplier[last] = multiplier;
    s->toward[last] = toward;
    s->active[last] = row;
    s->length = last + 1;
    memcpy(s->value, s->start, (size_t)q->count * sizeof(NUMBER));
    for (int64_t k = 0; k <= last; k++) {
        NAMED(take)(s->value, q->gram + s->active[k] * q->count, s->multiplier[k], q->count);
    }
    return NAMED(violated)(q, s, s->tolerance);
}

/* Takes the row at `place` out, while `entering` is on its way in. */
static void NAMED(leave_factor)(const PROBLEM *q, SEARCH *s, int64_t place, int64_t entering)
{
    const int64_t length = s->length;
    NUMBER rest = 1 / s->inverse[place];
    s->side[s->active[place]] = 0;
    s->work += (length + q->column) / 2;
    for (int64_t k = place + 1; k < length; k++) {
        const NUMBER *line = NAMED(line)(s, k);
        NUMBER *to = NAMED(line)(s, k - 1), left = line[place];
        for (int64_t j = 0; j < place; j++) {
            to[j] = line[j];
        }
        for (int64_t j = place + 1; j < k; j++) {
            left -= s->along[j] * line[j];
            to[j - 1] = line[j] + s->share[j] * left;
        }
        const NUMBER old = 1 / s->inverse[k], part = rest * left;
        const NUMBER inverse = 1 / (old + part * left);
        s->along[k] = left;
        s->share[k] = part * inverse;
        rest = rest * (old * inverse);
        s->inverse[k - 1] = inverse;
        s->active[k - 1] = s->active[k];
        s->toward[k - 1] = s->toward[k];
        s->multiplier[k - 1] = s->multiplier[k];
    }
    s->length = length - 1;
    NAMED(rates)(q, s, entering);
}
