/* wait_cmsdk.c -- sleeps until the UART of the Arm Cortex-M System Design Kit has a byte (DDI 0479, "APB UART")
 *
 * Its interrupt is raised until it is cleared here. It is cleared before the last look, so that a byte that comes after
 * the look ends the sleep.
 */
#include "board.h"
#include "board_config.h"

#define UART_STATE (*(volatile uint32_t *)(BOARD_UART_BASE + 0x04U))
#define UART_CTRL (*(volatile uint32_t *)(BOARD_UART_BASE + 0x08U))
#define UART_INTCLEAR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x0CU))

#define STATE_RX_FULL 2U
#define CTRL_RX_INTERRUPT (1U << 3)
#define INT_RX (1U << 1)

void uart_wait(void) {
    UART_CTRL |= CTRL_RX_INTERRUPT;
    UART_INTCLEAR = INT_RX;
    interrupt_clear(BOARD_UART_INTERRUPT);
    if ((UART_STATE & STATE_RX_FULL) == 0U) {
        interrupt_wait(BOARD_UART_INTERRUPT);
    }
}
