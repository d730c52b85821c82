/* rti_search.h -- the quadratic program of rti_step.h, in the rows of its limits: rti_search.py compiled. */

/* H = L D L'; 0 where a pivot is not above zero. */
static int NAMED(factor)(WORK *s)
{
    const int64_t size = s->size;
    NUMBER *pivots = s->right;
    for (int64_t j = 0; j < size; j++) {
        const NUMBER *own = s->factor + j * size;
        for (int64_t k = 0; k < j; k++) {
            s->scaled[k] = own[k] * pivots[k];
        }
        for (int64_t i = j; i < size; i++) {
            NUMBER *row = s->factor + i * size, sum = s->h[i * size + j];
            for (int64_t k = 0; k < j; k++) {
                sum -= row[k] * s->scaled[k];
            }
            if (i > j) {
                row[j] = sum * s->inverse[j];
                continue;
            }
            if (!(sum > 0 && sum < (NUMBER)FAR)) {
                return 0;
            }
            pivots[j] = sum;
            s->inverse[j] = 1 / sum;
        }
    }
    return 1;
}

/* L^-1 G', and the rows at the optimum without limits. */
static void NAMED(unlimited)(const COURSE *q, WORK *s)
{
    const int64_t size = s->size, m = q->m, c = q->c;
    for (int64_t j = 0; j < size; j++) {
        NUMBER sum = -s->g[j];
        for (int64_t k = 0; k < j; k++) {
            sum -= s->factor[j * size + k] * s->right[k];
        }
        s->right[j] = sum;
    }
    for (int64_t j = 0; j < size; j++) {
        s->right[j] = s->right[j] * s->inverse[j];
    }
    for (int64_t i = 0; i < s->rows; i++) {
        const int64_t first = (i < size) ? i : 0, at = i - size;
        NUMBER *v = s->v + i * size, value = 0;
        for (int64_t j = first; j < size; j++) {
            NUMBER sum = s->limits[i * size + j];
            for (int64_t k = first; k < j; k++) {
                sum -= s->factor[j * size + k] * v[k];
            }
            v[j] = sum;
            value += sum * s->right[j];
        }
        s->value[i] = value;
        s->side[i] = 0;
        const int64_t end = (i < size) ? i % m : m + at % c;
        const NUMBER plan = (i < size) ? s->u[i] : s->e[(1 + at / c) * q->n + q->limited[at % c]];
        s->low[i] = q->low[end] - plan;
        s->high[i] = q->high[end] - plan;
    }
}

/* The most violated row outside the active set, in its span; -1 where none is. */
static int64_t NAMED(select)(const COURSE *q, const WORK *s)
{
    int64_t found = -1;
    NUMBER most = (NUMBER)q->tolerance;
    for (int64_t i = 0; i < s->rows; i++) {
        const NUMBER over = s->value[i] - s->high[i], under = s->low[i] - s->value[i];
        const NUMBER excess = ((over > under) ? over : under) * s->weight[i];
        if (s->side[i] == 0 && excess > most) {
            most = excess;
            found = i;
        }
    }
    return found;
}

/* T = V D^-1 V' */
static void NAMED(tableau)(const COURSE *q, WORK *s)
{
    const int64_t size = s->size, rows = s->rows;
    for (int64_t b = 0; b < rows; b++) {
        const int64_t first = (b < size) ? b : 0;
        for (int64_t j = first; j < size; j++) {
            s->scaled[j] = s->v[b * size + j] * s->inverse[j];
        }
        for (int64_t a = b; a < rows; a++) {
            NUMBER sum = 0;
            for (int64_t j = (a < size) ? a : first; j < size; j++) {
                sum += s->v[a * size + j] * s->scaled[j];
            }
            s->t[a * rows + b] = sum;
            s->t[b * rows + a] = sum;
        }
        s->least[b] = (NUMBER)q->least * s->t[b * rows + b];
    }
}

/* Exchanges the multiplier and the value of a row. */
static void NAMED(pivot)(WORK *s, int64_t row)
{
    const int64_t rows = s->rows;
    NUMBER *across = s->t + row * rows;
    const NUMBER inverse = 1 / across[row];
    for (int64_t j = 0; j < rows; j++) {
        across[j] *= inverse;
    }
    for (int64_t i = 0; i < rows; i++) {
        NUMBER *other = s->t + i * rows;
        const NUMBER factor = other[row];
        if (i != row) {
            for (int64_t j = 0; j < rows; j++) {
                other[j] -= factor * across[j];
            }
            other[row] = -(factor * inverse);
        }
    }
    across[row] = inverse;
}

/* Lets violated rows enter until none is left. */
static int64_t NAMED(search)(const COURSE *q, WORK *s)
{
    int64_t row = NAMED(select)(q, s);
    NUMBER limit = 0, toward = 0, multiplier = 0;
    if (row >= 0) {
        NAMED(tableau)(q, s);
    }
    for (int64_t work = 0; row >= 0; work++) {
        if (work >= q->budget) {
            return CAPPED;
        }
        if (toward == 0) { /* a row that is new */
            toward = (NUMBER)((s->value[row] > s->high[row]) ? 1 : -1);
            limit = (toward > 0) ? s->high[row] : s->low[row];
            multiplier = 0;
        }
        for (int64_t i = 0; i < s->rows; i++) {
            s->column[i] = s->t[i * s->rows + row];
        }
        const NUMBER pivot = s->column[row];
        NUMBER step = (pivot > s->least[row]) ? (s->value[row] - limit) * toward / pivot : (NUMBER)FAR;
        NUMBER nearest = (NUMBER)FAR;
        int64_t leaving = -1;
        for (int64_t i = 0; i < s->rows; i++) {
            const NUMBER rate = s->column[i] * (toward * s->side[i]);
            if (s->side[i] != 0 && rate > 0) {
                const NUMBER ratio = s->value[i] * s->side[i] / rate;
                if (ratio < nearest) {
                    nearest = ratio;
                    leaving = i;
                }
            }
        }
        const int leaves = nearest < step;
        step = leaves ? nearest : step;
        if (!(step < (NUMBER)FAR)) {
            return INFEASIBLE;
        }
        const NUMBER moved = step * toward;
        multiplier += moved;
        for (int64_t i = 0; i < s->rows; i++) {
            s->value[i] -= s->column[i] * moved;
        }
        if (leaves) {
            s->value[leaving] = (s->side[leaving] > 0) ? s->high[leaving] : s->low[leaving];
            s->side[leaving] = 0;
            NAMED(pivot)(s, leaving);
        } else {
            s->value[row] = multiplier;
            s->side[row] = toward;
            NAMED(pivot)(s, row);
            row = NAMED(select)(q, s);
            toward = 0;
        }
    }
    return SOLVED;
}

/* Whether a step keeps the limits of the states, and the multipliers of the right sign meet its slope. */
static int NAMED(optimal)(const COURSE *q, WORK *s)
{
    const int64_t size = s->size;
    const NUMBER trusted = (NUMBER)q->trusted;
    for (int64_t i = 0; i < s->rows; i++) {
        const NUMBER toward = s->side[i], held = s->value[i] * toward;
        s->held[i] = (toward != 0 && held > 0) ? held * toward : 0;
    }
    for (int64_t i = 0; i < size; i++) {
        NUMBER error = s->g[i] + s->held[i];
        for (int64_t j = 0; j < size; j++) {
            error += ((j <= i) ? s->h[i * size + j] : s->h[j * size + i]) * s->step[j];
        }
        for (int64_t k = size; k < s->rows; k++) {
            error += s->limits[k * size + i] * s->held[k];
        }
        error *= s->weight[i];
        const NUMBER most = trusted * s->h[i * size + i];
        if (!(error < most && error > -most)) {
            return 0;
        }
    }
    for (int64_t k = size; k < s->rows; k++) {
        NUMBER y = 0;
        for (int64_t j = 0; j < size; j++) {
            y += s->limits[k * size + j] * s->step[j];
        }
        if (!((y - s->high[k]) * s->weight[k] < trusted && (s->low[k] - y) * s->weight[k] < trusted)) {
            return 0;
        }
    }
    return 1;
}
