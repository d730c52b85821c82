/* rti_lanes.h -- the iterations of rti_step.h in all lanes of a row: what is read, what the model gives, what is told. */

/* Asks the model for sample `k` of all lanes. */
static void NAMED(modeled)(const COURSE *q, const PLANS *plans, int64_t k, int64_t width)
{
    const int64_t n = q->n, m = q->m, length = q->length, count = n * (1 + n + m), by = (length + 1) * n;
    NUMBER *rows = q->model_rows;
    for (int64_t j = 0; j < n; j++) {
        for (int64_t lane = 0; lane < width; lane++) {
            ROW(q->model->inputs[j])[lane] = plans->x[lane * by + k * n + j];
        }
    }
    for (int64_t j = 0; j < m; j++) {
        for (int64_t lane = 0; lane < width; lane++) {
            ROW(q->model->inputs[n + j])[lane] = plans->u[(lane * length + k) * m + j];
        }
    }
    JOIN(compute_, KIND)(q->model, rows, width);
    for (int64_t j = 0; j < count; j++) {
        for (int64_t lane = 0; lane < width; lane++) {
            plans->found[(lane * length + k) * count + j] = ROW(q->model->results[j])[lane];
        }
    }
}

/* Reads the parameters: x[0], t, the last output and, where there is one, 1 and the plan of the sample before. */
static void NAMED(resume)(const COURSE *q, PLANS *plans, const NUMBER *rows, int64_t width)
{
    const int64_t n = q->n, m = q->m, length = q->length, alone = 2 * n + m;
    const int32_t *at = q->parameters;
    for (int64_t lane = 0; lane < width; lane++) {
        NUMBER *x = plans->x + lane * (length + 1) * n, *u = plans->u + lane * length * m;
        for (int64_t j = 0; j < n; j++) {
            x[j] = ROW(at[j])[lane];
            plans->target[lane * n + j] = ROW(at[n + j])[lane];
        }
        for (int64_t j = 0; j < m; j++) {
            plans->last[lane * m + j] = ROW(at[2 * n + j])[lane];
            plans->fallback[lane * m + j] = 0;
        }
        plans->warm[lane] = q->parameter_count > alone && ROW(at[alone])[lane] > 0;
        for (int64_t j = 0; plans->warm[lane] && j < length * n; j++) {
            x[n + j] = ROW(at[alone + 1 + j])[lane];
        }
        for (int64_t j = 0; j < length * m; j++) {
            u[j] = plans->warm[lane] ? ROW(at[alone + 1 + length * n + j])[lane] : 0;
        }
        plans->status[lane] = SOLVED;
    }
}

/* Writes outputs, whether there is a plan, the largest change, the plan moved up by one sample, and the status. */
static void NAMED(tell)(const COURSE *q, const PLANS *plans, NUMBER *rows, int64_t width)
{
    const int64_t n = q->n, m = q->m, length = q->length;
    for (int64_t lane = 0; lane < width; lane++) {
        const int solved = plans->status[lane] == SOLVED;
        const NUMBER *x = plans->x + lane * (length + 1) * n, *u = plans->u + lane * length * m;
        int64_t row = q->target;
        for (int64_t j = 0; j < m; j++) {
            ROW(row++)[lane] = solved ? u[j] : plans->fallback[lane * m + j];
        }
        ROW(row++)[lane] = (NUMBER)solved;
        ROW(row++)[lane] = plans->largest[lane];
        for (int64_t k = 0; k < length; k++) {
            for (int64_t j = 0; j < n; j++) {
                ROW(row++)[lane] = solved ? x[((k + 1 < length) ? k + 2 : length) * n + j] : 0;
            }
        }
        for (int64_t k = 0; k < length; k++) {
            for (int64_t j = 0; j < m; j++) {
                ROW(row++)[lane] = solved ? u[((k + 1 < length) ? k + 1 : k) * m + j] : 0;
            }
        }
        ROW(row)[lane] = (NUMBER)plans->status[lane];
    }
}

/* Takes the problem's steps from what its parameters are in every lane. */
static void NAMED(iterate)(const COURSE *q, NUMBER *rows, int64_t width)
{
    const int64_t n = q->n, m = q->m, length = q->length, count = n * (1 + n + m);
    WORK s;
    PLANS plans;
    NUMBER *room = NAMED(begin)(q, &s);
    TAKE(plans.x, WIDTH * (length + 1) * n);
    TAKE(plans.u, WIDTH * length * m);
    TAKE(plans.found, WIDTH * length * count);
    TAKE(plans.target, WIDTH * n);
    TAKE(plans.last, WIDTH * m);
    TAKE(plans.fallback, WIDTH * m);
    TAKE(plans.largest, WIDTH);
    NAMED(resume)(q, &plans, rows, width);
    for (int64_t iteration = 0; iteration < q->iterations; iteration++) {
        for (int64_t k = 0; k < length; k++) {
            NAMED(modeled)(q, &plans, k, width);
            for (int64_t lane = 0; lane < width; lane++) { /* without a plan, the states are where the moves lead */
                NUMBER *x = plans.x + (lane * (length + 1) + k + 1) * n;
                for (int64_t j = 0; !plans.warm[lane] && j < n; j++) {
                    x[j] = plans.found[(lane * length + k) * count + j];
                }
            }
        }
        for (int64_t lane = 0; lane < width; lane++) {
            plans.warm[lane] = 1;
            plans.largest[lane] = (NUMBER)FAR;
            if (plans.status[lane] != SOLVED) {
                continue;
            }
            s.found = plans.found + lane * length * count;
            s.target = plans.target + lane * n;
            s.last = plans.last + lane * m;
            s.x = plans.x + lane * (length + 1) * n;
            s.u = plans.u + lane * length * m;
            plans.status[lane] = NAMED(improve)(q, &s, plans.fallback + lane * m);
            if (plans.status[lane] == SOLVED) {
                plans.largest[lane] = NAMED(advance)(q, &s);
            }
        }
    }
    NAMED(tell)(q, &plans, rows, width);
}
