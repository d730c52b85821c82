/* host_exchange.c -- one exchange over two pipes: a request out, a reply in, for the host's half of the firmloop line
 *
 * It does what verify/links/framed.py of firmloop does where nothing goes wrong, and leaves all the rest to it.
 */
#include "support/frame.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <unistd.h>

#define FRAME_MOST 4096U /* bytes that a pipe takes at once or not at all: Linux, pipe(7), PIPE_BUF */
#define RECEIVED_MOST 8192U
#define NOT_SENT (-1)
#define ASKED_MOST 200U /* times, some 50 us: less than to wake one that sleeps takes on many a machine */

/* Two descriptors, and what came last: as it is, and decoded. */
typedef struct {
    int32_t reader;
    int32_t writer;
    uint8_t received[RECEIVED_MOST];
    uint8_t decoded[RECEIVED_MOST];
} exchange_t;

long host_exchange(exchange_t *self, uint32_t head, uint32_t bound, const uint8_t *payload, uint32_t length);

/* Reads what came, or waits for it; of a descriptor that does not block, asks for a while first. */
static ssize_t receive(exchange_t *self) {
    ssize_t got = read(self->reader, self->received, RECEIVED_MOST);
    for (uint32_t asked = 0; got < 0 && errno == EAGAIN; asked++) {
        if (asked >= ASKED_MOST) {
            struct pollfd awaited = {self->reader, POLLIN, 0};
            (void)poll(&awaited, 1U, -1);
        }
        got = read(self->reader, self->received, RECEIVED_MOST);
    }
    return got;
}

/* `head` is type + 256 * sequence. Returns the length of the reply's payload, which is at decoded + FRAME_HEADER;
 * NOT_SENT if the request did not go out; -2 - n if the n bytes in `received` are what came instead of a whole reply.
 */
long host_exchange(exchange_t *self, uint32_t head, uint32_t bound, const uint8_t *payload, uint32_t length) {
    uint8_t frame[FRAME_MOST];
    const size_t headroom = FRAME_HEADROOM(length);
    if (FRAME_ROOM(length) > FRAME_MOST) {
        return NOT_SENT;
    }
    memcpy(frame + headroom + FRAME_HEADER, payload, length);
    const uint8_t type = (uint8_t)(head & 0xFFU);
    const uint8_t sequence = (uint8_t)((head >> 8) & 0xFFU);
    const size_t size = frame_seal(frame, headroom, type, sequence, length, bound);
    if (write(self->writer, frame, size) != (ssize_t)size) {
        return NOT_SENT;
    }
    const ssize_t got = receive(self);
    const size_t count = (got > 0) ? (size_t)got : 0U;
    fl_message_t message;
    if (count > 1U && frame_find_zero(self->received, 0U, count) == count - 1U) {
        memcpy(self->decoded, self->received, count - 1U);
        if (frame_open(self->decoded, count - 1U, &message) && frame_whole(&message, bound) &&
            message.type == (type | 0x80U) && message.sequence == sequence) {
            return (long)message.length;
        }
    }
    return -2L - (long)count;
}
