/* start.c -- what any core does in C before main(), and the functions that compiled C calls by name */
#include "board.h"

/* Places given by the linker script; only their addresses mean anything. */
extern uint32_t data_start[];
extern uint32_t data_end[];
extern const uint32_t data_image[];
extern uint32_t bss_start[];
extern uint32_t bss_end[];

int main(void);

__attribute__((used, noreturn)) void start_c(void) {
    const uint32_t *from = data_image;
    for (uint32_t *to = data_start; to < data_end; to++) {
        *to = *from;
        from++;
    }
    for (uint32_t *to = bss_start; to < bss_end; to++) {
        *to = 0U;
    }
    (void)main();
    for (;;) {
    }
}

void say_register(const char *name, uint32_t value) {
    char text[9];
    for (uint32_t i = 0; i < 8U; i++) {
        text[i] = "0123456789abcdef"[(value >> (28U - 4U * i)) & 15U];
    }
    text[8] = '\0';
    transport_text(name);
    transport_text(text);
}

/* The compiler calls these two by name for structures and buffers; there is no C library to take them from. Volatile
 * keeps it from recognizing a loop as what the function is, and calling the function from within itself. */
void *memcpy(void *to, const void *from, size_t count) {
    volatile uint8_t *bytes = to;
    const uint8_t *source = from;
    for (size_t i = 0; i < count; i++) {
        bytes[i] = source[i];
    }
    return to;
}

void *memset(void *to, int value, size_t count) {
    volatile uint8_t *bytes = to;
    for (size_t i = 0; i < count; i++) {
        bytes[i] = (uint8_t)value;
    }
    return to;
}
