/* uart_user.c -- a UART by two functions of yours, in a C file that the target's `sources` names
 *
 * board_getc() returns the next byte, or -1 if none has come. board_putc() takes a byte and returns true, or returns
 * false at once if the transmitter is busy. Whatever has to be set up first is the target's setup, or done at the first
 * call.
 */
#include "board.h"

static bool refused; /* the transmitter took no byte when it was last asked */
static uint8_t waiting;

void uart_start(void) {
    refused = false;
}

void uart_put(uint8_t byte) {
    while (!uart_ready()) {
    }
    waiting = byte;
    refused = !board_putc(byte);
}

bool uart_ready(void) {
    if (refused) {
        refused = !board_putc(waiting);
    }
    return !refused;
}

int32_t uart_get(void) {
    return (int32_t)board_getc();
}
