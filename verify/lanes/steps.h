/* steps.h -- the steps of lanes.c for one type of number: NUMBER, in functions that end in KIND; WHOLE: an integer. */

/* Reads `width` lanes of an array from `lane` on into a row. */
static void JOIN(load_, KIND)(const array_t *from, int64_t step, int64_t column, int64_t lane, int64_t width, NUMBER *row)
{
    const int64_t at = step * from->step + column * from->column + lane * from->lane, by = from->lane;
    switch (from->kind) {
    case INT16: COPY(NUMBER, row[k], ((const int16_t *)from->first)[at + k * by]);
    case INT32: COPY(NUMBER, row[k], ((const int32_t *)from->first)[at + k * by]);
    case INT64: COPY(NUMBER, row[k], ((const int64_t *)from->first)[at + k * by]);
    case FLOAT: COPY(NUMBER, row[k], ((const float *)from->first)[at + k * by]);
    case LONG: COPY(NUMBER, row[k], ((const long double *)from->first)[at + k * by]);
    default: COPY(NUMBER, row[k], ((const double *)from->first)[at + k * by]);
    }
}

/* Writes a row where `load` would read it. */
static void JOIN(keep_, KIND)(const array_t *to, int64_t step, int64_t column, int64_t lane, int64_t width, const NUMBER *row)
{
    const int64_t at = step * to->step + column * to->column + lane * to->lane, by = to->lane;
    switch (to->kind) {
    case INT16: COPY(int16_t, ((int16_t *)to->first)[at + k * by], row[k]);
    case INT32: COPY(int32_t, ((int32_t *)to->first)[at + k * by], row[k]);
    case INT64: COPY(int64_t, ((int64_t *)to->first)[at + k * by], row[k]);
    case FLOAT: COPY(float, ((float *)to->first)[at + k * by], row[k]);
    case LONG: COPY(long double, ((long double *)to->first)[at + k * by], row[k]);
    default: COPY(double, ((double *)to->first)[at + k * by], row[k]);
    }
}

/* Computes every operation of one sample. */
static void JOIN(compute_, KIND)(const plan_t *plan, NUMBER *rows, int64_t width)
{
    for (int64_t i = 0; i < plan->op_count; i++) {
        const op_t *op = &plan->ops[i];
        const NUMBER *a = ROW(op->places[0]), *b = ROW(op->places[1]);
        const NUMBER *c = ROW(op->places[2]);
        NUMBER *t = ROW(op->target);
#if WHOLE
        const int32_t s = op->whole[0], z = op->whole[1];
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
        EACH(32, a[k] + ((b[k] * c[k] + ((int64_t)1 << 31)) >> 32))  /* mul_add */
        EACH(50, a[k] + ((b[k] * c[k]) >> 16))                       /* mul_add_short */
        EACH(33, turn(a[k], s, z))                                   /* turn */
        EACH(34, turn_sine(a[k]))                                    /* turn_sine */
        EACH(35, turn_cosine(a[k]))                                  /* turn_cosine */
        EACH(36, whole_root(a[k], s))                                /* whole_root */
        EACH(37, inverse(a[k], s, z))                                /* inverse */
#else
        EACH(24, a[k] / b[k])                                        /* div */
        EACH(25, (a[k] >= b[k]) ? ((a[k] > c[k]) ? 1 : 0) : 1)       /* outside */
        EACH(26, (a[k] >= b[k]) ? c[k] : b[k])                       /* beyond */
        EACH(27, (a[k] != a[k]) ? 1 : 0)                             /* none */
        EACH(28, (a[k] - a[k]) * b[k])                               /* nought */
        EACH(29, (a[k] != 0 && b[k] != b[k]) ? 1 : 0)                /* none_where */
        EACH(30, ((a[k] - a[k]) != (a[k] - a[k])) ? 1 : 0)           /* lost */
        EACH(31, REAL(fabs)(a[k]))                                   /* magnitude */
        EACH(43, REAL(sin)(a[k]))                                    /* true_sin */
        EACH(44, REAL(cos)(a[k]))                                    /* true_cos */
        EACH(45, REAL(exp)(a[k]))                                    /* true_exp */
        EACH(46, REAL(tanh)(a[k]))                                   /* true_tanh */
        EACH(47, REAL(sqrt)(a[k]))                                   /* true_sqrt */
#ifdef WORD
        EACH(38, JOIN(wave_, KIND)(a[k], 0))                         /* sin */
        EACH(39, JOIN(wave_, KIND)(a[k], 1))                         /* cos */
        EACH(40, JOIN(power_, KIND)(a[k]))                           /* exp */
        EACH(41, JOIN(bent_, KIND)(a[k]))                            /* tanh */
        EACH(42, JOIN(root_, KIND)(a[k]))                            /* sqrt */
        case 48:                                                     /* improve */
            JOIN(iterate_, KIND)((const JOIN(course_, KIND) *)plan->courses + op->whole[0], rows, width);
            break;
        case 49:                                                     /* solve */
            JOIN(solve_, KIND)((const JOIN(problem_, KIND) *)plan->problems + op->whole[0], rows, width);
            break;
#endif
#endif
        default:
            return;
        }
    }
}

/* Goes on to the next sample. */
static void JOIN(follow_, KIND)(const plan_t *plan, NUMBER *rows, NUMBER *kept, int64_t width)
{
    for (int64_t j = 0; j < plan->state_count; j++) {
        memcpy(kept + j * WIDTH, ROW(plan->following[j]), (size_t)width * sizeof(NUMBER));
    }
    for (int64_t j = 0; j < plan->state_count; j++) {
        memcpy(ROW(plan->states[j]), kept + j * WIDTH, (size_t)width * sizeof(NUMBER));
    }
}

/* Of `state` the element (0, n, lane) is where a lane begins; `before` takes the state of each step. What parameters are
 * asked to be is refused outside of their `ranges`. `rows` holds the constants, `kept` is room for the state. */
void JOIN(lanes_, KIND)(const plan_t *plan, NUMBER *rows, NUMBER *kept, int64_t lanes, int64_t steps,
                        const NUMBER *ranges, const array_t *inputs, const array_t *asked, const array_t *state,
                        const array_t *before, const array_t *results, const array_t *status);

void JOIN(lanes_, KIND)(const plan_t *plan, NUMBER *rows, NUMBER *kept, int64_t lanes, int64_t steps,
                        const NUMBER *ranges, const array_t *inputs, const array_t *asked, const array_t *state,
                        const array_t *before, const array_t *results, const array_t *status)
{
    for (int64_t first = 0; first < lanes; first += WIDTH) {
        const int64_t width = (lanes - first < WIDTH) ? lanes - first : WIDTH;
        for (int64_t j = 0; j < plan->state_count; j++) {
            JOIN(load_, KIND)(state, 0, j, first, width, ROW(plan->states[j]));
        }
        for (int64_t step = 0; step < steps; step++) {
            for (int64_t j = 0; j < plan->input_count; j++) {
                JOIN(load_, KIND)(inputs, step, j, first, width, ROW(plan->inputs[j]));
            }
            for (int64_t j = 0; asked->first != NULL && j < plan->tuned_count; j++) {
                NUMBER *held = ROW(plan->states[plan->state_count - plan->tuned_count + j]);
                JOIN(load_, KIND)(asked, step, j, first, width, kept);
                for (int64_t k = 0; k < width; k++) {
                    held[k] = (kept[k] >= ranges[2 * j] && kept[k] <= ranges[2 * j + 1]) ? kept[k] : held[k];
                }
            }
            for (int64_t j = 0; before->first != NULL && j < plan->state_count; j++) {
                JOIN(keep_, KIND)(before, step, j, first, width, ROW(plan->states[j]));
            }
            JOIN(compute_, KIND)(plan, rows, width);
            for (int64_t j = 0; j < plan->result_count; j++) {
                JOIN(keep_, KIND)(results, step, j, first, width, ROW(plan->results[j]));
            }
            for (int64_t k = 0; plan->bit_count > 0 && k < width; k++) {
                uint32_t word = 0;
                for (int64_t j = 0; j < plan->bit_count; j++) {
                    word |= (uint32_t)(ROW(plan->bits[2 * j])[k] != 0) << plan->bits[2 * j + 1];
                }
                ((uint32_t *)status->first)[step * status->step + (first + k) * status->lane] = word;
            }
            JOIN(follow_, KIND)(plan, rows, kept, width);
        }
    }
}
