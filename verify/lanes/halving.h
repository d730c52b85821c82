/* halving.h -- halves the way between two inputs of each lane to where a value passes its edge; of one type. */

/* Reads a physical input as the program does: to_raw of verify/scaling.py. */
static NUMBER JOIN(read_, KIND)(double x, const scale_t *scale)
{
#if WHOLE
    const double whole = floor(x * scale->factor + 0.5);
    return (NUMBER)((whole > scale->most) ? scale->most : (whole < scale->least) ? scale->least : whole);
#else
    (void)scale;
    return (NUMBER)x;
#endif
}

/* Tells whether two numbers are the same bits: -0 is not 0. */
static uint8_t JOIN(alike_, KIND)(NUMBER a, NUMBER b)
{
    return memcmp(&a, &b, sizeof a) == 0;
}

/* Computes the sample that moves, whose inputs are in their rows, and `behind` more of them. */
static void JOIN(sample_, KIND)(const plan_t *plan, NUMBER *rows, NUMBER *kept, int64_t first, int64_t width,
                                int64_t behind, const array_t *inputs, const array_t *state)
{
    for (int64_t j = 0; j < plan->state_count; j++) {
        JOIN(load_, KIND)(state, 0, j, first, width, ROW(plan->states[j]));
    }
    JOIN(compute_, KIND)(plan, rows, width);
    for (int64_t sample = 0; sample < behind; sample++) {
        JOIN(follow_, KIND)(plan, rows, kept, width);
        for (int64_t j = 0; j < plan->input_count; j++) {
            JOIN(load_, KIND)(inputs, sample, j, first, width, ROW(plan->inputs[j]));
        }
        JOIN(compute_, KIND)(plan, rows, width);
    }
}

/* Tells on which side of the edge the value of each lane is: Edge.above of verify/stimuli/edges.py. */
static void JOIN(sides_, KIND)(const plan_t *plan, const NUMBER *rows, const way_t *way, int64_t first, int64_t width,
                               uint8_t *side)
{
    const NUMBER *value = ROW(plan->results[0]), *limit = ROW(plan->results[plan->result_count - 1]);
    for (int64_t k = 0; k < width; k++) {
        double above = (double)value[k] - ((plan->result_count > 1) ? (double)limit[k] : way->limit);
        if (isfinite(way->every)) {
            above -= way->every * rint(above / way->every);
        }
        side[k] = (way->odd[first + k]) ? above > 0.0 : above >= 0.0;
    }
}

/* `inputs` are those of the `behind` samples after the one that moves, `state` is what was before it. `kept` has room
 * for the state, `read` for three rows an input: as they are read at both last places, and between these. */
void JOIN(halve_, KIND)(const plan_t *plan, NUMBER *rows, NUMBER *kept, NUMBER *read, int64_t lanes, int64_t behind,
                        const way_t *way, const array_t *inputs, const array_t *state);

void JOIN(halve_, KIND)(const plan_t *plan, NUMBER *rows, NUMBER *kept, NUMBER *read, int64_t lanes, int64_t behind,
                        const way_t *way, const array_t *inputs, const array_t *state)
{
    const int64_t count = plan->input_count;
    for (int64_t first = 0; first < lanes; first += WIDTH) {
        const int64_t width = (lanes - first < WIDTH) ? lanes - first : WIDTH;
        double *near = way->near + first, *far = way->far + first, middle[WIDTH];
        uint8_t alike[WIDTH], as_near[WIDTH], as_far[WIDTH], side[WIDTH];
        memcpy(alike, way->alike + first, (size_t)width);
        for (int64_t k = 0; k < width; k++) {
            near[k] = 0.0;
            far[k] = 1.0;
        }
        for (int64_t j = 0; j < count; j++) {
            NUMBER *at = read + 3 * j * WIDTH;
            for (int64_t k = 0; k < width; k++) {
                at[k] = JOIN(read_, KIND)(way->begin[(first + k) * count + j], &way->scales[j]);
                at[WIDTH + k] = JOIN(read_, KIND)(way->there[(first + k) * count + j], &way->scales[j]);
            }
        }
        for (int64_t halving = 0; halving < way->halvings; halving++) {
            int doubt = 0;
            for (int64_t k = 0; k < width; k++) {
                middle[k] = (near[k] + far[k]) / 2.0;
                as_near[k] = as_far[k] = 1;
            }
            for (int64_t j = 0; j < count; j++) {
                NUMBER *at = read + 3 * j * WIDTH;
                for (int64_t k = 0; k < width; k++) {
                    const int64_t here = (first + k) * count + j;
                    const double x = way->begin[here] + middle[k] * (way->there[here] - way->begin[here]);
                    const NUMBER now = JOIN(read_, KIND)(x, &way->scales[j]);
                    at[2 * WIDTH + k] = now;
                    as_near[k] &= JOIN(alike_, KIND)(now, at[k]);
                    as_far[k] &= JOIN(alike_, KIND)(now, at[WIDTH + k]);
                }
            }
            for (int64_t k = 0; k < width; k++) {
                doubt |= !(as_near[k] | as_far[k]);
            }
            if (doubt) { /* the row is computed as a whole */
                for (int64_t j = 0; j < count; j++) {
                    memcpy(ROW(plan->inputs[j]), read + (3 * j + 2) * WIDTH, (size_t)width * sizeof(NUMBER));
                }
                JOIN(sample_, KIND)(plan, rows, kept, first, width, behind, inputs, state);
                JOIN(sides_, KIND)(plan, rows, way, first, width, side);
            }
            for (int64_t k = 0; k < width; k++) {
                const int known = as_near[k] | as_far[k];
                const int same = known ? (as_near[k] | alike[k]) : side[k] == way->side[first + k];
                alike[k] &= (uint8_t)same;
                as_near[k] = (uint8_t)same; /* from here on: where the middle becomes the near place */
                near[k] = same ? middle[k] : near[k];
                far[k] = same ? far[k] : middle[k];
            }
            for (int64_t j = 0; j < count; j++) {
                NUMBER *at = read + 3 * j * WIDTH;
                for (int64_t k = 0; k < width; k++) {
                    at[k] = as_near[k] ? at[2 * WIDTH + k] : at[k];
                    at[WIDTH + k] = as_near[k] ? at[WIDTH + k] : at[2 * WIDTH + k];
                }
            }
        }
    }
}
