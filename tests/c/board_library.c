/* board_library.c -- the image as functions of this process: what came over the line is fed to it, what it says is kept
 *
 * The timer counts its own readings, the stack is not measured.
 */
#define main image_main
#include "main.c"
#undef main

#define SAID_MOST (1U << 20)

static uint8_t said[SAID_MOST];
static size_t said_count;
static size_t kept;
static bool mute; /* the processor is held in reset, or has not come up */

void image_reset(void);
void image_mute(bool whether);
void image_feed(const uint8_t *bytes, size_t count);
size_t image_take(uint8_t *bytes);

/* As after power-up: everything that main() has in memory is lost. */
void image_reset(void) {
    tiny_init(&controller);
    reply_size = 0;
    session = 0;
    exchange = 0;
    bound = 0;
    kept = 0;
    said_count = 0;
    overhead = ticks_of_nothing();
}

void image_mute(bool whether) {
    mute = whether;
}

/* The loop of main(), once for every piece that its memory can take. */
void image_feed(const uint8_t *bytes, size_t count) {
    size_t fed = mute ? count : 0U;
    while (fed < count) {
        const size_t room = sizeof received - kept;
        const size_t piece = (count - fed < room) ? count - fed : room;
        for (size_t i = 0; i < piece; i++) {
            received[kept + i] = bytes[fed + i];
        }
        fed += piece;
        kept = handle_all(kept + piece);
        if (kept == sizeof received) {
            kept = 1U;
        }
    }
}

size_t image_take(uint8_t *bytes) {
    const size_t count = said_count;
    for (size_t i = 0; i < count; i++) {
        bytes[i] = said[i];
    }
    said_count = 0;
    return count;
}

void transport_open(void) {
}

size_t transport_read(uint8_t *bytes, size_t room) {
    (void)bytes;
    (void)room;
    return 0U;
}

void transport_write(const uint8_t *bytes, size_t count) {
    for (size_t i = 0; i < count && said_count < SAID_MOST; i++) {
        said[said_count] = bytes[i];
        said_count++;
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
