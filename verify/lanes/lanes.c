/* lanes.c -- runs programs of numbers in many lanes side by side: the bit-exact reference, for int64, float and double
 *
 * It shares nothing with the C that is generated, which it judges. Each operation is one loop over a row of lanes; the
 * meaning of each is that of its name in quantize/ops.py, and the numbers that stand for them are the places of the
 * names in verify/lanes/codes.py. Integers hold 32-bit words and their 64-bit products, which are proven to fit.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define WIDTH 128 /* lanes of a row: the rows of a usual program fit the nearest cache */

typedef struct {
    int32_t code;
    int32_t target; /* row */
    int32_t places[4];
    int32_t whole[2]; /* shifts, and a factor */
} op_t;

/* Rows that hold what is read, kept and written, each list with its length; the others are constants and values. */
typedef struct plan {
    const op_t *ops;
    int64_t op_count;
    const int32_t *inputs;
    int64_t input_count;
    const int32_t *states;
    const int32_t *following; /* what each state becomes */
    int64_t state_count;
    int64_t tuned_count; /* of the states, the last ones: a caller sets them before each step */
    const int32_t *results;
    int64_t result_count;
    const int32_t *bits; /* pairs: row, place in the status word */
    int64_t bit_count;
    const void *courses; /* nonlinear programs that operations improve: course_ of rti_step.h */
    const void *problems; /* quadratic programs that operations solve: problem_ of qp_search.h */
} plan_t;

/* An array whose element (step, column, lane) stands at these distances, in elements, from the first. */
typedef struct {
    void *first; /* NULL where it is not wanted */
    int64_t kind; /* as in KINDS of compiled.py */
    int64_t step;
    int64_t column;
    int64_t lane;
} array_t;

/* How an input is read: times a factor, rounded and limited. */
typedef struct {
    double factor;
    double least;
    double most;
} scale_t;

/* Of every lane two places of its inputs, an element an input, and on which side of an edge the first one is. */
typedef struct {
    const double *begin;
    const double *there;
    const uint8_t *odd; /* there what is on the edge counts as below it */
    const uint8_t *side;
    const uint8_t *alike; /* the value at the other place is on the same side */
    const scale_t *scales;
    double limit; /* of the value, where no row is it */
    double every;
    int64_t halvings;
    double *near; /* how far on the way the last two places are */
    double *far;
} way_t;

enum { INT16, INT32, INT64, FLOAT, DOUBLE, LONG };
enum { SOLVED, CAPPED, INFEASIBLE }; /* as in quantize/twins/rti_course.py */

#define FAR 1e30

#define ROW(place) (rows + (int64_t)(place) * WIDTH)
#define EACH(number, expression)                \
    case number:                                \
        for (int64_t k = 0; k < width; k++) {   \
            t[k] = (NUMBER)(expression);        \
        }                                       \
        break;

#define COPY(type, to, from)                  \
    for (int64_t k = 0; k < width; k++) {     \
        to = (type)(from);                    \
    }                                         \
    break

#define PASTE(one, other) one##other
#define JOIN(one, other) PASTE(one, other)

#include "curved.h"

#define NUMBER int64_t
#define KIND i64
#define WHOLE 1
#include "steps.h"
#include "halving.h"
#undef NUMBER
#undef KIND
#undef WHOLE

#define WHOLE 0
#define NUMBER float
#define KIND f32
#define WORD uint32_t
#define SHORT 1
#define REAL(name) name##f
#include "elementary.h"
#include "rti_step.h"
#include "qp_search.h"
#include "steps.h"
#include "halving.h"
#undef NUMBER
#undef KIND
#undef WORD
#undef SHORT
#undef REAL

#define NUMBER double
#define KIND f64
#define WORD uint64_t
#define SHORT 0
#define REAL(name) name
#include "elementary.h"
#include "rti_step.h"
#include "qp_search.h"
#include "steps.h"
#include "halving.h"
#undef NUMBER
#undef KIND
#undef WORD
#undef SHORT
#undef REAL

/* Of laws alone, whose functions are true ones. */
#define NUMBER long double
#define KIND long
#define REAL(name) name##l
#include "steps.h"
