/* uart_nrf.c -- the UART of Nordic nRF51 and nRF52
 *
 * nRF51 Reference Manual, chapter 29; nRF52840 Product Specification, "UART". Pins are chosen by PSELTXD and PSELRXD,
 * which the target's setup writes.
 */
#include <stdbool.h>

#include "board.h"
#include "board_config.h"

#define TASKS_STARTRX (*(volatile uint32_t *)(BOARD_UART_BASE + 0x000U))
#define TASKS_STARTTX (*(volatile uint32_t *)(BOARD_UART_BASE + 0x008U))
#define EVENTS_RXDRDY (*(volatile uint32_t *)(BOARD_UART_BASE + 0x108U))
#define EVENTS_TXDRDY (*(volatile uint32_t *)(BOARD_UART_BASE + 0x11CU))
#define UART_ENABLE (*(volatile uint32_t *)(BOARD_UART_BASE + 0x500U))
#define UART_RXD (*(volatile uint32_t *)(BOARD_UART_BASE + 0x518U))
#define UART_TXD (*(volatile uint32_t *)(BOARD_UART_BASE + 0x51CU))
#define UART_BAUDRATE (*(volatile uint32_t *)(BOARD_UART_BASE + 0x524U))

#define ENABLED 4U
/* The manual's table is 2^32 * baud / 16 MHz, rounded to its upper 20 bits: 0x01D7E000 at 115200 bit/s. */
#define BAUDRATE ((uint32_t)((((uint64_t)BOARD_UART_BAUD << 32) / BOARD_UART_CLOCK_HZ + 0x800U) & 0xFFFFF000UL))

static bool sending; /* the first byte has no predecessor whose end could be waited for */

void uart_start(void) {
    UART_BAUDRATE = BAUDRATE;
    UART_ENABLE = ENABLED;
    EVENTS_RXDRDY = 0U;
    EVENTS_TXDRDY = 0U;
    TASKS_STARTRX = 1U;
    TASKS_STARTTX = 1U;
    sending = false;
}

void uart_put(uint8_t byte) {
    while (sending && EVENTS_TXDRDY == 0U) {
    }
    EVENTS_TXDRDY = 0U;
    sending = true;
    UART_TXD = byte;
}

bool uart_ready(void) {
    return !sending || EVENTS_TXDRDY != 0U;
}

int32_t uart_get(void) {
    if (EVENTS_RXDRDY == 0U) {
        return -1;
    }
    EVENTS_RXDRDY = 0U; /* before the byte is taken: taking it may raise the event for the next one */
    return (int32_t)(UART_RXD & 0xFFU);
}
