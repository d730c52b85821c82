/* timer_cmsdk.c -- ticks from a timer of the Arm Cortex-M System Design Kit (DDI 0479, "APB timer")
 *
 * Counts down from RELOAD at the board's clock, 32 bits wide.
 */
#include "board.h"
#include "board_config.h"

#define TIMER_CTRL (*(volatile uint32_t *)(BOARD_TIMER_BASE + 0x0U))
#define TIMER_VALUE (*(volatile uint32_t *)(BOARD_TIMER_BASE + 0x4U))
#define TIMER_RELOAD (*(volatile uint32_t *)(BOARD_TIMER_BASE + 0x8U))

void timer_start(void) {
    TIMER_CTRL = 0U;
    TIMER_RELOAD = 0xFFFFFFFFUL;
    TIMER_VALUE = 0xFFFFFFFFUL;
    TIMER_CTRL = 1U;
}

uint32_t timer_begin(void) {
    return ~TIMER_VALUE;
}

uint32_t timer_now(void) {
    return ~TIMER_VALUE;
}
