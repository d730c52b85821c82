/* transport_uart.c -- the line is a UART */
#include "board.h"

void transport_open(void) {
    uart_start();
}

size_t transport_read(uint8_t *bytes, size_t room) {
    size_t count = 0;
    int32_t byte = uart_get();
    while (byte < 0) {
        uart_wait();
        byte = uart_get();
    }
    while (byte >= 0) {
        bytes[count] = (uint8_t)byte;
        count++;
        byte = (count < room) ? uart_get() : -1;
    }
    return count;
}

void transport_write(const uint8_t *bytes, size_t count) {
    for (size_t i = 0; i < count; i++) {
        uart_put(bytes[i]);
    }
}

/* Zero bytes around the text keep it a frame of its own, which the host can tell from a message. */
void transport_text(const char *text) {
    for (const char *at = text; *at != '\0'; at++) {
        uart_put((uint8_t)*at);
        if (*at == '\n') {
            uart_put(0U);
        }
    }
}

void transport_fail(void) {
}
