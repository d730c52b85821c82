/* truth.c -- what the blind benchmark conceals: a motor or a stage, moved by other means than the fitting simulator.
 *
 * Runge-Kutta over fixed substeps; dry friction and the drop of the brushes are set-valued: their sign holds from one
 * zero of the speed or the current to the next, where a substep is divided, and what rests goes on resting while what
 * drives it is no more than they can hold. Inputs are held from row to row; a switch inside a substep counts with its
 * share. The trajectory of every substep is returned.
 */
#include <math.h>
#include <stdlib.h>

/* In the order of PARAMETERS in truth.py. */
enum {
    IS_MOTOR, R, L, KE, KT, J, B,
    COULOMB, STATIC, STRIBECK, POSITIVE, NEGATIVE, LOAD_RATIO, BRISTLE, BRISTLE_LEVEL,
    DRAG, LOAD, STEP, STEP_TIME, GRAVITY, GRAVITY_PHASE, COGGING, COGGING_N, COGGING_PHASE, RIPPLE, RIPPLE_N, RIPPLE_PHASE,
    STOP, STOP_STIFFNESS, SPRING, CUBIC,
    COUPLING, COUPLING_DAMPING, COUPLED_INERTIA, GAP, KT_SATURATION, HEAT_RISE, HEAT_TIME, BRUSH, L_SATURATION,
    DEAD_ZONE, LIMIT, SLEW, DELAY, SUPPLY, SAG,
    ANGLE_DAMPING, PERIODIC, PERIODIC_HZ, GAIN_ASYMMETRY, HYSTERESIS, HYSTERESIS_REACH,
    INERTIA_WAVE, THINNING, THINNING_TIME, OUTAGE,
    COUNT
};
enum { CURRENT, SPEED, POSITION, LOAD_SPEED, TWIST, HEAT, BRISTLE_STATE, LOOP_STATE, WARMTH, STATES };
enum { PARTS = 8 }; /* of a substep, at most */

static double sign(double x) { return (x > 0.0) - (x < 0.0); }

/* Of what a case does not conceal no sine is computed: those took most of the time. */
static double wave(double size, double angle) { return size != 0.0 ? size * sin(angle) : 0.0; }

static double driver(const double *p, double u) {
    double v = u;
    if (p[DEAD_ZONE] > 0.0) {
        v = fabs(v) > p[DEAD_ZONE] ? v - sign(v) * p[DEAD_ZONE] : 0.0;
    }
    if (p[LIMIT] > 0.0) {
        v = fmin(fmax(v, -p[LIMIT]), p[LIMIT]);
    }
    return v > 0.0 ? v * (1.0 + p[GAIN_ASYMMETRY]) : v;
}

static double motor_torque(const double *p, const double *x, double v) {
    if (p[IS_MOTOR] == 0.0) {
        return v;
    }
    const double i = x[CURRENT];
    double kt = p[KT];
    if (p[KT_SATURATION] > 0.0) {
        kt /= 1.0 + i * i / (p[KT_SATURATION] * p[KT_SATURATION]);
    }
    return kt * i * (1.0 - wave(p[RIPPLE], p[RIPPLE_N] * x[POSITION] + p[RIPPLE_PHASE]));
}

static double friction(const double *p, const double *x, double v, double side) {
    double level = p[COULOMB] + p[LOAD_RATIO] * fabs(motor_torque(p, x, v));
    if (p[STRIBECK] > 0.0) {
        level += (p[STATIC] - p[COULOMB]) * exp(-(x[SPEED] / p[STRIBECK]) * (x[SPEED] / p[STRIBECK]));
    }
    return level + (side > 0.0 ? p[POSITIVE] : p[NEGATIVE]);
}

static double inductance(const double *p, double i) {
    return p[L_SATURATION] > 0.0 ? p[L] / (1.0 + i * i / (p[L_SATURATION] * p[L_SATURATION])) : p[L];
}

/* What turns, which a crank carries in and out twice a turn. */
static double inertia(const double *p, double a) { return p[J] * (1.0 + wave(p[INERTIA_WAVE], 2.0 * a)); }

/* The next row's number, by the last one and what is commanded: no two recordings share it. */
static unsigned drawn(unsigned last, double command) {
    return 1664525u * last + 1013904223u + (unsigned)(int)(1e3 * command);
}

/* Signs of the dry friction and of the brushes' drop; what rests stays. */
struct side {
    double speed;
    double current;
    int stuck;
    int dark;
};

static void rates(const double *p, const double *x, double v, double torque, double t, const struct side *on,
                  double *d) {
    const double w = x[SPEED];
    const double a = x[POSITION];
    const double viscous = p[B] * w * (1.0 + wave(p[ANGLE_DAMPING], 2.0 * a)) *
                           (p[THINNING_TIME] > 0.0 ? exp(-x[WARMTH]) : 1.0);
    double sum = motor_torque(p, x, v) + torque - viscous;
    double resistance = p[R];
    sum -= p[DRAG] * fabs(w) * w + p[LOAD];
    sum -= wave(p[GRAVITY], a + p[GRAVITY_PHASE]) + wave(p[COGGING], p[COGGING_N] * a + p[COGGING_PHASE]);
    sum -= p[SPRING] * a + p[CUBIC] * a * a * a + wave(p[PERIODIC], 6.283185307179586 * p[PERIODIC_HZ] * t);
    if (p[STOP_STIFFNESS] > 0.0 && a > p[STOP]) {
        sum -= p[STOP_STIFFNESS] * (a - p[STOP]);
    }
    for (int k = 0; k < STATES; ++k) {
        d[k] = 0.0;
    }
    if (p[BRISTLE] > 0.0) { /* Dahl: the bristle bends with the motion and yields at its level */
        sum -= p[BRISTLE] * x[BRISTLE_STATE];
        d[BRISTLE_STATE] = w - fabs(w) * x[BRISTLE_STATE] * p[BRISTLE] / p[BRISTLE_LEVEL];
    }
    if (p[HYSTERESIS] > 0.0) { /* Bouc-Wen, exponent 3, in a spring that acts at every position */
        const double z = x[LOOP_STATE] / p[HYSTERESIS_REACH];
        sum -= p[HYSTERESIS] * z * z * z;
        d[LOOP_STATE] = w * (1.0 - (sign(w) * z > 0.0 ? 1.0 : 0.2) * fabs(z * z * z)) - 20.0 * x[LOOP_STATE];
    }
    if (p[INERTIA_WAVE] != 0.0) {
        sum -= p[J] * p[INERTIA_WAVE] * cos(2.0 * a) * w * w; /* half its slope along the way */
    }
    if (p[THINNING_TIME] > 0.0) { /* grease that its own friction warms */
        d[WARMTH] = (p[THINNING] * viscous * w - x[WARMTH]) / p[THINNING_TIME];
    }
    if (p[COUPLED_INERTIA] > 0.0) {
        double twist = x[TWIST];
        double link;
        const double half = 0.5 * p[GAP];
        const double beyond = twist > half ? twist - half : (twist < -half ? twist + half : 0.0);
        link = p[COUPLING] * beyond;
        if (p[GAP] == 0.0 || beyond != 0.0) {
            link += p[COUPLING_DAMPING] * (w - x[LOAD_SPEED]);
        }
        if (p[GAP] > 0.0 && link * beyond < 0.0) {
            link = 0.0; /* teeth do not pull */
        }
        sum -= link;
        d[LOAD_SPEED] = link / p[COUPLED_INERTIA];
        d[TWIST] = w - x[LOAD_SPEED];
    }
    sum -= on->speed * friction(p, x, v, on->speed);
    d[SPEED] = on->stuck ? 0.0 : sum / inertia(p, a);
    d[POSITION] = w;
    if (p[IS_MOTOR] != 0.0) {
        const double i = x[CURRENT];
        double e = v - p[KE] * w - p[BRUSH] * on->current;
        if (p[SUPPLY] > 0.0) {
            e -= v * v / (p[SUPPLY] * p[SUPPLY]) * p[SAG] * i;
        }
        if (p[HEAT_TIME] > 0.0) {
            resistance *= 1.0 + 0.00393 * x[HEAT];
            d[HEAT] = (p[HEAT_RISE] * i * i * resistance - x[HEAT]) / p[HEAT_TIME];
        }
        d[CURRENT] = on->dark ? 0.0 : (e - resistance * i) / inductance(p, i);
    }
}

/* `a` are the rates at x. */
static void step(const double *p, const double *x, const double *a, double v, double torque, double t, double h,
                 const struct side *on, double *moved) {
    double b[STATES];
    double c[STATES];
    double d[STATES];
    double y[STATES];
    for (int s = 0; s < STATES; ++s) y[s] = x[s] + 0.5 * h * a[s];
    rates(p, y, v, torque, t, on, b);
    for (int s = 0; s < STATES; ++s) y[s] = x[s] + 0.5 * h * b[s];
    rates(p, y, v, torque, t, on, c);
    for (int s = 0; s < STATES; ++s) y[s] = x[s] + h * c[s];
    rates(p, y, v, torque, t, on, d);
    for (int s = 0; s < STATES; ++s) moved[s] = x[s] + h / 6.0 * (a[s] + 2.0 * b[s] + 2.0 * c[s] + d[s]);
}

/* The share of a step after which what began at `from` is at rest; 1 where it does not come to rest. */
static double until_rest(double from, double to) { return from * to < 0.0 ? from / (from - to) : 1.0; }

static void move(const double *p, double *x, double v, double torque, double t, double h) {
    for (int part = 0; part < PARTS && h > 0.0; ++part) {
        struct side on = {sign(x[SPEED]), sign(x[CURRENT]), 0, 0};
        double free[STATES];
        double y[STATES];
        rates(p, x, v, torque, t, &on, free);
        if (x[SPEED] == 0.0) {
            on.stuck = fabs(inertia(p, x[POSITION]) * free[SPEED]) <= friction(p, x, v, free[SPEED]);
            on.speed = on.stuck ? 0.0 : sign(free[SPEED]);
        }
        if (x[CURRENT] == 0.0) {
            on.dark = fabs(inductance(p, 0.0) * free[CURRENT]) <= p[BRUSH];
            on.current = on.dark ? 0.0 : sign(free[CURRENT]);
        }
        if (x[SPEED] == 0.0 || x[CURRENT] == 0.0) {
            rates(p, x, v, torque, t, &on, free);
        }
        step(p, x, free, v, torque, t, h, &on, y);
        const double speed = until_rest(x[SPEED], y[SPEED]);
        const double current = until_rest(x[CURRENT], y[CURRENT]);
        const double share = part + 1 < PARTS ? fmin(speed, current) : 1.0;
        if (share < 1.0) {
            step(p, x, free, v, torque, t, share * h, &on, y);
            y[speed <= current ? SPEED : CURRENT] = 0.0;
        }
        for (int s = 0; s < STATES; ++s) x[s] = y[s];
        t += share * h;
        h -= share * h;
    }
}

/** Run `rows` rows of `step` s, `fine` substeps each. command (rows): the input, or the wanted speed where gains is not
 * null (proportional, integral, limit: a PI speed controller on the true speed, whose output is written to command).
 * torque (rows): a disturbance. out (rows x fine x 3): current, speed, position at the start of every substep. */
int truth_run(int rows, int fine, double step, const double *p, double *command, const double *gains,
              const double *torque, double *out) {
    const double h = step / fine;
    double x[STATES] = {0.0};
    double integral = 0.0;
    double slewed = 0.0;
    unsigned number = 1;
    double dark = 0.0;
    double *driven = malloc(sizeof(double) * (size_t)rows);
    if (driven == NULL) {
        return 1;
    }
    for (int row = 0; row < rows; ++row) {
        if (gains != NULL) {
            const double error = command[row] - x[SPEED];
            const double wanted = gains[0] * error + integral;
            command[row] = fmin(fmax(wanted, -gains[2]), gains[2]);
            if (command[row] == wanted) {
                integral += gains[1] * step * error;
            }
        }
        driven[row] = driver(p, command[row]);
        if (p[OUTAGE] > 0.0) { /* a loose contact: four times a second, and as long as that */
            number = drawn(number, command[row]);
            dark = dark <= 0.0 && number / 4294967296.0 < 4.0 * step ? p[OUTAGE] : dark - step;
            driven[row] = dark > 0.0 ? 0.0 : driven[row];
        }
        for (int k = 0; k < fine; ++k) {
            const double t = row * step + k * h;
            const double late = (t - p[DELAY]) / step; /* in rows */
            double *at = &out[((size_t)row * (size_t)fine + (size_t)k) * 3];
            double v;
            const int before = (int)floor(late + 1e-9);
            const int after = (int)floor(late + h / step - 1e-9);
            v = before >= 0 ? driven[before] : 0.0;
            if (after > before) {
                const double share = (after - late) * step / h;
                v = share * v + (1.0 - share) * (after >= 0 ? driven[after] : 0.0);
            }
            if (p[SLEW] > 0.0) {
                const double reach = p[SLEW] * h;
                const double moved = fmin(fmax(v - slewed, -reach), reach);
                slewed += moved;
                v = slewed - 0.5 * moved * fabs(moved) / reach; /* the mean: what is reached early is held */
            }
            at[0] = x[CURRENT];
            at[1] = x[SPEED];
            at[2] = x[POSITION];
            /* a switch inside the substep */
            const double stepped = fmin(fmax((t + h - p[STEP_TIME]) / h, 0.0), 1.0);
            const double pushed = torque[row] - p[STEP] * stepped;
            move(p, x, v, pushed, t, h);
            if (!isfinite(x[SPEED])) {
                free(driven);
                return 2;
            }
        }
    }
    free(driven);
    return 0;
}
