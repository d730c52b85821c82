/* timer_dwt.c -- processor cycles from the Data Watchpoint and Trace unit (ARMv7-M Reference Manual, DDI 0403, C1.8)
 *
 * CYCCNT is 32 bits wide. Emulators do not model it.
 */
#include "board.h"
#include "board_config.h"

#define DEMCR (*(volatile uint32_t *)0xE000EDFCUL)
#define DWT_CTRL (*(volatile uint32_t *)(BOARD_TIMER_BASE + 0x000U))
#define DWT_CYCCNT (*(volatile uint32_t *)(BOARD_TIMER_BASE + 0x004U))
#define DWT_LAR (*(volatile uint32_t *)(BOARD_TIMER_BASE + 0xFB0U))

#define DEMCR_TRCENA (1UL << 24)
#define CTRL_CYCCNTENA 1U
#define LAR_KEY 0xC5ACCE55UL /* unlocks the unit of a Cortex-M7; others ignore it */

void timer_start(void) {
    DEMCR |= DEMCR_TRCENA;
    DWT_LAR = LAR_KEY;
    DWT_CYCCNT = 0U;
    DWT_CTRL |= CTRL_CYCCNTENA;
}

uint32_t timer_begin(void) {
    return DWT_CYCCNT;
}

uint32_t timer_now(void) {
    return DWT_CYCCNT;
}
