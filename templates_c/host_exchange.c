/* host_exchange.c -- one exchange over two pipes: a request out, a reply in, for the host's half of the firmloop line
 *
 * It does what verify/links/framed.py of firmloop does where nothing goes wrong, and leaves all the rest to it.
 */
#include "support/frame.h"

#include <string.h>
#include <unistd.h>

#define FRAME_MOST 4096U /* bytes that a pipe takes at once or not at all: Linux, pipe(7), PIPE_BUF */
#define RECEIVED_MOST 8192U
#define NOT_SENT (-1)

long host_exchange(int reader, int writer, unsigned type, unsigned sequence, uint32_t bound, const uint8_t *payload,
                   size_t length, uint8_t *received, uint8_t *reply);

/* Returns the length of the reply's payload, which is at reply + FRAME_HEADER; NOT_SENT if the request did not go out;
 * -2 - n if the n bytes in `received` are what came instead of a whole reply. */
long host_exchange(int reader, int writer, unsigned type, unsigned sequence, uint32_t bound, const uint8_t *payload,
                   size_t length, uint8_t *received, uint8_t *reply) {
    uint8_t frame[FRAME_MOST];
    const size_t headroom = FRAME_HEADROOM(length);
    if (FRAME_ROOM(length) > FRAME_MOST) {
        return NOT_SENT;
    }
    memcpy(frame + headroom + FRAME_HEADER, payload, length);
    const size_t size = frame_seal(frame, headroom, (uint8_t)type, (uint8_t)sequence, length, bound);
    if (write(writer, frame, size) != (ssize_t)size) {
        return NOT_SENT;
    }
    const ssize_t got = read(reader, received, RECEIVED_MOST);
    const size_t count = (got > 0) ? (size_t)got : 0U;
    fl_message_t message;
    if (count > 1U && frame_find_zero(received, 0U, count) == count - 1U) {
        memcpy(reply, received, count - 1U);
        if (frame_open(reply, count - 1U, &message) && frame_whole(&message, bound) &&
            message.type == ((type | 0x80U) & 0xFFU) && message.sequence == sequence) {
            return (long)message.length;
        }
    }
    return -2L - (long)count;
}
