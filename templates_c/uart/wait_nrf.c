/* wait_nrf.c -- sleeps until the UART of Nordic nRF51 and nRF52 has a byte (nRF51 Reference Manual, chapter 29)
 *
 * The interrupt is raised as long as the event is, which uart_get() clears. It is cleared before the last look, so that
 * a byte that comes after the look ends the sleep.
 */
#include "board.h"
#include "board_config.h"

#define EVENTS_RXDRDY (*(volatile uint32_t *)(BOARD_UART_BASE + 0x108U))
#define UART_INTENSET (*(volatile uint32_t *)(BOARD_UART_BASE + 0x304U))

#define INTEN_RXDRDY (1U << 2)

void uart_wait(void) {
    UART_INTENSET = INTEN_RXDRDY;
    interrupt_clear(BOARD_UART_INTERRUPT);
    if (EVENTS_RXDRDY == 0U) {
        interrupt_wait(BOARD_UART_INTERRUPT);
    }
}
