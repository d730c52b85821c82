/* elementary.h -- elementary functions of one type in lanes: what quantize/twins/elementary.py and root.py mean.
 *
 * Of NUMBER, whose bits are a WORD; SHORT: a float, else a double.
 */

#if SHORT
#define PICK(one, other) ((NUMBER)(one))
#define WAVES 4
#define POWERS 6
#else
#define PICK(one, other) ((NUMBER)(other))
#define WAVES 8
#define POWERS 12
#endif

static WORD JOIN(bits_, KIND)(NUMBER x)
{
    WORD bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static NUMBER JOIN(number_, KIND)(WORD bits)
{
    NUMBER x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* Returns 1 + x. */
static NUMBER JOIN(from_one_, KIND)(NUMBER x)
{
#if SHORT
    return 1.0f + x;
#else
    return (0.75 + x) + 0.25;
#endif
}

/* Returns the sine of x + ahead pi/2. */
static NUMBER JOIN(wave_, KIND)(NUMBER x, WORD ahead)
{
    const NUMBER round = PICK(12582912.0, 6755399441055744.0);
    const NUMBER nearest = x * (NUMBER)0.63661977236758138 + round, k = nearest - round;
    const NUMBER most = x - k * PICK(1.5703125, 1.5707963267341256); /* less pi/2 in three parts */
    const NUMBER more = most - k * PICK(4.837512969970703e-4, 6.077100506303966e-11);
    const NUMBER r = more - k * PICK(7.549789954891882e-8, 2.0222662487959506e-21);
    const NUMBER z = r * r;
    const WORD quarter = JOIN(bits_, KIND)(nearest) + ahead;
    NUMBER even = 0, odd = 0;
    double sine = 1.0, cosine = 1.0, sines[WAVES], cosines[WAVES]; /* factorials */
    for (int i = 0; i < WAVES; i++) {
        cosine *= (2.0 * i + 1.0) * (2.0 * i + 2.0);
        sine *= (2.0 * i + 2.0) * (2.0 * i + 3.0);
        cosines[i] = ((i % 2 == 0) ? -1.0 : 1.0) / cosine;
        sines[i] = ((i % 2 == 0) ? -1.0 : 1.0) / sine;
    }
    for (int i = WAVES - 1; i >= 0; i--) {
        even = (i == WAVES - 1) ? (NUMBER)sines[i] : even * z + (NUMBER)sines[i];
        odd = (i == WAVES - 1) ? (NUMBER)cosines[i] : odd * z + (NUMBER)cosines[i];
    }
    even = r + r * (z * even);
    odd = JOIN(from_one_, KIND)(z * odd);
    const NUMBER value = (quarter & 1) ? odd : even;
    return (quarter & 2) ? -value : value;
}

static NUMBER JOIN(limited_, KIND)(NUMBER x, NUMBER low, NUMBER high)
{
    return (x >= low) ? ((x > high) ? high : x) : low;
}

static NUMBER JOIN(power_, KIND)(NUMBER given)
{
    const NUMBER x = JOIN(limited_, KIND)(given, PICK(-87.0, -708.0), PICK(88.0, 709.0));
    const NUMBER round = PICK(12582912.0, 6755399441055744.0);
    const NUMBER k = (x * (NUMBER)1.4426950408889634 + round) - round;
    const NUMBER most = x - k * PICK(0.693115234375, 0.6931471805592082); /* less log(2) in two parts */
    const NUMBER r = most - k * PICK(3.1946184945309415e-5, 7.371002565167799e-13);
    const WORD word = (WORD)((int64_t)k + PICK(127, 1023)) << (int)PICK(23, 52);
    NUMBER rest = 0;
    double factorial = 1.0, powers[POWERS];
    for (int i = 0; i < POWERS; i++) {
        factorial *= i + 2.0;
        powers[i] = 1.0 / factorial;
    }
    for (int i = POWERS - 1; i >= 0; i--) {
        rest = (i == POWERS - 1) ? (NUMBER)powers[i] : rest * r + (NUMBER)powers[i];
    }
    return ((NUMBER)1 + (r + r * (r * rest))) * JOIN(number_, KIND)(word);
}

static NUMBER JOIN(bent_, KIND)(NUMBER given)
{
    const NUMBER x = JOIN(limited_, KIND)(given, PICK(-10.0, -20.0), PICK(10.0, 20.0));
    return JOIN(from_one_, KIND)(-((NUMBER)2 / (JOIN(power_, KIND)(x + x) + (NUMBER)1)));
}

static NUMBER JOIN(root_, KIND)(NUMBER x)
{
    NUMBER found = JOIN(number_, KIND)((JOIN(bits_, KIND)(x) >> 1) + (WORD)(SHORT ? 0x1FBB4F2E : 0x1FF769E5C0000000));
    for (int i = 0; i < (SHORT ? 3 : 4); i++) {
        found = (NUMBER)0.5 * (found + x / found);
    }
    return (x >= PICK(1.1754944e-38, 2.2250738585072014e-308)) ? found : (NUMBER)0;
}

#undef PICK
#undef WAVES
#undef POWERS
