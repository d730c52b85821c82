/* timer_mtime.c -- ticks from mtime, the low word of the counter that every RISC-V has (Privileged Architecture, 3.2.1) */
#include "board.h"
#include "board_config.h"

#define MTIME_LOW (*(volatile uint32_t *)BOARD_TIMER_BASE)

void timer_start(void) {
}

uint32_t timer_begin(void) {
    return MTIME_LOW;
}

uint32_t timer_now(void) {
    return MTIME_LOW;
}
