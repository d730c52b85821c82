/* timer_systick.c -- ticks from the core's own SysTick counter (ARMv6-M and v7-M Architecture Reference Manuals, B3.3)
 *
 * It counts the processor's clock down, 24 bits wide. A measurement starts it anew, so that only one longer than 2^24
 * ticks meets its interrupt, which counts the turns: the time it takes is in the measurement, once in 16 777 216 ticks.
 */
#include "board.h"
#include "board_config.h"

#define SYST_CSR (*(volatile uint32_t *)(BOARD_TIMER_BASE + 0x0U))
#define SYST_RVR (*(volatile uint32_t *)(BOARD_TIMER_BASE + 0x4U))
#define SYST_CVR (*(volatile uint32_t *)(BOARD_TIMER_BASE + 0x8U))

#define TURN_BITS 24U
#define TURN_MASK 0x00FFFFFFUL
#define CSR_ENABLE_INTERRUPT_PROCESSOR_CLOCK 7U

static volatile uint32_t turns;

void systick_handler(void) {
    turns++;
}

void timer_start(void) {
    SYST_CSR = 0U;
    SYST_RVR = TURN_MASK;
    (void)timer_begin();
    SYST_CSR = CSR_ENABLE_INTERRUPT_PROCESSOR_CLOCK;
    __asm__ volatile("cpsie i");
}

/* Any write clears the counter, which is reloaded at the next tick: read as its negative, it runs 0, 1, 2, ... */
uint32_t timer_begin(void) {
    SYST_CVR = 0U;
    turns = 0U;
    return 0U;
}

uint32_t timer_now(void) {
    uint32_t high = turns;
    uint32_t low = SYST_CVR;
    while (high != turns) { /* a turn ended between the two readings */
        high = turns;
        low = SYST_CVR;
    }
    return (high << TURN_BITS) | ((0U - low) & TURN_MASK);
}
