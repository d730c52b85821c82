/* board_host.c -- stands in for a board on this machine, so that the image's own code can be tested without one
 *
 * The line is standard input and output. The timer counts its own readings, the stack is not measured.
 */
#include "board/board.h"

#include <stdlib.h>
#include <unistd.h>

void transport_open(void) {
}

size_t transport_read(uint8_t *bytes, size_t room) {
    const ssize_t count = read(0, bytes, room);
    if (count <= 0) {
        exit(0);
    }
    return (size_t)count;
}

void transport_write(const uint8_t *bytes, size_t count) {
    size_t sent = 0;
    while (sent < count) {
        const ssize_t now = write(1, bytes + sent, count - sent);
        if (now <= 0) {
            exit(1);
        }
        sent += (size_t)now;
    }
}

void timer_start(void) {
}

uint32_t timer_begin(void) {
    return timer_now();
}

uint32_t timer_now(void) {
    static uint32_t readings;
    readings++;
    return readings;
}

void stack_paint(uint32_t most) {
    (void)most;
}

uint32_t stack_depth(uint32_t most) {
    (void)most;
    return 0U;
}
