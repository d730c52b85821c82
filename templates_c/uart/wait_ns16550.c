/* wait_ns16550.c -- sleeps until a UART of the 16550 kind has a byte (National Semiconductor PC16550D, IER)
 *
 * Its interrupt is raised while a byte is there, so that one that comes after the last look ends the sleep.
 */
#include "board.h"
#include "board_config.h"

#define UART_IER (*(volatile uint8_t *)(BOARD_UART_BASE + 1U))
#define UART_LSR (*(volatile uint8_t *)(BOARD_UART_BASE + 5U))

#define IER_DATA_READY 0x01U
#define LSR_DATA_READY 0x01U

void uart_wait(void) {
    UART_IER = IER_DATA_READY;
    interrupt_clear(BOARD_UART_INTERRUPT);
    if ((UART_LSR & LSR_DATA_READY) == 0U) {
        interrupt_wait(BOARD_UART_INTERRUPT);
    }
}
