/* wait_poll.c -- does not wait: for a UART whose interrupt the target does not name */
#include "board.h"

void uart_wait(void) {
}
