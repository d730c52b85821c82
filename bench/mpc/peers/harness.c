/* Run one controller over recorded states on an MPS2 board with AN386, and write what each step gave and took.
 *
 * A controller is peer_start() and peer_step(). A line a step: the bits of the move, what the controller says of its
 * own answer, and the ticks of the timer. The last line: bytes of stack and heap touched, and calls of malloc.
 */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "states.h" /* STEPS, STATES, MOST_TICKS, states[STEPS][STATES] */

void peer_start(void);
int peer_step(const float *state, float *move); /* 1: the controller says that it solved its problem */

extern uint32_t stack_end[], stack_top[], data_from[], data_start[], data_end[], bss_start[], bss_end[];
extern char heap_start[], heap_end[];
extern void (*init_start[])(void);
extern void (*init_end[])(void);

int main(void);
void reset(void);
void stop(void);
void *_sbrk(ptrdiff_t bytes);
void *__real_malloc(size_t bytes);
void *__wrap_malloc(size_t bytes);

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define PAINT 0xA5A5A5A5u

static uint32_t mallocs;
static char *heap = heap_start;

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    stack_top, reset, stop, stop, stop, stop, stop, 0, 0, 0, 0, stop, stop, 0, stop, stop};

static uint32_t call_host(uint32_t operation, const void *argument) {
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void stop(void) {
    static const uint32_t done[2] = {0x20026u, 0u}; /* ADP_Stopped_ApplicationExit */
    for (;;) {
        (void)call_host(0x20u, done); /* SYS_EXIT_EXTENDED */
    }
}

__attribute__((naked, used)) void reset(void) {
    __asm__ volatile("ldr r0, =0xE000ED88\n ldr r1, [r0]\n orr r1, r1, #0xF00000\n str r1, [r0]\n dsb\n isb\n"
                     "ldr r0, =stack_end\n ldr r1, =0xA5A5A5A5\n mov r2, sp\n"
                     "1: cmp r0, r2\n it lo\n strlo r1, [r0], #4\n blo 1b\n"
                     "bl main\n b stop\n");
}

void *_sbrk(ptrdiff_t bytes) {
    char *old = heap;
    if (bytes > heap_end - heap) {
        return (void *)-1;
    }
    heap += bytes;
    return old;
}

void *__wrap_malloc(size_t bytes) {
    ++mallocs;
    return __real_malloc(bytes);
}

/* A timer of 32 bits that counts every tick, and one that counts every 256th to tell how often the first went round. */
static void start_timers(void) {
    REGISTER(0x40000008) = 0xFFFFFFFFu;
    REGISTER(0x40000004) = 0xFFFFFFFFu;
    REGISTER(0x40000000) = 1u;
    REGISTER(0x40002000) = 0xFFFFFFFFu;
    REGISTER(0x40002008) = 0x8Au;
}

static uint64_t between(uint32_t fine_from, uint32_t coarse_from, uint32_t fine_to, uint32_t coarse_to) {
    const uint32_t fine = fine_from - fine_to;
    const uint64_t coarse = (uint64_t)(coarse_from - coarse_to) << 8;
    const uint64_t rounds = coarse + 0x80000000u < fine ? 0u : (coarse + 0x80000000u - fine) >> 32;
    return (rounds << 32) + fine;
}

static char *put(char *at, uint64_t number) {
    int shift = 60;
    while (shift > 0 && (number >> shift) == 0u) {
        shift -= 4;
    }
    for (; shift >= 0; shift -= 4) {
        *at++ = "0123456789abcdef"[(number >> shift) & 15u];
    }
    *at++ = ' ';
    return at;
}

static void write_line(const uint64_t *numbers, int count) {
    static uint32_t console;
    char line[96];
    char *at = line;
    if (console == 0u) {
        const uint32_t opened[3] = {(uint32_t)(uintptr_t)":tt", 4u, 3u};
        console = call_host(0x01u, opened);
    }
    for (int i = 0; i < count; ++i) {
        at = put(at, numbers[i]);
    }
    *at++ = '\n';
    const uint32_t written[3] = {console, (uint32_t)(uintptr_t)line, (uint32_t)(at - line)};
    (void)call_host(0x05u, written);
}

int main(void) {
    memcpy(data_start, data_from, (size_t)((char *)data_end - (char *)data_start));
    memset(bss_start, 0, (size_t)((char *)bss_end - (char *)bss_start));
    for (void (**init)(void) = init_start; init < init_end; ++init) {
        (*init)();
    }
    start_timers();
    const uint32_t empty_from = REGISTER(0x40000004);
    const uint32_t empty_to = REGISTER(0x40000004);
    peer_start();
    mallocs = 0;
    uint64_t spent = 0;
    for (int k = 0; k < STEPS && spent < MOST_TICKS; ++k) {
        float move = 0.0f;
        const uint32_t coarse_from = REGISTER(0x40002004);
        const uint32_t fine_from = REGISTER(0x40000004);
        const int told = peer_step(states[k], &move);
        const uint32_t fine_to = REGISTER(0x40000004);
        const uint32_t coarse_to = REGISTER(0x40002004);
        const uint64_t ticks = between(fine_from, coarse_from, fine_to, coarse_to) - (empty_from - empty_to);
        uint32_t bits;
        memcpy(&bits, &move, sizeof bits);
        const uint64_t numbers[3] = {bits, (uint64_t)(told != 0), ticks};
        write_line(numbers, 3);
        spent += ticks;
    }
    const uint32_t *touched = stack_end;
    while (*touched == PAINT) {
        ++touched;
    }
    const uint64_t numbers[4] = {(uint64_t)((char *)stack_top - (char *)touched), (uint64_t)(heap - heap_start), mallocs,
                                 0u};
    write_line(numbers, 4);
    stop();
    return 0;
}
