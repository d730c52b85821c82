/* curved.h -- curved functions of whole numbers in lanes: what quantize/twins/curved.py means, lane by lane. */

/* Rounds a quotient down; that by 0, which a value out of its proven range may ask for, is 0, as numpy has it. */
static int64_t over(int64_t a, int64_t b)
{
    const int64_t whole = (b != 0) ? a / b : 0;
    return whole - (int64_t)(b != 0 && whole * b != a && (a < 0) != (b < 0));
}

static int64_t turn(int64_t a, int64_t factor, int64_t s)
{
    return (int64_t)(int32_t)(uint32_t)((a * factor) >> s);
}

static int64_t turn_sine(int64_t x)
{
    static const int64_t factors[] = {843314857, -1387197326, 684554113, -160859250, 22020091, -1879182};
    const int64_t quarter = (int64_t)1 << 30, half = 2 * quarter;
    const int64_t folded = (x >= 0) ? half - x : -half - x;
    const int64_t y = (x >= quarter || x < -quarter) ? folded : x, z = (y * y) >> 30;
    int64_t sum = factors[5];
    for (int k = 4; k >= 0; k--) {
        sum = factors[k] + ((z * sum) >> 32);
    }
    return (y * sum) >> 29;
}

static int64_t turn_cosine(int64_t x)
{
    return turn_sine((int64_t)(int32_t)(uint32_t)(x + ((int64_t)1 << 30)));
}

static int64_t whole_root(int64_t a, int64_t s)
{
    static const int64_t factors[] = {104433954, -396673923, 836167627, -654565611};
    int64_t m = a, places = 0, y = factors[3];
    for (int64_t step = 16; step >= 2; step /= 2) {
        const int64_t small = m < ((int64_t)1 << (31 - step));
        m = small ? m << step : m;
        places += small ? step / 2 : 0;
    }
    for (int k = 2; k >= 0; k--) {
        y = factors[k] + ((m * y) >> 32);
    }
    y <<= 5;
    for (int k = 0; k < 2; k++) {
        y = (y * (((int64_t)3 << 27) - ((m * ((y * y) >> 32)) >> 32))) >> 28;
    }
    return ((m * y) >> 30) >> (places + (31 - s) / 2);
}

static int64_t inverse(int64_t x, int64_t k, int64_t j)
{
    const int64_t word = (int64_t)1 << 31, half = ((int64_t)1 << k) >> 1;
    const int64_t y = over(word, (x + half) >> k), left = (word << k) - x * y;
    return (y << j) + ((y * (left >> k)) >> (31 - j));
}
