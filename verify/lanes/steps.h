/* steps.h -- the steps of lanes.c for one type of number: NUMBER, in a function NAME; WHOLE says that it is an integer. */

/* inputs (steps, m, lanes), asked (steps, tuned, lanes) with the range of each or NULL, state (n, lanes) in and out,
 * before (steps, n, lanes), results (steps, r, lanes), status (steps, lanes). `rows` holds the constants. */
void NAME(const plan_t *plan, NUMBER *rows, NUMBER *kept, int64_t lanes, int64_t steps, const NUMBER *inputs,
          const NUMBER *asked, const NUMBER *ranges, NUMBER *state, NUMBER *before, NUMBER *results, uint32_t *status);

void NAME(const plan_t *plan, NUMBER *rows, NUMBER *kept, int64_t lanes, int64_t steps, const NUMBER *inputs,
          const NUMBER *asked, const NUMBER *ranges, NUMBER *state, NUMBER *before, NUMBER *results, uint32_t *status)
{
    for (int64_t first = 0; first < lanes; first += WIDTH) {
        const int64_t width = (lanes - first < WIDTH) ? lanes - first : WIDTH;
        const size_t size = (size_t)width * sizeof(NUMBER);
        for (int64_t j = 0; j < plan->state_count; j++) {
            memcpy(ROW(plan->states[j]), state + j * lanes + first, size);
        }
        for (int64_t step = 0; step < steps; step++) {
            for (int64_t j = 0; j < plan->input_count; j++) {
                memcpy(ROW(plan->inputs[j]), inputs + (step * plan->input_count + j) * lanes + first, size);
            }
            for (int64_t j = 0; asked != NULL && j < plan->tuned_count; j++) {
                const NUMBER *wish = asked + (step * plan->tuned_count + j) * lanes + first;
                NUMBER *held = ROW(plan->states[plan->state_count - plan->tuned_count + j]);
                for (int64_t k = 0; k < width; k++) {
                    held[k] = (wish[k] >= ranges[2 * j] && wish[k] <= ranges[2 * j + 1]) ? wish[k] : held[k];
                }
            }
            for (int64_t j = 0; before != NULL && j < plan->state_count; j++) {
                memcpy(before + (step * plan->state_count + j) * lanes + first, ROW(plan->states[j]), size);
            }
            for (int64_t i = 0; i < plan->op_count; i++) {
                const op_t *op = &plan->ops[i];
                const NUMBER *a = ROW(op->places[0]), *b = ROW(op->places[1]);
                const NUMBER *c = ROW(op->places[2]);
                NUMBER *t = ROW(op->target);
#if WHOLE
                const int32_t s = op->shift;
#else
                const NUMBER *d = ROW(op->places[3]);
#endif
                switch (op->code) {
                EACH(0, a[k])                                                /* copy */
                EACH(1, -a[k])                                               /* neg */
                EACH(2, (a[k] < 0) ? -a[k] : a[k])                           /* abs */
                EACH(3, (a[k] == 0) ? 1 : 0)                                 /* not */
                EACH(4, a[k] + b[k])                                         /* add */
                EACH(5, a[k] - b[k])                                         /* sub */
                EACH(6, a[k] * b[k])                                         /* mul, wide */
                EACH(7, (a[k] < b[k]) ? a[k] : b[k])                         /* min */
                EACH(8, (a[k] > b[k]) ? a[k] : b[k])                         /* max */
                EACH(9, (a[k] < b[k]) ? 1 : 0)                               /* lt */
                EACH(10, (a[k] <= b[k]) ? 1 : 0)                             /* le */
                EACH(11, (a[k] == b[k]) ? 1 : 0)                             /* eq */
                EACH(12, (a[k] != b[k]) ? 1 : 0)                             /* ne */
                EACH(13, (a[k] != 0 && b[k] != 0) ? 1 : 0)                   /* and */
                EACH(14, (a[k] != 0 || b[k] != 0) ? 1 : 0)                   /* or */
                EACH(15, (a[k] != 0) ? b[k] : c[k])                          /* select */
                EACH(16, (a[k] >= b[k]) ? ((a[k] > c[k]) ? c[k] : a[k]) : b[k]) /* clamp */
#if WHOLE
                EACH(17, a[k] + b[k] * c[k])                                 /* mac */
                EACH(18, (a[k] * b[k] + ((int64_t)1 << (s - 1))) >> s)       /* mul_shift */
                EACH(19, (a[k] * b[k]) >> s)                                 /* mul_down */
                EACH(20, (a[k] >> s) + ((a[k] >> (s - 1)) & 1))              /* shr, high */
                EACH(21, a[k] >> s)                                          /* asr, high_down */
                EACH(22, a[k] << s)                                          /* shl */
                EACH(23, (int64_t)((uint64_t)a[k] << (32 + s)) >> (32 + s))  /* wrap */
#else
                EACH(24, a[k] / b[k])                                        /* div */
                EACH(25, (a[k] >= b[k]) ? ((a[k] > c[k]) ? 1 : 0) : 1)       /* outside */
                EACH(26, (a[k] >= b[k]) ? c[k] : b[k])                       /* beyond */
                EACH(27, (a[k] != a[k]) ? 1 : 0)                             /* none */
                EACH(28, (a[k] != a[k] || b[k] != b[k]) ? 1 : 0)             /* unordered */
                EACH(29, (a[k] >= b[k]) ? 0 : ((c[k] != c[k] || d[k] != d[k]) ? 1 : 0)) /* unordered_below */
                EACH(30, ((a[k] - a[k]) != (a[k] - a[k])) ? 1 : 0)           /* lost */
                EACH(31, (NUMBER)fabs((double)a[k]))                         /* magnitude */
#endif
                default:
                    return;
                }
            }
            for (int64_t j = 0; j < plan->result_count; j++) {
                memcpy(results + (step * plan->result_count + j) * lanes + first, ROW(plan->results[j]), size);
            }
            for (int64_t j = 0; j < plan->bit_count; j++) {
                const NUMBER *set = ROW(plan->bits[2 * j]);
                for (int64_t k = 0; k < width; k++) {
                    status[step * lanes + first + k] |= (uint32_t)(set[k] != 0) << plan->bits[2 * j + 1];
                }
            }
            for (int64_t j = 0; j < plan->state_count; j++) {
                memcpy(kept + j * WIDTH, ROW(plan->following[j]), size);
            }
            for (int64_t j = 0; j < plan->state_count; j++) {
                memcpy(ROW(plan->states[j]), kept + j * WIDTH, size);
            }
        }
        for (int64_t j = 0; j < plan->state_count; j++) {
            memcpy(state + j * lanes + first, ROW(plan->states[j]), size);
        }
    }
}
